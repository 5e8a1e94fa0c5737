"""Data sets: a sweep's rows on disk, chunk by chunk, that a kill cannot damage.

Decides the layout: a folder with a manifest (what the rows are of) and one compressed HDF5 file a
chunk, each under a temporary name until it is whole. Resuming computes what is missing; another
design, sweep or version of this package is refused. Hides names, columns, locks and renaming.
"""

import io
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from smoskin.datasets.manifest import (
    PART,
    Manifest,
    Run,
    add_run,
    claim,
    locked,
    manifest_of,
    read_manifest,
    settle,
    write_whole,
)
from smoskin.datasets.patterns import Sweep
from smoskin.datasets.simulation import Rows, Simulation
from smoskin.datasets.workers import Engine, LocalEngine
from smoskin.design.skin import SkinDesign
from smoskin.errors import MissingExtraError, RecordingError

_ROWS_AT_ONCE: Final = 4096
"""That HDF5 compresses together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One quantity of every row."""

    name: str
    """In files, with its unit."""
    field: str
    """Of `Rows`."""
    kind: str
    """NumPy's name of its numbers' type."""
    about: str
    """What it is."""


COLUMNS: Final = (
    Column(name="skin_seed", field="skin", kind="int64",
           about="seed of the manufactured skin; -1: as designed"),
    Column(name="position_m", field="position", kind="float64",
           about="(touch, x y) on the undeformed skin"),
    Column(name="force_N", field="force", kind="float64",
           about="(touch, x y z) on the skin; all zero: no touch"),
    Column(name="radius_m", field="radius", kind="float64", about="(touch) of its patch"),
    Column(name="temperature_degC", field="temperature", kind="float64",
           about="of rubber, magnets and chips"),
    Column(name="magnet_shift_m", field="magnet_shift", kind="float64",
           about="(magnet, x y z) over the board; NaN if invalid"),
    Column(name="magnet_turn_rad", field="magnet_turn", kind="float64",
           about="(magnet, x y z) rotation vector; NaN if invalid"),
    Column(name="board_shift_m", field="board_shift", kind="float64",
           about="(x y) over the base; NaN if invalid"),
    Column(name="board_turn_rad", field="board_turn", kind="float64",
           about="about z; NaN if invalid"),
    Column(name="field_T", field="field", kind="float64",
           about="(chip, x y z) exact, in the skin's frame; NaN if invalid"),
    Column(name="reading_T", field="reading", kind="float64",
           about="(chip, x y z) as read, in the chip's axes; NaN if invalid"),
    Column(name="flags", field="flags", kind="int64",
           about="(chip) 2 saturated, 16 invalid; 0: good"),
    Column(name="valid", field="valid", kind="bool",
           about="whether the skin has found its equilibrium"),
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """How far a sweep has come."""

    chunks: int
    """That are on disk."""
    chunks_in_all: int
    rows: int
    """That are on disk."""
    rows_in_all: int
    rate: float
    """Rows a second since the start or the resumption; zero before the first chunk."""
    seconds_left: float
    """At this rate; infinite before the first chunk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """A data set on disk; `open_dataset` and `write_dataset` make it."""

    path: Path
    manifest: Manifest
    """What the rows are of."""
    present: tuple[int, ...]
    """Chunks that are on disk."""
    invalid: int
    """Rows among them without an equilibrium."""
    flagged: int
    """Rows among them with a chip that is not good."""

    @property
    def sweep(self) -> Sweep:
        """What was pressed."""
        return self.manifest.sweep

    @property
    def missing(self) -> tuple[int, ...]:
        """Chunks that are not on disk."""
        return tuple(sorted(set(range(self.sweep.chunks)) - set(self.present)))

    @property
    def complete(self) -> bool:
        """Whether every chunk is on disk."""
        return len(self.present) == self.sweep.chunks

    @property
    def columns(self) -> tuple[Column, ...]:
        """What every row holds."""
        return COLUMNS

    def column(self, name: str) -> NDArray[Any]:
        """One column of all rows, in SI units, shape (R, ...).

        Parameters
        ----------
        name : str
            Of a column.

        Raises
        ------
        RecordingError
            If there is no such column, chunks are missing or one is damaged.
        """
        _known(name)
        self._require_all()
        return np.concatenate([self._read(chunk, name) for chunk in self.present])

    def chunks(self) -> Iterator[Rows]:
        """All rows, chunk by chunk, in order.

        Raises
        ------
        RecordingError
            If chunks are missing or one is damaged.
        """
        self._require_all()
        for chunk in self.present:
            yield Rows(**{one.field: self._read(chunk, one.name) for one in COLUMNS})

    def export(self, path: str | os.PathLike[str]) -> None:
        """Write all rows to one HDF5 file.

        Raises
        ------
        RecordingError
            If the file exists or cannot be written, chunks are missing or one is damaged.
        """
        self._require_all()
        target = Path(path)
        if target.exists():
            raise RecordingError(f"{target} exists; choose another name or remove it")
        part = target.with_name(target.name + PART)
        try:
            with _h5py().File(part, "w") as file:
                file.attrs["manifest"] = (self.path / "manifest.json").read_text(encoding="utf-8")
                for column in COLUMNS:
                    begin = 0
                    for chunk in self.present:
                        values = self._read(chunk, column.name)
                        if chunk == 0:
                            shape = (self.sweep.rows, *values.shape[1:])
                            data = _create(file, column, shape, values.dtype)
                        data[begin : begin + len(values)] = values
                        begin += len(values)
            settle(part, target)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise RecordingError(f"{target} cannot be written: {error}") from error

    def _require_all(self) -> None:
        if not self.complete:
            raise RecordingError(
                f"{self.path}: {len(self.missing)} of {self.sweep.chunks} chunks are missing; "
                "repeat the sweep to complete it"
            )

    def _read(self, chunk: int, name: str) -> NDArray[Any]:
        file = _chunk_file(self.path, chunk)
        try:
            with _h5py().File(file, "r") as opened:
                return np.asarray(opened[name][...])
        except (OSError, KeyError) as error:
            raise RecordingError(f"{file} is damaged: {error}") from error


def write_dataset(
    path: str | os.PathLike[str],
    design: SkinDesign,
    sweep: Sweep,
    *,
    engine: Engine | None = None,
    simulation: Callable[[int], Rows] | None = None,
    progress: Callable[[State], None] | None = None,
    deadline: float = 600.0,
    clock: Callable[[], float] = time.monotonic,
) -> Dataset:
    """Compute a sweep, or what is missing of it, and keep it on disk.

    However often it is killed and repeated, on however many workers: the files are the same.

    Parameters
    ----------
    path : str or path-like
        A folder: new, empty, or with the same sweep begun.
    design : SkinDesign
    sweep : Sweep
    engine : Engine, optional
        Where to compute; by default one process a core of this machine.
    simulation : callable, optional
        Computes the rows of a chunk; by default ``Simulation(design, sweep)``.
    progress : callable, optional
        Called when a chunk is on disk, and once at the start.
    deadline : float, optional
        s that one chunk may take.
    clock : callable, optional
        A monotonic clock in s.

    Returns
    -------
    Dataset
        Complete.

    Raises
    ------
    ArgumentError
        If the skin cannot be pressed so; before anything is written or computed.
    RecordingError
        If the folder holds something else, another process writes to it, or it cannot be written.
    EngineError
        If the workers fail; what is on disk stays.
    MissingExtraError
        If h5py is not installed.
    """
    _h5py()
    compute = Simulation(design, sweep) if simulation is None else simulation
    workers = LocalEngine() if engine is None else engine
    folder = Path(path)
    with locked(folder):
        manifest = claim(folder, manifest_of(design, sweep))
        missing = open_dataset(folder).missing
        begun, rows_before = clock(), sweep.rows - sum(sweep.rows_in(one) for one in missing)
        rows, left = rows_before, len(missing)

        def report() -> None:
            taken = clock() - begun
            rate = (rows - rows_before) / taken if rows > rows_before and taken > 0 else 0.0
            if progress is not None:
                progress(
                    State(
                        chunks=sweep.chunks - left,
                        chunks_in_all=sweep.chunks,
                        rows=rows,
                        rows_in_all=sweep.rows,
                        rate=rate,
                        seconds_left=(sweep.rows - rows) / rate if rate else math.inf,
                    )
                )

        report()
        work = _Packer(compute, manifest.identity)
        for chunk, image in workers.run(work, missing, deadline=deadline):
            write_whole(_chunk_file(folder, chunk), image)
            rows, left = rows + sweep.rows_in(chunk), left - 1
            report()
        if missing:
            seconds = clock() - begun
            add_run(folder, Run(engine=workers.name, chunks=len(missing), seconds=seconds))
        return open_dataset(folder)


def open_dataset(path: str | os.PathLike[str]) -> Dataset:
    """A data set on disk, complete or not.

    Parameters
    ----------
    path : str or path-like
        The folder that `write_dataset` wrote.

    Returns
    -------
    Dataset
        Columns are read when they are asked for. Chunk files that cannot be read at all count as
        missing.

    Raises
    ------
    RecordingError
        If there is no data set, or it holds chunks of another one.
    MissingExtraError
        If h5py is not installed.
    """
    _h5py()
    folder = Path(path)
    manifest = read_manifest(folder)
    sweep = manifest.sweep
    present, invalid, flagged = [], 0, 0
    for chunk in range(sweep.chunks):
        file = _chunk_file(folder, chunk)
        stamp = _stamp(file)
        if stamp is None:
            continue
        if stamp != replace(
            stamp, identity=manifest.identity, chunk=chunk, rows=sweep.rows_in(chunk)
        ):
            raise RecordingError(f"{file} belongs to another data set; remove it")
        present.append(chunk)
        invalid += int(stamp.invalid)
        flagged += int(stamp.flagged)
    return Dataset(
        path=folder, manifest=manifest, present=tuple(present), invalid=invalid, flagged=flagged
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stamp:
    """What a chunk file says of itself."""

    identity: str
    chunk: int
    rows: int
    invalid: int
    flagged: int


@dataclass(frozen=True, slots=True)
class _Packer:
    """On a worker: computes a chunk and packs it into the bytes of its file."""

    simulation: Callable[[int], Rows]
    identity: str

    def __call__(self, chunk: int) -> bytes:
        rows = self.simulation(chunk)
        image = io.BytesIO()
        with _h5py().File(image, "w") as file:
            stamp = _Stamp(
                identity=self.identity,
                chunk=chunk,
                rows=len(rows),
                invalid=int((~rows.valid).sum()),
                flagged=int(rows.flags.any(axis=1).sum()),
            )
            file.attrs.update(asdict(stamp))
            for column in COLUMNS:
                values = np.asarray(getattr(rows, column.field), dtype=column.kind)
                _create(file, column, values.shape, values.dtype)[...] = values
        return image.getvalue()


def _create(file: Any, column: Column, shape: tuple[int, ...], kind: np.dtype[Any]) -> Any:
    """A column in an HDF5 file: compressed, with a checksum that finds damage."""
    data = file.create_dataset(
        column.name,
        shape=shape,
        dtype=kind,
        chunks=(min(shape[0], _ROWS_AT_ONCE), *shape[1:]),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
        fletcher32=True,
    )
    data.attrs["about"] = column.about
    return data


def _stamp(file: Path) -> _Stamp | None:
    """Of a chunk file; None if it is not there or cannot be read."""
    if not file.exists():
        return None
    try:
        with _h5py().File(file, "r") as opened:
            return _Stamp(**opened.attrs)
    except (OSError, TypeError):
        return None


def _chunk_file(folder: Path, chunk: int) -> Path:
    return folder / f"chunk-{chunk:06d}.h5"


def _known(name: str) -> None:
    if name not in {one.name for one in COLUMNS}:
        known = ", ".join(one.name for one in COLUMNS)
        raise RecordingError(f"column must be one of {known}; got {name!r}")


def _h5py() -> Any:  # untyped
    """The library, which is there only where it is asked for."""
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError("data sets", "data") from error
    return h5py
