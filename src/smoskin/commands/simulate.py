"""What `smoskin simulate` does: one press of a virtual skin, in numbers and words.

Decides how touches are written on a command line, in N and mm, and what is told of the answer.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.datasets.patterns import LARGEST_FORCE, Mechanics
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Grip, Sliding, Sticking
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact, Motion, Reading
from smoskin.roles import VirtualSkin
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

_MM: Final = 1e-3
_MOST_NUMBERS: Final = 100_000
"""Numbers of a list that a text stands for."""
_DIGITS: Final = {"at_mm": 1, "force_N": 3, "turn_deg": 3}
"""Digits that people read of each value; four of all others."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressReport:
    """One state of touch and what comes of it."""

    design: SkinDesign
    contacts: tuple[Contact, ...]
    depths: Floats
    """How far the skin under each contact has sunk, (K,), m; NaN if not valid."""
    motion: Motion
    field: Floats
    """Exact field in the skin's frame, (S, 3), T."""
    reading: Reading
    temperature: float
    """Temperature of the skin, degC."""

    @property
    def valid(self) -> bool:
        """Whether the skin has found an equilibrium."""
        return bool(self.motion.valid)

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines; what is not known is null."""
        magnets, board = self.motion.magnets, self.motion.board
        flags = self.reading.flags.tolist()
        touches = [
            {"at_mm": contact.position / _MM, "force_N": contact.force, "depth_mm": depth / _MM}
            for contact, depth in zip(self.contacts, self.depths, strict=True)
        ]
        moves = [
            {"name": magnet.name, "shift_mm": moved[:3] / _MM, "turn_deg": np.degrees(moved[3:])}
            for magnet, moved in zip(self.design.magnets, magnets, strict=True)
        ]
        chips = [
            {
                "name": site.name,
                "field_mT": self.field[chip] / 1e-3,
                "reading_mT": self.reading.field[chip] / 1e-3,
                "flags": [flag.name for flag in ChipFlag if flags[chip] & flag],
            }
            for chip, site in enumerate(self.design.halls)
        ]
        values = {
            "design": self.design.name,
            "valid": self.valid,
            "temperature_degC": self.temperature,
            "touches": touches,
            "magnets": moves,
            "board": {"shift_mm": board[:3] / _MM, "turn_deg": np.degrees(board[3:])},
            "chips": chips,
        }
        return dict(_plain(values))

    def tables(self) -> "list[Table]":
        """Touches, magnets and chips, for people."""
        values = self.as_json()
        magnets = [*values["magnets"], {"name": "board", **values["board"]}]
        seen = ("field in the skin (mT)", "reads, own axes (mT)", "flags")
        return [
            _table("Touches", values["touches"], "x, y (mm)", "Fx, Fy, Fz (N)", "depth (mm)"),
            _table("Magnets over the board", magnets, "x, y, z (mm)", "turn (deg)"),
            _table("Chips", values["chips"], *seen),
        ]


def simulate_press(
    design: SkinDesign,
    at: Sequence[str] = (),
    force: Sequence[str] = (),
    *,
    temperature: float = REFERENCE_TEMPERATURE,
    mechanics: Mechanics = "whole",
    grip: str | None = None,
    manufactured: bool = False,
    seed: int = 0,
) -> PressReport:
    """One state of one or more touches.

    Each touch is at ``x,y`` in mm, by default one in the middle of the skin, with a force
    ``Fx,Fy,Fz`` in N on the skin, or one for all; pressing is negative z, by default 0.5 N. The
    skin's temperature is in degC, the grip as `parse_grip` reads it. The seed is that of the made
    skin, drawn from the tolerances if it is `manufactured`, and of the chips' noise. It raises an
    `ArgumentError` if a text is not such numbers, or the skin cannot be touched so.
    """
    contacts = _contacts(design, at, force)
    skin: VirtualSkin
    if mechanics == "whole":
        skin = Twin(design, seed=seed, manufactured=manufactured, grip=parse_grip(grip))
    elif manufactured or grip is not None:
        raise ArgumentError("reduced mechanics know neither grip nor manufactured skins")
    else:
        skin = ReducedTwin(design, seed=seed)
    motion = skin.motion(contacts, temperature=temperature)
    depths = skin.depths(contacts, temperature=temperature)
    return PressReport(
        design=design,
        contacts=contacts,
        depths=depths if motion.valid else np.full(len(contacts), np.nan),
        motion=motion,
        field=skin.field(motion, temperature),
        reading=skin.sense(motion, temperature=temperature),
        temperature=temperature,
    )


def parse_grip(text: str | None) -> Grip:
    """A grip from its word: ``sticking``, ``frictionless``, ``covered`` or ``sliding:0.5``.

    >>> parse_grip("sliding:0.5")
    Sliding(friction=0.5)
    """
    word, _, number = (text or "sticking").partition(":")
    if word == "sliding" and number:
        return Sliding(friction=parse_numbers("grip", number)[0])
    kinds: tuple[Grip, ...] = (Sticking(), Frictionless(), Covered())
    named = {type(kind).__name__.lower(): kind for kind in kinds}
    if word not in named or number:
        raise ArgumentError(
            f"grip must be sticking, frictionless, covered or sliding:FRICTION; got {text!r}"
        )
    return named[word]


def parse_numbers(name: str, text: str) -> tuple[float, ...]:
    """Numbers from ``0.1,0.5,1`` or, evenly from and to, ``0.1:1:10``.

    >>> parse_numbers("forces", "0.1:0.4:4")
    (0.1, 0.2, 0.3, 0.4)
    """
    try:
        if ":" in text:
            begin, end, count = text.split(":")
            if int(count) > _MOST_NUMBERS:
                raise ArgumentError(f"{name} must be at most {_MOST_NUMBERS:,}; got {count}")
            # Rounded, so that a tenth of a newton is the tenth that people write.
            evenly = np.linspace(float(begin), float(end), int(count))
            return tuple(round(number, 12) for number in evenly.tolist())
        return tuple(float(number) for number in text.split(","))
    except ArgumentError:
        raise
    except ValueError as error:
        raise ArgumentError(
            f"{name} must be numbers such as 0.1,0.5 or from:to:count; got {text!r}"
        ) from error


def _contacts(design: SkinDesign, at: Sequence[str], force: Sequence[str]) -> tuple[Contact, ...]:
    """Touches from their words."""
    places = [np.multiply(_vector("at", text, 2), _MM) for text in at]
    places = places or [geometry(design).extent / 2]
    pushes = [_vector("force", text, 3) for text in force or ["0,0,-0.5"]]
    if len(pushes) == 1:
        pushes *= len(places)
    if len(places) != len(pushes):
        raise ArgumentError(
            f"force must be given once, or once for each at; got {len(pushes)} for {len(places)}"
        )
    for push in pushes:
        if not (np.abs(push) <= LARGEST_FORCE).all():
            raise ArgumentError(f"force must lie within {LARGEST_FORCE:g} N; got {push} N")
    return tuple(Contact(position=p, force=f) for p, f in zip(places, pushes, strict=True))


def _vector(name: str, text: str, length: int) -> list[float]:
    """So many numbers from a text."""
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != length:
        raise ArgumentError(f"{name} must be {length} numbers with commas; got {text!r}")
    return numbers


def _plain(value: Any) -> Any:
    """The same for JSON: numbers to nine figures, NaN as null."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | np.ndarray) and np.ndim(value):
        return [_plain(part) for part in value]
    if isinstance(value, str | bool):
        return value
    return float(f"{value:.9g}") if np.isfinite(value) else None


def _table(title: str, rows: Sequence[dict[str, Any]], *headings: str) -> "Table":
    """Rows of plain values, each after its name or number."""
    from rich.table import Table

    table = Table("", title=title)
    for heading in headings:
        table.add_column(heading, justify="right")
    for number, row in enumerate(rows, 1):
        cells = (_text(value, _DIGITS.get(key, 4)) for key, value in row.items() if key != "name")
        table.add_row(row.get("name", str(number)), *cells)
    return table


def _text(value: Any, digits: int) -> str:
    """A plain value in words; a chip without flags is good."""
    if isinstance(value, list):
        return ", ".join(_text(part, digits) for part in value) or "good"
    if isinstance(value, str):
        return value
    return "-" if value is None else f"{value:.{digits}f}"
