"""The demonstration: a scripted hand, and the mouse, on the twin, seen through an estimator.

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
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.calibrate import TouchCalibration, TouchStep, calibrate
from smoskin.commands.hand import Hand, JudgedTouch, Touch, scripted_hand
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator, Sink
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.service.loop import Loop
from smoskin.service.page.view import View
from smoskin.service.recorder import Recorder
from smoskin.service.source import TwinSource
from smoskin.twin.creep import Creep
from smoskin.twin.rig import VirtualRig
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

BAYES: Final = "Bayes"
CLOSED_FORM: Final = "closed form"
DEFAULT_TOUCHES: Final = 15
"""Touches of the calibration: five more or less change the errors by less than skins differ."""
_ZEROS: Final = 20
"""Readings of the untouched skin that are its zero."""
_LIFT: Final = 0.5
"""s for which the hand lets go so that a new zero can be taken."""
_SHOWN: Final = 0.25
"""s for which the page shows each touch of the rig."""
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

    Touches met by the mouse, by a new zero or read by another estimator are left out.

    Parameters
    ----------
    design : SkinDesign
    seconds : float, optional
        How long; without it until interrupted, with the hand starting over every minute.
    page : bool
        Whether to serve the live page, on which the mouse presses the skin too.
    port : int
        TCP port of the page; 0 takes a free one.
    rate : float
        Readings a second, Hz.
    seed : int
        Seed of the skin, of all noise and of the hand.
    calibration_touches : int
        Touches that the rig makes.
    table : ResponseTable, optional
        Table of the design; by default the one that comes with the package.
    others : sequence of path
        Files of more estimators to choose from on the page, as `smoskin.load_estimator` reads them.
    record : path, optional
        MCAP file for readings and estimates.
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
    if not 0.0 < rate < math.inf:
        raise ArgumentError(f"rate must be positive and finite; got {rate} Hz")
    script = scripted_hand(design, seconds or 60.0, seed, start=_ZEROS / rate)
    hand = Hand(script, repeat=seconds is None)
    table = load_response_table(design.name) if table is None else table
    makers: dict[str, Callable[[], Estimator]] = {
        os.fspath(path): partial(load_estimator, path, design) for path in others
    }
    with ExitStack() as stack:
        names = (BAYES, CLOSED_FORM, *makers)
        shown = stack.enter_context(_Page(design, hand, port, names)) if page else None
        on_start(None if shown is None else shown.view.url)

        def tell(word: str, sentence: str) -> None:
            say(sentence)
            if shown is not None:
                shown.view.announce(word, sentence)

        tell("Making a skin", "A workshop makes a virtual skin of the whole folded sheet.")
        twin = Twin(design, seed=seed, manufactured=True)
        twin.prepare()
        done = _calibrated(table, twin, seed, calibration_touches, tell, shown)
        readers = Readers(
            {
                BAYES: lambda: BayesEstimator(design, done.table),
                CLOSED_FORM: lambda: ClosedFormEstimator(design, done.table),
                **makers,
            }
        )
        source = TwinSource(twin, rate=rate, creep=Creep(design))
        sinks: list[Sink] = [] if record is None else [Recorder(record, design)]
        if shown is not None:
            shown.view.announce()
            sinks.append(shown)
        loop = stack.enter_context(Loop(source, readers, sinks=sinks))
        end = math.inf if seconds is None else seconds
        located = _play(loop, source, hand, readers, shown, step=1 / rate, end=end, stop=stop)
        after = None if located is None else round(located - begun, 2)
        return _result(hand.judge(), done.used, loop, after)


def _calibrated(
    table: ResponseTable,
    twin: Twin,
    seed: int,
    count: int,
    tell: Callable[[str, str], None],
    shown: "_Page | None",
) -> TouchCalibration:
    """The table of this skin, by a rig's touches in sight of who watches the page."""
    if shown is not None:
        shown.begin(twin)

    def follow(step: TouchStep) -> None:
        tell("Calibrating", f"A rig touches the skin: {step.sentence}.")
        if shown is not None:
            shown.show_touch(step.contact)

    rig = VirtualRig(twin, seed=seed)
    return calibrate(table, rig, design=twin.design, count=count, progress=follow)


def _play(
    loop: Loop,
    source: TwinSource,
    hand: Hand,
    readers: "Readers",
    shown: "_Page | None",
    *,
    step: float,
    end: float,
    stop: threading.Event | None,
) -> float | None:
    """Let the hand touch the skin until the end; the moment in which it was first located."""
    located: float | None = None
    try:
        for estimate in loop:
            if located is None and estimate.status is Status.CONTACT:
                located = time.monotonic()
            if estimate.status is not Status.NOT_CALIBRATED:
                hand.begin(estimate.time)
            hand.note(estimate)
            if readers.name != BAYES:
                hand.spoil(estimate.time)
            if shown is not None:
                shown.serve(estimate.time, loop, readers)
            if estimate.time >= end or (stop is not None and stop.is_set()):
                break
            source.touch(hand.contacts(estimate.time + step))
    except KeyboardInterrupt:
        if end < math.inf:
            raise
    return located


