"""Recordings of a skin, begun and ended while it is read: of `--record` and the page's button.

Decides their names (the one that was given, then dated ones beside it), that nothing is ever
overwritten unasked, and what is told of each. Hides the threads that write.
"""

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Final, final

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError, SmoskinError, require
from smoskin.outputs import check_output, read_input
from smoskin.records import Estimate, Reading
from smoskin.roles import Sink, Source
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
        say: Callable[[str], object] = lambda sentence: None,
    ) -> None:
        self._design, self._source, self._say = design, source, say
        names = [] if calibration is None else [Path(calibration)]
        self._attachments = {path.name: read_input(path, _ATTACHED) for path in names}
        path = Path(home or ".")
        name = "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in design.name)
        self._folder, self._name = (path, name) if path.is_dir() else (path.parent, path.stem)
        self._waits = isinstance(source, ReplaySource | TwinSource)
        self._lock = threading.Lock()
        self._path: Path | None = None
        self._recorder: Recorder | None = None
        self._aside: Aside | None = None
        self._taken = self._lost = self._lost_before = 0
        self._refusal = ""

    def begin(self, path: Given | None = None, *, force: bool = False) -> None:
        """Record into this new file, by default a dated one; ends the recording before.

        With `force` it may replace another file than the one that is played. It raises a
        `SmoskinError` if the file cannot be written.
        """
        self.end()
        file = self._free() if path is None else self._given(path, force)
        recorder = Recorder(file, self._design, attachments=self._attachments, on_failure=self._say)
        with self._lock:
            self._path, self._recorder, self._taken = file, recorder, 0
            # What is played or simulated can wait for a disk.
            self._aside = Aside(recorder, patience=_PATIENCE if self._waits else 0.0)

    def end(self) -> None:
        """Finish the recording behind the last reading; nothing where none goes on."""
        with self._lock:
            aside, self._aside = self._aside, None
        if aside is not None:
            try:
                aside.close()
            finally:
                self._lost = aside.dropped
                self._lost_before += self._lost

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
        return self._aside is not None and not self.failure

    @property
    def failure(self) -> str:
        """Sentence about why the newest file cannot be written any more; empty while it can."""
        return "" if self._recorder is None else self._recorder.failure

    @property
    def dropped(self) -> int:
        """Readings that could not be recorded while they should have been."""
        aside = self._aside
        return self._lost_before + (0 if aside is None else aside.dropped)

    @property
    def sentence(self) -> str:
        """The newest recording's name and what it lost, for people; empty before the first."""
        if self._refusal or self._path is None:
            return self._refusal
        aside = self._aside
        lost = self._lost if aside is None else aside.dropped
        word = "Recorded" if aside is None else "Recording into"
        told = f"{word} {self._path.name}: {self._taken - lost} readings, {lost} lost."
        return f"{told} {self.failure}." if self.failure else told

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Record a reading and its estimate, if a recording goes on."""
        with self._lock:
            if self._aside is not None:
                self._aside.write(reading, estimate)
                self._taken += 1

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
