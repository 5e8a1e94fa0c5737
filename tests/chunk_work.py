"""Work for the tests of engines and data sets: importable by name in worker processes."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from smoskin.datasets.patterns import Sweep
from smoskin.datasets.simulation import Rows
from smoskin.design.skin import SkinDesign


def log(folder: str, item: int) -> None:
    """One line an item begun, appended in one write."""
    with open(Path(folder) / "log", "a") as file:
        file.write(f"{item} {os.getpid()}\n")


def begun(folder) -> list[tuple[int, int]]:
    """Items begun and by whom, in order."""
    file = Path(folder) / "log"
    lines = file.read_text().splitlines() if file.exists() else []
    return [(int(item), int(pid)) for item, pid in (line.split() for line in lines)]


@dataclass(frozen=True)
class Square:
    """Squares its item after a while, noting that it began."""

    folder: str
    seconds: float = 0.0

    def __call__(self, item: int) -> int:
        log(self.folder, item)
        time.sleep(self.seconds)
        return item * item


@dataclass(frozen=True)
class Deadly:
    """Kills its own process at item 2, as often as told; then squares."""

    folder: str
    times: int

    def __call__(self, item: int) -> int:
        log(self.folder, item)
        if item == 2 and sum(number == 2 for number, _ in begun(self.folder)) <= self.times:
            os.kill(os.getpid(), signal.SIGKILL)
        return item * item


def contents(folder) -> dict[str, dict[str, tuple[str, tuple[int, ...], bytes]]]:
    """Every bit of every column by its chunk's name; a compressor may pack the same otherwise."""
    import h5py

    chunks = {}
    for path in sorted(Path(folder).glob("chunk-*")):
        with h5py.File(path) as file:
            chunks[path.name] = {
                name: (str(column.dtype), column.shape, column[...].tobytes())
                for name, column in file.items()
            }
    return chunks


def refuse(item: int) -> int:
    """Raises at item 1."""
    if item == 1:
        raise ValueError("one is too few")
    return item


def environment(item: int) -> dict[str, str]:
    return dict(os.environ)


@dataclass(frozen=True)
class MadeUp:
    """Rows of a sweep without any physics, slowly, noting that a chunk was begun."""

    design: SkinDesign
    sweep: Sweep
    folder: str
    seconds: float = 0.0

    def __call__(self, chunk: int) -> Rows:
        log(self.folder, chunk)
        time.sleep(self.seconds)
        touches, draw = self.sweep.touches(self.design, chunk), self.sweep.noise(chunk)
        rows, magnets, chips = len(touches), len(self.design.magnets), len(self.design.halls)
        valid = draw.random(rows) > 0.1
        seed = self.sweep.skin(chunk)
        return Rows(
            skin=np.full(rows, -1 if seed is None else seed),
            position=touches.position,
            force=touches.force,
            radius=touches.radius,
            temperature=np.full(rows, self.sweep.temperature(chunk)),
            magnet_shift=draw.normal(size=(rows, magnets, 3)),
            magnet_turn=draw.normal(size=(rows, magnets, 3)),
            board_shift=draw.normal(size=(rows, 3)),
            board_turn=draw.normal(size=(rows, 3)),
            field=np.where(valid[:, None, None], draw.normal(size=(rows, chips, 3)), np.nan),
            reading=draw.normal(size=(rows, chips, 3)),
            flags=np.where(valid[:, None], draw.integers(0, 2, (rows, chips)) * 2, 16),
            valid=valid,
        )


@dataclass(frozen=True)
class FailsAt:
    """Another simulation, but for one chunk."""

    simulation: MadeUp
    chunk: int

    def __call__(self, chunk: int) -> Rows:
        if chunk == self.chunk:
            raise RuntimeError("out of luck")
        return self.simulation(chunk)
