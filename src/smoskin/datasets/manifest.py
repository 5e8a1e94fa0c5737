"""What a data set is of, written before its first row; and files that a kill cannot damage.

Decides what must be the same for two runs to fill one folder: design, sweep and version of this
package. Hides the manifest's JSON, the lock that keeps a second writer out, and the writing under
a temporary name.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from smoskin.datasets.patterns import Sweep, format_sweep, parse_sweep
from smoskin.design.document import design_values
from smoskin.design.skin import SkinDesign
from smoskin.errors import RecordingError

FORMAT: Final = "smoskin data set 1"
PART: Final = ".part"
"""Ending of a file that is not yet whole."""
_FILE: Final = "manifest.json"
_LOCK: Final = ".lock"


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One time that chunks were computed to the end."""

    engine: str
    chunks: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What the rows are of."""

    design_name: str
    design_hash: str
    design_values: Mapping[str, Any]
    """Every value, by its path with its unit."""
    version: str
    """Of the package that computes the rows."""
    sweep: Sweep
    runs: tuple[Run, ...] = ()
    """Those that ended well; a killed one leaves its chunks alone."""

    @property
    def identity(self) -> str:
        """SHA-256 over what decides the rows."""
        whole = "\n".join((FORMAT, self.version, self.design_hash, self.sweep.content_hash))
        return hashlib.sha256(whole.encode()).hexdigest()


def manifest_of(design: SkinDesign, sweep: Sweep) -> Manifest:
    """Of a sweep that is to be computed by this package."""
    return Manifest(
        design_name=design.name,
        design_hash=design.content_hash,
        design_values={
            f"{path.rpartition('.')[0]}.{key}".removeprefix("."): value
            for path, key, value in design_values(design)
            if path != "name"
        },
        version=version("smoskin"),
        sweep=sweep,
    )


def claim(folder: Path, wanted: Manifest) -> Manifest:
    """Make a folder this data set's, or make sure that it is; files not whole are removed.

    Raises
    ------
    RecordingError
        If it holds anything else; the message says what differs.
    """
    for part in folder.glob(f"*{PART}"):
        part.unlink()
    if not (folder / _FILE).exists():
        others = sorted(one.name for one in folder.iterdir() if one.name != _LOCK)
        if others:
            raise RecordingError(f"{folder} must be empty or hold this data set; got {others[0]}")
        _save(folder, wanted)
        return wanted
    kept = read_manifest(folder)
    for what, there, here in (
        ("version of smoskin", {"version": kept.version}, {"version": wanted.version}),
        ("design", kept.design_values, wanted.design_values),
        ("sweep", _flat(format_sweep(kept.sweep)), _flat(format_sweep(wanted.sweep))),
    ):
        for key in [*here, *there]:
            if there.get(key) != here.get(key):
                raise RecordingError(
                    f"{folder} holds rows of another {what}: {key} is {there.get(key)!r} there "
                    f"and {here.get(key)!r} here; use another folder"
                )
    if kept.identity != wanted.identity:
        raise RecordingError(f"{folder} holds rows of another data set; use another folder")
    return kept


def add_run(folder: Path, run: Run) -> None:
    """Note in the manifest that chunks were computed."""
    kept = read_manifest(folder)
    _save(folder, replace(kept, runs=(*kept.runs, run)))


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder.

    Raises
    ------
    RecordingError
        If there is none, or it is damaged.
    """
    file = folder / _FILE
    try:
        document = json.loads(file.read_bytes())
        if document["format"] != FORMAT:
            raise RecordingError(f"{file} must be of format {FORMAT!r}; got {document['format']!r}")
        found = Manifest(
            design_name=document["design"]["name"],
            design_hash=document["design"]["content_hash"],
            design_values=document["design"]["values"],
            version=document["smoskin_version"],
            sweep=parse_sweep(document["sweep"]),
            runs=tuple(Run(**run) for run in document["runs"]),
        )
        if document["identity"] != found.identity:
            raise RecordingError(f"{file} has been changed: its identity is not that of its values")
    except OSError as error:
        raise RecordingError(f"{folder} holds no data set: {error}") from error
    except RecordingError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{file} is damaged: {error!r}") from error
    return found


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """The folder, made if need be, to this process alone; a kill gives it free.

    Raises
    ------
    RecordingError
        If another process has it, or it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / _LOCK, os.O_CREAT | os.O_RDWR, 0o644)
    except OSError as error:
        raise RecordingError(f"{folder} cannot be written: {error}") from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RecordingError(f"{folder} is being written by another process") from error
        yield
    finally:
        os.close(handle)


def write_whole(file: Path, content: bytes) -> None:
    """Write a file that is whole or not there, whenever this process or the machine stops.

    Raises
    ------
    RecordingError
        If it cannot be written.
    """
    part = file.with_name(file.name + PART)
    try:
        part.write_bytes(content)
        settle(part, file)
    except OSError as error:
        raise RecordingError(f"{file} cannot be written: {error}") from error


def settle(part: Path, file: Path) -> None:
    """Give a finished file its name, once it is on the disk."""
    _sync(part)
    os.replace(part, file)
    _sync(file.parent)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _save(folder: Path, manifest: Manifest) -> None:
    sweep = manifest.sweep
    document = {
        "format": FORMAT,
        "identity": manifest.identity,
        "smoskin_version": manifest.version,
        "chunks": sweep.chunks,
        "rows": sweep.rows,
        "sweep": format_sweep(sweep),
        "sweep_hash": sweep.content_hash,
        "design": {
            "name": manifest.design_name,
            "content_hash": manifest.design_hash,
            "values": dict(manifest.design_values),
        },
        "runs": [asdict(run) for run in manifest.runs],
    }
    write_whole(folder / _FILE, json.dumps(document, indent=1).encode() + b"\n")


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as one, by dotted keys."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
