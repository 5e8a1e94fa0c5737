"""A source of readings, its estimates, and an arm that follows them, until told to end.

Decides what people may say meanwhile, and that every change of what the arm is allowed is told.
"""

import os
import queue
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Final, final

import numpy as np

from smoskin.commands.follow.page import ArmPage
from smoskin.commands.recordings import Recordings
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, RecordingError
from smoskin.outputs import check_output
from smoskin.records import Contact, Estimate, Pose, Reading
from smoskin.robot.arm import Arm
from smoskin.robot.chain import Chain
from smoskin.robot.driver import Driver
from smoskin.robot.follow import Command, Follow
from smoskin.robot.holding import Holding
from smoskin.robot.law import Limits
from smoskin.robot.simulated import OWN_MODEL, SimulatedArm
from smoskin.robot.ur import UrArm
from smoskin.robot.xarm import XArm
from smoskin.roles import Estimator, Sink, Source
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.service.apart.realtime import undisturbed
from smoskin.service.loop import Counters, Loop
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource, open_source

WARNING: Final = (
    "This is not a safety function: it stops the arm by category 2 only, and runs on an ordinary "
    "computer. The wired emergency stop and the robot's own limits stay in force."
)
WORDS: Final = ("arm", "disarm", "reset", "zero", "quit")
"""What people may say, a word a line; an empty line is a sign that Enter is held."""


def follow_source(
    url: str | os.PathLike[str],
    design: SkinDesign | None = None,
    *,
    calibration: str | os.PathLike[str] | None = None,
    model: str | os.PathLike[str] = OWN_MODEL,
    site: str = "skin",
    robot: str | None = None,
    limits: Limits | None = None,
    port: int | None = None,
    seconds: float | None = None,
    realtime: bool = False,
    record: str | os.PathLike[str] | None = None,
    force: bool = False,
    words: "queue.Queue[str] | None" = None,
    say: Callable[[str], object] = lambda sentence: None,
) -> Counters:
    """Let an arm follow the touches of a source's skin; what the loop did.

    Parameters
    ----------
    url : str or path
        Source, as `smoskin.open_source` takes it.
    design : SkinDesign, optional
        Design of its skin; by default the source's own.
    calibration : path, optional
        File of the skin, as `smoskin.load_estimator` reads it.
    model, site : path and str
        MuJoCo model of the arm, and its site at the skin's middle.
    robot : str, optional
        A real arm that the model is of, ``ur:HOST`` or ``xarm:HOST``; by default the model is
        simulated. It moves only while Enter is held, or the page's button.
    limits : Limits, optional
        What the arm may do.
    port : int, optional
        TCP port of the operator's page, 0 for a free one; no page by default.
    seconds : float, optional
        Time of readings to end after, s.
    realtime : bool
        Whether to run before other programs, as `smoskin.service.apart.realtime.undisturbed`.
    record, force : path and bool
        A new MCAP file for readings, estimates, the calibration's file and the arm; with `force`
        it may replace another. The arm never waits for it: what a disk is too slow for is left out.
    words : queue of str, optional
        What people say, of `WORDS`; nobody arms the arm without.
    say : callable
        Function that is told a sentence whenever something changes.

    Raises
    ------
    ArgumentError
        If no design is known, the robot is none, or the system forbids `realtime`.
    SourceError
        If the source cannot be opened or falls silent, or the robot refuses.
    ModelError
        If the calibration or the arm's model cannot be read or fits no such skin.
    FileError, RecordingError
        If there is such a file already, or it cannot be made; at the end, with the arm at rest, if
        it could not be written whole.
    MissingExtraError
        If the extra ``robot`` is not installed, or, to record, ``recording``.
    """
    if record is not None:
        check_output(record, force=force)
    say(WARNING)
    words = queue.Queue() if words is None else words
    with ExitStack() as stack:
        source = stack.enter_context(open_source(url))
        skin = source.design if design is None else design
        if skin is None:
            raise ArgumentError(f"design must be given: {url} does not name it")
        simulated = SimulatedArm(skin, time.monotonic, model=model, site=site)
        holding = Holding()
        arm = simulated if robot is None else _robot(robot, simulated.chain)
        switch = None if robot is None else holding
        follow = Follow(arm.chain, skin, limits)
        held = switch or (lambda: True)
        driver = stack.enter_context(Driver(arm, follow, on_command=_changes(say), held=held))
        estimator = _estimator(skin, calibration, _poses(source, driver))
        sinks: list[Sink] = [driver]  # first, so that the arm is told and stopped before any other
        if record is not None:
            recordings = Recordings(skin, source, calibration, home=record, waits=False, say=say)
            recordings.begin(record, force=force)
            stack.callback(_tell, recordings, say)
            sinks.append(_Followed(recordings, driver))
        loop = stack.enter_context(Loop(source, estimator, sinks=sinks))
        driver.look()
        if port is not None:
            shown = skin, simulated, driver, follow, words, switch, WARNING, port
            page = stack.enter_context(ArmPage(*shown, _touching(source, robot)))
            say(f"The arm is live at {page.url}")
        stack.enter_context(undisturbed(realtime=realtime))
        driver.start()
        _heed(loop, words, seconds, lambda word: _obey(driver, holding, estimator, word, say))
        return loop.counters


