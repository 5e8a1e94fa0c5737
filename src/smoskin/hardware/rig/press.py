"""A rig that presses a real skin: approach, tare, descend, touch off, press, hold, retract.

Decides how far a step goes, when a touch has begun and when it must end. Each step is one move that
is told when the one before has been felt, so that whoever dies meanwhile leaves the probe within
one step of what was last felt.
"""

import threading
import time
from contextlib import ExitStack
from typing import Final, NoReturn, final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arguments import typed
from smoskin.arrays import Floats, frozen
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.rig.listening import Listener
from smoskin.hardware.rig.notes import Notes
from smoskin.hardware.rig.parts import Gauge, Stage
from smoskin.records import Contact, HeldTouch
from smoskin.roles import Rig, Source

STEP: Final = 0.05
"""Force that a step of the descent adds at most, N."""
_TRAVEL, _DESCENT, _STEPPING = 10e-3, 2e-3, 1e-3
"""Speeds of the probe beside the skin, towards it and onto it, m/s."""
_MARGIN: Final = 1e-3
"""Height over the highest place touched so far at which steps begin, m."""
_BIT: Final = 0.25e-3
"""Length of a move towards that height, after each of which the force is read, m."""
_REST, _HOLD, _SETTLE = 0.3, 0.3, 0.2
"""Seconds: rest is read before a touch; it is held; it settles before that."""
_MEAN: Final = 3
"""Readings of the gauge that make one force."""
_FINE: Final = 5e-3
"""Force up to which a press is as hard as asked for, N."""
_DRIFT: Final = 25e-3
"""Force that a gauge may feel after a touch, N."""
_PULL: Final = 0.1
"""Pull from which a gauge that is pressed must have the other sign, N."""
_LIFT: Final = 20.0
"""Seconds in which the probe is lifted, whatever has happened."""


