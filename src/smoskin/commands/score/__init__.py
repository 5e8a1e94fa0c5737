"""How good an estimator is, in figures, maps and JSON: `smo.score` and `smoskin score`.

Made skins that no training has seen are pressed all over in sessions
(`smoskin.commands.score.evaluate`), and every touch counts. A response table is calibrated to each
skin first, by touches that a rig makes. Decides what is asked and told; an estimator is known by
its steps alone. The same file, design and exam give the same figures.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.score.errors import Marks, grid_places, marks_of, together
from smoskin.commands.score.evaluate import (
    Judged,
    Session,
    grid_sessions,
    judge,
    label,
    pair_session,
)
from smoskin.commands.score.plan import Exam
from smoskin.commands.score.report import Case, Count, ScoreSheet, case_of
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.feasibility import load_design
from smoskin.origami.geometry import geometry
from smoskin.roles import Estimator, Progress, unheard
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import load_estimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, LearnedModel
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import NetworkModel
from smoskin.sensing.response.bound import bound_map
from smoskin.sensing.response.calibrate import Target, TouchPlanner, calibrate_touches
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.whole import Twin

__all__ = ["Exam", "ScoreSheet", "candidate", "examine", "score"]

Scored: TypeAlias = Path | str | ResponseTable | NetworkModel | LearnedModel | Estimator
"""A file of the package, what it holds, or any estimator."""

DATA: Final = "score.json"
"""Name of the file that holds a score."""
_ROOM: Final = 22.0
"""Temperature at which skins are calibrated, degC."""


def score(
    file_or_model: Scored,
    design: SkinDesign | str = "planar",
    *,
    skins: Sequence[int] = range(1, 6),
    touches: int = 60,
    count: int | None = None,
    places: tuple[int, int] | None = None,
    chips: Sequence[int] | None = None,
    drag: float = 0.0,
    pairs: int = 0,
    out: Path | None = None,
    progress: Progress = unheard,
) -> ScoreSheet:
    """Figures of an estimator on made skins that it has never seen, pressed all over.

    Parameters
    ----------
    file_or_model : path, model or Estimator
        A file of the package; a response table, a network or a learned model; or an estimator.
    design : SkinDesign or str
        Design of the skins that are pressed, or its name.
    skins : sequence of int
        Seeds of the made skins, and of all that is drawn for each.
    touches : int
        Labelled touches that calibrate a response table to each skin; 0: it is taken as it is.
    count : int, optional
        Places that are pressed with each force; by default 200 of a grid of 25 x 33, or all
        `places`.
    places : tuple of int, optional
        Grid from rim to rim, along x and y.
    chips : sequence of int, optional
        Chips that are read; all that the file has by default.
    drag : float
        Largest drag of a second round, N; 0: no such round.
    pairs : int
        Pairs of touches at once on each skin.
    out : Path, optional
        Folder for score.json and the figures, which replace those of an earlier score there.
    progress : Progress, optional
        Listener.

    Returns
    -------
    ScoreSheet
        Its `as_json`, its `tables` for people, and whether every target is `met`.

    Raises
    ------
    ModelError
        If the file cannot be examined, or is of another design.
    ArgumentError
        If a number is out of its range, the file does not read the chips, or the folder cannot be
        written.
    MissingExtraError
        If JAX, safetensors or, with a folder, Matplotlib is not installed.
    """
    skin = load_design(design) if isinstance(design, str) else design
    exam = Exam(
        skins=tuple(skins),
        touches=touches,
        places=places or (25, 33),
        count=count if count or places else 200,
        drag=drag,
        pairs=pairs,
        chips=None if chips is None else tuple(chips),
    )
    subject = candidate(file_or_model, skin, exam)
    if out is None:
        return examine(skin, subject, exam, progress=progress)
    from smoskin.commands.score.plates import score_plates

    _check_folder(out)
    sheet = examine(skin, subject, exam, progress=progress)
    text = json.dumps(sheet.as_json(), indent=1) + "\n"
    (out / DATA).write_text(text, encoding="utf-8")
    for plate in score_plates(skin, sheet):
        plate.write(out)
    return sheet


def _check_folder(folder: Path) -> None:
    """Make a folder if it is missing, and refuse one that takes no file."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / DATA).open("a", encoding="utf-8"):
            pass
    except OSError as error:
        raise ArgumentError(
            f"out must be a folder that can be written; got {str(folder)!r}: {error.strerror}"
        ) from error


