"""A virtual rig: presses a twin where it is told, on rubber that creeps, under chips that drift.

Decides how long a touch is held and how often chips are read meanwhile, and how far the rig's
stage and gauge are off. Hides the memory that a skin and its chips keep from touch to touch.
"""

from typing import Final, cast, final
from urllib.parse import parse_qsl

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SourceError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, check_temperature
from smoskin.records import Contact, HeldTouch, Motion, Reading
from smoskin.roles import Rig, VirtualSkin
from smoskin.twin.creep import Creep
from smoskin.twin.readout import MagneticSkin
from smoskin.twin.surroundings import Ambience
from smoskin.twin.whole import Twin
from smoskin.twin.world.effect import Run

_RIG: Final = 7
"""Tells a rig's randomness from all else that a seed begins."""
_RATE: Final = 50.0
"""Rate at which chips are read while something happens, Hz."""
_RAMP, _REST, _HOLD, _PERIOD = 0.02, 0.2, 0.3, 1.0
"""Times in s: a touch comes and goes; rest is read before it; it is held; from touch to touch."""


@final
class VirtualRig(Rig):
    """A rig with a virtual skin on it; time is the skin's.

    Parameters
    ----------
    skin : SkinDesign or VirtualSkin
        A design, of which a skin is made as a workshop would make it; or the twin of a skin.
    rng : numpy.random.Generator, optional
        Generator of noise, drift and the rig's errors; by default one that the seed begins.
    seed : int
        Seed of the made skin, as `smo.open_source` takes it, and of all that spoils touches.
    temperature : float
        Temperature of skin and chips, degC.
    creep : bool
        Whether the rubber creeps.
    drift : float
        Random walk of each axis of the chips in a second, T.
    stage, gauge : float
        Standard deviations of where the stage stands, m, and what the gauge reads, N.
    run : Run, optional
        What a world does to the skin meanwhile; by default nothing.

    Raises
    ------
    ArgumentError
        If a spread is negative or not finite, or no skin stands the temperature.
    MissingExtraError
        If a skin is to be made without the extra ``twin``.

    Examples
    --------
    >>> from smoskin.feasibility import load_design
    >>> rig = VirtualRig(load_design("planar"), seed=3)
    >>> touch = rig.press(Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5)))
    >>> len(touch.readings)
    26
    """

    @typed
    def __init__(
        self,
        skin: SkinDesign | VirtualSkin,
        rng: np.random.Generator | None = None,
        *,
        seed: Seed = 0,
        temperature: float = REFERENCE_TEMPERATURE,
        creep: bool = True,
        drift: float = 0.3e-6,
        stage: float = 20e-6,
        gauge: float = 2e-3,
        run: Run | None = None,
    ) -> None:
        check_temperature(temperature)
        for name, value in (("drift", drift), ("stage", stage), ("gauge", gauge)):
            if not 0.0 <= value < np.inf:
                raise ArgumentError(f"{name} must be finite and >= 0; got {value}")
        twin = Twin(skin, seed=seed, manufactured=True) if isinstance(skin, SkinDesign) else skin
        self._twin = twin
        self._rng = np.random.default_rng([seed, _RIG]) if rng is None else rng
        self._temperature = temperature
        self._creep = Creep(twin.design) if creep else None
        self._drift, self._run = drift, run
        self._stage, self._gauge = stage, gauge
        self._walked: Floats = np.zeros((len(twin.design.halls), 3))
        self._begun = 0
        self._time = -_REST

    @property
    def place_spread(self) -> float:
        """Standard deviation of the stage's places, along each axis, m."""
        return self._stage

    @property
    def force_spread(self) -> float:
        """Standard deviation of the gauge's forces, along each axis, N."""
        return self._gauge

    @typed
    def press(self, contact: Contact, timeout: float = 30.0) -> HeldTouch:
        """As `Rig.press`; `timeout` is in seconds of the skin's time."""
        if timeout < _PERIOD:
            raise SourceError(f"no touch is over within {timeout} s; one takes {_PERIOD:g} s")
        return self.hold(contact, self._twin.motion((contact,), temperature=self._temperature))

    def hold(self, contact: Contact, motion: Motion) -> HeldTouch:
        """Touch the skin so, where the state in which the contact would hold it is known."""
        start = self._begun * _PERIOD
        self._begun += 1
        rest = start - np.linspace(_REST, 0.0, round(_REST * _RATE) + 1)
        held = start + np.linspace(_RAMP, _HOLD, round((_HOLD - _RAMP) * _RATE) + 1)
        after = [] if start == 0.0 else [start - _PERIOD + _HOLD + _RAMP]
        times = np.concatenate([after, rest, held])
        pressed = np.arange(len(times)) >= len(times) - len(held)
        readings = self._read(times, pressed, motion)
        position = contact.position + self._stage * self._rng.normal(size=2)
        force = contact.force + self._gauge * self._rng.normal(size=3)
        return HeldTouch(
            contact=Contact(position=position, force=force),
            readings=readings,
            rest=(float(rest[0]), float(rest[-1])),
            held=(float(held[0]), float(held[-1])),
        )

    def close(self) -> None:
        """Let go of nothing: a virtual rig holds nothing."""

    def _read(self, times: Floats, pressed: Bools, motion: Motion) -> tuple[Reading, ...]:
        """What the chips read at these times; pressed (T,) says when the motion holds."""
        steps = np.diff(times, prepend=self._time)
        self._time = float(times[-1])
        still = Motion.rest(len(motion.magnets))
        states = Motion.stack([still, motion])[pressed.astype(int)]
        states = states if self._run is None else self._run.moved(times, states)
        readings, self._walked = drifting_readings(
            self._twin,
            states if self._creep is None else self._creep.steps(steps, states),
            times,
            steps,
            self._rng,
            temperature=self._temperature,
            drift=self._drift,
            walked=self._walked,
            around=None if self._run is None else self._run.around(times),
        )
        return readings


