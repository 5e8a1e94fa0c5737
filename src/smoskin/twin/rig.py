"""A virtual rig: presses a twin where it is told, on rubber that creeps, under chips that drift.

Decides how long a touch is held and how often chips are read meanwhile, and how far the rig's
stage and gauge are off. Hides the memory that a skin and its chips keep from touch to touch.
"""

from typing import Final, cast, final
from urllib.parse import parse_qsl

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SourceError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, check_temperature
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.mechanics.viscoelasticity import Memory, elastomer_prony
from smoskin.records import Contact, HeldTouch, Motion, Reading, Trace
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
_LEVELS: Final = 9
"""Forces of a slow touch at which the skin is solved, from none to the whole."""
_ABOVE: Final = 5e-3
"""Height of the probe over the skin that it does not touch, m."""


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
    ramp, recovery : float
        Times, s, in which a touch comes and goes with an even change of force, and for which the
        skin is watched once it is let go. By default touches come at once, and neither the way
        there nor the release is read; with a ramp each touch has its `Trace`.
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
        ramp: float = 0.0,
        recovery: float = 0.0,
        run: Run | None = None,
    ) -> None:
        check_temperature(temperature)
        for name, value in (
            *(("drift", drift), ("stage", stage), ("gauge", gauge)),
            *(("ramp", ramp), ("recovery", recovery)),
        ):
            if not 0.0 <= value < np.inf:
                raise ArgumentError(f"{name} must be finite and >= 0; got {value}")
        twin = Twin(skin, seed=seed, manufactured=True) if isinstance(skin, SkinDesign) else skin
        self._twin = twin
        self._rng = np.random.default_rng([seed, _RIG]) if rng is None else rng
        self._temperature = temperature
        self._creep = Creep(twin.design) if creep else None
        self._drift, self._run = drift, run
        self._stage, self._gauge = stage, gauge
        self._ramp, self._recovery = ramp, recovery
        self._parts = np.random.default_rng([seed, _RIG, 1])
        self._depth = Memory(elastomer_prony(twin.design.columns.material), np.zeros(1))
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
        if self._ramp > 0.0 or self._recovery > 0.0:
            return self._slowly(contact)
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
        readings = self._read(
            times, Motion.stack([Motion.rest(len(motion.magnets)), motion])[pressed.astype(int)]
        )
        return HeldTouch(
            contact=self._measured(contact),
            readings=readings,
            rest=(float(rest[0]), float(rest[-1])),
            held=(float(held[0]), float(held[-1])),
        )

    def close(self) -> None:
        """Let go of nothing: a virtual rig holds nothing."""

    def _measured(self, contact: Contact) -> Contact:
        """The touch as stage and gauge tell it."""
        position = contact.position + self._stage * self._rng.normal(size=2)
        force = contact.force + self._gauge * self._rng.normal(size=3)
        return Contact(position=position, force=force)

    def _slowly(self, contact: Contact) -> HeldTouch:
        """Touch the skin with a force that rises and falls evenly, and watch it recover."""
        ramp = max(self._ramp, _RAMP)
        start = self._time + _REST + 2.0 / _RATE
        ends = start + np.cumsum([0.0, ramp, _HOLD, ramp, self._recovery])
        times = start - _REST + np.arange(round((ends[-1] - start + _REST) * _RATE) + 1) / _RATE
        share = np.interp(times, ends[:4], [0.0, 1.0, 1.0, 0.0])
        levels = np.linspace(0.0, 1.0, _LEVELS)
        made = [
            [Contact(position=contact.position, force=level * contact.force)]
            for level in levels[1:]
        ]
        solved = self._twin.motions(touches_of(made), temperature=self._temperature)
        deep = [self._twin.depths(each, temperature=self._temperature).sum() for each in made]
        magnets, board = (
            _between(share, levels, np.concatenate([np.zeros_like(part[:1]), part]))
            for part in (solved.magnets, solved.board)
        )
        steps = np.diff(times, prepend=self._time)
        sunk = np.interp(share, levels, [0.0, *deep])[:, None]
        if self._creep is not None:
            pairs = zip(steps.tolist(), sunk, strict=True)
            sunk = np.array([self._depth.step(step, depth) for step, depth in pairs])
        measured = self._measured(contact)
        force = share[:, None] * contact.force + self._gauge * self._parts.normal(
            size=(len(times), 3)
        )
        height = np.where(share > 0.0, -sunk[:, 0], _ABOVE)
        place = np.column_stack([np.tile(measured.position, (len(times), 1)), height])
        begins = [start - _REST, *ends.tolist()]
        names = ("rest", "press", "hold", "retract", "recovery")
        return HeldTouch(
            contact=measured,
            readings=self._read(times, Motion(magnets=magnets, board=board)),
            rest=(begins[0], begins[1]),
            held=(begins[2] + _RAMP, begins[3]),
            trace=Trace(
                gauge=np.column_stack([times, force]),
                stage=np.column_stack([times, place]),
                phases=[*zip(names, begins[:-1], begins[1:], strict=True)],
            ),
        )

    def _read(self, times: Floats, states: Motion) -> tuple[Reading, ...]:
        """What the chips read at these times, (T,), in these states, (T,)."""
        steps = np.diff(times, prepend=self._time)
        self._time = float(times[-1])
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


def _between(share: Floats, levels: Floats, values: Floats) -> Floats:
    """Values (L, ...) at levels (L,), on straight lines at the shares (T,)."""
    above = np.clip(np.searchsorted(levels, share), 1, len(levels) - 1)
    part = (share - levels[above - 1]) / (levels[above] - levels[above - 1])
    part = part.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1.0 - part) * values[above - 1] + part * values[above])


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

    The name is ``virtual``, with ``seed`` (0), ``temperature`` in degC (25) and, in s, ``ramp`` and
    ``recovery`` (0) as options, such as ``virtual?seed=3&temperature=30``. It raises an
    `ArgumentError` if there is no such rig, or an option is unknown or out of its range, and a
    `MissingExtraError` without the extra ``twin``.
    """
    kind, _, query = name.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    numbers = {"temperature": REFERENCE_TEMPERATURE, "ramp": 0.0, "recovery": 0.0}
    if kind != "virtual" or not options.keys() <= {"seed", *numbers}:
        raise ArgumentError(
            f"rig must be virtual, with the options seed, {', '.join(numbers)}; got {name!r}"
        )
    try:
        seed = int(options.pop("seed", 0))
        numbers |= {option: float(text) for option, text in options.items()}
    except ValueError as error:
        raise ArgumentError(f"a rig's options must be numbers; got {name!r}") from error
    if seed < 0:
        raise ArgumentError(f"seed of a rig must not be negative; got {seed}")
    return VirtualRig(
        design,
        seed=seed,
        temperature=numbers["temperature"],
        ramp=numbers["ramp"],
        recovery=numbers["recovery"],
    )
