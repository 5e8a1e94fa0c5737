"""What any file is, whether it is whole, what it was made from and which commands read it.

Decides by what a kind is known: the first bytes, never the name. Whether it is whole is for its own
reader to say, which checks every checksum.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from smoskin.commands.sweep import summarise
from smoskin.design.document import read_design, shipped_design
from smoskin.errors import DesignError, ModelError, RecordingError, SmoskinError
from smoskin.feasibility import check_design
from smoskin.measurement import read_touches
from smoskin.origami.pattern import broken_rules, read_pattern
from smoskin.outputs import read_text
from smoskin.sensing import files
from smoskin.sensing.closed_form.calibration import parse_calibration
from smoskin.sensing.learned.gaussian_process import Metric, load_model
from smoskin.sensing.network.model import load_network
from smoskin.sensing.response.table import load_response_table
from smoskin.service.kept import recorded_touches
from smoskin.service.recording import TOUCH_TOPIC, open_recording

_MCAP: Final = b"\x89MCAP0\r\n"
_START: Final = 65_536
"""Bytes that a kind is known by."""
_FOLD: Final = (b'"file_spec"', b'"vertices_coords"')
"""Keys by which a FOLD document is known."""
_TOLD: Final = 5
"""Broken rules of a pattern that are told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """One file and what there is to say of it."""

    file: str
    kind: str
    """Name of the kind, with its article."""
    facts: Mapping[str, str]
    """What it holds and what it was made from, by name."""
    problem: str
    """What is damaged or missing; empty where the file is whole."""
    read_by: tuple[str, ...]
    """Command lines that read it."""

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines."""
        return {
            "file": self.file,
            "kind": self.kind,
            "whole": not self.problem,
            "problem": self.problem,
            "facts": dict(self.facts),
            "read_by": [f"smoskin {line}" for line in self.read_by],
        }

    def lines(self) -> list[str]:
        """The same for people."""
        known = self.kind not in (_ANY.name, _UNKNOWN.name)
        state = ("damaged: " if known else "") + self.problem if self.problem else "whole"
        facts = [f"  {name}: {value}" for name, value in self.facts.items()]
        return [
            f"{self.file}: {self.kind}, {state}",
            *facts,
            *(f"  read by: smoskin {line}" for line in self.read_by),
        ]


Facts = Iterator[tuple[str, str]]
"""Facts, one after the other; the reader's error ends them where the file is damaged."""


class _Kind(NamedTuple):
    """A kind of file."""

    name: str
    facts: Callable[[Path], Facts]
    read_by: tuple[str, ...] = ()
    """Commands, with {} for the file."""


def check_file(path: Path) -> Checked:
    """What a file or folder is and whether it is whole; it raises nothing for what it finds."""
    facts: dict[str, str] = {}
    kind, problem = _ANY, ""
    try:
        kind = _kind_of(path)
        for name, value in kind.facts(path):
            facts[name] = value
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
    except SmoskinError as error:
        problem = str(error).removeprefix(f"{path}: ")
    return Checked(
        file=str(path),
        kind=kind.name,
        facts=MappingProxyType(facts),
        problem=problem,
        read_by=tuple(line.format(path) for line in kind.read_by) if not problem else (),
    )


def kind_of(path: Path) -> str:
    """Name of the kind of a file, with its article, by how it begins."""
    return _kind_of(path).name


def _kind_of(path: Path) -> _Kind:
    """The kind of a file, by how it begins."""
    if path.is_dir():
        return _DATA_SET
    if path.exists() and not path.is_file():
        raise RecordingError("is no plain file")
    with path.open("rb") as file:
        start = file.read(_START)
    if not start:
        raise RecordingError("the file is empty")
    if start.startswith(_MCAP):
        return _RECORDING
    if start.startswith(b"\x89HDF"):
        return _HDF5
    if b"\0" in start[:8]:
        return _ARRAYS.get(files.tensor_key(path), _UNKNOWN)
    if start.lstrip().startswith(b"{") and any(mark in start for mark in _FOLD):
        return _PATTERN
    marks = {b"panel_a": _DESIGN, b"field_factor": _CALIBRATION, b"force_z_N": _TOUCHES}
    return next((kind for mark, kind in marks.items() if mark in start), _UNKNOWN)


def _of_design(content_hash: str) -> tuple[str, str]:
    """The design that something was made for, by name where it comes with the package."""
    try:
        return "design", f"{shipped_design(content_hash).name} ({content_hash[:12]})"
    except DesignError:
        return "design", content_hash[:12]


def _nothing(path: Path) -> Facts:
    yield from ()


def _unknown(path: Path) -> Facts:
    raise RecordingError("no kind of file that smoskin writes or reads")
    yield


def _design(path: Path) -> Facts:
    design = read_design(path)
    yield "design", f"{design.name} ({design.content_hash[:12]})"
    n, m = design.cells
    yield "cells", f"{n} x {m}, {len(design.magnets)} magnets, {len(design.halls)} chips"
    check_design(design)


