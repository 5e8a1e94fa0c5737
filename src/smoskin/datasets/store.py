"""Data sets: a sweep's rows on disk, chunk by chunk, that a kill cannot damage; and their reader.

Decides the layout: a folder with a manifest (what the rows are of), one compressed HDF5 file a
chunk, each under a temporary name until it is whole, and the files' SHA-256. Resuming computes
what is missing or no longer as it was written; another design, sweep or version of this package
is refused. Hides names, columns, locks and renaming.
"""

import hashlib
import io
import itertools
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from smoskin.arrays import Ints
from smoskin.datasets import manifest as manifests
from smoskin.datasets.manifest import Manifest, Run
from smoskin.datasets.patterns import Sweep
from smoskin.datasets.simulation import COLUMNS, Column, Rows, Simulation
from smoskin.datasets.workers import Engine
from smoskin.design.skin import SkinDesign
from smoskin.errors import MissingExtraError, RecordingError
from smoskin.outputs import check_output, path_text, write_output
from smoskin.roles import Progress, unheard

_ROWS_AT_ONCE: Final = 4096
"""Rows that HDF5 compresses together."""
_SUMS: Final = "checksums.sha256"
"""File of the chunks' SHA-256, as ``sha256sum --check`` reads it; of two lines the last counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """A data set on disk; `open_dataset` and `write_dataset` make it.

    Reading raises `RecordingError` where a chunk is damaged, or missing though all are asked for.
    """

    path: Path
    """The folder."""
    manifest: Manifest
    """What the rows are of."""
    present: tuple[int, ...]
    """Chunks on disk."""

    @property
    def design(self) -> SkinDesign:
        """The skin that was pressed, as designed."""
        return self.manifest.design

    @property
    def sweep(self) -> Sweep:
        """What was pressed."""
        return self.manifest.sweep

    @property
    def missing(self) -> tuple[int, ...]:
        """Chunks that are not on disk."""
        return tuple(sorted(set(range(self.sweep.chunks)) - set(self.present)))

    @property
    def missing_rows(self) -> Ints:
        """Numbers of the rows that are not on disk, rising."""
        return np.array([row for chunk in self.missing for row in self.sweep.rows_of(chunk)], int)

    @property
    def complete(self) -> bool:
        """Whether every chunk is on disk."""
        return len(self.present) == self.sweep.chunks

    @property
    def invalid(self) -> int:
        """Number of rows on disk without an equilibrium."""
        return sum(int((~self._read(chunk, "valid")).sum()) for chunk in self.present)

    @property
    def flagged(self) -> int:
        """Number of rows on disk with a chip that is not good."""
        return sum(int(self._read(chunk, "flags").any(axis=-1).sum()) for chunk in self.present)

    def column(self, name: str, *, partial: bool = False) -> NDArray[Any]:
        """One column of all rows, in SI units, shape (R, ...).

        With `partial` rows may be missing; those of `missing_rows` are then left out.
        """
        names = [column.name for column in COLUMNS.values()]
        if name not in names:
            raise RecordingError(f"column must be one of {', '.join(names)}; got {name!r}")
        if not partial:
            self._require_all()
        if not self.present:
            raise RecordingError(f"{self.path} holds no rows yet; repeat the sweep to fill it")
        return np.concatenate([self._read(chunk, name) for chunk in self.present])

    def chunks(self) -> Iterator[Rows]:
        """All rows, chunk by chunk, in order."""
        self._require_all()
        for chunk in self.present:
            yield Rows(
                **{field: self._read(chunk, column.name) for field, column in COLUMNS.items()}
            )

    def damaged(self) -> tuple[int, ...]:
        """Chunks on disk whose files are no longer as they were written; reads them all."""
        sums, damaged = _read_sums(self.path), []
        for chunk in self.present:
            file = _chunk_file(self.path, chunk)
            try:
                now = hashlib.sha256(file.read_bytes()).hexdigest()
            except OSError as error:
                raise RecordingError(f"{self.path} cannot be read: {error}") from error
            if now != sums.get(file.name):
                damaged.append(chunk)
        return tuple(damaged)

    def export(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write all rows to one HDF5 file; raises `FileError` where it cannot be, or exists."""
        self._require_all()
        write_output(check_output(path, force=force), self._fill)

    def _fill(self, path: Path) -> None:
        """Write all rows to this HDF5 file."""
        with _h5py().File(path, "w") as file:
            file.attrs["manifest"] = (self.path / manifests.FILE).read_text(encoding="utf-8")
            for chunk, column in itertools.product(self.present, COLUMNS.values()):
                values, rows = self._read(chunk, column.name), self.sweep.rows_of(chunk)
                if chunk == 0:
                    _create(file, column, (self.sweep.rows, *values.shape[1:]))
                file[column.name][rows.start : rows.stop] = values

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
                values = np.asarray(opened[name][...])
        except (OSError, KeyError) as error:
            raise RecordingError(f"{file} is damaged: {error}") from error
        if len(values) != len(self.sweep.rows_of(chunk)):
            raise RecordingError(f"{file} is damaged: {name} has {len(values)} rows")
        return values


