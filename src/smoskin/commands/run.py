"""Estimates of any source, as lines and on a page: what `smoskin run` does.

Decides with which design a source is read (its own, unless another is given), that the first
readings are the zero, and what is said of it all at the end.
"""

import json
import math
import os
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from smoskin.arrays import Floats
from smoskin.commands.readers import bound_of
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.hardware.serial import SerialSource
from smoskin.outputs import check_output, read_input
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator, Resource, Sink, Source
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.sensing.signals.zero import ZeroTracking
from smoskin.service.bridges.values import estimate_values, number
from smoskin.service.loop import Aside, Counters, Loop
from smoskin.service.page.carpet import Bound
from smoskin.service.recorder import Recorder
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource, open_source

_ATTACHED: Final = 1 << 28
"""Bytes of a calibration that a recording takes along, at most."""
_BACKLOG: Final = 100
"""Readings of a board that may wait to be estimated; then the oldest are dropped, and counted."""
_PATIENCE: Final = 10.0
"""s that a recording of what can wait waits for the disk."""
_DRIFT_EVERY: Final = 25
"""Readings from one look at the zero's drift to the next."""
_TOLD: Final = ("corrupt", "repeated", "late", "dropped", "restarts", "reconnections")
"""Counters of a line that a summary tells where they are not 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What was read, in a few numbers."""

    readings: int
    rate_hz: float | None
    """Rate of the last thousand readings."""
    latency_ms_median: float | None
    latency_ms_p99: float | None
    """Time from a reading's arrival until it is estimated and recorded."""
    statuses: dict[str, int]
    """Estimates of each status that occurred."""
    touches: int
    """How often an untouched skin became a touched one."""
    skipped: int
    """Readings that the source left out because nobody asked in time."""
    lost: int
    """Readings that are missing from the recording that was played, or on a board's line."""
    damage: str
    """Sentence about that recording's damage; empty where it is whole."""
    line: dict[str, int]
    """Counters of a board's serial line (`LineCounters`); empty for any other source."""
    not_recorded: int
    """Readings that could not be written."""
    failure: str
    """Sentence about why; empty where all could be."""

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines."""
        return asdict(self)

    def __str__(self) -> str:
        statuses = ", ".join(f"{count} {name}" for name, count in self.statuses.items())
        parts = [
            f"{self.readings} readings" + (f": {statuses}" if statuses else ""),
            f"{self.touches} touches",
            f"{self.rate_hz:.0f} Hz" if self.rate_hz else "",
            f"estimated in {self.latency_ms_median:.2f} ms, 99 % in {self.latency_ms_p99:.2f} ms"
            if self.latency_ms_median is not None and self.latency_ms_p99 is not None
            else "",
            f"{self.skipped} skipped" if self.skipped else "",
            f"{self.lost} lost" if self.lost else "",
            *(f"{count} {name}" for name, count in self.line.items() if name in _TOLD and count),
            f"{self.not_recorded} not recorded" if self.not_recorded else "",
        ]
        return "; ".join(filter(None, parts)) + "."


class Watch(Resource):
    """A source and what is estimated of its readings; iterate for the estimates.

    Parameters
    ----------
    url : str or path
        The source, as `smoskin.open_source` takes it.
    design : SkinDesign, optional
        Design of the skin that the source reads; by default the source's own.
    calibration : path, optional
        File of this skin, as `smoskin.load_estimator` reads it, or it is taken to be as designed.
    arm : bool
        Whether an arm turns the skin, as `smoskin.load_estimator` takes it.
    uncalibrated : bool
        Whether the table of a design will do, as `smoskin.load_estimator` takes it.
    zero : bool
        Whether the first 20 good readings are the zero: nothing may touch the skin in them, and
        they are answered by `Status.NOT_CALIBRATED`.
    seconds : float, optional
        Time after the first reading to stop at, s, on the readings' clock.
    record, force : path and bool
        A new MCAP file for readings, estimates and the calibration's file; with `force` it may
        replace another.
    view, port : bool and int
        Whether to serve the live page, and its TCP port; 0 takes a free one. The mouse presses a
        virtual skin there. A recording, unless it is recorded anew, is paused, sought in and
        played at other speeds; without `seconds` it stays behind its end.
    say : callable
        Called with sentences about what is going on.
    bridges : callable
        Function of this watch, when its `design` and `chips` are known, that gives further sinks.

    Raises
    ------
    ArgumentError
        If the source has another number of chips than the design, or the port is taken.
    DesignError
        If no design is given and the source's is neither in it nor comes with the package.
    FileError
        If the recording cannot be written.
    ModelError
        If the source or the calibration belongs to another design, or the latter cannot be read.
    SourceError
        If the source cannot be opened; in iterating, if it falls silent.
    """

    _page: "_Page | None"
    _recorder: Recorder | None
    _recording: Aside | None

    def __init__(
        self,
        url: str | os.PathLike[str],
        design: SkinDesign | None = None,
        *,
        calibration: str | os.PathLike[str] | None = None,
        arm: bool = False,
        uncalibrated: bool = False,
        zero: bool = True,
        seconds: float | None = None,
        record: str | os.PathLike[str] | None = None,
        force: bool = False,
        view: bool = False,
        port: int = 0,
        say: Callable[[str], object] = lambda sentence: None,
        bridges: Callable[["Watch"], Sequence[Sink]] = lambda watch: (),
    ) -> None:
        if record is not None:
            check_output(record, force=force)
        self._seconds = seconds
        self._zero_asked = threading.Event()
        self._begun, self._shown = set[int](), dict[int, Status]()  # readings, by their numbers
        with ExitStack() as stack:
            if str(url).startswith("twin:"):
                say(f"Making the skin of {url}.")
            self._source = stack.enter_context(_live(open_source(url)))
            self._played = self._source if isinstance(self._source, ReplaySource) else None
            if self._damage:
                say(self._damage)
            needed = calibration is None or view or record is not None
            skin = _design_of(self._source, str(url), design, needed=needed)
            estimator = _estimator_of(skin, calibration, arm, uncalibrated)
            self._estimator = ZeroFirst(estimator) if zero else estimator
            self._page = self._recorder = self._recording = None
            self._seekable = view and record is None and self._played is not None
            if view and skin is not None:
                self._page = stack.enter_context(self._page_of(skin, port, estimator))
            if record is not None and skin is not None:
                self._recorder = _recorder_of(record, skin, self._source, calibration, say)
                self._recording = stack.enter_context(_aside(self._recorder, self._source))
            self.design, self.chips = skin, self._source.chips
            own = (sink for sink in (self._recording, self._page) if sink is not None)
            sinks = *own, *map(stack.enter_context, bridges(self))
            self._loop = stack.enter_context(Loop(self._source, self._estimator, sinks=sinks))
            stack.pop_all()
        if self._page is not None:
            say(f"The skin is live at {self._page.url}")

    def __iter__(self) -> Iterator[Estimate]:
        """Estimates, one for each reading, until the source ends or the time is over."""
        first: float | None = None
        touched, began = False, 0
        for count, estimate in enumerate(self._loop):
            number = count if self._played is None else self._played.number
            began = began if touched else number
            touched = bool(estimate.contacts)
            if self._played is not None and self._played.goal is not None:
                continue  # what is sought lies ahead
            first = estimate.time if first is None else first
            if touched:
                self._begun.add(began)
            if self._page is not None and count % _DRIFT_EVERY == 0:
                self._page.show_drift(self._estimator.drift)
            if self._seekable:
                self._shown[number] = estimate.status
            yield estimate
            # Not while something touches: it would be the zero.
            if self._zero_asked.is_set() and not touched:
                self._zero_asked.clear()
                self._estimator.reset()
            if self._seconds is not None and estimate.time - first >= self._seconds:
                return

    def _page_of(self, skin: SkinDesign, port: int, estimator: Estimator) -> "_Page":
        """The live page, with the map of a table's bound.

        A recording is sought in there unless it is recorded anew.
        """
        # A recording of one that is sought in would hold what nobody did.
        seekable = self._played if self._seekable else None
        if seekable is not None:
            seekable.on_rewind = self._estimator.reset
            seekable.stays = lambda: self._seconds is None
        page = _Page(skin, port, self._source, seekable, self.ask_zero)
        if isinstance(estimator, BayesEstimator):
            page.show_bound(bound_of(skin, estimator.table))
        return page

    def ask_zero(self) -> None:
        """Take the next readings of the untouched skin as its zero; from any thread."""
        self._zero_asked.set()

    def stop(self) -> None:
        """End the source, from any thread; iterating ends soon after."""
        self._loop.stop()

    def close(self) -> None:
        """End source, page and recording."""
        self._loop.close()

    @property
    def url(self) -> str | None:
        """Address of the page, if there is one."""
        return None if self._page is None else self._page.url

    @property
    def counters(self) -> Counters:
        """What the loop has done so far."""
        return self._loop.counters

    @property
    def summary(self) -> Summary:
        """What has been read so far; what is shown again on the page counts once."""
        counters, recording = self._loop.counters, self._recording
        statuses = Counter(self._shown.values()) if self._seekable else counters.statuses
        played = None if self._played is None else self._played.recording
        line = asdict(self._source.counters) if isinstance(self._source, SerialSource) else {}
        return Summary(
            readings=sum(statuses.values()),
            rate_hz=number(counters.rate, 2),
            latency_ms_median=number(counters.latency_median * 1e3, 3),
            latency_ms_p99=number(counters.latency_p99 * 1e3, 3),
            statuses={status.name: n for status in Status if (n := statuses[status])},
            touches=len(self._begun),
            skipped=self._source.missed if isinstance(self._source, TwinSource) else 0,
            lost=line.get("lost", 0) if played is None else played.lost_readings,
            line=line,
            damage=self._damage,
            not_recorded=0 if recording is None else recording.dropped,
            failure="" if self._recorder is None else self._recorder.failure,
        )

    @property
    def _damage(self) -> str:
        return "" if self._played is None else self._played.recording.damage


def _estimator_of(
    skin: SkinDesign | None,
    calibration: str | os.PathLike[str] | None,
    arm: bool,
    uncalibrated: bool,
) -> Estimator:
    """What reads a skin: by its calibration, else as the paper does one that is as designed."""
    if calibration is None and skin is not None:
        return ClosedFormEstimator(skin, tracking=ZeroTracking(arm=arm))
    assert calibration is not None
    return load_estimator(calibration, skin, arm=arm, uncalibrated=uncalibrated)


class _Page(Sink):
    """The live page of a source, beside the truth where the skin is virtual."""

    def __init__(
        self,
        design: SkinDesign,
        port: int,
        source: Source,
        player: ReplaySource | None,
        on_zero: Callable[[], None],
    ) -> None:
        from smoskin.service.page.view import View

        self._player = player
        self._twin = source if isinstance(source, TwinSource) else None
        self._view = View(
            design,
            port=port,
            on_press=None if self._twin is None else self._press,
            on_zero=on_zero,
            player=player,
        )
        self.url = self._view.url

    def _press(self, contacts: tuple[Contact, ...]) -> None:
        if self._twin is not None:
            self._twin.touch(contacts)

    def show_bound(self, bound: Bound) -> None:
        """Offer a heat map of how finely touches can be placed."""
        self._view.show_bound(bound)

    def show_drift(self, drift: Floats) -> None:
        """Tell how far the zero has followed."""
        self._view.show_drift(drift)

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Show a reading, its estimate and, of a virtual skin, the true touch."""
        if self._player is not None and self._player.goal is not None:
            return
        if self._twin is None:
            self._view.write(reading, estimate)
            return
        truth = self._twin.contacts
        vertices = self._twin.twin.sheet_vertices(truth)
        self._view.write(reading, estimate, truth=truth, vertices=vertices)

    def close(self) -> None:
        """End the page."""
        self._view.close()


