"""The recording of a live source, in a process of its own: writing takes no time from the loop.

Decides how many readings may wait for the disk, and that what ends the other process ends the
recording, but not the loop.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, final

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, RecordingError, SmoskinError, require
from smoskin.records import Estimate, Reading
from smoskin.roles import Sink
from smoskin.service.apart.process import Remote
from smoskin.service.recorder import Recorder

_EVERY: Final = 0.02
"""s for which readings are gathered: together they are handed over at half the cost."""
_ROOM: Final = 4096
"""Readings that may wait."""


@final
class RecorderApart(Sink):
    """A `Recorder` in a process of its own: a sink that never waits.

    Readings are written in their order; those that find no room, because the disk stands still, are
    passed over and counted. If this process is killed, what it has handed over is still written.

    Parameters
    ----------
    path, design, attachments
        As `Recorder` takes them; it raises the same errors.
    on_failure : callable
        Called once, by a thread, with a sentence when nothing more can be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        design: SkinDesign,
        *,
        attachments: Mapping[str, bytes],
        on_failure: Callable[[str], object],
    ) -> None:
        require("recording and replaying", "recording", "mcap")
        self._path, self._chips = Path(path).absolute(), len(design.halls)
        self._on_failure = on_failure
        self.failure = ""
        """Reason why nothing more is written; empty while it is."""
        self._taken = self._kept = 0
        self._passed, self._closed = 0, False
        self._remote = Remote(
            Written,
            *(self._path, design, dict(attachments)),
            every=_EVERY,
            on_kept=self._keep,
            on_failure=self._fail,
        )

    @property
    def dropped(self) -> int:
        """How many readings found no room, or are not in the file because of a failure."""
        return self._passed + (self._taken - self._kept if self.failure else 0)

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Let a reading and what was made of it be written; raises as `Recorder.write`."""
        if self._closed:
            raise RecordingError("the recorder is closed")
        if len(reading.field) != self._chips:
            raise ArgumentError(f"reading must have {self._chips} chips; got {len(reading.field)}")
        if self._remote.waiting >= _ROOM and not self.failure:
            self._passed += 1
            return
        self._taken += 1
        self._add("write", reading, estimate)

    def write_arm(self, moment: float, angles: Floats, speeds: Floats, state: str) -> None:
        """Let be written how an arm stands, as `Recorder.write_arm`; not where there is no room."""
        if self._closed:
            raise RecordingError("the recorder is closed")
        if self._remote.waiting < _ROOM:
            self._add("write_arm", moment, angles, speeds, state)

    def _add(self, method: str, *given: object) -> None:
        """Have something written, unless nothing can be any more."""
        if not self.failure:
            try:
                self._remote.add(method, *given)
            except SmoskinError as error:
                self._fail(f"{self._path} cannot be written: {error}; nothing more is recorded")

    def close(self) -> None:
        """Write what waits, and end the file; any number of times."""
        self._closed = True
        try:
            self._remote.close()
        except SmoskinError as error:
            self._fail(f"{self._path} was not ended: {error}")

    def _keep(self, count: int) -> None:
        self._kept = count

    def _fail(self, sentence: str) -> None:
        if not self.failure:
            self.failure = sentence
            self._on_failure(sentence)


@final
class Written:
    """A recorder that tells how many readings are safe, and what ended it.

    Parameters
    ----------
    path, design, attachments
        As `Recorder` takes them.
    on_kept, on_failure : callable
        Called with the number of readings on the disk, when it has changed, and with a sentence.
    """

    def __init__(
        self,
        path: Path,
        design: SkinDesign,
        attachments: Mapping[str, bytes],
        *,
        on_kept: Callable[[int], object],
        on_failure: Callable[[str], object],
    ) -> None:
        self._recorder = Recorder(path, design, attachments=attachments, on_failure=on_failure)
        self._on_kept, self._reported = on_kept, 0

    def write(self, reading: Reading, estimate: Estimate | None) -> None:
        """Append a reading and what was made of it."""
        self._recorder.write(reading, estimate)
        self._tell()

    def write_arm(self, moment: float, angles: Floats, speeds: Floats, state: str) -> None:
        """Append how an arm stands."""
        self._recorder.write_arm(moment, angles, speeds, state)

    def close(self) -> None:
        """Write what is left and end the file."""
        self._recorder.close()
        self._tell()

    def _tell(self) -> None:
        if self._recorder.kept != self._reported:
            self._reported = self._recorder.kept
            self._on_kept(self._reported)
