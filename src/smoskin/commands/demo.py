"""The demonstration: a scripted hand, and the mouse, on the twin, seen through the estimator.

The skin is a manufactured one of the whole sheet, which theory's signs and ratios do not fit. So
it is first measured on a virtual bench, as a real one would be. Then the hand touches it again and
again, anywhere round the top vertices and with and without drag; each touch is judged by what the
estimator said while it was held.
"""

import math
import os
import threading
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Sink
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.closed_form.table_fit import fit_press_table
from smoskin.service.loop import Loop
from smoskin.service.page.scene import SkinShape
from smoskin.service.page.view import View
from smoskin.service.recorder import Recorder
from smoskin.service.source import TwinSource
from smoskin.twin.bench import TwinSkin, measure, table_loads
from smoskin.twin.whole import Twin

_PERIOD: Final = 0.8
_RAMP: Final = 0.15
_FIRST: Final = 0.2
_HOLD: Final = 0.35
"""s: a touch starts every period, rises and falls in a ramp, and is held between."""
_PRESS: Final = (0.2, 0.6)
_DRAG: Final = (0.1, 0.3)
"""N: of the scripted touches, as light as a hand's that explores."""
_OFF_VERTEX: Final = 0.2
"""Share of a cell by which a scripted touch may lie off the top vertex, each way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One side of a judged touch, in the units people read."""

    x_mm: float
    y_mm: float
    fx_N: float
    fy_N: float
    fz_N: float

    @classmethod
    def of(cls, contact: Contact) -> "Touch":
        """A contact in millimetres and newtons."""
        (x, y), force = contact.position * 1e3, contact.force
        return cls(
            **{
                name: round(float(value), 4) + 0.0  # no negative zero
                for name, value in zip(
                    ("x_mm", "y_mm", "fx_N", "fy_N", "fz_N"), (x, y, *force), strict=True
                )
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedTouch:
    """A scripted touch beside what the estimator said of it."""

    true: Touch
    estimated: Touch | None
    """The median over the hold; None where no contact was reported for most of it."""
    status: str
    """The commonest status while it was held; NO_READING where nothing was read then."""
    found: bool
    """Whether the estimate names the cell that was touched."""
    position_error_mm: float | None
    force_error_percent: float | None
    """Of the force vector, relative to the true force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """The demonstration in six numbers."""

    touches: int
    found: int
    mean_position_error_mm: float | None
    mean_force_error_percent: float | None
    rate_hz: float
    latency_us_median: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoResult:
    """What the demonstration showed."""

    touches: tuple[JudgedTouch, ...]
    summary: Summary

    def as_json(self) -> dict[str, object]:
        """Plain values for machines: ``{"touches": [...], "summary": {...}}``."""
        return {
            "touches": [asdict(touch) for touch in self.touches],
            "summary": asdict(self.summary),
        }


def scripted_hand(design: SkinDesign, seconds: float, seed: int) -> tuple[Contact, ...]:
    """As many touches as fit into so many seconds, spread over the whole skin.

    Every other touch drags as well; the first presses straight.

    Raises
    ------
    ArgumentError
        If not even one touch fits.
    """
    count = math.floor((seconds - _FIRST) / _PERIOD)
    if count < 1:
        raise ArgumentError(f"seconds must be at least {_FIRST + _PERIOD:g}; got {seconds:g}")
    rng = np.random.default_rng(seed)
    places = geometry(design).tops.reshape(-1, 2)
    extent = geometry(design).cell
    rounds = [rng.permutation(places) for _ in range(-(-count // len(places)))]
    touches = []
    for k, place in enumerate(np.concatenate(rounds)[:count]):
        off = rng.uniform(-_OFF_VERTEX, _OFF_VERTEX, 2) * (extent.length, extent.width)
        press, drag, way = rng.uniform(*_PRESS), rng.uniform(*_DRAG), rng.uniform(0, math.tau)
        drag *= k % 2
        touches.append(
            Contact(
                position=place + off,
                force=(drag * math.cos(way), drag * math.sin(way), -press),
            )
        )
    return tuple(touches)


def run_demo(
    design: SkinDesign,
    *,
    seconds: float | None = None,
    page: bool = True,
    port: int = 0,
    rate: float = 100.0,
    seed: int = 0,
    record: str | os.PathLike[str] | None = None,
    on_start: Callable[[str | None], None] = lambda url: None,
    say: Callable[[str], None] = lambda sentence: None,
) -> DemoResult:
    """Run the demonstration and judge every touch of the hand.

    Parameters
    ----------
    design : SkinDesign
    seconds : float, optional
        How long; without it until interrupted, with the hand starting over every minute.
    page : bool
        Serve the live page, on which the mouse presses the skin too.
    port : int
        Of the page; 0 takes a free one.
    rate : float
        Hz, of the readings.
    seed : int
        Of the skin, of all noise and of the hand.
    record : path, optional
        Write everything to this MCAP file.
    on_start : callable
        Called once with the page's address, or None without a page.
    say : callable
        Called with a sentence before each step that takes seconds.

    Returns
    -------
    DemoResult
        Of the touches that the hand finished; those met by the mouse are left out.

    Raises
    ------
    MissingExtraError
        If the extra ``twin`` or, with a page, ``view`` is not installed.
    """
    script = scripted_hand(design, seconds or 60.0, seed)
    say("Making a virtual skin of the whole folded sheet.")
    twin = Twin(design, seed=seed, manufactured=True)
    measured = sum(load.cell is not None for load in table_loads(design))
    say(f"Calibrating it on a virtual bench: {measured} touches, on every cell.")
    calibration = _calibrated(twin, np.random.default_rng(seed))
    source = TwinSource(twin, rate=rate)
    estimator = ClosedFormEstimator(design, calibration)
    hand = _Hand(script, repeat=seconds is None)
    with ExitStack() as stack:
        sinks: list[Sink] = []
        if record is not None:
            sinks.append(Recorder(record, design))
        show = _Page(design, twin, hand, port) if page else None
        if show is not None:
            sinks.append(show)
        loop = stack.enter_context(Loop(source, estimator, sinks=sinks))
        on_start(show.url if show is not None else None)
        try:
            for number, estimate in enumerate(loop):
                hand.note(estimate)
                if show is not None and number % 25 == 0:
                    show.latency = loop.counters.latency_median
                if show is not None and show.zero_asked.is_set():
                    show.zero_asked.clear()
                    estimator.zero(tuple(show.latest))
                if seconds is not None and estimate.time >= seconds:
                    break
                source.touch(hand.contacts(estimate.time + 1 / rate))
        except KeyboardInterrupt:
            if seconds is not None:
                raise
        counters = loop.counters
    touches = hand.judge(design)
    return DemoResult(
        touches=touches,
        summary=Summary(
            touches=len(touches),
            found=sum(touch.found for touch in touches),
            mean_position_error_mm=_mean([touch.position_error_mm for touch in touches]),
            mean_force_error_percent=_mean([touch.force_error_percent for touch in touches]),
            rate_hz=round(counters.rate, 2),
            latency_us_median=round(counters.latency_median * 1e6, 1),
        ),
    )


def _calibrated(twin: Twin, rng: np.random.Generator) -> Calibration:
    """What a bench with this noise finds of the skin."""
    touches = measure(TwinSkin(twin), table_loads(twin.design), rng)
    return fit_press_table(twin.design, touches, date="", data_sha256="").calibration


def _mean(errors: Sequence[float | None]) -> float | None:
    """Mean of the errors that there are."""
    known = [error for error in errors if error is not None]
    return round(float(np.mean(known)), 3) if known else None


class _Hand:
    """The scripted hand, the mouse beside it, and what was estimated meanwhile."""

    def __init__(self, script: Sequence[Contact], *, repeat: bool) -> None:
        self.mouse: Contact | None = None
        self._script = script
        self._repeat = repeat
        self._held: dict[int, list[Estimate]] = {}
        self._latest = -math.inf
        self._spoilt: set[int] = set()

    def contacts(self, time: float) -> tuple[Contact, ...]:
        """What touches the skin at a time; the mouse pushes the hand aside."""
        # Times that differ in their last bits alone are one, lest the twin be solved for each.
        number, since = self._turn(round(time, 6))
        mouse = self.mouse
        if mouse is not None:
            self._spoilt.add(number)
            return (mouse,)
        touch = self._touch(number)
        strength = min(since / _RAMP, 1.0, (_HOLD + 2 * _RAMP - since) / _RAMP)
        if touch is None or strength <= 0:
            return ()
        return (Contact(position=touch.position, force=strength * touch.force),)

    def note(self, estimate: Estimate) -> None:
        """Keep an estimate that was made while a touch was held."""
        self._latest = estimate.time
        number, since = self._turn(estimate.time)
        if self._touch(number) is not None and _RAMP < since < _RAMP + _HOLD:
            self._held.setdefault(number, []).append(estimate)

    def judge(self, design: SkinDesign) -> tuple[JudgedTouch, ...]:
        """Every touch that the hand finished and the mouse left alone, read or not."""
        if self._latest < _FIRST:
            return ()
        number, since = self._turn(self._latest)
        finished = number + (since >= _RAMP + _HOLD)
        return tuple(
            _judge(touch, self._held.get(number, []), design)
            for number in range(finished)
            if number not in self._spoilt and (touch := self._touch(number)) is not None
        )

    def _turn(self, time: float) -> tuple[int, float]:
        """Running number of the touch whose turn it is, and the time since its start, s."""
        number = math.floor((time - _FIRST) / _PERIOD)
        return number, time - _FIRST - number * _PERIOD

    def _touch(self, number: int) -> Contact | None:
        """The scripted touch of a running number."""
        if number < 0 or (number >= len(self._script) and not self._repeat):
            return None
        return self._script[number % len(self._script)]


def _judge(true: Contact, held: Sequence[Estimate], design: SkinDesign) -> JudgedTouch:
    """A touch against the estimates made while it was held."""
    commonest = Counter(estimate.status for estimate in held).most_common(1)
    status = commonest[0][0] if commonest else None
    contacts = [one for estimate in held for one in estimate.contacts]
    if status is not Status.CONTACT:
        return JudgedTouch(
            true=Touch.of(true), estimated=None, found=False,
            status="NO_READING" if status is None else status.name,
            position_error_mm=None, force_error_percent=None,
        )  # fmt: skip
    median = Contact(
        position=np.median([one.position for one in contacts], axis=0),
        force=np.median([one.force for one in contacts], axis=0),
    )
    extent = geometry(design).cell
    off = np.abs(median.position - true.position)
    miss = float(np.linalg.norm(median.force - true.force) / np.linalg.norm(true.force))
    return JudgedTouch(
        true=Touch.of(true),
        estimated=Touch.of(median),
        status=status.name,
        found=bool(off[0] < extent.length / 2 and off[1] < extent.width / 2),
        position_error_mm=round(float(np.linalg.norm(off)) * 1e3, 3),
        force_error_percent=round(100 * miss, 3),
    )


class _Page(Sink):
    """The live page as a sink of the loop, with the truth beside the estimate."""

    def __init__(self, design: SkinDesign, twin: Twin, hand: _Hand, port: int) -> None:
        self.zero_asked = threading.Event()
        self.latest: deque[Reading] = deque(maxlen=20)
        self.latency = math.nan
        self._twin, self._hand = twin, hand
        self._view = View(
            _shape(design),
            port=port,
            on_press=self._press,
            on_zero=self.zero_asked.set,
            title=f"smoskin: {design.name}",
        )

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._view.url

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Show a reading, its estimate and the true touch."""
        self.latest.append(reading)
        if estimate is None:
            return
        truth = self._hand.contacts(reading.time)
        self._view.show(
            reading,
            estimate,
            truth=truth,
            vertices=self._twin.sheet_vertices(truth),
            latency=self.latency,
        )

    def close(self) -> None:
        """End the page."""
        self._view.close()

    def _press(self, contact: Contact | None) -> None:
        self._hand.mouse = contact


def _shape(design: SkinDesign) -> SkinShape:
    """What the page draws of a design."""
    sheet = geometry(design).sheet
    length, width = geometry(design).extent.tolist()
    return SkinShape(
        vertices=sheet.vertices,
        facets=sheet.facets,
        chip_names=tuple(site.name for site in design.halls),
        chips=geometry(design).chips,
        magnets=geometry(design).magnets,
        magnet_radius=design.magnets[0].radius,
        magnet_height=design.magnets[0].height,
        board=-design.columns.height,
        extent=(length, width),
    )
