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
_PRESS: Final = "0,0,-0.5"
"""N: the force of a touch unless told otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressReport:
    """One state of touch and what comes of it."""

    design: SkinDesign
    contacts: tuple[Contact, ...]
    depths: Floats
    """(K,), m: how far the skin under each contact has sunk; NaN if not valid."""
    motion: Motion
    field: Floats
    """(S, 3), T: exact, in the skin's frame."""
    reading: Reading
    temperature: float
    """Temperature of the skin, degC."""

    @property
    def valid(self) -> bool:
        """Whether the skin has found an equilibrium."""
        return bool(self.motion.valid)

    def as_json(self) -> dict[str, object]:
        """Plain values for machines; what is not known is null."""
        magnets, board = self.motion.magnets, self.motion.board
        return {
            "design": self.design.name,
            "valid": self.valid,
            "temperature_degC": self.temperature,
            "touches": [
                {
                    "at_mm": _plain(contact.position / _MM),
                    "force_N": _plain(contact.force),
                    "depth_mm": _plain(depth / _MM),
                }
                for contact, depth in zip(self.contacts, self.depths, strict=True)
            ],
            "magnets": [
                {
                    "name": magnet.name,
                    "shift_mm": _plain(moved[:3] / _MM),
                    "turn_deg": _plain(np.degrees(moved[3:])),
                }
                for magnet, moved in zip(self.design.magnets, magnets, strict=True)
            ],
            "board": {
                "shift_mm": _plain(board[:2] / _MM),
                "turn_deg": _plain(np.degrees(board[2])),
            },
            "chips": [
                {
                    "name": site.name,
                    "field_mT": _plain(field / 1e-3),
                    "reading_mT": _plain(read / 1e-3),
                    "flags": [each.name for each in ChipFlag if flag & each],
                }
                for site, field, read, flag in zip(
                    self.design.halls,
                    self.field,
                    self.reading.field,
                    self.reading.flags.tolist(),
                    strict=True,
                )
            ],
        }

    def tables(self) -> "list[Table]":
        """Touches, magnets and chips, for people."""
        values: Any = self.as_json()
        touches = _table("Touches", "", "x, y (mm)", "Fx, Fy, Fz (N)", "depth (mm)")
        for number, touch in enumerate(values["touches"], 1):
            place, depth = _text(touch["at_mm"], 1), _text([touch["depth_mm"]], 4)
            touches.add_row(str(number), place, _text(touch["force_N"], 3), depth)
        magnets = _table("Magnets over the board", "", "x, y, z (mm)", "turn (deg)")
        for magnet in values["magnets"]:
            shift, turned = _text(magnet["shift_mm"], 4), _text(magnet["turn_deg"], 3)
            magnets.add_row(magnet["name"], shift, turned)
        board = values["board"]
        magnets.add_row("board", _text(board["shift_mm"], 4), _text([board["turn_deg"]], 3))
        chips = _table("Chips", "", "field in the skin (mT)", "reads, own axes (mT)", "flags")
        for chip in values["chips"]:
            field, reading = _text(chip["field_mT"], 4), _text(chip["reading_mT"], 4)
            chips.add_row(chip["name"], field, reading, ", ".join(chip["flags"]) or "good")
        return [touches, magnets, chips]


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

    Parameters
    ----------
    design : SkinDesign
    at : sequence of str
        ``x,y`` in mm of each touch; by default one touch in the middle of the skin.
    force : sequence of str
        ``Fx,Fy,Fz`` in N of each touch on the skin, or one for all; pressing is negative z. By
        default 0.5 N straight down.
    temperature : float
        Temperature of the skin, degC.
    mechanics : {"whole", "reduced"}
        Which twin is pressed.
    grip : str, optional
        How touches hold on to the skin, as `parse_grip` reads it.
    manufactured : bool
        Whether the skin is drawn from the tolerances.
    seed : int
        Seed of the made skin and of the chips' noise.

    Raises
    ------
    ArgumentError
        If a text is not such numbers, or the skin cannot be touched so.
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

    Raises
    ------
    ArgumentError
        If it is none of these.

    Examples
    --------
    >>> parse_grip("sliding:0.5")
    Sliding(friction=0.5)
    """
    word, _, number = (text or "sticking").partition(":")
    if word == "sliding" and number:
        return Sliding(friction=parse_numbers("grip", number)[0])
    kinds: dict[str, Grip] = {
        "sticking": Sticking(),
        "frictionless": Frictionless(),
        "covered": Covered(),
    }
    if word not in kinds or number:
        raise ArgumentError(
            f"grip must be sticking, frictionless, covered or sliding:FRICTION; got {text!r}"
        )
    return kinds[word]


def parse_numbers(name: str, text: str) -> tuple[float, ...]:
    """Numbers from ``0.1,0.5,1`` or, evenly from and to, ``0.1:1:10``.

    Raises
    ------
    ArgumentError
        If the text is neither.

    Examples
    --------
    >>> parse_numbers("forces", "0.1:0.4:4")
    (0.1, 0.2, 0.3, 0.4)
    """
    try:
        if ":" in text:
            begin, end, count = text.split(":")
            # Rounded, so that a tenth of a newton is the tenth that people write.
            evenly = np.linspace(float(begin), float(end), int(count))
            return tuple(round(number, 12) for number in evenly.tolist())
        return tuple(float(number) for number in text.split(","))
    except ValueError as error:
        raise ArgumentError(
            f"{name} must be numbers such as 0.1,0.5 or from:to:count; got {text!r}"
        ) from error


def _contacts(design: SkinDesign, at: Sequence[str], force: Sequence[str]) -> tuple[Contact, ...]:
    """Touches from their words."""
    places = [np.multiply(_vector("at", text, 2), _MM) for text in at]
    places = places or [geometry(design).extent / 2]
    pushes = [_vector("force", text, 3) for text in force or [_PRESS]]
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
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != length:
        raise ArgumentError(f"{name} must be {length} numbers with commas; got {text!r}")
    return numbers


def _plain(value: Any) -> Any:
    """Numbers to nine figures for JSON, NaN as null."""
    if np.ndim(value):
        return [_plain(each) for each in value]
    return float(f"{value:.9g}") if np.isfinite(value) else None


def _table(title: str, *headings: str) -> "Table":
    from rich.table import Table

    table = Table(title=title)
    for heading in headings:
        table.add_column(heading, justify="right" if heading else "left")
    return table


def _text(values: Sequence[float | None], digits: int) -> str:
    return ", ".join("-" if value is None else f"{value:.{digits}f}" for value in values)
