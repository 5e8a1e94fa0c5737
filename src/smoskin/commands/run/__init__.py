"""Estimates of any source, handed on and on a page: what `smoskin run` does.

Decides with which design a source is read (its own, unless another is given), that the first
readings are the zero, and what is said of it all at the end.
"""

import os
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Final

from smoskin.arrays import Floats
from smoskin.commands.readers import Readers, bound_of, makers_of
from smoskin.commands.recordings import Recordings, can_record
from smoskin.commands.run.lines import Summary
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.hardware.serial import SerialSource
from smoskin.outputs import check_output
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator, Resource, Sink, Source
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.sensing.signals.zero import ZeroTracking
from smoskin.service.bridges.values import number
from smoskin.service.loop import Counters, Loop
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource, open_source
from smoskin.twin.reduced import ReducedTwin

_BACKLOG: Final = 100
"""Readings of a board that may wait to be estimated; then the oldest are dropped, and counted."""
_TELL_EVERY: Final = 25
"""Readings from one look at the zero's drift and the recording to the next."""


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
        replace another. With a page it may be a folder, for the recordings that are begun there;
        they stand beside the file, or else in the working folder, by dated names.
    estimators : sequence of path
        Files of more estimators to choose from on the page.
    view, port : bool and int
        Whether to serve the live page, and its TCP port; 0 takes a free one. The mouse presses a
        virtual skin there. A recording, unless it is recorded anew, is paused, sought in and
        played at other speeds; without `seconds` it stays behind its end. An estimator that is
        chosen there reads it again up to where it is.
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

    _page: "_Page | None" = None
    _recordings: Recordings | None = None

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
        estimators: Sequence[str | os.PathLike[str]] = (),
        view: bool = False,
        port: int = 0,
        say: Callable[[str], object] = lambda sentence: None,
        bridges: Callable[["Watch"], Sequence[Sink]] = lambda watch: (),
    ) -> None:
        if begins := record is not None and not (view and Path(record).is_dir()):
            check_output(record or "", force=force)
        self._seconds, self._chosen = seconds, deque[str](maxlen=1)
        self._zero_asked = threading.Event()
        self._begun, self._shown = set[int](), dict[int, Status]()  # readings, by their numbers
        with ExitStack() as stack:
            source = self._source = stack.enter_context(_opened(str(url), say))
            self._played = source if isinstance(source, ReplaySource) else None
            needed = calibration is None or view or record is not None
            skin = _design_of(self._source, str(url), design, needed=needed)
            options = {"arm": arm, "uncalibrated": uncalibrated}
            if view and skin is not None:
                makers = makers_of(skin, calibration, estimators, shipped=_whole(source), **options)
                self._estimator: Estimator = Readers(makers, zero=zero)
            else:
                self._estimator = _estimator_of(skin, calibration, zero, **options)
            self._seekable = view and record is None and self._played is not None
            # A recording of one that is sought in would hold what nobody did.
            if skin is not None and (begins or (view and not self._seekable and can_record())):
                sink = Recordings(skin, self._source, calibration, home=record, say=say)
                self._recordings = stack.enter_context(sink)
            if view and skin is not None:
                self._page = stack.enter_context(self._page_of(skin, port))
            if begins and self._recordings:
                self._recordings.begin(record, force=force)
            self.design, self.chips = skin, self._source.chips
            own = filter(None, (self._recordings, self._page))
            sinks = (*own, *map(stack.enter_context, bridges(self)))
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
            if self._page is not None and count % _TELL_EVERY == 0:
                self._page.tell(self._estimator.drift)
            if self._seekable:
                self._shown[number] = estimate.status
            yield estimate
            # Not while something touches: it would be the zero.
            if self._zero_asked.is_set() and not touched:
                self._zero_asked.clear()
                self._estimator.reset()
            self._heed_choice()
            if self._seconds is not None and estimate.time - first >= self._seconds:
                return

    def _page_of(self, skin: SkinDesign, port: int) -> "_Page":
        """The live page, on which a recording is sought in unless it is recorded anew."""
        seekable = self._played if self._seekable else None
        if seekable is not None:
            seekable.on_rewind = self._rewind
            seekable.stays = lambda: self._seconds is None
        page = _Page(self, skin, port, self._source, seekable, self._recordings)
        if isinstance(self._estimator, Readers):
            page.show_bound_of(skin, self._estimator.made(self._estimator.name))
        return page

    @property
    def estimators(self) -> tuple[str, ...]:
        """Names of the estimators to choose from, that of the beginning first; with a page only."""
        return self._estimator.names if isinstance(self._estimator, Readers) else ()

    def choose(self, name: str) -> None:
        """Let another of the `estimators` read the skin, by the same zero; from the page's thread.

        What is played is read again by it up to where it is.
        """
        readers = self._estimator
        if not isinstance(readers, Readers) or name not in readers.names:
            raise ArgumentError(f"name must be one of {self.estimators}; got {name!r}")
        made = readers.made(name)
        self._chosen.append(name)
        if self._seekable and self._played is not None:
            self._played.seek(self._played.position)
        if self._page is not None and self.design is not None:
            self._page.show_bound_of(self.design, made)

    def _heed_choice(self) -> None:
        """Read on by the estimator that was chosen."""
        while isinstance(self._estimator, Readers) and self._chosen:
            self._estimator.choose(self._chosen.popleft())

    def _rewind(self) -> None:
        """Begin anew at the first reading of what is played."""
        self._heed_choice()
        self._estimator.reset()

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
    def latest(self) -> float:
        """When the last reading was done with, s of `time.monotonic`; NaN before the first."""
        return self._loop.latest

    @property
    def counters(self) -> Counters:
        """What the loop has done so far."""
        return self._loop.counters

    @property
    def summary(self) -> Summary:
        """What has been read so far; what is shown again on the page counts once."""
        counters, recordings = self._loop.counters, self._recordings
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
            not_recorded=0 if recordings is None else recordings.dropped,
            failure="" if recordings is None else recordings.first_failure,
        )

    @property
    def _damage(self) -> str:
        return "" if self._played is None else self._played.recording.damage


