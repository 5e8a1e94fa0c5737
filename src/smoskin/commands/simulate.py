"""What `smoskin simulate` does: one press in words, or a sweep on disk.

Decides how presses and sweeps are written on a command line, in N, mm and degC, and what is told
of the answer.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from smoskin.arrays import Floats
from smoskin.datasets.patterns import LARGEST_FORCE, Grid, Mechanics, Pairs, Random, Sweep, sideways
from smoskin.datasets.store import Dataset, State, write_dataset
from smoskin.datasets.workers import DaskEngine, Engine, LocalEngine
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.touches import (
    FINGERTIP,
    Covered,
    Frictionless,
    Grip,
    Sliding,
    Sticking,
)
from smoskin.records import ChipFlag, Contact, Motion, Reading
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

Kind = Literal["grid", "shear", "pairs", "random"]
EngineName = Literal["local", "dask"]

_MM: Final = 1e-3
_TENTHS: Final = "0.1:1:10"
"""N: forces of a grid unless told otherwise, as in the SI."""


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
    """degC."""

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
                    "at_mm": _plain(one.position / _MM),
                    "force_N": _plain(one.force),
                    "depth_mm": _plain(depth / _MM),
                }
                for one, depth in zip(self.contacts, self.depths, strict=True)
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
                    "flags": _flag_names(flag),
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
        told: Any = self.as_json()
        touches = _table("Touches", "", "x, y (mm)", "Fx, Fy, Fz (N)", "depth (mm)")
        for number, one in enumerate(told["touches"], 1):
            touches.add_row(
                str(number), _text(one["at_mm"], 1), _text(one["force_N"], 3),
                _text([one["depth_mm"]], 4),
            )  # fmt: skip
        magnets = _table("Magnets over the board", "", "x, y, z (mm)", "turn (deg)")
        for one in told["magnets"]:
            magnets.add_row(one["name"], _text(one["shift_mm"], 4), _text(one["turn_deg"], 3))
        board = told["board"]
        magnets.add_row("board", _text(board["shift_mm"], 4), _text([board["turn_deg"]], 3))
        chips = _table("Chips", "", "field in the skin (mT)", "reads, own axes (mT)", "flags")
        for one in told["chips"]:
            chips.add_row(
                one["name"], _text(one["field_mT"], 4), _text(one["reading_mT"], 4),
                ", ".join(one["flags"]) or "good",
            )  # fmt: skip
        return [touches, magnets, chips]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepReport:
    """A finished sweep."""

    dataset: Dataset
    exported: Path | None
    """The one file that it was also written to."""
    seconds: float
    """Of computing, in all runs that ended well."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        data = self.dataset
        return {
            "path": str(data.path),
            "exported": None if self.exported is None else str(self.exported),
            "design_hash": data.design.content_hash,
            "sweep_hash": data.sweep.content_hash,
            "chunks": data.sweep.chunks,
            "rows": data.sweep.rows,
            "invalid_rows": data.invalid,
            "flagged_rows": data.flagged,
            "seconds": self.seconds,
        }

    def lines(self) -> list[str]:
        """The summary for people."""
        data = self.dataset
        rows = data.sweep.rows
        said = [
            f"{rows} rows in {data.sweep.chunks} chunks: {data.path}",
            f"without an equilibrium, flagged invalid: {data.invalid}",
            f"with a saturated or invalid chip: {data.flagged}",
        ]
        if self.seconds > 0:
            said.append(f"computed in {self.seconds:.1f} s, {rows / self.seconds:.0f} rows/s")
        if self.exported is not None:
            said.append(f"in one file: {self.exported}")
        return said


