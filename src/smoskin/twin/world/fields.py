"""What surrounds the chips while an arm moves: the Earth, a motor, steel; and warmth."""

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from smoskin.arrays import Floats
from smoskin.magnetics.dipole import dipole_field
from smoskin.magnetics.sector import VACUUM_PERMEABILITY
from smoskin.origami.geometry import geometry
from smoskin.twin.surroundings import Ambience
from smoskin.twin.whole import Twin
from smoskin.twin.world.arm import ARM, TURNING, Arm, level_axis
from smoskin.twin.world.effect import Effect

_EARTH = 60e-6
"""T: strength of the Earth's field in northern Europe."""
_DIP = math.radians(65.0)
"""Dip of it there under the horizon."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Earth(Effect):
    """The Earth's field as the arm turns the skin in it: even over all chips."""

    on_bench = False
    chance = ARM
    strength: float = _EARTH
    """T."""
    arm: Arm = TURNING

    def ambience(self, twin: Twin, rng: np.random.Generator, times: Floats) -> Ambience:
        """As `Effect.ambience`."""
        return _of_field(twin, _turned_earth(self.strength, self.arm, rng, times)[:, None])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Motor(Effect):
    """A motor on the arm: a dipole that goes round while the arm moves."""

    on_bench = False
    moment: float = 0.06
    """A m^2: 100 uT at 50 mm, as small brushless motors leak."""
    place: tuple[float, float, float] = (0.5, -0.4, -0.06)
    """Place: along x and y in extents of the skin, m along z."""
    turns: float = 7.3
    """Rounds in a second."""

    def ambience(self, twin: Twin, rng: np.random.Generator, times: Floats) -> Ambience:
        """As `Effect.ambience`."""
        phase = 2 * math.pi * (self.turns * times + rng.uniform())
        spin = np.stack([np.cos(phase), np.sin(phase), np.zeros_like(phase)], axis=-1)
        moments = self.moment * (times > 0.0)[:, None] * spin
        places = np.broadcast_to(_placed(twin, self.place), moments.shape)
        return _of_field(twin, _dipoles(twin, moments, places))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Steel(Effect):
    """A steel part that passes by as the arm moves: a sphere, as dipole in its middle.

    Its moment is ``M V + 4 pi a^3 B / mu_0``: what it keeps, and the image of the Earth's field B
    in iron. The image of the skin's own magnets, which have no dipole, is left out: some 10 nT.
    """

    on_bench = False
    chance = ARM
    radius: float = 15e-3
    """a, m: a bolt head, a bearing."""
    remanence: float = 1.5e3
    """M, A/m: of a part that has once been near a magnet."""
    place: tuple[float, float, float] = (1.4, 0.5, -0.02)
    """Place at the start: along x and y in extents of the skin, m along z."""
    travel: float = 30e-3
    """Farthest way along y, m."""
    arm: Arm = TURNING

    def ambience(self, twin: Twin, rng: np.random.Generator, times: Floats) -> Ambience:
        """As `Effect.ambience`."""
        field = _turned_earth(_EARTH, self.arm, rng, times)
        kept = self.remanence * 4 / 3 * math.pi * self.radius**3 * _direction(rng)
        moments = kept + 4 * math.pi * self.radius**3 / VACUUM_PERMEABILITY * field
        way = np.array([0.0, self.travel, 0.0]) * self.arm.sway(times)[:, None]
        return _of_field(twin, _dipoles(twin, moments, _placed(twin, self.place) + way))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Warmth(Effect):
    """Chips that warm up under power, unlike each other, while magnets follow half-way."""

    rise: float = 3.0
    """Largest rise of a chip, K."""
    time: float = 120.0
    """Time constant, s."""
    followed: float = 0.5
    """Share of it by which the magnet over the chip warms."""

    def ambience(self, twin: Twin, rng: np.random.Generator, times: Floats) -> Ambience:
        """As `Effect.ambience`."""
        chips = len(twin.design.halls)
        rise = self.rise * rng.uniform(0.3, 1.0, chips)
        warm = rise * -np.expm1(-np.maximum(times, 0.0) / self.time)[:, None]
        still = np.zeros((len(times), chips, 3))
        return Ambience(field=still, magnets=self.followed * warm, chips=warm)


def _turned_earth(strength: float, arm: Arm, rng: np.random.Generator, times: Floats) -> Floats:
    """The Earth's field in the frame of a skin on an arm, (T, 3), T."""
    axis, bearing = level_axis(rng), rng.uniform(0, 2 * math.pi)
    level = math.cos(_DIP) * np.array([math.cos(bearing), math.sin(bearing), 0.0])
    field = strength * (level - [0.0, 0.0, math.sin(_DIP)])
    return np.asarray(np.swapaxes(arm.turns(axis, times), -1, -2) @ field)


def _placed(twin: Twin, place: tuple[float, float, float]) -> Floats:
    """A place given in extents of the skin along x and y, m."""
    return np.append(np.array(place[:2]) * geometry(twin.design).extent, place[2])


def _direction(rng: np.random.Generator) -> Floats:
    """Any direction, (3,)."""
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _dipoles(twin: Twin, moments: Floats, places: Floats) -> Floats:
    """Field of a dipole (T, 3) at places (T, 3), m, at the chips, (T, S, 3), T."""
    away = geometry(twin.design).chips - places[:, None]
    return dipole_field(np.broadcast_to(moments[:, None], away.shape), away)


def _of_field(twin: Twin, field: Floats) -> Ambience:
    """An ambience of a field alone, (T, S or 1, 3)."""
    none = Ambience.none(len(field), len(twin.design.halls))
    return Ambience(field=none.field + field, magnets=none.magnets, chips=none.chips)
