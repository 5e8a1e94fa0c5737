"""A skin characterised from recordings of a rig's touches: figures, a page and a picture.

Decides what is written, and that each figure stands with its uncertainty, its definition and the
world it was measured in, or with the reason why the recordings do not give it.
"""

import hashlib
import io
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from smoskin.arguments import typed
from smoskin.commands.report.courses import Course, course_of
from smoskin.commands.report.figures import Figure, figures_of
from smoskin.commands.report.rig import compliance_of, lag_of, less_compliance, rig_figures
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, RecordingError
from smoskin.outputs import check_output, write_output
from smoskin.service.kept import recorded_touches, rig_of
from smoskin.service.recording import open_recording

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A recording that figures were made of."""

    path: str
    sha256: str
    world: str
    """What was touched by what."""
    touches: int

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "file": self.path,
            "sha256": self.sha256,
            "world": self.world,
            "touches": self.touches,
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Characterisation:
    """What recordings tell of a skin."""

    design: SkinDesign
    recordings: tuple[Recorded, ...]
    courses: tuple[Course, ...]
    """Touches with good readings."""
    figures: tuple[Figure, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "design": self.design.name,
            "design_hash": self.design.content_hash,
            "recordings": [recorded.as_json() for recorded in self.recordings],
            "figures": [figure.as_json() for figure in self.figures],
        }

    def tables(self) -> "Sequence[Table]":
        """Figures, and why others are not there."""
        from rich.table import Table

        table = Table("figure", "value", "of", "in the paper")
        for figure in self.figures:
            table.add_row(figure.title, *_cells(figure), figure.printed)
        return (table,)


@typed
def characterise(
    recordings: Sequence[str | os.PathLike[str]], *, block: str | os.PathLike[str] | None = None
) -> Characterisation:
    """The figures of one skin from recordings of its touches by a rig.

    A recording of touches of a rigid block by the same rig tells how far that itself gives way,
    which is taken off the depths.

    Raises
    ------
    ArgumentError
        If there is no recording, or they are of skins of different designs.
    RecordingError
        If one cannot be read, or holds no touch of a rig, or no touch has good readings.
    """
    if not recordings:
        raise ArgumentError("recordings must be at least one; got none")
    courses: list[Course] = []
    recorded: list[Recorded] = []
    designs: list[SkinDesign] = []
    lags: list[float] = []
    for run, path in enumerate(recordings):
        touches = recorded_touches(path, some=True)
        designs.append(open_recording(path).design)
        for touch in touches:
            if (course := course_of(touch, run)) is not None:
                courses.append(course)
                lags.append(lag_of(touch, course))
        digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        recorded.append(
            Recorded(path=os.fspath(path), sha256=digest, world=_world(path), touches=len(touches))
        )
    if len({design.content_hash for design in designs}) > 1:
        names = ", ".join(dict.fromkeys(design.name for design in designs))
        raise ArgumentError(f"recordings must be of one design; got {names}")
    if not courses:
        raise RecordingError("no touch of these recordings has good readings at rest and held")
    pressed = () if block is None else recorded_touches(block, some=True)
    compliance = compliance_of([c for touch in pressed if (c := course_of(touch)) is not None])
    if compliance.count:
        courses = [less_compliance(course, compliance.value) for course in courses]
    return Characterisation(
        design=designs[0],
        recordings=tuple(recorded),
        courses=tuple(courses),
        figures=(*figures_of(courses, designs[0]), *rig_figures(compliance, lags)),
    )


def write_report(
    done: Characterisation, folder: str | os.PathLike[str], *, force: bool = False
) -> tuple[Path, ...]:
    """Write report.json, report.html and report.svg to a folder; their paths.

    It raises a `FileError` if one exists and is not to be replaced, or cannot be written, and a
    `MissingExtraError` without the extra ``plots``.
    """
    from smoskin.commands.report.pictures import draw_courses
    from smoskin.commands.tessellate.pages import report_page
    from smoskin.plots import styled

    place = check_output(folder, folder=True)
    files = tuple(place / f"report.{end}" for end in ("json", "html", "svg"))
    for file in files:
        check_output(file, force=force)
    place.mkdir(parents=True, exist_ok=True)
    picture = io.BytesIO()
    with styled():
        draw_courses(done.courses).savefig(picture, format="svg", metadata={"Date": None})
    worlds = "; ".join(dict.fromkeys(recorded.world for recorded in done.recordings))
    figures = [("figure", "value", "of", "in the paper", "equation", "source")]
    figures += [(f.title, *_cells(f), f.printed, f.equation, f.source) for f in done.figures]
    parts = [
        (f.title, [("where", f.unit), *((label, f"{value:.4g}") for label, value in f.parts)])
        for f in done.figures
        if len(f.parts) > 1
    ]
    sources = [("recording", "touches", "world", "SHA-256")]
    sources += [(r.path, str(r.touches), r.world, r.sha256[:12]) for r in done.recordings]
    page = report_page(
        f"{done.design.name}: characterisation",
        f"{len(done.courses)} touches; {worlds}.",
        [("Figures", figures), *parts, ("Recordings", sources)],
        ("report.json", "report.svg"),
        picture.getvalue(),
        "force, depth and signal of the touches",
    )
    document = json.dumps(done.as_json(), indent=2, ensure_ascii=False) + "\n"
    for file, content in zip(files, (document.encode(), page, picture.getvalue()), strict=True):
        write_output(file, content)
    return files


def _cells(figure: Figure) -> tuple[str, str]:
    """Value with its deviation and how many it is of; or why there is none."""
    measured = figure.measured
    if figure.reason:
        return f"not known: {figure.reason}", ""
    spread = f" ± {measured.deviation:.2g}" if measured.deviation == measured.deviation else ""
    return f"{measured.value:.4g}{spread} {figure.unit}", str(measured.count)


def _world(path: str | os.PathLike[str]) -> str:
    """What was touched by what, as the recording says."""
    rig = rig_of(path)
    if "rig" in rig:
        return f"a virtual skin on the rig {rig['rig']}"
    if "source" in rig:
        return f"a real skin on {rig['source']}, pressed by {rig.get('stage', 'a stage')}"
    return "a skin of which the recording says nothing"