def drifting_readings(
    twin: VirtualSkin,
    motion: Motion,
    times: Floats,
    durations: Floats,
    rng: np.random.Generator,
    *,
    temperature: float,
    drift: float,
    walked: Floats | float = 0.0,
    around: Ambience | None = None,
) -> tuple[tuple[Reading, ...], Floats]:
    """Readings of a skin's chips in T states, one after the other, while they drift.

    `times`, (T,), s, are those of the readings, `durations`, (T,), s, those since the one before.
    Skin and chips have a temperature, degC; each axis walks at random by `drift` in a second, T.
    The walk before the first reading is `walked`, (S, 3), T; that by the last is returned too. What
    is `around` needs a skin that is a `smoskin.twin.readout.MagneticSkin`.
    """
    degrees = np.full(len(times), temperature)
    if around is None:
        sample = twin.sample(motion, rng, temperature=degrees)
    else:
        sample = cast(MagneticSkin, twin).sample(motion, rng, temperature=degrees, around=around)
    field = mlx90393.tesla(sample.counts, twin.design.hall_setting)
    steps = drift * np.sqrt(durations)[:, None, None] * rng.normal(size=field.shape)
    walk = walked + np.cumsum(steps, axis=0)
    reported = mlx90393.degrees(sample.temperature_counts)
    readings = tuple(
        Reading(time=float(t), field=f, temperature=d, flags=g)
        for t, f, d, g in zip(times, field + walk, reported, sample.flags, strict=True)
    )
    return readings, walk[-1]


def open_rig(name: str, design: SkinDesign) -> VirtualRig:
    """The rig that a name with options asks for, with a skin made for it from the design.

    The name is ``virtual``, with ``seed`` (0) and ``temperature`` in degC (25) as options, such as
    ``virtual?seed=3&temperature=30``. It raises an `ArgumentError` if there is no such rig, or an
    option is unknown or out of its range, and a `MissingExtraError` without the extra ``twin``.
    """
    kind, _, query = name.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    if kind != "virtual" or not options.keys() <= {"seed", "temperature"}:
        raise ArgumentError(
            f"rig must be virtual, with the options seed and temperature; got {name!r}"
        )
    try:
        seed, degrees = int(options.get("seed", 0)), float(options.get("temperature", 25.0))
    except ValueError as error:
        raise ArgumentError(
            f"seed and temperature of a rig must be numbers; got {name!r}"
        ) from error
    if seed < 0:
        raise ArgumentError(f"seed of a rig must not be negative; got {seed}")
    return VirtualRig(design, seed=seed, temperature=degrees)