def _result(
    touches: tuple[JudgedTouch, ...], used: int, loop: Loop, after: float | None
) -> DemoResult:
    """The judged touches with their summary."""
    counters = loop.counters
    return DemoResult(
        touches=touches,
        summary=Summary(
            estimator=BayesEstimator.__name__,
            calibration_touches=used,
            touches=len(touches),
            found=sum(touch.found for touch in touches),
            mean_position_error_mm=_mean([touch.position_error_mm for touch in touches]),
            mean_force_error_percent=_mean([touch.force_error_percent for touch in touches]),
            rate_hz=round(counters.rate, 2),
            latency_us_median=round(counters.latency_median * 1e6, 1),
            first_touch_after_s=after,
        ),
    )


def _mean(errors: Sequence[float | None]) -> float | None:
    """Mean of the errors that there are."""
    known = [error for error in errors if error is not None]
    return round(float(np.mean(known)), 3) if known else None


class Readers(Estimator):
    """One of several estimators at a time, each made by its function when it is first chosen.

    The first of the names is chosen at the start.
    """

    def __init__(self, makers: Mapping[str, Callable[[], Estimator]]) -> None:
        self._makers = dict(makers)
        self._made: dict[str, Estimator] = {}
        self._untouched: tuple[Reading, ...] = ()
        self.choose(next(iter(makers)))

    def choose(self, name: str) -> None:
        """Let the estimator of this name read the skin, with the zero of the one before it."""
        if name not in self._made:
            self._made[name] = self._makers[name]()
        self.name = name
        self._current = ZeroFirst(self._made[name], count=_ZEROS)
        self._current.reset()
        if self._untouched:
            self._current.zero(self._untouched)

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._current.drift

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take these readings of the untouched skin as the zero, of whatever reads the skin."""
        self._untouched = tuple(readings)
        self._current.zero(readings)

    def reset(self) -> None:
        """Forget everything; the next good readings are the new zero."""
        self._untouched = ()
        self._current.reset()

    def step(self, reading: Reading) -> Estimate:
        """What the chosen estimator makes of a reading."""
        estimate = self._current.step(reading)
        if estimate.status is Status.NOT_CALIBRATED and len(self._untouched) < _ZEROS:
            self._untouched += (reading,)
        return estimate


class _Page(Sink):
    """The live page as a sink of the loop, with the truth beside the estimate.

    What people ask for on the page waits here until the loop takes it.
    """

    def __init__(self, design: SkinDesign, hand: Hand, port: int, names: Sequence[str]) -> None:
        self._hand = hand
        self._latency = math.nan
        self._served = 0
        self._zero_at = math.inf
        self._twin: Twin
        self._zero_asked = threading.Event()
        self._choices: deque[str] = deque(maxlen=1)
        self._latest: deque[Reading] = deque(maxlen=1000)
        self.view = View(
            design,
            port=port,
            on_press=self._press,
            on_zero=self._zero_asked.set,
            estimators=names,
            on_choose=self._choices.append,
        )

    def begin(self, twin: Twin) -> None:
        """Show this skin, once somebody looks or after some patience."""
        self._twin = twin
        end = time.monotonic() + _PATIENCE
        while not self.view.watched and time.monotonic() < end:
            time.sleep(0.05)
        self._show(())  # the curves begin with the untouched skin

    def show_touch(self, contact: Contact) -> None:
        """Show a touch of the rig for a moment."""
        # The rig reports its own place, which may lie off the rim by its stage's error.
        place = np.clip(contact.position, 0.0, geometry(self._twin.design).extent)
        self._show((Contact(position=place, force=contact.force),))
        time.sleep(_SHOWN)
        self._show(())

    def _show(self, contacts: tuple[Contact, ...]) -> None:
        """Show the skin under these contacts, with no estimate of them, until it is drawn."""
        self.view.write(
            self._twin.read(contacts, time=time.monotonic()),
            truth=contacts,
            vertices=self._twin.sheet_vertices(contacts),
        )
        time.sleep(_SHOWN / 4)

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Show a reading, its estimate and the true touch."""
        self._latest.append(reading)
        truth = self._hand.contacts(reading.time)
        self.view.write(
            reading,
            estimate,
            truth=truth,
            vertices=self._twin.sheet_vertices(truth),
            latency=self._latency,
        )

    def serve(self, now: float, loop: Loop, readers: Readers) -> None:
        """Do what people have asked for on the page; a new zero waits until the hand lets go."""
        self._served += 1
        if self._served % 25 == 0:
            self._latency = loop.counters.latency_median
        if self._choices:
            readers.choose(self._choices.popleft())
            self.view.announce()
        if self._zero_asked.is_set():
            self._zero_asked.clear()
            self._zero_at = now + _LIFT
            self._hand.lift(self._zero_at)
        if now >= self._zero_at:
            latest = [reading for reading in self._latest if reading.time >= now - _LIFT / 2]
            readers.zero(latest)
            self._zero_at = math.inf

    def close(self) -> None:
        """End the page."""
        self.view.close()

    def _press(self, contact: Contact | None) -> None:
        self._hand.mouse = contact