def open_dataset(path: str | os.PathLike[str]) -> Dataset:
    """The data set in a folder, complete or not; columns are read when they are asked for.

    Raises
    ------
    RecordingError
        If there is no data set.
    MissingExtraError
        If h5py is not installed.
    """
    folder = Path(path_text(path))
    _h5py()
    manifest = manifests.read_manifest(folder)
    present = [c for c in range(manifest.sweep.chunks) if _chunk_file(folder, c).exists()]
    return Dataset(path=folder, manifest=manifest, present=tuple(present))


def write_dataset(
    path: str | os.PathLike[str],
    design: SkinDesign,
    sweep: Sweep,
    *,
    engine: Engine | None = None,
    simulation: Callable[[int], Rows] | None = None,
    progress: Progress = unheard,
) -> Dataset:
    """Compute a sweep, or what is missing of it or damaged, and keep it on disk.

    However often it is killed and repeated, on however many workers: the columns are the same.

    Parameters
    ----------
    path : path
        A folder: new, empty, or with the same sweep begun.
    engine : Engine, optional
        Where to compute; by default one process a core of this machine.
    simulation : callable, optional
        Computes the rows of a chunk; by default ``Simulation(design, sweep)``.
    progress : callable, optional
        Called at the start and whenever a chunk is on disk.

    Raises
    ------
    ArgumentError
        If the skin cannot be pressed so; before anything is written or computed.
    RecordingError
        If the folder holds something else, or another process writes to it.
    FileError
        If it cannot be written.
    EngineError
        If the workers fail; what is on disk stays.
    MissingExtraError
        If h5py or loky is not installed.
    """
    _h5py()
    compute = Simulation(design, sweep) if simulation is None else simulation
    workers = Engine() if engine is None else engine
    folder = Path(path)
    with manifests.locked(folder):
        manifest = manifests.claim(folder, Manifest(design=design, sweep=sweep))
        damaged = _remove_damaged(folder)
        missing = open_dataset(folder).missing
        begun, computed = time.monotonic(), 0
        rows = sweep.rows - sum(len(sweep.rows_of(chunk)) for chunk in missing)
        progress(f"{rows}/{sweep.rows} rows", rows / sweep.rows)
        for chunk, image in workers.run(_Packer(compute), missing):
            _write_chunk(_chunk_file(folder, chunk), image)
            computed += len(sweep.rows_of(chunk))
            there, rate = rows + computed, computed / (time.monotonic() - begun)
            progress(f"{there}/{sweep.rows} rows, {rate:.0f}/s", there / sweep.rows)
        if missing:
            seconds = time.monotonic() - begun
            run = Run(engine=workers.name, chunks=len(missing), damaged=damaged, seconds=seconds)
            manifests.save_manifest(folder, replace(manifest, runs=(*manifest.runs, run)))
        return open_dataset(folder)


@dataclass(frozen=True, slots=True)
class _Packer:
    """On a worker: computes a chunk and packs it into the bytes of its file."""

    simulation: Callable[[int], Rows]

    def __call__(self, chunk: int) -> bytes:
        rows = self.simulation(chunk)
        image = io.BytesIO()
        with _h5py().File(image, "w") as file:
            for field, column in COLUMNS.items():
                values = np.asarray(getattr(rows, field))
                _create(file, column, values.shape)[...] = values
        return image.getvalue()


def _create(file: Any, column: Column, shape: tuple[int, ...]) -> Any:
    """A new column of an HDF5 file: compressed, with a checksum that finds damage."""
    data = file.create_dataset(
        column.name,
        shape=shape,
        dtype=column.kind,
        chunks=(min(shape[0], _ROWS_AT_ONCE), *shape[1:]),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
        fletcher32=True,
    )
    data.attrs["about"] = column.about
    return data


def _write_chunk(file: Path, image: bytes) -> None:
    """Write a chunk; its sum first, so that no chunk is ever without."""
    try:
        with open(file.parent / _SUMS, "ab") as sums:
            sums.write(f"{hashlib.sha256(image).hexdigest()}  {file.name}\n".encode())
            sums.flush()
            os.fsync(sums.fileno())
    except OSError as error:
        raise RecordingError(f"{file.parent} cannot be written: {error}") from error
    write_output(file, image)


def _remove_damaged(folder: Path) -> int:
    """Remove chunks that are not as they were written; how many there were."""
    data = open_dataset(folder)
    damaged = data.damaged()
    for chunk in damaged:
        _chunk_file(folder, chunk).unlink()
    # Written anew, as a kill may have cut the last line.
    sound = {_chunk_file(folder, chunk).name for chunk in set(data.present) - set(damaged)}
    lines = [f"{value}  {name}\n" for name, value in _read_sums(folder).items() if name in sound]
    write_output(folder / _SUMS, "".join(lines).encode())
    return len(damaged)


def _read_sums(folder: Path) -> Mapping[str, str]:
    """SHA-256 by the name of the file."""
    try:
        lines = (folder / _SUMS).read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return {}
    return {name: value for value, _, name in (line.partition("  ") for line in lines)}


def _chunk_file(folder: Path, chunk: int) -> Path:
    return folder / f"chunk-{chunk:06d}.h5"


def _h5py() -> Any:  # untyped
    """The library, which is there only where it is asked for."""
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError("data sets", "data") from error
    return h5py
