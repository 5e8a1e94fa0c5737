"""What a data set is of, written before its first row.

Decides what must be the same for two runs to fill one folder: design, sweep and version of this
package. Hides the manifest's JSON and the lock that keeps a second writer out.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from smoskin.datasets.patterns import Sweep, format_sweep, parse_sweep
from smoskin.design.document import design_values, format_design, parse_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import RecordingError, SmoskinError
from smoskin.outputs import PART, write_output

FORMAT: Final = "smoskin data set 2"
FILE: Final = "manifest.json"
_LOCK: Final = ".lock"


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One time that chunks were computed to the end."""

    engine: str
    """Name of the engine."""
    chunks: int
    """Number of chunks that were computed."""
    damaged: int
    """Number of them that had been computed before, but whose files were damaged."""
    seconds: float
    """Duration, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What the rows of a data set are of."""

    design: SkinDesign
    """The skin that was pressed, as designed."""
    sweep: Sweep
    """What was pressed."""
    version: str = field(default_factory=lambda: version("smoskin"))
    """Version of the package that computes the rows."""
    runs: tuple[Run, ...] = ()
    """Runs that ended well; a killed one leaves its chunks alone."""

    @property
    def identity(self) -> str:
        """SHA-256 over what decides the rows."""
        whole = "\n".join((FORMAT, self.version, self.design.content_hash, self.sweep.content_hash))
        return hashlib.sha256(whole.encode()).hexdigest()


def claim(folder: Path, manifest: Manifest) -> Manifest:
    """Make a folder this data set's, or make sure that it is; files not whole are removed.

    `RecordingError` says what differs where it holds anything else.
    """
    new, parts = not (folder / FILE).exists(), list(folder.glob(f"*{PART}"))
    others = {path.name for path in folder.iterdir()} - {_LOCK, *(part.name for part in parts)}
    if new and others:
        raise RecordingError(f"{folder} must be empty or hold this data set; got {min(others)}")
    for part in parts:
        part.unlink()
    if new:
        save_manifest(folder, manifest)
        return manifest
    kept = read_manifest(folder)
    if kept.identity == manifest.identity:
        return kept
    for what, there, here in zip(
        ("version of smoskin", "design", "sweep"), _values(kept), _values(manifest), strict=True
    ):
        for key in [*here, *there]:
            if there.get(key) != here.get(key):
                raise RecordingError(
                    f"{folder} holds rows of another {what}: {key} is {there.get(key)!r} there "
                    f"and {here.get(key)!r} here; use another folder"
                )
    raise RecordingError(f"{folder} holds rows of another data set; use another folder")


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder; `RecordingError` where there is none or it is damaged."""
    file = folder / FILE
    try:
        document = json.loads(file.read_bytes())
        if (form := document["format"]) != FORMAT:
            raise RecordingError(
                f"must be of format {FORMAT!r}; got {form!r}; repeat the sweep in another folder"
            )
        manifest = Manifest(
            design=parse_design(document["design"]),
            sweep=parse_sweep(document["sweep"]),
            version=document["smoskin_version"],
            runs=tuple(Run(**run) for run in document["runs"]),
        )
        if document["identity"] != manifest.identity:
            raise RecordingError("has been changed: its identity is not that of its values")
    except OSError as error:
        raise RecordingError(f"{folder} holds no data set: {error}") from error
    except SmoskinError as error:
        raise RecordingError(f"{file}: {error}") from error
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError) as error:
        raise RecordingError(f"{file} is damaged: {error!r}") from error
    except ValueError as error:
        raise RecordingError(f"{file} is damaged: {error}") from error
    return manifest


def save_manifest(folder: Path, manifest: Manifest) -> None:
    """Write the manifest of a folder."""
    document = {
        "format": FORMAT,
        "identity": manifest.identity,
        "smoskin_version": manifest.version,
        "chunks": manifest.sweep.chunks,
        "rows": manifest.sweep.rows,
        "sweep": format_sweep(manifest.sweep),
        "design_hash": manifest.design.content_hash,
        "design": format_design(manifest.design),
        "runs": [asdict(run) for run in manifest.runs],
    }
    write_output(folder / FILE, json.dumps(document, indent=1).encode() + b"\n")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """The folder, made if need be, to this process alone; a kill gives it free.

    `RecordingError` tells that another process has it, or that it cannot be made.
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


def _values(manifest: Manifest) -> tuple[dict[str, Any], ...]:
    """Everything that decides the rows, by dotted keys: version, design and sweep."""
    design = {
        f"{path.rpartition('.')[0]}.{key}".removeprefix("."): value
        for path, key, value in design_values(manifest.design)
        if path != "name"
    }
    return {"version": manifest.version}, design, _flat(format_sweep(manifest.sweep))


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    """Nested tables as one, by dotted keys."""
    if not isinstance(value, dict):
        return {key: value}
    parts = [_flat(part, f"{key}.{name}".removeprefix(".")) for name, part in value.items()]
    return {name: part for flat in parts for name, part in flat.items()}