def _design_of(
    source: Source, url: str, design: SkinDesign | None, *, needed: bool
) -> SkinDesign | None:
    """The given design, which must be the source's, or the source's own, which a board may lack."""
    own = source.design_hash
    if design is None:
        found = source.design
        if found is None and needed:
            raise ArgumentError(
                f"design must be given, or a learned model of it: {url!r} does not name it"
            )
        return found
    if own is not None:
        design.check_own(f"source {url!r}", own)
    if source.chips != len(design.halls):
        raise ArgumentError(
            f"source must have {len(design.halls)} chips, as design {design.name!r}; "
            f"got {source.chips} from {url!r}"
        )
    return design


def _make_room(record: str | os.PathLike[str], source: Source) -> None:
    """Remove the recording that a new one replaces, unless it is the one that is played."""
    if not os.path.exists(record):
        return
    if isinstance(source, ReplaySource) and os.path.samefile(record, source.recording.path):
        raise ArgumentError(
            f"record must be another file than the one that is played; got {record}"
        )
    os.unlink(record)


def _live(source: Source) -> Source:
    """A source whose readings are not kept until they are old where estimating is too slow."""
    if isinstance(source, SerialSource):
        source.room = _BACKLOG
    return source


def _recorder_of(
    record: str | os.PathLike[str],
    skin: SkinDesign,
    source: Source,
    calibration: str | os.PathLike[str] | None,
    say: Callable[[str], object],
) -> Recorder:
    """A recorder of a skin into a new file, which may replace another than the one played."""
    _make_room(record, source)
    return Recorder(record, skin, attachments=_files(calibration), on_failure=say)


