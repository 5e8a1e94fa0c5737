"""Boards on pseudo-terminals, for whatever reads serial ports."""

import os
import select
import threading
import tty
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from smoskin.hardware.board import VirtualBoard
from smoskin.records import Reading
from smoskin.roles import Source


class Line:
    """A pseudo-terminal whose far end is written by hand."""

    def __init__(self, name: str | None = None) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.link = name
        self.port = os.ttyname(self.slave)
        if name is not None:
            os.symlink(self.port, name)
            self.port = name
        self._open = True

    def send(self, data: bytes) -> None:
        os.write(self.master, data)

    def deliver(self, data: bytes) -> None:
        """Send all of it, as soon as there is room: a busy reader loses nothing."""
        while data:
            _, free, _ = select.select([], [self.master], [], 10.0)
            assert free, "nobody reads"
            data = data[os.write(self.master, data) :]

    def received(self) -> bytes:
        try:
            return os.read(self.master, 4096)
        except BlockingIOError:
            return b""

    def hang_up(self) -> None:
        """Vanish, as a board does that is unplugged."""
        if self._open:
            self._open = False
            if self.link is not None:
                os.unlink(self.link)
            os.close(self.master)
            os.close(self.slave)

    def __enter__(self) -> "Line":
        return self

    def __exit__(self, *_: object) -> None:
        self.hang_up()


class Readings(Source):
    """Readings that are given, with a design, as fast as they are asked for."""

    def __init__(self, design, readings: Iterable[Reading]) -> None:
        self._design, self._readings = design, iter(readings)

    @property
    def chips(self) -> int:
        return len(self._design.halls)

    @property
    def design(self):
        return self._design

    def read(self, timeout: float = 1.0) -> Reading | None:
        return next(self._readings, None)

    def close(self) -> None:
        self._readings = iter(())


class BoardAndReader(Source):
    """A virtual board and whoever reads it; it begins to send when it is first read."""

    def __init__(self, board: VirtualBoard, reader: Callable[[str], Source]) -> None:
        self.board = board
        self.reader = reader(board.port)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._begun = False

    @property
    def chips(self) -> int:
        return self.reader.chips

    @property
    def design_hash(self) -> str | None:
        return self.reader.design_hash

    @property
    def design(self):
        return self.reader.design

    def read(self, timeout: float = 1.0) -> Reading | None:
        if not self._begun:
            self._begun = True
            self._thread.start()
        return self.reader.read(timeout)

    def close(self) -> None:
        self.reader.close()
        self.board.close()
        if self._begun:
            self._thread.join(35.0)

    def _run(self) -> None:
        while self.board.step():
            pass


@contextmanager
def sending(source: Source, format: str = "smoskin") -> Iterator[str]:
    """The port of a virtual board that sends a source's readings."""
    board = VirtualBoard(source, format=format)
    thread = threading.Thread(target=lambda: [None for _ in iter(board.step, False)], daemon=True)
    thread.start()
    try:
        yield board.port
    finally:
        board.close()
        thread.join(5.0)
