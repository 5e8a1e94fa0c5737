"""Pages that show bodies in space: one file, nothing from outside, a slider that moves them.

Decides how bodies become triangles of a page, and what its slider does: it lifts bodies off each
other, or leads their vertices from frame to frame. `space.html` draws them.
"""

import base64
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from typing import Any, Literal

import numpy as np

from smoskin.arrays import Floats, Ints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shade:
    """A colouring of a body's vertices, linear from 0 to the end of its scale."""

    name: str
    unit: str
    top: float
    """End of the scale."""
    values: Floats
    """(S, V): a value of every vertex in every frame."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """Triangles that are shown, coloured and moved together."""

    name: str
    colour: str
    """Colour where no shade is chosen, such as ``#9ecae1``."""
    frames: Floats
    """(S, V, 3), m: vertices in every frame."""
    triangles: Ints
    """(T, 3)."""
    level: float = 0.0
    """Height that the slider lifts it to, in shares of the whole."""
    shades: Sequence[Shade] = ()


def page(
    bodies: Sequence[Body], title: str, slider: Literal["apart", "fold"], *, start: float = 0.0
) -> bytes:
    """The page of bodies with a slider of this name, which begins at `start`, from 0 to 1."""
    groups = [
        {
            "name": body.name,
            "colour": body.colour,
            "level": body.level,
            "frames": len(body.frames),
            "vertices": _packed((1e3 * body.frames).astype("<f4")),
            "triangles": _packed(body.triangles.astype("<u4")),
            "shades": [
                {
                    "name": shade.name,
                    "unit": shade.unit,
                    "top": shade.top,
                    "values": _packed(shade.values.astype("<f4")),
                }
                for shade in body.shades
            ],
        }
        for body in bodies
    ]
    text = resources.files("smoskin.space").joinpath("space.html").read_text(encoding="utf-8")
    marks = {
        "SLIDER": slider,
        "START": f"{start:g}",
        "TITLE": escape(title),
        "GROUPS": json.dumps(groups),
    }
    return re.sub(r"\b[A-Z]{5,6}\b", lambda mark: marks.get(mark[0], mark[0]), text).encode()


def _packed(numbers: Any) -> str:
    """Numbers as a page carries them."""
    return base64.b64encode(np.ascontiguousarray(numbers).tobytes()).decode()
