"""Effects of the real world, and worlds that are made of them.

Decides where an effect may act: on the skin's making, its contact law, the fingers, its motion in
time, what surrounds its chips, and how readings arrive. Hides the randomness of each, which is its
own: a world with one effect more leaves the others as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol
from zlib import crc32

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Touches
from smoskin.records import Motion, Reading
from smoskin.roles import ContactLaw
from smoskin.twin.manufacture import Deviations, Tolerances, drawn_skin
from smoskin.twin.surroundings import Ambience
from smoskin.twin.whole import Twin


class History(Protocol):
    """A skin's motion as it depends on time and on what went before."""

    def steps(self, times: Floats, motion: Motion) -> Motion:
        """Motions at the next (T,) times, s, for the (T,) states that touches would hold."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """Something real that the plain world leaves out; each hook changes nothing by default."""

    on_bench: ClassVar[bool] = True
    """Whether it acts while a skin is calibrated as well, which is done on a bench."""
    on_arm: ClassVar[bool] = False
    """Whether an arm turns the skin, so that its weight moves it."""
    chance: ClassVar[str] = ""
    """Name of its randomness, by default the class': effects of one arm share theirs."""

    def tolerances(self, usual: Tolerances) -> Tolerances:
        """Tolerances that skins are drawn from."""
        return usual

    def skin(self, design: SkinDesign, made: Deviations, rng: np.random.Generator) -> Deviations:
        """A made skin."""
        return made

    def law(self, number: int) -> ContactLaw | None:
        """Contact law of the skin of this number; None: its own."""
        return None

    def fingers(self, touches: Touches, rng: np.random.Generator) -> Touches:
        """What touches, where touches are asked for."""
        return touches

    def history(self, twin: Twin, rng: np.random.Generator) -> History | None:
        """What the skin's motion does in time, from rest."""
        return None

    def ambience(self, twin: Twin, rng: np.random.Generator, times: Floats) -> Ambience | None:
        """What surrounds the chips at (T,) times, s."""
        return None

    def poses(self, rng: np.random.Generator, times: Floats) -> Floats | None:
        """Rotations from the skin's frame to the room's by an arm at (T,) times, s, (T, 3, 3)."""
        return None

    def arrived(
        self, readings: Sequence[Reading | None], rng: np.random.Generator
    ) -> Sequence[Reading | None]:
        """Readings as they arrive; None for one that does not."""
        return readings


class Run:
    """A skin in a world through time, from rest: one session, or one calibration."""

    def __init__(self, twin: Twin, effects: Sequence[Effect], seed: Sequence[int]) -> None:
        self._twin, self._effects, self._seed = twin, tuple(effects), tuple(seed)
        made = [effect.history(twin, self._rng(effect)) for effect in self._effects]
        self._histories = [history for history in made if history is not None]

    def moved(self, times: Floats, motion: Motion) -> Motion:
        """Motions at the next (T,) times for the states that touches would hold."""
        for history in self._histories:
            motion = history.steps(times, motion)
        return motion

    def around(self, times: Floats) -> Ambience | None:
        """What surrounds the chips at (T,) times; None where nothing does."""
        given = [effect.ambience(self._twin, self._rng(effect), times) for effect in self._effects]
        parts = [part for part in given if part is not None]
        none = Ambience.none(len(times), len(self._twin.design.halls))
        return sum(parts, start=none) if parts else None

    def poses(self, times: Floats) -> Floats:
        """Rotations from the skin's frame to the room's at (T,) times, (T, 3, 3)."""
        given = (effect.poses(self._rng(effect), times) for effect in self._effects)
        still = np.broadcast_to(np.eye(3), (len(times), 3, 3))
        return next((turned for turned in given if turned is not None), still)

    def arrived(self, readings: Sequence[Reading]) -> Sequence[Reading | None]:
        """Readings as they arrive; None for one that does not."""
        there: Sequence[Reading | None] = readings
        for effect in self._effects:
            there = effect.arrived(there, self._rng(effect))
        return there

    def _rng(self, effect: Effect) -> np.random.Generator:
        return rng_of(effect, self._seed)


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """A world by its effects; without any it is the plain one."""

    name: str
    effects: tuple[Effect, ...] = ()
    posed: bool = False
    """Whether the arm that turns its skins tells estimators how it holds them."""

    def __post_init__(self) -> None:
        if self.posed and not self.on_arm:
            raise ArgumentError(f"posed must go with an effect on an arm; got world {self.name!r}")

    @property
    def on_arm(self) -> bool:
        """Whether an arm turns its skins so that their weight moves them."""
        return any(effect.on_arm for effect in self.effects)

    @property
    def plain(self) -> bool:
        """Whether nothing is added to the twin's own assumptions."""
        return not self.effects

    def skin(self, design: SkinDesign, seed: int, contact: ContactLaw | None = None) -> Twin:
        """The made skin of a seed in this world, by another contact law if one is given."""
        tolerances = Tolerances()
        for effect in self.effects:
            tolerances = effect.tolerances(tolerances)
        made = drawn_skin(design, seed, tolerances)
        laws = [contact]
        for effect in self.effects:
            made = effect.skin(design, made, rng_of(effect, (seed,)))
            laws.append(effect.law(seed))
        law = next((law for law in laws if law is not None), None)
        return Twin(design, seed=seed, deviations=made, contact=law)

    def fingers(self, touches: Touches, seed: Sequence[int]) -> Touches:
        """What touches, where touches are asked for."""
        for effect in self.effects:
            touches = effect.fingers(touches, rng_of(effect, seed))
        return touches

    def run(self, twin: Twin, seed: Sequence[int], *, bench: bool = False) -> Run:
        """A skin's course of a session, or of its calibration on a bench."""
        acting = [effect for effect in self.effects if effect.on_bench or not bench]
        return Run(twin, acting, seed)


def rng_of(effect: Effect, seed: Sequence[int]) -> np.random.Generator:
    """The generator of one effect's randomness."""
    word = effect.chance or type(effect).__name__
    return np.random.default_rng([*seed, crc32(word.encode())])
