"""How good an estimator is, in figures, maps and JSON: `smo.score` and `smoskin score`.

Made skins that no training has seen are pressed all over in sessions
(`smoskin.commands.score.evaluate`), and every touch counts. A response table is calibrated to each
skin first, by touches that a rig makes. Decides what is asked and told; an estimator is known by
its steps alone. The same file, design and exam give the same figures.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.commands.score.errors import Answers, together
from smoskin.commands.score.evaluate import (
    Exam,
    Session,
    grid_sessions,
    in_turn,
    judge,
    label,
    pair_session,
    starts_in_range,
)
from smoskin.commands.score.report import ScoreSheet, case_of, grid_places
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.feasibility import load_design
from smoskin.outputs import check_output, write_output
from smoskin.roles import ContactLaw, Estimator, Progress, unheard
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import load_estimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, LearnedModel
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import NetworkModel
from smoskin.sensing.response.bound import bound_map
from smoskin.sensing.response.calibrate import Target, TouchPlanner, calibrate_touches
from smoskin.sensing.response.table import ResponseTable, shipped_tables
from smoskin.sensing.signals.estimator import FOLLOWING, ON_AN_ARM
from smoskin.sensing.signals.signals import signal_noise
from smoskin.sensing.signals.zero import ZeroTracking
from smoskin.twin.whole import Twin
from smoskin.twin.world.effect import World
from smoskin.twin.world.worlds import PLAIN, world_of

__all__ = ["Exam", "ScoreSheet", "candidate", "examine", "score"]

Scored: TypeAlias = Path | str | ResponseTable | NetworkModel | LearnedModel | Estimator
"""A file of the package, what it holds, or any estimator."""

DATA: Final = "score.json"
"""Name of the file that holds a score."""
_ROOM: Final = 22.0
"""Temperature at which skins are calibrated, degC."""


@typed
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
    pairs_after: float = 0.3,
    world: str | World = "hard",
    effect: str | None = None,
    contact: ContactLaw | None = None,
    posed: bool = False,
    out: Path | None = None,
    progress: Progress = unheard,
) -> ScoreSheet:
    """Figures of an estimator on made skins that it has never seen, pressed all over.

    Parameters
    ----------
    file_or_model : path, model or Estimator
        A file of the package, or the name of a design whose table is shipped; a response table, a
        network or a learned model; or an estimator.
    design : SkinDesign or str
        Design of the skins that are pressed, or its name.
    skins, touches, places, chips, drag, pairs, pairs_after
        As the `Exam` has them.
    count : int, optional
        Places that are pressed with each force; by default 200 of a grid of 25 x 33, or all
        `places`.
    world : str or World
        World in which skins are made, calibrated and pressed: `hard`, with all that the twin's own
        assumptions leave out; `limb`, with its motor and steel inside the limb; `plain`, without;
        or one of your own.
    effect : str, optional
        A world of this effect alone.
    contact : ContactLaw, optional
        Contact law of all the skins; by default the world's.
    posed : bool
        Whether the arm that turns the skins tells how it holds them, as a robot's program can; it
        turns once untouched before the first touch.
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
        If a number is out of its range, no skin's chips are within theirs, the file does not read
        the chips, or there is no such world or effect.
    ContractError
        If the contact law breaks its role.
    FileError
        If the folder cannot be written.
    MissingExtraError
        If JAX, safetensors or, with a folder, Matplotlib is not installed.
    """
    skin = load_design(design) if isinstance(design, str) else design
    judged_in = world if isinstance(world, World) else world_of(world, effect)
    if posed:
        judged_in = replace(judged_in, name=f"{judged_in.name}, posed", posed=True)
    exam = Exam(
        skins=tuple(skins),
        touches=touches,
        places=places or (25, 33),
        count=count if count or places else 200,
        drag=drag,
        pairs=pairs,
        pairs_after=pairs_after,
        chips=None if chips is None else tuple(chips),
        world=judged_in,
        contact=contact,
    )
    subject = candidate(file_or_model, skin, exam)
    if out is None:
        return examine(skin, subject, exam, progress=progress)
    from smoskin.commands.score.plates import score_plates

    check_output(out, folder=True)
    sheet = examine(skin, subject, exam, progress=progress)
    write_output(out / DATA, (json.dumps(sheet.as_json(), indent=1) + "\n").encode())
    for plate in score_plates(sheet):
        plate.write(out)
    return sheet


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

    def enter(
        self, twin: Twin, rng: np.random.Generator, world: World = PLAIN
    ) -> tuple[ResponseTable | None, tuple[Estimator, Estimator]]:
        """Table of a made skin, if any, and estimators: of straight touches, and of dragged ones.

        The table is calibrated where touches are planned.
        """
        table = self.reader
        if isinstance(table, Estimator):
            return None, (table, table)
        if self.plan:
            bench = (int(rng.integers(1 << 31)),) if not world.plain else ()
            labels = label(
                twin, self.plan, rng, temperature=_ROOM, chips=table.chips, world=world, seed=bench
            )
            table = calibrate_touches(table, labels, signal_noise(twin.design, table.chips))
        tracking = _tracking(world)
        no_drags = TouchPriors(drag_spread=0.0)
        straight = BayesEstimator(twin.design, table, priors=no_drags, tracking=tracking)
        return table, (straight, BayesEstimator(twin.design, table, tracking=tracking))


def candidate(given: Scored, design: SkinDesign, exam: Exam) -> Candidate:
    """A file, model or estimator, ready for an exam; refused as `score` says."""
    digest = ""
    if isinstance(given, (Path, str)):
        path = shipped_tables().get(str(given), Path(given))
        given = load_estimator(path, design, uncalibrated=True)
        if isinstance(given, BayesEstimator):
            given = given.table
        elif isinstance(given, NetworkEstimator):
            given = given.model
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if isinstance(given, ResponseTable):
        design.check_own("table", given.design_hash)
        table = given if exam.chips is None else given.of_chips(exam.chips)
        noise = signal_noise(design, table.chips)
        plan = tuple(TouchPlanner(table, noise).plan(exam.touches)) if exam.touches else ()
        return Candidate(
            kind="response table", chips=table.chips, reader=table, plan=plan, file_sha256=digest
        )
    if isinstance(given, NetworkModel):
        given = NetworkEstimator(design, given, tracking=_tracking(exam.world))
    elif isinstance(given, LearnedModel):
        given = LearnedEstimator(given)
    kind, chips = _kind(given, design)
    if exam.chips not in (None, chips):
        raise ArgumentError(f"chips must be those of the {kind}, {chips}; got {exam.chips}")
    return Candidate(kind=kind, chips=chips, reader=given, file_sha256=digest)


def _tracking(world: World) -> ZeroTracking:
    """How zeros are followed in a world."""
    return ON_AN_ARM if world.on_arm else FOLLOWING


def _kind(reader: Estimator, design: SkinDesign) -> tuple[str, tuple[int, ...]]:
    """Kind and chips of an estimator that reads every skin alike."""
    match reader:
        case NetworkEstimator():
            return "network", reader.model.chips
        case LearnedEstimator():
            if reader.model.chips_in_reading != len(design.halls):
                raise ModelError(
                    f"model must read {len(design.halls)} chips, as design {design.name!r} has; "
                    f"got one of {reader.model.chips_in_reading}"
                )
            return "learned model", reader.model.encoding.chips
    kind = "calibration" if isinstance(reader, ClosedFormEstimator) else "estimator"
    return kind, tuple(range(len(design.halls)))


def examine(
    design: SkinDesign,
    subject: Candidate,
    exam: Exam,
    *,
    make: Callable[[int], Twin] | None = None,
    progress: Progress = unheard,
) -> ScoreSheet:
    """The sheet that a candidate fills on skins of a design.

    `make` makes the skin of a seed; by default the exam's world does. A skin of which a chip is at
    the end of its range untouched is no skin yet: it is sent back, and the sheet names it.
    """
    answers: dict[str, list[Answers]] = {}
    sent_back: list[int] = []
    whole, done = len(exam.skins) * exam.sessions, 0
    noise = signal_noise(design, subject.chips)
    for seed in exam.skins:
        progress(f"skin {seed}: calibration", done / whole)
        twin = make(seed) if make else exam.world.skin(design, seed, exam.contact)
        if not starts_in_range(twin):
            sent_back.append(seed)
            done += exam.sessions
            continue
        table, estimators = subject.enter(twin, np.random.default_rng([seed, 0]), exam.world)
        for case, session in _sessions(twin, exam, seed):
            progress(f"skin {seed}: {case}", done / whole)
            drags = case in ("undragged", "dragged")
            rng = np.random.default_rng([seed, 4, done])
            part = judge(estimators[drags], twin, session, rng)
            if table is not None and session.touches.position.shape[1] == 1:
                part = replace(part, bound=_bounds(table, noise, exam, session, drags=drags))
            answers.setdefault(case, []).append(part)
            done += 1
    if not answers:
        raise ArgumentError(f"skins must read within their chips' range untouched; got {sent_back}")
    return ScoreSheet(
        design=design,
        sent_back=tuple(sent_back),
        kind=subject.kind,
        file_sha256=subject.file_sha256,
        chips=subject.chips,
        exam=exam,
        cases=tuple(
            case_of(case, design, together(parts), exam) for case, parts in answers.items()
        ),
    )


def _sessions(twin: Twin, exam: Exam, seed: int) -> Iterator[tuple[str, Session]]:
    """Sessions of one skin, each under the name of its case."""
    drags = {"straight": 0.0} | ({"dragged": exam.drag} if exam.drag else {})
    for k, (case, drag) in enumerate(drags.items(), start=1):
        rng = np.random.default_rng([seed, k])
        for session in grid_sessions(
            twin,
            rng,
            places=exam.places,
            drag=drag,
            count=exam.count,
            world=exam.world,
            seed=(seed, k),
        ):
            yield case, session
            if case == "straight" and exam.drag:
                yield "undragged", session
    if exam.pairs:
        rng = np.random.default_rng([seed, 3])
        pairs = pair_session(twin, rng, exam.pairs, exam.world, (seed, 3))
        yield "pairs", pairs
        yield "pairs in turn", in_turn(twin, pairs, exam.pairs_after)


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
