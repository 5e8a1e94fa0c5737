"""How good a file of an estimator is, in figures, maps and JSON: the work of `smoskin score`.

Made skins that no training has seen are pressed all over in sessions
(`smoskin.commands.score.evaluate`), and
every touch counts. Decides what is asked and told; an estimator is known by its steps alone. The
same file, design and exam give the same figures.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.score.errors import Marks, grid_places, marks_of, together
from smoskin.commands.score.evaluate import Judged, Session, grid_sessions, judge, pair_session
from smoskin.commands.score.files import Subject, load_subject
from smoskin.commands.score.plan import Exam
from smoskin.commands.score.report import Case, Count, ScoreSheet, case_of
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError
from smoskin.origami.layout import skin_extent
from smoskin.sensing.response.bound import bound_map
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.whole import Twin

__all__ = ["Exam", "ScoreSheet", "Written", "examine", "score_file"]

Progress = Callable[[str, float], None]
"""Is told what is being done, and the share of the whole that is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """What a score has left in its folder."""

    sheet: ScoreSheet
    data: Path
    """score.json."""
    figures: tuple[Path, ...]
    """SVG files."""


class _Sitting(NamedTuple):
    """One session of one skin."""

    case: str
    judged: Judged
    marks: Marks


def score_file(
    design: SkinDesign,
    file: Path | str,
    out: Path | str,
    exam: Exam | None = None,
    *,
    progress: Progress = lambda what, share: None,
) -> Written:
    """Examine a file's estimator and write score.json and the figures.

    Files of an earlier score there are replaced; the same file, design and exam give the same
    bytes.

    Parameters
    ----------
    design : SkinDesign
    file : path
        A response table (`smoskin.commands.table`) or a network (`smoskin.commands.train`).
    out : path
        The folder; made if missing.
    exam : Exam, optional
    progress : callable, optional

    Raises
    ------
    ModelError
        If the file cannot be examined, or is of another design.
    ArgumentError
        If the folder cannot be written, or the file does not read the exam's chips.
    MissingExtraError
        If Matplotlib, JAX or safetensors is not installed.
    """
    if find_spec("matplotlib") is None:
        raise MissingExtraError("the score's figures", "plots")
    from smoskin.commands.score.plates import score_plates

    asked = exam or Exam()
    subject = load_subject(file, design, asked)
    data = _writable(Path(out)) / "score.json"
    found = examine(
        design,
        subject,
        asked,
        file_sha256=hashlib.sha256(Path(file).read_bytes()).hexdigest(),
        progress=lambda what, share: progress(what, 0.97 * share),
    )
    progress("figures", 0.97)
    figures = tuple(plate.write(data.parent) for plate in score_plates(design, found))
    data.write_text(json.dumps(found.as_json(), indent=1) + "\n", encoding="utf-8")
    progress("done", 1.0)
    return Written(sheet=found, data=data, figures=figures)


def examine(
    design: SkinDesign,
    subject: Subject,
    exam: Exam,
    *,
    file_sha256: str = "",
    make: Callable[[int], Twin] | None = None,
    progress: Progress = lambda what, share: None,
) -> ScoreSheet:
    """The sheet that an estimator fills.

    Parameters
    ----------
    design : SkinDesign
    subject : Subject
        What makes an estimator for each skin.
    exam : Exam
    file_sha256 : str
        Of the file that it was read from.
    make : callable, optional
        The skin of a seed; by default one manufactured with the usual tolerances.
    progress : callable, optional
    """
    sat: list[_Sitting] = []
    whole = exam.skins * exam.sessions
    noise = signal_noise(design, subject.chips)
    for seed in exam.seeds:
        progress(f"skin {seed}: calibration", len(sat) / whole)
        twin = make(seed) if make else Twin(design, seed=seed, manufactured=True)
        entrant = subject.enter(twin, np.random.default_rng([seed, 0]))
        for case, session in _sessions(twin, exam, seed):
            progress(f"skin {seed}: {case}", len(sat) / whole)
            free = case in ("undragged", "dragged")
            estimator = entrant.dragged if free else entrant.straight
            judged = judge(estimator, twin, session, np.random.default_rng([seed, 4, len(sat)]))
            bound = None
            if entrant.known is not None and case != "pairs":
                bound = _bounds(entrant.known, noise, exam, session, drags=free)
            marks = marks_of(judged, skin_extent(design), seed, bound)
            sat.append(_Sitting(case, judged, marks))
    return ScoreSheet(
        design=design.name,
        design_hash=design.content_hash,
        kind=subject.kind,
        file_sha256=file_sha256,
        chips=subject.chips,
        exam=exam,
        cases=tuple(
            _case(design, exam, [one for one in sat if one.case == case])
            for case in dict.fromkeys(one.case for one in sat)
        ),
    )


def _sessions(twin: Twin, exam: Exam, seed: int) -> Iterator[tuple[str, Session]]:
    """Sessions of one skin, each under the name of its case."""
    drags = {"straight": 0.0} | ({"dragged": exam.drag} if exam.drag else {})
    for k, (case, drag) in enumerate(drags.items(), start=1):
        rng = np.random.default_rng([seed, k])
        for session in grid_sessions(twin, rng, places=exam.places, drag=drag, count=exam.count):
            yield case, session
            if case == "straight" and exam.drag:
                yield "undragged", session
    if exam.pairs:
        yield "pairs", pair_session(twin, np.random.default_rng([seed, 3]), exam.pairs)


def _bounds(
    known: ResponseTable, noise: Floats, exam: Exam, session: Session, *, drags: bool
) -> Floats:
    """Bounds of the place of each touch of a session on the grid, (B, 2), m.

    The slopes are those without drag: drags bend the signals little.
    """
    force = -float(session.touches.force[0, 0, 2])
    at = grid_places(session.touches.position[:, 0], known.basis.extent, exam.places)
    maps = [
        bound_map(known, noise, force=force, drags=drags, misfit=misfit, places=exam.places)
        for misfit in (False, True)
    ]
    return np.stack([one.location.ravel()[at] for one in maps], axis=1)


def _case(design: SkinDesign, exam: Exam, sat: Sequence[_Sitting]) -> Case:
    """A case of all its sessions."""
    places = sat[0].judged.truth.shape[1]
    said = np.concatenate([one.judged.count for one in sat])
    before = np.concatenate([one.judged.idle for one in sat])
    return case_of(
        sat[0].case,
        design,
        together([one.marks for one in sat]),
        idle=Count.of(0, before),
        touched=Count.of(places, said),
        places=exam.places if places == 1 else None,
    )


def _writable(folder: Path) -> Path:
    """The folder, made if missing and shown to take a file."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "score.json").open("a", encoding="utf-8"):
            pass
    except OSError as error:
        raise ArgumentError(
            f"out must be a folder that can be written; got {str(folder)!r}: {error.strerror}"
        ) from error
    return folder
