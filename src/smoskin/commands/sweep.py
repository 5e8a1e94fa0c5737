"""What `smoskin sweep` does: a data set of presses on disk, and what one on disk holds.

Decides how sweeps are written on a command line, in N, mm and degC, and what is told of them.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

from smoskin.commands.simulate import parse_grip, parse_numbers
from smoskin.datasets.patterns import Grid, Mechanics, Pairs, Random, Sweep, format_sweep, sideways
from smoskin.datasets.store import Dataset, open_dataset, write_dataset
from smoskin.datasets.workers import Engine
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.roles import Progress, unheard

Kind = Literal["grid", "shear", "pairs", "random"]

_MM: Final = 1e-3
_TENTHS: Final = "0.1:1:10"
"""N: forces of a grid unless told otherwise, as in the SI."""
_OPTIONS: Final[Mapping[Kind, tuple[str, ...]]] = MappingProxyType(
    {
        "grid": ("forces", "places", "radius"),
        "shear": ("forces", "places", "radius", "drags", "directions"),
        "pairs": ("forces", "places", "radius"),
        "random": ("count", "touches", "forces", "drags", "radius", "margin"),
    }
)
_MOST_CHUNKS: Final = 4096
"""Chunks that a sweep is cut into unless told otherwise: a folder's worth of files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepReport:
    """What a data set on disk holds."""

    dataset: Dataset
    """The data set."""
    damaged: int
    """Number of chunks whose files are not as they were written."""
    exported: Path | None = None
    """The one file that it was also written to."""

    @property
    def sound(self) -> bool:
        """Whether every row is there, as it was written."""
        return self.dataset.complete and not self.damaged

    @property
    def seconds(self) -> float:
        """Time of computing in all runs that ended well, s."""
        return sum(run.seconds for run in self.dataset.manifest.runs)

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        data, sweep = self.dataset, self.dataset.sweep
        return {
            "path": str(data.path),
            "exported": None if self.exported is None else str(self.exported),
            "design": data.design.name,
            "design_hash": data.design.content_hash,
            "sweep": format_sweep(sweep),
            "sweep_hash": sweep.content_hash,
            "chunks": sweep.chunks,
            "rows": sweep.rows,
            "missing_rows": len(data.missing_rows),
            "damaged_chunks": self.damaged,
            "invalid_rows": data.invalid,
            "flagged_rows": data.flagged,
            "seconds": self.seconds,
        }

    def lines(self) -> list[str]:
        """The summary for people."""
        data, sweep = self.dataset, self.dataset.sweep
        kind = type(sweep.presses).__name__.lower()
        degrees = ", ".join(f"{temperature:g}" for temperature in sweep.temperatures)
        lines = [
            f"{sweep.rows} rows in {sweep.chunks} chunks: {data.path}",
            f"design {data.design.name}: {sweep.presses.count} presses ({kind}) at {degrees} degC "
            f"on {max(len(sweep.skins), 1)} skin(s), {sweep.mechanics} mechanics",
            f"without an equilibrium, flagged invalid: {data.invalid}",
            f"with a saturated or invalid chip: {data.flagged}",
        ]
        if not self.sound:
            lines.append(
                f"missing rows: {len(data.missing_rows)}; damaged chunks: {self.damaged}; "
                "repeat the sweep to complete it"
            )
        if self.seconds > 0:
            lines.append(
                f"computed in {self.seconds:.1f} s, {sweep.rows / self.seconds:.0f} rows/s"
            )
        if self.exported is not None:
            lines.append(f"in one file: {self.exported}")
        return lines


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
    """A sweep from its words; an option that is None is not given.

    Options of a grid are forces, places, radius; of shear these, drags, directions; of pairs as of
    a grid; of random count, touches, forces, drags, radius, margin. Temperatures are in degC; made
    skins have the seeds 0, 1, ..., by default it is the design itself. A very large sweep has more
    presses a chunk than `Sweep` has, for fewer files. It raises an `ArgumentError` if an option is
    not one of the kind's, or is out of bounds.
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
    force: bool = False,
    progress: Progress = unheard,
) -> SweepReport:
    """Compute a sweep, or what is missing of it, into a folder; and into one file if asked.

    `force` lets that file be replaced. It raises as `smoskin.datasets.store.write_dataset`.
    """
    data = write_dataset(out, design, sweep, engine=engine, progress=progress)
    if export is not None:
        data.export(export, force=force)
    return SweepReport(dataset=data, damaged=0, exported=export)


def summarise(path: str | os.PathLike[str]) -> SweepReport:
    """What a data set on disk holds, complete or not; every file is read."""
    data = open_dataset(path)
    damaged = data.damaged()
    sound = replace(data, present=tuple(sorted(set(data.present) - set(damaged))))
    return SweepReport(dataset=sound, damaged=len(damaged))


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
        along, across = text.split("x")
        return int(along), int(across)
    except ValueError as error:
        raise ArgumentError(f"{name} must be two numbers such as 25x33; got {text!r}") from error


def _count(name: str, text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise ArgumentError(f"{name} must be a whole number; got {text!r}") from error