def _aside(recorder: Recorder, source: Source) -> Aside:
    """A recorder that holds up no chips; what is played or simulated can wait for a disk."""
    waits = isinstance(source, ReplaySource | TwinSource)
    return Aside(recorder, patience=_PATIENCE if waits else 0.0)


def _files(calibration: str | os.PathLike[str] | None) -> dict[str, bytes]:
    """What a recording takes along beside the design: the calibration, by its file's name."""
    if calibration is None:
        return {}
    return {Path(calibration).name: read_input(calibration, _ATTACHED)}


def thinned(
    estimates: Iterator[Estimate], *, every: float | None = None, changes: bool = False
) -> Iterator[tuple[Estimate, bool]]:
    """Estimates, and whether each is worth a line.

    With neither option all are; with `every` one in so many seconds is, with `changes` one whose
    status or number of touches differs from the one before.
    """
    due = -math.inf
    before: tuple[Status, int] | None = None
    for estimate in estimates:
        state = estimate.status, len(estimate.contacts)
        # A clock that was set back counts from there.
        late = every is not None and not due - every <= estimate.time < due
        if late:
            due = estimate.time + (every or 0.0)
        yield estimate, late or (changes and state != before) or (every is None and not changes)
        before = state


def estimate_line(estimate: Estimate, *, as_json: bool) -> str:
    """One estimate as a line of text, or of JSON, in millimetres and newtons."""
    values = estimate_values(estimate)
    if as_json:
        return json.dumps(values)
    places = "".join(
        f"  x {touch['x_mm']:6.1f} mm  y {touch['y_mm']:6.1f} mm  "
        "F ({:+.3f}, {:+.3f}, {:+.3f}) N".format(*touch["force_N"])
        for touch in values["contacts"]
    )
    return f"{estimate.time:10.3f} s  {estimate.status.name:<14}{places}"
