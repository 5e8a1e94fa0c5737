"""What a skin feels besides touch: the Earth's field, and the magnets of skins beside it."""

from dataclasses import dataclass

import numpy as np

from smoskin.arrays import Floats, assign, freeze, frozen
from smoskin.errors import ArgumentError

_NONE = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Neighbour:
    """Another skin of the same design, at rest, by the pose of its frame in this skin's."""

    place: Floats
    """(3,), m: place of its origin."""
    turn: Floats
    """(3,), rad: rotation vector of its axes."""

    def __init__(self, *, place: object, turn: object = _NONE) -> None:
        assign(self, place=_finite("place", place), turn=_finite("turn", turn))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surroundings:
    """Magnetic disturbance of a skin that stands still; by default none.

    Examples
    --------
    >>> Surroundings(earth=(20e-6, 0.0, -45e-6)).neighbours
    ()
    """

    earth: Floats
    """(3,), T: the Earth's field in the skin's frame; 25 to 65 uT at the Earth's surface."""
    neighbours: tuple[Neighbour, ...]
    """Further skins; their magnets do not move."""

    def __init__(self, *, earth: object = _NONE, neighbours: tuple[Neighbour, ...] = ()) -> None:
        assign(self, earth=_finite("earth", earth), neighbours=tuple(neighbours))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ambience:
    """Things round S chips that change from state to state, one of T in each row."""

    field: Floats
    """(T, S, 3), T: field besides the skin's own, in the skin's frame."""
    magnets: Floats
    """(T, S), K: what is warmer than the skin at each chip's magnet."""
    chips: Floats
    """(T, S), K: what is warmer at the chip itself."""

    def __post_init__(self) -> None:
        freeze(self, field=(None, None, 3))
        shape = self.field.shape[:2]
        freeze(self, magnets=shape, chips=shape)

    @classmethod
    def none(cls, states: int, chips: int) -> "Ambience":
        """Nothing at all."""
        still = np.zeros((states, chips))
        return cls(field=np.zeros((states, chips, 3)), magnets=still, chips=still)

    def __add__(self, other: "Ambience") -> "Ambience":
        return Ambience(
            field=self.field + other.field,
            magnets=self.magnets + other.magnets,
            chips=self.chips + other.chips,
        )


def _finite(name: str, value: object) -> Floats:
    """Three finite numbers, read-only."""
    vector = frozen(name, value, (3,))  # type: ignore[arg-type]
    if not np.isfinite(vector).all():
        raise ArgumentError(f"{name} must be three finite numbers; got {vector}")
    return vector