def _heed(
    loop: Loop, words: "queue.Queue[str]", seconds: float | None, obey: Callable[[str], None]
) -> None:
    """Let a loop run until its readings end, the time is over or somebody says so."""
    first: float | None = None
    for estimate in loop:
        first = estimate.time if first is None else first
        for word in _drained(words):
            if word == "quit":
                return
            obey(word)
        if seconds is not None and estimate.time - first >= seconds:
            return


@final
class _Followed(Sink):
    """Recordings of what an arm follows, with the arm as it is looked at last."""

    def __init__(self, recordings: Recordings, driver: Driver) -> None:
        self._recordings, self._driver = recordings, driver

    @property
    def dropped(self) -> int:
        """As of the recordings."""
        return self._recordings.dropped

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Record a reading, its estimate and the arm."""
        self._recordings.write(reading, estimate)
        if self._driver.newest is not None:
            arm, command = self._driver.newest
            self._recordings.write_arm(reading.time, arm.angles, arm.speeds, command.sentence)

    def close(self) -> None:
        """End the recording."""
        self._recordings.close()


def _tell(recordings: Recordings, say: Callable[[str], object]) -> None:
    """End a recording and tell of it; a `RecordingError` if it is not whole."""
    recordings.close()
    say(recordings.sentence)
    if recordings.first_failure:
        raise RecordingError(recordings.first_failure)


def _estimator(
    skin: SkinDesign, calibration: str | os.PathLike[str] | None, pose: Callable[[], Pose]
) -> Estimator:
    """What reads a skin held so, of which the first readings are the zero."""
    known = None if calibration is None else load_estimator(calibration, skin)
    estimator = ZeroFirst(known or ClosedFormEstimator(skin))
    estimator.carried_by(pose)
    return estimator


def _touching(source: Source, robot: str | None) -> Callable[[tuple[Contact, ...]], None] | None:
    """What touches a virtual skin; a mouse may move no real arm."""
    return source.touch if robot is None and isinstance(source, TwinSource) else None


def _poses(source: Source, driver: Driver) -> Callable[[], Pose]:
    """How the skin is held: what virtual and recorded skins read does not hang on the arm."""
    if isinstance(source, TwinSource | ReplaySource):
        lying = Pose(turn=np.eye(3))
        return lambda: lying
    return lambda: driver.pose


def _changes(say: Callable[[str], object]) -> Callable[[Command], None]:
    """A function that tells commands' state and reason whenever they change."""
    last: list[tuple[object, object]] = []

    def tell(command: Command) -> None:
        if last[-1:] != [(command.state, command.reason)]:
            last[:] = [(command.state, command.reason)]
            say(command.sentence)

    return tell


def _robot(name: str, chain: Chain) -> Arm:
    """A real arm by the name of its kind and its address."""
    kinds: dict[str, Callable[[str, Chain], Arm]] = {"ur": UrArm, "xarm": XArm}
    kind, _, host = name.partition(":")
    if kind not in kinds or not host:
        raise ArgumentError(f"robot must be ur:HOST or xarm:HOST; got {name!r}")
    return kinds[kind](host, chain)


def _drained(words: "queue.Queue[str]") -> Iterator[str]:
    """What people have said since."""
    while not words.empty():
        yield words.get().strip().lower()


def _obey(
    driver: Driver,
    holding: Holding,
    estimator: Estimator,
    word: str,
    say: Callable[[str], object],
) -> None:
    """Do what was said, or say why not; a new zero while armed is a fault, for nothing is known."""
    doing = {"arm": driver.arm, "disarm": driver.disarm, "reset": driver.reset, "": holding.sign}
    doing["zero"] = estimator.reset
    if word not in doing:
        say(f"Say one of {', '.join(WORDS)}; got {word!r}")
        return
    try:
        doing[word]()
    except ArgumentError as error:
        say(f"Not done: {error}")