def _recording(path: Path) -> Facts:
    recording = open_recording(path)
    made = recording.description
    yield "design", f"{made.design} ({made.design_hash[:12]}), {made.chips} chips"
    yield "made by", f"smoskin {made.version}"
    yield "readings", f"{recording.reading_count} over {recording.duration:.1f} s"
    yield "estimates", str(recording.estimate_count)
    if TOUCH_TOPIC in recording.topics.values():
        yield "touches of a rig", str(len(recorded_touches(path)))
    if recording.damage:
        raise RecordingError(recording.damage)


def _table(path: Path) -> Facts:
    table = load_response_table(path)
    yield _of_design(table.design_hash)
    yield "chips", ", ".join(map(str, table.chips))
    yield "normal forces", "{:.2f} to {:.2f} N".format(*table.forces)
    yield (
        "of",
        "one skin, calibrated by touches" if table.calibrated else "the design, no skin's own",
    )
    parts = dict(table.origin)
    effort = parts.pop("effort", None)
    parts |= effort if isinstance(effort, dict) else {}
    yield "made from", ", ".join(f"{key} {value}" for key, value in parts.items())


def _network(path: Path) -> Facts:
    network = load_network(path)
    yield _of_design(network.design_hash)
    yield "chips", ", ".join(map(str, network.chips))
    yield "made from", f"a table of SHA-256 {network.data_sha256[:12]}"
    yield from _held_out(network.metrics)


def _model(path: Path) -> Facts:
    model = load_model(path)
    yield "chips", str(model.chips_in_reading)
    yield "made from", f"data of SHA-256 {model.data_sha256[:12]}, judged by {model.split}"
    yield from _held_out(model.metrics)


def _held_out(metrics: tuple[Metric, ...]) -> Facts:
    """Figures that a model reached on examples held out from its training."""
    for metric in metrics:
        yield f"held out, {metric.name.replace('_', ' ')}", " ".join(metric.shown)


def _calibration(path: Path) -> Facts:
    calibration = parse_calibration(read_text(path, error=ModelError))
    yield _of_design(calibration.design_hash)
    yield "chips", str(len(calibration.field_factor))


def _touches(path: Path) -> Facts:
    table, digest = read_touches(path)
    made = int(table.made.sum())
    yield "rows", f"{len(table.made)}, of which {made} are filled in"
    yield "touches", f"{int(table.touched.sum())} on {table.field.shape[1]} chips"
    yield "SHA-256", digest[:12]


def _pattern(path: Path) -> Facts:
    pattern = read_pattern(path)
    letters = Counter(pattern.assignments)
    yield "vertices", str(len(pattern.vertices))
    yield "creases", f"{letters['M']} mountain, {letters['V']} valley, {letters['U']} unassigned"
    broken = broken_rules(pattern)
    yield "flat folding", f"broken rules: {len(broken)}" if broken else "no vertex forbids it"
    for fault in broken[:_TOLD]:
        yield f"vertex {fault.vertex}", f"{fault.rule}: {fault.finding}"
    if len(broken) > _TOLD:
        yield "and", f"{len(broken) - _TOLD} more; --plot FILE shows all"


def _data_set(path: Path) -> Facts:
    report = summarise(path)
    for line in report.lines():
        name, _, value = line.partition(":")
        yield name.strip(), value.strip()
    if not report.sound:
        raise RecordingError("rows are missing or damaged; the same sweep goes on from there")


_ESTIMATES: Final = "run SOURCE --calibration {}"
_ANY: Final = _Kind("a file", _nothing)
_UNKNOWN: Final = _Kind("a file of another kind", _unknown)
_DESIGN: Final = _Kind("a design", _design, ("info {}", "table {}", "simulate {}"))
_RECORDING: Final = _Kind("a recording", _recording, ("run replay:{}",))
_CALIBRATION: Final = _Kind("a calibration of the paper's forms", _calibration, (_ESTIMATES,))
_TOUCHES: Final = _Kind("a sheet of touches", _touches, ("calibrate --sheet {}", "fit-paper {}"))
_PATTERN: Final = _Kind("a crease pattern (FOLD)", _pattern)
_DATA_SET: Final = _Kind("a data set", _data_set, ("sweep --summary {}",))
_HDF5: Final = _Kind("HDF5, a part or an export of a data set", _nothing)
_ARRAYS: Final = {
    files.RESPONSE_TABLE: _Kind(
        "a response table", _table, (_ESTIMATES, "calibrate --table {}", "train {}", "score {}")
    ),
    files.NETWORK: _Kind("a network", _network, (_ESTIMATES, "score {}")),
    "smoskin_model": _Kind("a learned model", _model, (_ESTIMATES,)),
    "smoskin_training": _Kind("a checkpoint of a training", _nothing, ("train TABLE --resume",)),
}
