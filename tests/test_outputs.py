"""Files are written whole or not at all, and read within bounds; what cannot be is said at once."""

import os
import resource
import stat

import pytest

from smoskin import errors
from smoskin.errors import FileError, MissingExtraError, SmoskinError, require
from smoskin.outputs import (
    check_output,
    is_damaged,
    read_input,
    read_text,
    sealed,
    write_output,
)


def test_a_file_is_written_with_the_mode_of_the_user_and_nothing_else(tmp_path):
    before = os.umask(0o027)
    try:
        write_output(tmp_path / "a.txt", b"new")
        write_output(tmp_path / "b.svg", lambda part: part.write_text("fig"))
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").read_bytes() == b"new"
    assert (tmp_path / "b.svg").read_text() == "fig"
    assert {stat.S_IMODE(file.stat().st_mode) for file in tmp_path.iterdir()} == {0o640}
    assert {file.name for file in tmp_path.iterdir()} == {"a.txt", "b.svg"}


@pytest.mark.parametrize("stop", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_fails_leaves_what_was_there(tmp_path, stop):
    file = tmp_path / "a.txt"
    write_output(file, b"old")

    def fail(part):
        part.write_bytes(b"ha")
        raise stop

    with pytest.raises((FileError, KeyboardInterrupt), match=r"No space left|^$"):
        write_output(file, fail)
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert file.read_bytes() == b"old"


def test_a_full_disk_is_told_and_leaves_nothing(tmp_path):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(FileError, match=r"a\.csv cannot be written: File too large"):
            write_output(tmp_path / "a.csv", bytes(10_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list(tmp_path.iterdir())


def test_links_are_followed_and_stay(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "far" / "file")
    write_output(check_output(tmp_path / "link"), b"x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "far" / "file").read_bytes() == b"x"


def test_what_cannot_be_written_is_refused_before_work(tmp_path):
    (tmp_path / "old").write_text("mine")
    os.mkfifo(tmp_path / "pipe")
    for name, sentence in {
        "old": "old exists; choose another name or --force",
        "no/such/file": "No such file",
        "old/below": "Not a directory",
        "": "must be a file to write; got a folder",
        "pipe": "must be a file to write; got a pipe",
        "/dev/full": "must be a file to write; got a device",
        "x" * 300: "must be a name of at most 250 bytes",
        "/proc/new": "cannot be written|must be a folder that can be written",
    }.items():
        with pytest.raises(FileError, match=sentence):
            write_output(check_output(tmp_path / name), b"x")
    assert check_output(tmp_path / "old", force=True) == tmp_path / "old"
    with pytest.raises(FileError, match="File exists"):
        check_output(tmp_path / "old", folder=True)
    assert check_output(tmp_path / "a" / "b", folder=True).is_dir()
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_only_regular_files_of_a_bounded_size_are_read(tmp_path):
    (tmp_path / "file").write_bytes(b"12345")
    os.mkfifo(tmp_path / "pipe")
    assert read_input(tmp_path / "file", 5) == b"12345"
    for path, sentence in {
        "file": "must hold at most 4 bytes; got 5",
        "pipe": "must be a file; got a pipe",
        "": "must be a file; got a folder",
        "/dev/zero": "must be a file; got a device",
        "none": "none cannot be read: No such file",
        "x" * 300: "cannot be read: File name too long",
        "a\0b": r"a\\x00b cannot be read",
    }.items():
        with pytest.raises(errors.ModelError, match=sentence):
            read_input(tmp_path / path, 4, errors.ModelError)
    (tmp_path / "file").write_bytes(b"a\xff")
    with pytest.raises(FileError, match="must be text in UTF-8; got byte 0xff at 1"):
        read_text(tmp_path / "file")


def test_a_changed_text_does_not_fit_its_checksum():
    text = sealed("a = 1\n# sha256: mine\n")
    assert text.startswith("a = 1\n# sha256: mine\n# sha256: ")
    assert not is_damaged(text)
    assert not is_damaged(text.replace("\n", "\r\n"))
    assert is_damaged(text.replace("1", "2", 1))
    assert not is_damaged("a = 1\n")
    assert not is_damaged("")


def test_messages_are_one_short_line():
    assert str(SmoskinError("plain, naïve µT")) == "plain, naïve µT"
    assert str(SmoskinError("a\x1b[31m\nb\udcff")) == r"a\x1b[31m\nb\udcff"
    long = str(FileError("must be short; got " + "x" * 5000 + " and no more"))
    assert len(long) == 300
    assert long.startswith("must be short; got x")
    assert long.endswith("x and no more")
    assert len(str(FileError("\0" * 5000))) == 300


def test_a_missing_extra_is_told_with_what_pip_takes(monkeypatch):
    require("reading", "learned", "json")
    with pytest.raises(MissingExtraError, match=r"reading needs the extra 'learned': pip install "):
        require("reading", "learned", "json", "no_such_module")

    class Origin:
        url: str | None = None

        def read_text(self, name):
            return self.url

    monkeypatch.setattr("importlib.metadata.distribution", lambda name: Origin)
    monkeypatch.setattr(Origin, "read_text", lambda name: Origin.url)
    for url, advice in {
        None: "'smoskin[cli]'",
        '{"url": "file:///a%20b/c", "dir_info": {"editable": true}}': "-e '/a b/c[cli]'",
        '{"url": "file:///c", "dir_info": {}}': "'/c[cli]'",
        '{"url": "file:///s.whl", "archive_info": {}}': "'/s.whl[cli]'",
        '{"url": "https://x.y/s.whl", "archive_info": {}}': "'smoskin[cli]'",
    }.items():
        Origin.url = url
        assert str(MissingExtraError("it", "cli")).endswith(f": pip install {advice}")
