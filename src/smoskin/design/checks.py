"""What the parts of a design refuse: values, names and choices that nobody can build.

Decides how small and how large a value may be.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, TypeVar

from smoskin.arguments import typed
from smoskin.errors import DesignError

Part = TypeVar("Part")
_SIZE: Final = (1e-6, 1.0, "m")
_LIMITS: Final[Mapping[str, tuple[float, float, str]]] = MappingProxyType(
    {
        **dict.fromkeys(("panel_a", "panel_b", "thickness", "gap", "radius", "height"), _SIZE),
        "sensing_height": _SIZE,
        "clearance": _SIZE,
        "held_height": _SIZE,
        "play": _SIZE,
        "vertex_hole": (0.0, 0.1, "m"),
        "rim_share": (0.1, 1.0, ""),
        "pillars": (1, 10_000, ""),
        "skin_radius": (1e-3, 1e5, "m"),
        "far_radius": (1e-3, 1e5, "m"),
        "remanence": (1.0, 1e7, "A/m"),
        "stiffness_variation": (1e-3, 1e3, ""),
        "folding_correction": (1e-6, 1e6, "N"),
    }
)
"""Least and most of each value that can be built, and its unit."""
MOST_CELLS: Final = 64
"""Cells along x or y, and parts of one kind, that the models are laid out for."""
_LONGEST_NAME: Final = 100
"""Characters of a name."""


def within(owner: str, **values: float) -> None:
    """Refuse values that nobody can build."""
    for name, value in values.items():
        least, most, unit = _LIMITS[name]
        if not (math.isfinite(value) and value > 0.0) and least > 0.0:
            raise DesignError(f"{owner}.{name} must be positive and finite; got {value}")
        if not least <= value <= most:
            wanted = f"from {least:g} to {most:g} {unit}".rstrip()
            raise DesignError(f"{owner}.{name} must be {wanted}; got {value:g}")


def share(owner: str, **values: float) -> None:
    """Refuse what is no share."""
    for name, value in values.items():
        if not 0.0 <= value <= 1.0:
            raise DesignError(f"{owner}.{name} must lie in [0, 1]; got {value}")


def named(owner: str, name: str) -> None:
    """Refuse what people cannot call a part by."""
    if not (0 < len(name) <= _LONGEST_NAME and name.isprintable() and name.strip()):
        raise DesignError(
            f"{owner}.name must be 1 to {_LONGEST_NAME} characters of text; got {name!r}"
        )


def choice(owner: str, name: str, value: object, valid: tuple[object, ...]) -> None:
    """Refuse what is not among the valid ones."""
    if value not in valid:
        wanted = ", ".join(map(str, valid))
        raise DesignError(f"{owner}.{name} must be one of {wanted}; got {value!r}")


def part_of_design(record: type[Part]) -> type[Part]:
    """A record that refuses what its annotations do not admit as a design's fault."""
    return typed(record, DesignError)