@final
class PressRig(Rig):
    """A stage and a gauge that press the skin which a source reads.

    It presses straight: its gauge feels one axis. The stage's axes are the skin's; its place `p`
    has the probe over the skin's place `p - origin`, and `origin[2]` is the height at which the
    probe travels. A touch ends, whatever goes wrong, with the stage stopped and the probe lifted to
    that height. It holds all three parts, and closes them.

    Parameters
    ----------
    source : Source
        Readings of the skin, on any clock.
    stage : Stage
    gauge : Gauge
    origin : array_like
        Place of the stage, (3,), m, with the probe over the skin's origin, above all that stands.
    reach : float
        How far below the origin the probe may go, m.
    limit : float
        Force at which a touch is broken off, N.
    stiffness : float
        Stiffness of the stiffest place of the skin under this probe, N/m, from which the steps
        follow: 25 um for 2,000 N/m.
    place_spread, force_spread : float
        Standard deviations of the stage's places, m, and of the gauge's forces, N.
    recovery : float
        Time for which skin and gauge are read once the probe is lifted, s, besides a quarter of a
        second.
    radius : float, optional
        Radius of the limb that the stage's y axis turns instead of going along the skin, m: a
        millimetre of that axis is a degree.

    Raises
    ------
    ArgumentError
        If a length, force or stiffness is not positive and finite, or the origin not finite.

    Notes
    -----
    With the stiffness ``k`` a step is ``STEP / k``, so a force beyond the limit by more than one
    step needs a place that is stiffer than was said; where a step adds more than twice `STEP` the
    touch is broken off. From the second touch on, the way down to 1 mm above the highest skin met
    so far is made in longer moves, so nothing may stand higher than that beside those places.
    """

    @typed
    def __init__(
        self,
        source: Source,
        stage: Stage,
        gauge: Gauge,
        *,
        origin: ArrayLike,
        reach: float = 10e-3,
        limit: float = 1.5,
        stiffness: float = 2000.0,
        place_spread: float = 20e-6,
        force_spread: float = 2e-3,
        recovery: float = 0.0,
        radius: float | None = None,
    ) -> None:
        self._origin: Floats = frozen("origin", origin, (3,))
        if not np.isfinite(self._origin).all():
            raise ArgumentError(f"origin must be finite; got {self._origin} m")
        for name, value in (
            ("reach", reach),
            ("limit", limit),
            ("stiffness", stiffness),
            ("place_spread", place_spread),
            ("force_spread", force_spread),
            ("radius", 1.0 if radius is None else radius),
        ):
            if not 0.0 < value < np.inf:
                raise ArgumentError(f"{name} must be positive and finite; got {value}")
        if not 0.0 <= recovery < np.inf:
            raise ArgumentError(f"recovery must be finite and not negative; got {recovery}")
        self._recovery = recovery
        around = 1.0 if radius is None else 1e-3 * np.degrees(1.0 / radius)
        self._scale: Floats = np.array([1.0, around, 1.0])
        self._stage, self._gauge = stage, gauge
        self._reach, self._limit, self._stiffness = reach, limit, stiffness
        self._place_spread, self._force_spread = place_spread, force_spread
        self._touched = max(10e-3, 5.0 * force_spread)
        self._highest: float | None = None
        self._end = 0.0
        self._stopped = threading.Event()
        self.phase = "at rest"
        """What the rig is doing: approach, tare, rest, descend, press, hold, retract, released, or
        at rest."""
        self._notes = Notes()
        self._listener = Listener(source)

    @property
    def place_spread(self) -> float:
        """Standard deviation of the stage's places, along each axis, m."""
        return self._place_spread

    @property
    def force_spread(self) -> float:
        """Standard deviation of the gauge's forces, along each axis, N."""
        return self._force_spread

    @typed
    def press(self, contact: Contact, timeout: float = 30.0) -> HeldTouch:
        """Press so, hold, let go; raises as `Rig.press`, the probe lifted.

        It also raises an `ArgumentError` for a touch that is not straight, and a `SourceError` if
        the limit is reached, a part fails or the rig has been stopped.
        """
        self._check(contact)
        if self._stopped.is_set():
            raise SourceError("the rig has been stopped: see that all is well, and open it again")
        self._end = time.monotonic() + timeout
        try:
            return self._press(contact)
        except BaseException as error:
            self._break_off(error)
        finally:
            self.phase = "at rest"

    def stop(self) -> None:
        """Stop at once and stand, an emergency stop; from any thread.

        The touch that is made raises a `SourceError`, and the rig makes no other.
        """
        self._stopped.set()
        self._stage.stop()

    def close(self) -> None:
        """Let go of stage, gauge and source."""
        with ExitStack() as parts:
            parts.callback(self._stage.close)
            parts.callback(self._gauge.close)
            parts.callback(self._listener.close)

    def _check(self, contact: Contact) -> None:
        wanted = contact.normal_force
        if not self._touched + _FINE <= wanted <= self._limit - STEP:
            raise ArgumentError(
                f"normal force must be from {self._touched + _FINE:.3g} to "
                f"{self._limit - STEP:.3g} N, one step below the rig's limit; got {wanted:.3g} N"
            )
        if np.abs(contact.force[:2]).max() > 1e-6:
            raise ArgumentError(
                f"force must be straight down: this rig's gauge feels one axis; got "
                f"{contact.force} N"
            )

    def _press(self, contact: Contact) -> HeldTouch:
        """Every phase of a touch."""
        self._notes.begin()
        place = self._origin[:2] + self._scale[:2] * contact.position
        top = float(self._origin[2])
        self._enter("approach")
        here = self._stage.where()
        if here[2] < top - 1e-4:
            self._move(np.array([*here[:2], top]), _TRAVEL)
        self._move(np.array([*place, top]), _TRAVEL)
        self._enter("tare")
        time.sleep(_SETTLE)
        self._gauge.tare()
        self._enter("rest")
        rest, before = self._dwell(_REST)
        self._enter("descend")
        height = self._touch_off(place, before)
        self._enter("press")
        self._push(place, height, before, contact.normal_force)
        self._enter("hold")
        held, during = self._dwell(_HOLD)
        x, y, _ = self._stage.where()
        self._enter("retract")
        self._move(np.array([x, y, top]), _TRAVEL)
        self._enter("released")
        end = time.monotonic() + _SETTLE + self._recovery
        while time.monotonic() < end:
            self._force()
        after = float(np.mean([self._force() for _ in range(_MEAN)]))
        if abs(after - before) > _DRIFT:
            raise SourceError(
                f"the gauge reads {1e3 * (after - before):.0f} mN with the probe lifted: let it "
                "warm up, show the force of now and no peak, and see that nothing sticks to it"
            )
        force = during - 0.5 * (before + after)
        there = (np.array([x, y]) - self._origin[:2]) / self._scale[:2]
        return HeldTouch(
            contact=Contact(position=there, force=(0.0, 0.0, -force)),
            readings=self._listener.take(),
            rest=rest,
            held=held,
            trace=self._notes.trace(self._listener.clock, self._origin, before, self._scale),
        )

    def _touch_off(self, place: Floats, zero: float) -> float:
        """Go down until the skin is felt; the height at which it is, m."""
        top = height = float(self._origin[2])
        begin = top if self._highest is None else min(top, self._highest + _MARGIN)
        while height > begin:
            height = max(height - _BIT, begin)
            self._move(np.array([*place, height]), _DESCENT)
            if self._force() - zero > self._touched:
                raise SourceError(
                    f"something is {1e3 * (height - begin):.2f} mm above where the skin can be: "
                    "is it flat, level, and free of what may stand on it?"
                )
        while self._force() - zero <= self._touched:
            height -= STEP / self._stiffness
            self._lower(place, height)
        self._highest = height if self._highest is None else max(height, self._highest)
        return height

    def _push(self, place: Floats, height: float, zero: float, wanted: float) -> None:
        """Go down until the skin is pressed so hard, N."""
        stiffness = self._stiffness
        force = self._force() - zero
        while wanted - force > _FINE:
            height -= min(max(wanted - force, 0.25 * STEP), STEP) / stiffness
            self._lower(place, height)
            before, force = force, self._force() - zero
            added = force - before
            if added > 2.0 * STEP + 6.0 * self._force_spread:
                raise SourceError(
                    f"a step added {1e3 * added:.0f} mN, more than {1e3 * STEP:g}: the skin is "
                    f"stiffer here than {self._stiffness:g} N/m; give its true stiffness"
                )
            if added > STEP:
                stiffness *= 1.25 * added / STEP

    def _lower(self, place: Floats, height: float) -> None:
        """Make one step, if it is within reach."""
        if float(self._origin[2]) - height > self._reach:
            raise SourceError(
                f"the skin did not press back enough within {1e3 * self._reach:g} mm below the "
                "origin: is the origin right, is the gauge live, or the reach too small?"
            )
        self._move(np.array([*place, height]), _STEPPING)

    def _dwell(self, seconds: float) -> tuple[tuple[float, float], float]:
        """Stand still while the chips are read; from when to when, and the force meanwhile."""
        end = time.monotonic() + _SETTLE
        while time.monotonic() < end:
            self._force()
        begun, forces = self._listener.now(), []
        while (window := self._listener.window(begun, seconds)) is None:
            forces.append(self._force())
        return window, float(np.mean(forces))

    def _force(self) -> float:
        """Mean of some readings of the gauge, N, each of them within its limits."""
        felt, begun = [], time.monotonic()
        for _ in range(_MEAN):
            self._go_on()
            felt.append(self._gauge.force())
            if felt[-1] > self._limit:
                raise SourceError(
                    f"the probe was pressed with {felt[-1]:.2f} N, beyond the limit of "
                    f"{self._limit:g} N"
                )
            if felt[-1] < -_PULL:
                raise SourceError(
                    f"the gauge feels a pull of {-felt[-1]:.2f} N where it is pressed: does it "
                    "call presses negative? Then give its URL ?pressing=negative"
                )
        mean = float(np.mean(felt))
        self._notes.force(mean, begun)
        return mean

    def _move(self, target: Floats, speed: float) -> None:
        self._go_on()
        self._stage.move(target, speed, max(self._end - time.monotonic(), 0.1))
        self._notes.place(target)

    def _enter(self, phase: str) -> None:
        self.phase = phase
        self._notes.phase(phase)

    def _go_on(self) -> None:
        """Raise where the touch must not go on."""
        if self._stopped.is_set():
            raise SourceError("the rig was stopped")
        if time.monotonic() > self._end:
            raise SourceError(
                "the touch was not over in time: begin lower above the skin, or give its true "
                "stiffness, by which steps are longer"
            )
        self._listener.check()

    def _break_off(self, error: BaseException) -> NoReturn:
        """Stop, lift the probe unless the rig was stopped by hand, and raise."""
        fate = "the probe is lifted"
        try:
            self._stage.stop()
            if self._stopped.is_set():
                fate = "the probe stands where it stood: lift it by hand"
            else:
                x, y, _ = self._stage.where()
                self._stage.move(np.array([x, y, self._origin[2]]), _TRAVEL, _LIFT)
        except SourceError:
            fate = "the probe could not be lifted: lift it by hand"
        if isinstance(error, SourceError):
            raise SourceError(f"{self.phase}: {error}; {fate}") from error
        raise error
