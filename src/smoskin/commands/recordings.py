"""Recordings of a skin, begun and ended while it is read: of `--record` and the page's button.

Decides their names (the one that was given, then dated ones beside it), that nothing is ever
overwritten unasked, and what is told of each. Hides who writes: a thread, or for chips a process.
"""

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Final, final

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError, SmoskinError, require
from smoskin.outputs import check_output, read_input
from smoskin.records import Estimate, Reading
from smoskin.roles import Sink, Source
from smoskin.service.apart.recorder import RecorderApart
from smoskin.service.loop import Aside
from smoskin.service.recorder import Recorder
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource

Given = str | os.PathLike[str]

_ATTACHED: Final = 1 << 28
"""Bytes of a calibration that a recording takes along, at most."""
_PATIENCE: Final = 10.0
"""s that a recording of what can wait waits for the disk."""


def can_record() -> bool:
    """Whether the libraries that write recordings are installed."""
    with suppress(MissingExtraError):
        require("recording", "recording", "mcap", "rosbags")
        return True
    return False


@final
class Recordings(Sink):
    """A sink that records while somebody wants it, each time into a new file.

    Parameters
    ----------
    design, source : SkinDesign and Source
        The skin that is read, and where its readings come from: chips are not held up by a disk.
    calibration : path, optional
        File that every recording takes along.
    home : path, optional
        Folder for the recordings, by default the working folder; or the file of the first one,
        beside which further ones stand.
    waits : bool
        Whether what is played or simulated waits for the disk; an arm that follows it must not.
    say : callable
        Called with a sentence when a file cannot be written any more.
    """

    def __init__(
        self,
        design: SkinDesign,
        source: Source,
        calibration: Given | None = None,
        *,
        home: Given | None = None,
        waits: bool = True,
        say: Callable[[str], object] = lambda sentence: None,
    ) -> None:
        self._design, self._source, self._say = design, source, say
        names = [] if calibration is None else [Path(calibration)]
        self._attachments = {path.name: read_input(path, _ATTACHED) for path in names}
        path = Path(home or ".")
        name = "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in design.name)
        self._folder, self._name = (path, name) if path.is_dir() else (path.parent, path.stem)
        self._waits = waits and isinstance(source, ReplaySource | TwinSource)
        self._lock = threading.Lock()
        self._path: Path | None = None
        self._recorder: Recorder | RecorderApart | None = None
        self._sink: Aside | RecorderApart | None = None
        self._taken = self._lost = self._lost_before = 0
        self._refusal = self._failed_before = ""
        self._finished: Path | None = None

    def begin(self, path: Given | None = None, *, force: bool = False) -> None:
        """Record into this new file, by default a dated one; ends the recording before.

        With `force` it may replace another file than the one that is played. It raises a
        `SmoskinError` if the file cannot be written.
        """
        self.end()
        file = self._free() if path is None else self._given(path, force)
        recorder: Recorder | RecorderApart
        sink: Aside | RecorderApart
        kept, say = self._attachments, self._say
        # What is played or simulated can wait for a disk.
        if self._waits:
            recorder = Recorder(file, self._design, attachments=kept, on_failure=say)
            sink = Aside(recorder, patience=_PATIENCE)
        else:
            recorder = sink = RecorderApart(file, self._design, attachments=kept, on_failure=say)
        with self._lock:
            self._path, self._recorder, self._sink, self._taken = file, recorder, sink, 0

    def end(self) -> None:
        """Finish the recording behind the last reading; nothing where none goes on."""
        with self._lock:
            sink, self._sink = self._sink, None
        if sink is not None:
            try:
                sink.close()
            finally:
                self._lost = sink.dropped
                self._lost_before += self._lost
                self._failed_before = self.first_failure
                self._finished = self._path and self._path.absolute()

    def switch(self, on: bool) -> None:
        """Begin or end a recording for somebody on the page; a refusal is told by `sentence`."""
        self._refusal = ""
        try:
            self.begin() if on else self.end()
        except SmoskinError as error:
            self._refusal = f"Not recorded: {error}"
            self._say(self._refusal)

    @property
    def goes_on(self) -> bool:
        """Whether readings are recorded."""
        return self._sink is not None and not self.failure

    @property
    def failure(self) -> str:
        """Sentence about why the newest file cannot be written any more; empty while it can."""
        return "" if self._recorder is None else self._recorder.failure

    @property
    def first_failure(self) -> str:
        """The same about the first of all files that could not: a later one does not mend it."""
        return self._failed_before or self.failure

    @property
    def dropped(self) -> int:
        """Readings that could not be recorded while they should have been."""
        sink = self._sink
        return self._lost_before + (0 if sink is None else sink.dropped)

    @property
    def sentence(self) -> str:
        """The newest recording's name and what it lost, for people; empty before the first."""
        if self._refusal or self._path is None:
            return self._refusal
        sink = self._sink
        lost = self._lost if sink is None else sink.dropped
        word = "Recorded" if sink is None else "Recording into"
        account = f"{word} {self._path.name}: {self._taken - lost} readings, {lost} lost."
        return f"{account} {self.failure}." if self.failure else account

    @property
    def state(self) -> tuple[bool, str, Path | None]:
        """What a page is told: whether a recording goes on, the sentence, the newest ended file."""
        return self.goes_on, self.sentence, self._finished

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Record a reading and its estimate, if a recording goes on."""
        with self._lock:
            if self._sink is not None:
                self._sink.write(reading, estimate)
                self._taken += 1

    def write_arm(self, moment: float, angles: Floats, speeds: Floats, state: str) -> None:
        """Record how an arm stands, as `Recorder.write_arm`, where a disk is never waited for."""
        with self._lock:
            if isinstance(self._sink, RecorderApart):
                self._sink.write_arm(moment, angles, speeds, state)

    def close(self) -> None:
        """End the recording that goes on."""
        self.end()

    def _given(self, path: Given, force: bool) -> Path:
        """A file of a name that was given; what it replaces is gone."""
        file, played = check_output(path, force=force), self._source
        if not file.exists():
            return file
        if isinstance(played, ReplaySource) and file.samefile(played.recording.path):
            raise ArgumentError(
                f"record must be another file than the one that is played; got {file}"
            )
        file.unlink()
        return file

    def _free(self) -> Path:
        """A dated name that no file has."""
        start = f"{self._name}-{datetime.now():%Y%m%d-%H%M%S}"
        names = (f"{start}{f'-{k}' * (k > 1)}.mcap" for k in count(1))
        return next(path for name in names if not (path := self._folder / name).exists())
