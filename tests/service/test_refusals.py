"""What is refused of recordings before anything is lost: records, headers, files that fail."""

import errno
import struct
from pathlib import Path

import numpy as np
import pytest

from smoskin.errors import RecordingError
from smoskin.records import Reading
from smoskin.service import recorder as recorders
from smoskin.service.exchange import import_readings
from smoskin.service.mcap import messages
from smoskin.service.ros import Codec
from touch_recordings import CHIPS, DESIGN, recorder

RECORD = struct.Struct("<BQ")
MESSAGE = struct.pack("<HIQQ", 3, 0, 0, 0) + b"whole"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (RECORD.pack(5, 30)[:-1], "a chunk ends within a record"),
        (RECORD.pack(5, len(MESSAGE) + 1) + MESSAGE, "a chunk ends within a record"),
        (RECORD.pack(0, len(MESSAGE)) + MESSAGE, "a chunk holds something else than records"),
        (RECORD.pack(4, 3) + b"abc", "a channel cannot be read"),
    ],
)
def test_chunks_that_hold_no_records_are_refused(data: bytes, message: str) -> None:
    sound = RECORD.pack(5, len(MESSAGE)) + MESSAGE
    assert list(messages(sound, {3: "/skin/reading"})) == [("/skin/reading", b"whole")]
    assert list(messages(sound, {4: "/skin/reading"})) == []
    with pytest.raises(RecordingError, match=message):
        list(messages(sound + data, {3: "/skin/reading"}))


def test_a_message_shorter_than_its_head_is_passed_over() -> None:
    short = RECORD.pack(5, 21) + MESSAGE[:21]
    assert list(messages(short, {3: "/skin/reading"})) == []
    empty = RECORD.pack(5, 22) + MESSAGE[:22]
    assert list(messages(empty, {3: "/skin/reading"})) == [("/skin/reading", b"")]


def test_a_readings_number_and_time_stand_at_its_head() -> None:
    codec = Codec()
    reading = Reading(time=12.25, field=np.zeros((CHIPS, 3)))
    payload = codec.encode_reading(reading, 7, 5_000_000_000)
    assert codec.sequence_and_time(payload) == (7, 12.25)
    with pytest.raises(RecordingError, match="a reading cannot be decoded"):
        codec.sequence_and_time(payload[:27])


@pytest.mark.parametrize("gone", [False, True])
def test_a_recording_that_cannot_begin_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gone: bool
) -> None:
    path = tmp_path / "new.mcap"
    files = []

    def full(self: recorders.Recorder, attachments: object) -> None:
        files.append(self._file)
        assert path.exists()
        if gone:
            path.unlink()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(recorders.Recorder, "_begin", full)
    with pytest.raises(RecordingError, match=r"new\.mcap cannot be written: No space left"):
        recorder(path)
    assert not path.exists()
    assert files[0].raw.closed


def test_a_table_whose_recording_fails_is_not_said_to_be_converted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [f"chip{chip}_{axis}_T" for chip in range(CHIPS) for axis in "xyz"]
    rows = [",".join(["time_s", *names]), *(f"{k}" + ",0" * len(names) for k in range(3))]
    (tmp_path / "mine.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")

    def full(self: recorders.Recorder) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(recorders.Recorder, "_append", lambda self, *_: full(self))
    with pytest.raises(RecordingError, match="No space left on device; nothing more is recorded"):
        import_readings(tmp_path / "mine.csv", DESIGN, tmp_path / "mine.mcap")
    assert not (tmp_path / "mine.mcap").exists()