def simulate_press(
    design: SkinDesign,
    at: Sequence[str],
    force: Sequence[str],
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
        ``x,y`` in mm of each touch.
    force : sequence of str
        ``Fx,Fy,Fz`` in N of each touch on the skin; pressing is negative z.
    temperature : float
        Of the skin, degC.
    mechanics : {"whole", "reduced"}
        Of the twin.
    grip : str, optional
        As `parse_grip` reads it.
    manufactured : bool
        Whether the skin is drawn from the tolerances.
    seed : int
        Of the made skin and of the chips' noise.

    Raises
    ------
    ArgumentError
        If a text is not such numbers, or the skin cannot be touched so.
    """
    if len(at) != len(force):
        raise ArgumentError(f"every touch needs both at and force; got {len(at)} and {len(force)}")
    contacts = tuple(
        Contact(position=np.array(_vector("at", where, 2)) * _MM, force=_vector("force", push, 3))
        for where, push in zip(at, force, strict=True)
    )
    for contact in contacts:
        if not (np.abs(contact.force) <= LARGEST_FORCE).all():
            raise ArgumentError(
                f"force must lie within {LARGEST_FORCE:g} N; got {contact.force.tolist()} N"
            )
    if mechanics == "reduced":
        if manufactured or grip is not None:
            raise ArgumentError("reduced mechanics know neither grip nor manufactured skins")
        reduced = ReducedTwin(design, seed=seed)
        reduced.check(contacts)
        motion = reduced.motion(contacts, temperature=temperature)
        field = reduced.field(motion, temperature)
        reading = reduced.sense(motion, temperature=temperature)
        depths = reduced.depths(contacts, temperature=temperature)
    else:
        held = parse_grip(grip)
        twin = Twin(design, seed=seed, manufactured=manufactured, grip=held)
        twin.check(contacts)
        motion = twin.motion(contacts, temperature=temperature)
        field = twin.field(motion, temperature)
        reading = twin.sense(motion, temperature=temperature)
        depths = twin.depths(contacts, temperature=temperature)
    return PressReport(
        design=design,
        contacts=contacts,
        depths=depths,
        motion=motion,
        field=field,
        reading=reading,
        temperature=temperature,
    )


def plan_sweep(
    kind: Kind,
    options: Mapping[str, str | None],
    *,
    temperatures: str | None = None,
    skins: int = 0,
    mechanics: Mechanics = "whole",
    grip: str | None = None,
    seed: int = 0,
    presses_per_chunk: int | None = None,
) -> Sweep:
    """A sweep from its words.

    Parameters
    ----------
    kind : {"grid", "shear", "pairs", "random"}
    options : mapping
        What the kind of sweep takes, in words; None is not given. Grid: forces, places, radius.
        Shear: these, drags, directions. Pairs: as grid. Random: count, touches, forces, drags,
        radius, margin.
    temperatures : str, optional
        degC, one or more numbers.
    skins : int, optional
        How many manufactured skins, of seeds 0, 1, ...; by default the design itself.
    mechanics, grip, seed, presses_per_chunk
        As `Sweep` has them; the grip in words as `parse_grip` reads it. Chunks of a very large
        sweep are larger by default, so that there are not too many files.

    Raises
    ------
    ArgumentError
        If an option is not one of the kind's, or is out of bounds.
    """
    given = {name: value for name, value in options.items() if value is not None}
    for name in given:
        if name not in _OPTIONS[kind]:
            raise ArgumentError(
                f"{name} is no option of a {kind} sweep, which takes {', '.join(_OPTIONS[kind])}"
            )
    sweep = Sweep(
        presses=_random(given) if kind == "random" else _regular(kind, given),
        temperatures=parse_numbers("temperatures", temperatures or f"{REFERENCE_TEMPERATURE:g}"),
        skins=tuple(range(skins)),
        mechanics=mechanics,
        grip=parse_grip(grip),
        seed=seed,
    )
    if presses_per_chunk is None:
        presses_per_chunk = sweep.presses_per_chunk * -(-sweep.chunks // _MOST_CHUNKS)
    return replace(sweep, presses_per_chunk=presses_per_chunk)


def run_sweep(
    design: SkinDesign,
    sweep: Sweep,
    out: str | os.PathLike[str],
    *,
    engine: Engine | None = None,
    export: Path | None = None,
    progress: Callable[[State], None] | None = None,
) -> SweepReport:
    """Compute a sweep, or what is missing of it, into a folder; and into one file if asked.

    Raises
    ------
    ArgumentError, RecordingError, EngineError, MissingExtraError
        As `smoskin.datasets.store.write_dataset`.
    """
    data = write_dataset(out, design, sweep, engine=engine, progress=progress)
    if export is not None:
        data.export(export)
    seconds = sum(run.seconds for run in data.manifest.runs)
    return SweepReport(dataset=data, exported=export, seconds=seconds)


def parse_engine(name: EngineName, workers: int | None, scheduler: str | None) -> Engine:
    """The engine of this name.

    Raises
    ------
    ArgumentError
        If what is given beside it does not belong to it.
    """
    if name == "dask":
        return DaskEngine(scheduler, workers=workers)
    if scheduler is not None:
        raise ArgumentError("scheduler is an option of the dask engine; got engine local")
    return LocalEngine(workers)


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
            return tuple(round(one, 12) for one in evenly.tolist())
        return tuple(float(one) for one in text.split(","))
    except ValueError as error:
        raise ArgumentError(
            f"{name} must be numbers such as 0.1,0.5 or from:to:count; got {text!r}"
        ) from error


_OPTIONS: Final[Mapping[Kind, tuple[str, ...]]] = MappingProxyType(
    {
        "grid": ("forces", "places", "radius"),
        "shear": ("forces", "places", "radius", "drags", "directions"),
        "pairs": ("forces", "places", "radius"),
        "random": ("count", "touches", "forces", "drags", "radius", "margin"),
    }
)
_MOST_CHUNKS: Final = 4096
"""That a sweep is cut into unless told otherwise: a folder's worth of files."""


def _regular(kind: Kind, given: Mapping[str, str]) -> Grid | Pairs:
    """A pattern on a grid."""
    forces = parse_numbers("forces", given.get("forces", _TENTHS))
    places = _pair("places", given.get("places", "25x33"))
    radius = _range("radius", given.get("radius", f"{FINGERTIP / _MM:g}"))[0] * _MM
    if kind == "pairs":
        return Pairs(forces=forces, places=places, radius=radius)
    if kind == "grid":
        return Grid(forces=forces, places=places, radius=radius)
    sizes = parse_numbers("drags", given.get("drags", "0.1,0.2"))
    drags = sideways(sizes, _count("directions", given.get("directions", "8")))
    return Grid(forces=forces, places=places, radius=radius, drags=drags)


def _random(given: Mapping[str, str]) -> Random:
    """A random pattern."""
    if "count" not in given:
        raise ArgumentError("count must be given for a random sweep: how many presses")
    least, most = _range("touches", given.get("touches", "1"))
    small, large = _range("radius", given.get("radius", f"{FINGERTIP / _MM:g}"))
    return Random(
        count=_count("count", given["count"]),
        touches_at_once=(int(least), int(most)),
        forces=_range("forces", given.get("forces", "0.1:1")),
        drags=_range("drags", given.get("drags", "0")),
        radius=(small * _MM, large * _MM),
        margin=_range("margin", given.get("margin", "0"))[0] * _MM,
    )


def _range(name: str, text: str) -> tuple[float, float]:
    """``0.1:1``, or one number for both."""
    try:
        begin, _, end = text.partition(":")
        return float(begin), float(end or begin)
    except ValueError as error:
        raise ArgumentError(f"{name} must be a number or from:to; got {text!r}") from error


def _pair(name: str, text: str) -> tuple[int, int]:
    try:
        one, other = text.split("x")
        return int(one), int(other)
    except ValueError as error:
        raise ArgumentError(f"{name} must be two numbers such as 25x33; got {text!r}") from error


def _count(name: str, text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise ArgumentError(f"{name} must be a whole number; got {text!r}") from error


def _vector(name: str, text: str, length: int) -> tuple[float, ...]:
    try:
        numbers = tuple(float(one) for one in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != length:
        raise ArgumentError(f"{name} must be {length} numbers with commas; got {text!r}")
    return numbers


def _flag_names(flag: int) -> list[str]:
    return [one.name for one in ChipFlag if one.name and flag & one]


def _plain(value: Any) -> Any:
    """Numbers to nine figures for JSON, NaN as null."""
    if np.ndim(value):
        return [_plain(one) for one in value]
    return float(f"{value:.9g}") if np.isfinite(value) else None


def _table(title: str, *headings: str) -> "Table":
    from rich.table import Table

    table = Table(title=title)
    for heading in headings:
        table.add_column(heading, justify="right" if heading else "left")
    return table


def _text(values: Sequence[float | None], digits: int) -> str:
    return ", ".join("-" if one is None else f"{one:.{digits}f}" for one in values)