class Entrant(NamedTuple):
    """One skin's estimators."""

    straight: Estimator
    """An estimator that may take touches to be straight."""
    dragged: Estimator
    """An estimator that may not."""
    table: ResponseTable | None
    """Knowledge of the skin from which the bound can be told, if any."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """An estimator for an exam, or a response table that makes one for each skin."""

    kind: str
    """Kind of file, for people."""
    chips: tuple[int, ...]
    """Chips that are read."""
    reader: ResponseTable | Estimator
    plan: tuple[Target, ...] = ()
    """Touches that calibrate a skin."""
    file_sha256: str = ""
    """Hash of the file, if any."""

    def enter(self, twin: Twin, rng: np.random.Generator) -> Entrant:
        """Estimators of a made skin, calibrated where they are made from a table."""
        table = self.reader
        if isinstance(table, Estimator):
            return Entrant(table, table, None)
        design = twin.design
        if self.plan:
            labels = label(twin, self.plan, rng, temperature=_ROOM, chips=table.chips)
            table = calibrate_touches(table, labels, signal_noise(design, table.chips))
        straight, dragged = (
            BayesEstimator(design, table, priors=priors)
            for priors in (TouchPriors(drag_spread=0.0), TouchPriors())
        )
        return Entrant(straight, dragged, table)


def candidate(given: Scored, design: SkinDesign, exam: Exam) -> Candidate:
    """A file, model or estimator, ready for an exam.

    Raises
    ------
    ModelError
        If it holds nothing that can be examined, or belongs to another design.
    ArgumentError
        If it does not read the exam's chips.
    MissingExtraError
        If `safetensors` is not installed.
    """
    reader: ResponseTable | NetworkModel | LearnedModel | Estimator
    digest = ""
    if isinstance(given, (Path, str)):
        reader = load_estimator(given, design)
        reader = reader.table if isinstance(reader, BayesEstimator) else reader
        digest = hashlib.sha256(Path(given).read_bytes()).hexdigest()
    else:
        reader = given
    if isinstance(reader, ResponseTable):
        design.check_own("table", reader.design_hash)
        table = reader if exam.chips is None else reader.of_chips(exam.chips)
        noise = signal_noise(design, table.chips)
        plan = tuple(TouchPlanner(table, noise).plan(exam.touches)) if exam.touches else ()
        return Candidate(
            kind="response table", chips=table.chips, reader=table, plan=plan, file_sha256=digest
        )
    kind, chips, reader = _reader(reader, design)
    if exam.chips not in (None, chips):
        raise ArgumentError(f"chips must be those of the {kind}, {chips}; got {exam.chips}")
    return Candidate(kind=kind, chips=chips, reader=reader, file_sha256=digest)


def _reader(
    given: NetworkModel | LearnedModel | Estimator, design: SkinDesign
) -> tuple[str, tuple[int, ...], Estimator]:
    """Kind, chips and estimator of what reads every skin alike."""
    match given:
        case NetworkModel():
            given = NetworkEstimator(design, given)
        case LearnedModel():
            given = LearnedEstimator(given)
    match given:
        case NetworkEstimator():
            return "network", given.model.chips, given
        case LearnedEstimator():
            if given.model.chips_in_reading != len(design.halls):
                raise ModelError(
                    f"model must read {len(design.halls)} chips, as design {design.name!r} has; "
                    f"got one of {given.model.chips_in_reading}"
                )
            return "learned model", given.model.encoding.chips, given
        case ClosedFormEstimator():
            return "calibration", tuple(range(len(design.halls))), given
    return "estimator", tuple(range(len(design.halls))), given


class _Sitting(NamedTuple):
    """One session of one skin."""

    case: str
    judged: Judged
    marks: Marks


def examine(
    design: SkinDesign,
    subject: Candidate,
    exam: Exam,
    *,
    make: Callable[[int], Twin] | None = None,
    progress: Progress = unheard,
) -> ScoreSheet:
    """The sheet that an estimator fills.

    Parameters
    ----------
    design : SkinDesign
        Design of the skins.
    subject : Candidate
        Maker of an estimator for each skin.
    exam : Exam
        What is asked.
    make : callable, optional
        Maker of the skin of a seed; by default one manufactured with the usual tolerances.
    progress : Progress, optional
        Listener.
    """
    sat, whole = list[_Sitting](), len(exam.skins) * exam.sessions
    noise = signal_noise(design, subject.chips)
    for seed in exam.skins:
        progress(f"skin {seed}: calibration", len(sat) / whole)
        twin = make(seed) if make else Twin(design, seed=seed, manufactured=True)
        entrant = subject.enter(twin, np.random.default_rng([seed, 0]))
        for case, session in _sessions(twin, exam, seed):
            progress(f"skin {seed}: {case}", len(sat) / whole)
            free = case in ("undragged", "dragged")
            estimator = entrant.dragged if free else entrant.straight
            judged = judge(estimator, twin, session, np.random.default_rng([seed, 4, len(sat)]))
            bound = None
            if entrant.table is not None and case != "pairs":
                bound = _bounds(entrant.table, noise, exam, session, drags=free)
            sat.append(_Sitting(case, judged, marks_of(judged, geometry(design).extent, bound)))
    return ScoreSheet(
        design=design.name,
        design_hash=design.content_hash,
        kind=subject.kind,
        file_sha256=subject.file_sha256,
        chips=subject.chips,
        exam=exam,
        cases=tuple(
            _case(design, exam, [sitting for sitting in sat if sitting.case == case])
            for case in dict.fromkeys(sitting.case for sitting in sat)
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
    table: ResponseTable, noise: Floats, exam: Exam, session: Session, *, drags: bool
) -> Floats:
    """Bounds of the place of each touch of a session on the grid, (B, 2), m.

    The slopes are those without drag: drags bend the signals little.
    """
    force = -float(session.touches.force[0, 0, 2])
    at = grid_places(session.touches.position[:, 0], table.basis.extent, exam.places)
    maps = [
        bound_map(table, noise, force=force, drags=drags, misfit=misfit, places=exam.places)
        for misfit in (False, True)
    ]
    return np.stack([bounds.location.ravel()[at] for bounds in maps], axis=1)


def _case(design: SkinDesign, exam: Exam, sat: Sequence[_Sitting]) -> Case:
    """A case of all its sessions."""
    places = sat[0].judged.truth.shape[1]
    return case_of(
        sat[0].case,
        design,
        together([sitting.marks for sitting in sat]),
        idle=Count.of(0, np.concatenate([sitting.judged.idle for sitting in sat])),
        touched=Count.of(places, np.concatenate([sitting.judged.count for sitting in sat])),
        places=exam.places if places == 1 else None,
    )