def _whole(source: Source) -> bool:
    """Whether a source is no virtual skin of the reduced model, of which no table was made."""
    return not (isinstance(source, TwinSource) and isinstance(source.twin, ReducedTwin))


def _estimator_of(
    skin: SkinDesign | None,
    calibration: str | os.PathLike[str] | None,
    zero: bool,
    arm: bool,
    uncalibrated: bool,
) -> Estimator:
    """What reads a skin: by its calibration, else as the paper does one that is as designed."""
    estimator: Estimator
    if calibration is None:
        assert skin is not None
        estimator = ClosedFormEstimator(skin, tracking=ZeroTracking(arm=arm))
    else:
        estimator = load_estimator(calibration, skin, arm=arm, uncalibrated=uncalibrated)
    return ZeroFirst(estimator) if zero else estimator


class _Page(Sink):
    """The live page of a source, beside the truth where the skin is virtual."""

    def __init__(
        self,
        watch: Watch,
        design: SkinDesign,
        port: int,
        source: Source,
        player: ReplaySource | None,
        recordings: Recordings | None,
    ) -> None:
        from smoskin.service.apart.page import PageApart
        from smoskin.service.page.view import View

        self._player, self._recordings, self._mapped = player, recordings, False
        self._twin = source if isinstance(source, TwinSource) else None
        # What is played is paused and sought in by the page itself, which keeps that in here.
        self._view = (PageApart if player is None else partial(View, player=player))(
            design,
            port=port,
            on_press=None if self._twin is None else self._press,
            on_zero=watch.ask_zero,
            on_record=None if recordings is None else self._switch,
            estimators=watch.estimators,
            on_choose=watch.choose,
        )
        self.url = self._view.url

    def _press(self, contacts: tuple[Contact, ...]) -> None:
        if self._twin is not None:
            self._twin.touch(contacts)

    def _switch(self, on: bool) -> None:
        if self._recordings is not None:
            self._recordings.switch(on)
            self._view.show_recording(*self._recordings.state)

    def show_bound_of(self, design: SkinDesign, estimator: Estimator) -> None:
        """Offer the map of a table's bound, of the first estimator that has a table."""
        if isinstance(estimator, BayesEstimator) and not self._mapped:
            self._view.show_bound(bound_of(design, estimator.table))
            self._mapped = True

    def tell(self, drift: Floats) -> None:
        """Tell how far the zero has followed, and how the recording is."""
        self._view.show_drift(drift)
        if self._recordings is not None:
            self._view.show_recording(*self._recordings.state)

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
        own_design = source.design
        if own_design is None and needed:
            raise ArgumentError(
                f"design must be given, or a learned model of it: {url!r} does not name it"
            )
        return own_design
    if own is not None:
        design.check_own(f"source {url!r}", own)
    if source.chips != len(design.halls):
        raise ArgumentError(
            f"source must have {len(design.halls)} chips, as design {design.name!r}; "
            f"got {source.chips} from {url!r}"
        )
    return design


def _opened(url: str, say: Callable[[str], object]) -> Source:
    """A source, with a word about what takes long or is damaged.

    Readings of a board are not kept until they are old where estimating is too slow.
    """
    if url.startswith("twin:"):
        say(f"Making the skin of {url}.")
    source = open_source(url)
    if isinstance(source, ReplaySource) and source.recording.damage:
        say(source.recording.damage)
    if isinstance(source, SerialSource):
        source.room = _BACKLOG
    return source
