"""Files that are written whole or not at all, and read within bounds.

Decides what may be written (a new file, or one that the user gives up, in a folder that is there)
and read (regular files of a bounded size), and how damage of a file is noticed. Hides temporary
names, the disk's cache, and kinds of files that would hang or fill the memory.
"""

import hashlib
import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from smoskin.errors import ArgumentError, FileError, SmoskinError

PART: Final = ".part"
"""Ending of the name of a file that is not yet whole."""
TEXT_LIMIT: Final = 16 * 2**20
"""Largest text that is read, bytes."""
_NAME_LIMIT: Final = 255 - len(PART)
"""Longest name of a file, bytes."""
_SEAL: Final = "# sha256: "
"""Beginning of the last line of a text that carries its checksum."""

Given = str | os.PathLike[str]


def check_output(path: Given, *, force: bool = False, folder: bool = False) -> Path:
    """The path of a file that can be written, or of a folder, which is made; before work begins.

    Raises
    ------
    FileError
        If it cannot be written, is of another kind, or is a file that exists; `force` lets such a
        file be replaced.
    """
    target = Path(path)
    try:
        if len(os.fsencode(target.name)) > _NAME_LIMIT:
            start = target.name[:40]
            raise FileError(f"{start}... must be a name of at most {_NAME_LIMIT} bytes")
        if folder:
            target.mkdir(parents=True, exist_ok=True)
        elif _exists(target):
            if (kind := _kind(target.stat().st_mode)) != "a file":
                raise FileError(f"{target} must be a file to write; got {kind}")
            if not force:
                raise FileError(f"{target} exists; choose another name or --force (force=True)")
        home = target if folder else Path(os.path.realpath(target)).parent
        if (kind := _kind(home.stat().st_mode)) != "a folder":
            raise FileError(f"{home} must be a folder to write in; got {kind}")
        if not os.access(home, os.W_OK | os.X_OK):
            raise FileError(f"{home} must be a folder that can be written")
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise FileError(f"{target} cannot be written: {_reason(error)}") from error
    return target


def write_output(path: Given, content: bytes | Callable[[Path], object]) -> None:
    """Write a file that is whole or not there, whenever this process or the machine stops.

    The content is bytes, or a function that writes them to a file of another name. What stood
    there before is replaced once the new file is on the disk; `FileError` tells why it could not.
    """
    target = Path(os.path.realpath(path))
    part = target.with_name(target.name + PART)
    check_output(target, force=True)
    try:
        part.unlink(missing_ok=True)
        with open(part, "xb") as file:  # its mode is the user's, whoever fills it
            if isinstance(content, bytes):
                file.write(content)
        if not isinstance(content, bytes):
            content(part)
        _sync(part)
        os.replace(part, target)
        _sync(target.parent)
    except BaseException as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        if isinstance(error, OSError) and not isinstance(error, FileError):
            raise FileError(f"{path} cannot be written: {_reason(error)}") from error
        raise


def path_text(path: object) -> str:
    """A path as text; an `ArgumentError` for what is none."""
    if not isinstance(path, str | os.PathLike) or not isinstance(given := os.fspath(path), str):
        raise ArgumentError(f"path must be text or path-like; got {path!r:.200}")
    return given


def read_input(path: Given, limit: int, error: type[SmoskinError] = FileError) -> bytes:
    """The content of a regular file of at most so many bytes; the `error` for anything else."""
    path_text(path)
    try:
        facts, content = os.stat(path), b""
        kind = _kind(facts.st_mode)
        if kind == "a file" and facts.st_size <= limit:
            with open(path, "rb") as file:
                content = file.read(limit + 1)
    except (OSError, ValueError) as cause:
        raise error(f"{path} cannot be read: {_reason(cause)}") from cause
    if kind != "a file":
        raise error(f"{path} must be a file; got {kind}")
    if (size := max(facts.st_size, len(content))) > limit:
        raise error(f"{path} must hold at most {limit:,} bytes; got {size:,}")
    return content


def read_text(path: Given, limit: int = TEXT_LIMIT, error: type[SmoskinError] = FileError) -> str:
    """The text of a regular file in UTF-8; the `error` where it is none."""
    try:
        return read_input(path, limit, error).decode("utf-8-sig")
    except UnicodeDecodeError as cause:
        got = f"byte {cause.object[cause.start]:#04x} at {cause.start}"
        raise error(f"{path} must be text in UTF-8; got {got}") from cause


def sealed(text: str) -> str:
    """A text with its checksum as a comment in the last line, for `is_damaged`."""
    body = text.rstrip("\n")
    return f"{body}\n{_SEAL}{_digest(body)}\n"


def is_damaged(text: str) -> bool:
    """Whether a text has a checksum, as of `sealed`, that does not fit."""
    body, _, last = text.replace("\r\n", "\n").rstrip("\n").rpartition("\n")
    return last.startswith(_SEAL) and last != _SEAL + _digest(body)


def _digest(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def _exists(path: Path) -> bool:
    """Whether anything stands there, a link to nothing aside."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    return True


def _kind(mode: int) -> str:
    """Kind of a file, with its article."""
    kinds = {stat.S_IFREG: "a file", stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe"}
    return kinds.get(stat.S_IFMT(mode), "a device or socket")


def _reason(error: Exception) -> str:
    """Reason for an error of the system, in its words."""
    return str(getattr(error, "strerror", None) or error)


def _sync(path: Path) -> None:
    """Have what was written on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
