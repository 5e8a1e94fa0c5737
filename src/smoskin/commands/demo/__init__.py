"""The demonstration: a scripted hand and people's fingers on the twin, seen through an estimator.

The skin is a manufactured one of the whole sheet, unlike its design within a workshop's tolerances.
So a virtual rig first touches it a few times, in sight of who watches the page, and the response
table of its design becomes that of this skin. Then the hand touches it again and again, anywhere,
with and without drag; each touch is judged by what the estimator said while it was held.
"""

import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from smoskin.commands.calibrate import TouchCalibration, TouchStep, calibrate
from smoskin.commands.demo.hand import Hand, JudgedTouch, Touch
from smoskin.commands.readers import ZEROS, Readers, bound_of
from smoskin.commands.recordings import Recordings, can_record
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.outputs import check_output
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator, Sink
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import load_estimator
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.service.loop import Counters, Loop
from smoskin.service.page.view import View
from smoskin.service.source import TwinSource
from smoskin.twin.creep import Creep
from smoskin.twin.hand import scripted_hand
from smoskin.twin.rig import VirtualRig
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

BAYES: Final = "Bayes"
CLOSED_FORM: Final = "closed form"
DEFAULT_TOUCHES: Final = 15
"""Touches of the calibration: five more or less change the errors by less than skins differ."""
_LIFT: Final = 0.5
"""s for which the hand lets go so that a new zero can be taken."""
_TOLD: Final = 4.0
"""s for which a refusal stands on the page."""
_SHOWN: Final = 0.25
"""s for which the page shows each touch of the rig."""
_SLOWEST: Final = 0.01
"""Fewest readings a second, Hz."""
_FASTEST: Final = 10_000.0
"""Most readings a second, Hz; chips give some hundreds."""
_LONGEST: Final = 86_400.0
"""Longest demonstration whose end is set, s."""
_PATIENCE: Final = 5.0
"""s that the rig waits for somebody to open the page."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """The demonstration in a few numbers."""

    estimator: str
    """What read the chips in the judged touches."""
    calibration_touches: int
    """Touches of the rig that it rests on."""
    touches: int
    """Touches of the hand that were read while they were held."""
    unread: int
    """Touches of the hand in which a machine too busy for it read nothing."""
    found: int
    mean_position_error_mm: float | None
    mean_force_error_percent: float | None
    """Mean error of the force vector, relative to the true force."""
    rate_hz: float
    latency_us_median: float
    first_touch_after_s: float | None
    """Time from the start of the demonstration until the hand's first touch was located."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoResult:
    """What the demonstration showed."""

    touches: tuple[JudgedTouch, ...]
    summary: Summary

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines: ``{"touches": [...], "summary": {...}}``."""
        return asdict(self)

    def tables(self) -> "list[Table]":
        """Every touch beside its estimate."""
        from rich.table import Table

        table = Table(title="Touches of the hand")
        for heading in ("true x, y (mm)", "estimated", "true Fx, Fy, Fz (N)", "estimated", "off"):
            table.add_column(heading, justify="right")
        for touch in self.touches:
            place, force = _words(touch.true)
            if touch.estimated is None:
                table.add_row(place, touch.status, force, "", "", style="red")
                continue
            seen, felt = _words(touch.estimated)
            off = f"{touch.position_error_mm:.1f} mm, {touch.force_error_percent:.1f} %"
            table.add_row(place, seen, force, felt, off, style="" if touch.found else "red")
        return [table]


def _words(touch: Touch) -> tuple[str, str]:
    """Place and force of a touch."""
    return (
        f"{touch.x_mm:.1f}, {touch.y_mm:.1f}",
        f"{touch.fx_N:.2f}, {touch.fy_N:.2f}, {touch.fz_N:.2f}",
    )


def run_demo(
    design: SkinDesign,
    *,
    seconds: float | None = None,
    page: bool = True,
    port: int = 0,
    rate: float = 100.0,
    seed: int = 0,
    calibration_touches: int = DEFAULT_TOUCHES,
    table: ResponseTable | None = None,
    others: Sequence[str | os.PathLike[str]] = (),
    record: str | os.PathLike[str] | None = None,
    on_start: Callable[[str | None], None] = lambda url: None,
    say: Callable[[str], None] = lambda sentence: None,
    stop: threading.Event | None = None,
) -> DemoResult:
    """Run the demonstration and judge every touch that the hand finished.

    Touches met by people's fingers, by a new zero or read by another estimator are left out.

    Parameters
    ----------
    design : SkinDesign
    seconds : float, optional
        Duration; without it until interrupted, with the hand starting over every minute.
    page, port : bool and int
        Whether to serve the live page, on which people press the skin too, and its TCP port;
        0 takes a free one.
    rate, seed : float and int
        Readings a second, Hz; seed of the skin, of all noise and of the hand.
    calibration_touches : int
        Touches that the rig makes.
    table : ResponseTable, optional
        Table of the design; by default the one that comes with the package.
    others, record : sequence of path and path
        Files of more estimators to choose from on the page, as `smoskin.load_estimator` reads them;
        and a new MCAP file for readings and estimates. What the page's button records stands beside
        it, or else in the working folder, by dated names.
    on_start, say : callable
        Functions called once with the page's address, or None without a page; and with a sentence
        before each step that takes time.
    stop : threading.Event, optional
        Ends the demonstration when it is set.

    Raises
    ------
    ArgumentError
        If a number is out of its range or the port is in use.
    ModelError
        If no table comes with the package and none is given, or a file cannot be read.
    MissingExtraError
        If the extra ``demo`` is not installed.
    """
    begun = time.monotonic()
    if not _SLOWEST <= rate <= _FASTEST:
        raise ArgumentError(f"rate must be {_SLOWEST:g} to {_FASTEST:g} Hz; got {rate}")
    if record is not None:
        check_output(record)
    if seconds is not None and not seconds <= _LONGEST:
        raise ArgumentError(f"seconds must be at most {_LONGEST:g}; got {seconds}")
    script = scripted_hand(design, seconds or 60.0, seed, start=ZEROS / rate)
    stage = _Stage(Hand(script, repeat=seconds is None), say)
    table = load_response_table(design.name) if table is None else table
    makers: dict[str, Callable[[], Estimator]] = {
        BAYES: lambda: BayesEstimator(design, done.table),
        CLOSED_FORM: lambda: ClosedFormEstimator(design, done.table),
        **{os.fspath(path): partial(load_estimator, path, design) for path in others},
    }
    with ExitStack() as stack:
        stack.enter_context(stage)
        on_start(stage.open(design, port, tuple(makers)) if page else None)
        stage.make_skin(design, seed)
        done = stage.calibrated(table, seed, calibration_touches)
        source = TwinSource(stage.twin, rate=rate, creep=Creep(design))
        readers = Readers(makers)
        loop = stack.enter_context(Loop(source, readers, sinks=stage.sinks(record, design, source)))
        located: float | None = None
        # Whoever stops the demonstration, by a signal too, gets what it has shown so far.
        with suppress(KeyboardInterrupt):
            for estimate in loop:
                if located is None and estimate.status is Status.CONTACT:
                    located = round(time.monotonic() - begun, 2)
                stage.follow(estimate, loop, readers)
                if (seconds is not None and estimate.time >= seconds) or (stop and stop.is_set()):
                    break
                source.touch(stage.press(estimate.time + 1 / rate))
        return _result(stage.hand.judge(), done.used, loop.counters, located)


def _result(
    touches: tuple[JudgedTouch, ...], used: int, counters: Counters, located: float | None
) -> DemoResult:
    """The judged touches with their summary."""
    read = sum(touch.was_read for touch in touches)
    return DemoResult(
        touches=touches,
        summary=Summary(
            estimator=BayesEstimator.__name__,
            calibration_touches=used,
            touches=read,
            unread=len(touches) - read,
            found=sum(touch.found for touch in touches),
            mean_position_error_mm=_mean([touch.position_error_mm for touch in touches]),
            mean_force_error_percent=_mean([touch.force_error_percent for touch in touches]),
            rate_hz=round(counters.rate, 2),
            latency_us_median=round(counters.latency_median * 1e6, 1),
            first_touch_after_s=located,
        ),
    )


def _farewell(touches: Sequence[JudgedTouch]) -> str:
    """The last sentence of the page."""
    read = sum(touch.was_read for touch in touches)
    if not read:
        return "The demonstration is over."
    error = _mean([touch.position_error_mm for touch in touches])
    off = "" if error is None else f", {error:.1f} mm"
    many = "1 touch" if read == 1 else f"{read} touches"
    return f"The demonstration is over: {many}{off}."


def _mean(errors: Sequence[float | None]) -> float | None:
    """Mean of the errors that there are."""
    known = [error for error in errors if error is not None]
    return round(float(np.mean(known)), 3) if known else None


class _Stage(Sink):
    """The skin and the hand, in sight of whoever watches the live page where there is one.

    What people ask for on the page waits here until the loop has gone round.
    """

    twin: Twin

    def __init__(self, hand: Hand, say: Callable[[str], None]) -> None:
        self.hand = hand
        self._say = say
        self._view: View | None = None
        self._latency = math.nan
        self._rounds = 0
        self._zero_at = math.inf
        self._asked: deque[str] = deque()
        self._choices: deque[str] = deque(maxlen=1)
        self._pressed: deque[tuple[float, tuple[Contact, ...]]] = deque(maxlen=100)
        self._told_until = math.inf
        self._recordings: Recordings | None = None
        self._latest: deque[Reading] = deque(maxlen=1000)

    def open(self, design: SkinDesign, port: int, names: Sequence[str]) -> str:
        """Serve the page, with these estimators to choose from; its address."""
        self._view = View(
            design,
            port=port,
            on_press=self._press,
            on_still=self._hold_still,
            on_zero=partial(self._asked.append, "zero"),
            on_undo=partial(self._asked.append, "undo"),
            on_record=self._switch if can_record() else None,
            estimators=names,
            on_choose=self._choices.append,
        )
        return self._view.url

    def tell(self, word: str = "", sentence: str = "") -> None:
        """Say what is being done, or, on the page, what is estimated again."""
        if word:
            self._say(sentence)
        if self._view is not None:
            self._view.announce(word, sentence)

    def make_skin(self, design: SkinDesign, seed: int) -> None:
        """Make the skin that is touched."""
        self.tell("Making a skin", "A workshop makes a virtual skin of the whole folded sheet.")
        self.twin = Twin(design, seed=seed, manufactured=True)
        self.twin.prepare()

    def calibrated(self, table: ResponseTable, seed: int, count: int) -> TouchCalibration:
        """The table of this skin, by a rig's touches in sight of who watches the page."""
        end = time.monotonic() + _PATIENCE
        while self._view is not None and not self._view.watched and time.monotonic() < end:
            time.sleep(0.05)
        self._show(())  # the curves begin with the untouched skin
        extent = geometry(self.twin.design).extent

        def follow(step: TouchStep) -> None:
            self.tell("Calibrating", f"A rig touches the skin: {step.sentence}.")
            # The rig reports its own place, which may lie off the rim by its stage's error.
            place = np.clip(step.contact.position, 0.0, extent)
            self._show((Contact(position=place, force=step.contact.force),), _SHOWN)
            self._show(())

        rig = VirtualRig(self.twin, seed=seed)
        done = calibrate(table, rig, design=self.twin.design, count=count, progress=follow)
        if self._view is not None:
            self._view.show_bound(bound_of(self.twin.design, done.table))
        self.tell()
        return done

    def _show(self, contacts: tuple[Contact, ...], seconds: float = 0.0) -> None:
        """Show the skin under these contacts, with no estimate of them, until it is drawn."""
        if self._view is not None:
            reading = self.twin.read(contacts, time=time.monotonic())
            vertices = self.twin.sheet_vertices(contacts)
            self._view.write(reading, truth=contacts, vertices=vertices)
            time.sleep(_SHOWN / 4 + seconds)

    def sinks(
        self, record: str | os.PathLike[str] | None, design: SkinDesign, source: TwinSource
    ) -> list[Sink]:
        """The page, and before it what records, into this file or when somebody wants it."""
        if record is None and (self._view is None or not can_record()):
            return [self]
        self._recordings = Recordings(design, source, home=record, say=self._say)
        if record is not None:
            self._recordings.begin(record)
        return [self._recordings, self]

    def press(self, time: float) -> tuple[Contact, ...]:
        """What touches the skin from this time on."""
        contacts = self.hand.contacts(time)
        self._pressed.appendleft((time, contacts))
        return contacts

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Show a reading, its estimate and the true touch."""
        if self._view is not None:
            self._latest.append(reading)
            earlier = (touch for time, touch in self._pressed if time <= reading.time + 1e-6)
            truth = next(earlier, ())
            vertices = self.twin.sheet_vertices(truth)
            self._view.write(
                reading, estimate, truth=truth, vertices=vertices, latency=self._latency
            )

    def follow(self, estimate: Estimate, loop: Loop, readers: Readers) -> None:
        """Keep what is estimated of the hand's touches, and do what people have asked for.

        The hand begins once there is a zero; a new zero waits until the hand has let go.
        """
        now = estimate.time
        if estimate.status is not Status.NOT_CALIBRATED:
            self.hand.begin(now)
        self.hand.note(estimate)
        if readers.name != BAYES:
            self.hand.spoil(now)
        self._rounds += 1
        if self._view is not None and self._rounds % 25 == 0:
            self._latency = loop.counters.latency_median
            self._view.show_drift(readers.drift)
            self._tell_recording()
        if self._choices:
            readers.choose(self._choices.popleft())
            self.tell()
        if now >= self._told_until:
            self._told_until = math.inf
            self.tell()
        while self._asked:
            self._zero_or_undo(self._asked.popleft(), now, readers)
        if now >= self._zero_at:
            latest = [reading for reading in self._latest if reading.time >= now - _LIFT / 2]
            self._zero_at = math.inf
            try:
                readers.zero(latest)
            except ArgumentError as error:
                self._refuse("Let go first", str(error), now)

    def _zero_or_undo(self, what: str, now: float, readers: Readers) -> None:
        """Let the hand go for a new zero, which people must do too; or go back to the last one."""
        if what == "undo":
            try:
                readers.unzero()
            except ArgumentError as error:
                self._refuse("Nothing to undo", str(error), now)
        elif self.hand.fingers or self.hand.still:
            self._refuse(
                "Let go first", "the skin is touched; a zero is that of the untouched skin", now
            )
        else:
            self._zero_at = now + _LIFT
            self.hand.lift(self._zero_at)

    def _refuse(self, word: str, reason: str, now: float) -> None:
        """Say for a while why the zero stays as it is."""
        self.tell(word, f"{reason[0].upper()}{reason[1:].rstrip('.')}.")
        self._told_until = now + _TOLD

    def close(self) -> None:
        """End the page, with a last sentence."""
        if self._view is not None:
            self._view.end(_farewell(self.hand.judge()))
            self._view.close()

    def _press(self, contacts: tuple[Contact, ...]) -> None:
        self.hand.fingers = contacts

    def _hold_still(self, still: bool) -> None:
        self.hand.still = still

    def _switch(self, on: bool) -> None:
        if self._recordings is not None:  # there is no reading before the rig is done
            self._recordings.switch(on)
            self._tell_recording()

    def _tell_recording(self) -> None:
        """Tell on the page how the recording is."""
        if self._view is not None and self._recordings is not None:
            self._view.show_recording(*self._recordings.state)
