"""Sources by URL: recordings played back, and the twin at its own pace.

Decides what a source's URL may say and when each reading comes; hides waiting and closing.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, final
from urllib.parse import parse_qsl

from smoskin.errors import ArgumentError, RecordingError, SourceError
from smoskin.magnetics.temperature import check_temperature
from smoskin.records import Contact, Reading
from smoskin.roles import Source, VirtualSkin
from smoskin.service.pace import Pace

if TYPE_CHECKING:
    from smoskin.design.skin import SkinDesign
    from smoskin.service.recorder import Recording
    from smoskin.twin.creep import Creep

_FORMS: Final = "replay:FILE[?speed=1&gap=0.5] or twin://DESIGN[?rate=100&seed=0&speed=1]"
"""Forms of a URL, for messages."""


def open_source(url: str) -> Source:
    """The source that a URL names.

    Parameters
    ----------
    url : str
        ``replay:FILE`` plays a recording back. Options: ``speed``, times the original (1) or
        ``max``, as fast as possible; ``gap``, s, the longest wait for the next reading (0.5).

        ``twin://DESIGN`` simulates a skin, DESIGN being a name shipped with the package or the
        path of a TOML document. Options: ``rate``, Hz (100); ``seed`` of the noise and of the
        made skin (0); ``speed``, times real time (1) or ``max``; ``mechanics``, the ``whole``
        sheet (which needs the extra ``twin``) or the ``reduced`` model; ``manufactured``, whether
        the skin is drawn from the tolerances, ``yes`` or ``no`` (``no``); ``creep``, whether the
        rubber creeps, as estimators take it to (``yes``); ``temperature``, degC (25).

    Returns
    -------
    Source
        Open; close it, or use it in a ``with`` statement.

    Raises
    ------
    ArgumentError
        If the URL names no kind of source, or an option is unknown or out of its range.
    SourceError
        If the recording cannot be opened.
    DesignError
        If there is no such design.
    MissingExtraError
        If the whole sheet is asked for without the extra ``twin``.
    """
    scheme, colon, rest = url.partition(":")
    place, _, query = rest.removeprefix("//").partition("?")
    if not colon or scheme not in ("replay", "twin") or not place:
        raise ArgumentError(f"url must be {_FORMS}; got {url!r}")
    if scheme == "replay":
        return _open_replay(place, **_options(url, query, _REPLAY_OPTIONS))
    return _open_twin(place, **_options(url, query, _TWIN_OPTIONS))


@final
class ReplaySource(Source):
    """A recording's readings, with its own timing.

    Times are passed on as recorded. The pace follows them where they go forward by no more
    than `longest_gap`; it never goes back.

    Parameters
    ----------
    recording : Recording
        The recording to play.
    speed : float
        Pace over the original; infinite is as fast as possible.
    longest_gap : float
        Longest wait for the next reading, s.
    clock : callable
        A monotonic clock in s.
    sleep : callable, optional
        Waits for so many seconds; by default until then or until the source is closed.

    Raises
    ------
    ArgumentError
        If the speed or the gap is not positive.
    """

    def __init__(
        self,
        recording: "Recording",
        *,
        speed: float = 1.0,
        longest_gap: float = 0.5,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] | None = None,
    ) -> None:
        _require_positive("speed", speed)
        _require_positive("longest_gap", longest_gap)
        self._recording = recording
        self._readings: Iterator[Reading] = recording.readings()
        self._speed = speed
        self._longest_gap = longest_gap
        self._pace = Pace(clock, sleep)
        self._waiting: Reading | None = None
        self._reached: float | None = None

    @property
    def chips(self) -> int:
        """Number of chips in every reading."""
        return self._recording.description.chips

    @property
    def design_hash(self) -> str:
        """Content hash of the design of the skin that was recorded."""
        return self._recording.description.design_hash

    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading, when its time has come; None at the end or when closed.

        Raises
        ------
        SourceError
            If its time does not come within `timeout` seconds, or the file has changed.
        """
        if self._pace.closed:
            return None
        if self._waiting is None:
            try:
                self._waiting = next(self._readings, None)
            except RecordingError as error:
                raise SourceError(str(error)) from error
            if self._waiting is None:
                return None
            self._pace.advance(self._step(self._waiting.time))
        if not self._pace.wait(timeout):
            return None
        reading, self._waiting = self._waiting, None
        return reading

    def close(self) -> None:
        """End the playing; a waiting `read` returns."""
        self._pace.close()
        # Lets go of the file; another thread's `read` may still be in the old iterator.
        self._readings = iter(())

    def _step(self, moment: float) -> float:
        """Seconds to wait from the last reading to this one."""
        before = moment if self._reached is None else self._reached
        step = moment - before
        # Slightly out of order: the readings ahead of it have used up its time already. Far
        # back: the recorded clock was set anew.
        if step >= 0.0 or step < -self._longest_gap:
            self._reached = moment
        return min(max(step, 0.0) / self._speed, self._longest_gap)


@final
class TwinSource(Source):
    """A simulated skin, read at a steady rate, that can be touched meanwhile.

    Readings are timed from 0 in steps of 1 / rate. As with a real skin, the readings that
    nobody asked for in time are never made: their times are skipped, and `missed` counts them.

    Parameters
    ----------
    twin : VirtualSkin
        The skin.
    rate : float
        Readings a second of the twin's time, Hz.
    speed : float
        Pace over real time; infinite is as fast as possible.
    creep : Creep, optional
        How the skin creeps under a touch and recovers after it; by default it does not.
    temperature : float
        Temperature of skin and chips, degC.
    clock : callable
        A monotonic clock in s.
    sleep : callable, optional
        Waits for so many seconds; by default until then or until the source is closed.

    Raises
    ------
    ArgumentError
        If the rate is not positive and finite, the speed is not positive, or the skin does not
        stand the temperature.
    """

    def __init__(
        self,
        twin: VirtualSkin,
        *,
        rate: float = 100.0,
        speed: float = 1.0,
        creep: "Creep | None" = None,
        temperature: float = 25.0,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] | None = None,
    ) -> None:
        _require_positive("rate", rate)
        if math.isinf(rate):
            raise ArgumentError("rate must be finite; use speed=max to run as fast as possible")
        _require_positive("speed", speed)
        check_temperature(temperature)
        self._twin = twin
        self._rate = rate
        self._period = 1.0 / (rate * speed)
        self._pace = Pace(clock, sleep)
        self._temperature = temperature
        self._contacts: tuple[Contact, ...] = ()
        self._creep = creep
        self._index = 0
        self._missed = 0

    @property
    def chips(self) -> int:
        """Number of chips in every reading."""
        return len(self._twin.design.halls)

    @property
    def design(self) -> "SkinDesign":
        """Design of the skin."""
        return self._twin.design

    @property
    def design_hash(self) -> str:
        """Content hash of the skin's design."""
        return self.design.content_hash

    @property
    def missed(self) -> int:
        """How many readings were skipped because nobody asked in time."""
        return self._missed

    def touch(self, contacts: Sequence[Contact]) -> None:
        """Touch the skin so from the next reading on; may be called from any thread.

        Raises
        ------
        ArgumentError
            If a contact lies off the skin or pulls at it.
        """
        held = tuple(contacts)
        self._twin.check(held)  # raises here, not in the thread that reads
        self._contacts = held

    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading, when its time has come; None when closed.

        Raises
        ------
        SourceError
            If its time does not come within `timeout` seconds.
        """
        if not self._pace.wait(timeout):
            return None
        missed = int(self._pace.lateness / self._period) if self._period > 0.0 else 0
        self._index += missed
        self._missed += missed
        motion = self._twin.motion(self._contacts, temperature=self._temperature)
        if self._creep is not None:
            since = (missed + 1) / self._rate if self._index > missed else 0.0
            motion = self._creep.step(since, motion)
        reading = self._twin.sense(
            motion, time=self._index / self._rate, temperature=self._temperature
        )
        self._index += 1
        self._pace.advance((missed + 1) * self._period)
        return reading

    def close(self) -> None:
        """End the readings; a waiting `read` returns."""
        self._pace.close()


def _open_replay(path: str, *, speed: float, gap: float) -> ReplaySource:
    from smoskin.service.recorder import open_recording

    try:
        recording = open_recording(path)
    except RecordingError as error:
        raise SourceError(str(error)) from error
    return ReplaySource(recording, speed=speed, longest_gap=gap)


def _open_twin(
    name_or_path: str,
    *,
    rate: float,
    seed: int,
    speed: float,
    mechanics: str,
    manufactured: bool,
    creep: bool,
    temperature: float,
) -> TwinSource:
    from smoskin.feasibility import load_design
    from smoskin.twin.creep import Creep
    from smoskin.twin.reduced import ReducedTwin
    from smoskin.twin.whole import Twin

    if manufactured and mechanics == "reduced":
        raise ArgumentError("manufactured=yes needs mechanics=whole; got mechanics=reduced")
    design = load_design(name_or_path)
    skin: VirtualSkin
    if mechanics == "reduced":
        skin = ReducedTwin(design, seed=seed)
    else:
        skin = Twin(design, seed=seed, manufactured=manufactured)
    skin.prepare()
    return TwinSource(
        skin,
        rate=rate,
        speed=speed,
        creep=Creep(design) if creep else None,
        temperature=temperature,
    )


def _options(url: str, query: str, known: Mapping[str, "_Option"]) -> dict[str, Any]:
    """Values of all options, from a URL's query where it gives them."""
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
    except ValueError as error:
        raise ArgumentError(
            f"options must be written NAME=VALUE&NAME=VALUE; got {query!r} in {url!r}"
        ) from error
    names = [name for name, _ in pairs]
    for name in names:
        if name not in known:
            raise ArgumentError(f"options must be of {', '.join(known)}; got {name!r} in {url!r}")
        if names.count(name) > 1:
            raise ArgumentError(f"option {name!r} must be given once; got {url!r}")
    given = dict(pairs)
    return {
        name: option.read(name, given.get(name, option.usual)) for name, option in known.items()
    }


def _number(name: str, text: str) -> float:
    """A positive number."""
    value = _finite(text)
    if value is None or value <= 0.0:
        raise ArgumentError(f"{name} must be a positive number; got {text!r}")
    return value


def _speed(name: str, text: str) -> float:
    """A positive number; infinity where the text says ``max`` or 0."""
    value = 0.0 if text == "max" else _finite(text)
    if value is None or value < 0.0:
        raise ArgumentError(f"{name} must be a number >= 0 or 'max'; got {text!r}")
    return value or math.inf


def _temperature(name: str, text: str) -> float:
    """A number; whether a skin stands it is the twin's to say."""
    value = _finite(text)
    if value is None:
        raise ArgumentError(f"{name} must be a number of degC; got {text!r}")
    return value


def _finite(text: str) -> float | None:
    """The number that a text says, unless it says none."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _mechanics(name: str, text: str) -> str:
    """One of the two models of a skin."""
    if text not in ("whole", "reduced"):
        raise ArgumentError(f"{name} must be one of whole, reduced; got {text!r}")
    return text


def _yes(name: str, text: str) -> bool:
    """Whether the text says yes."""
    if text not in ("yes", "no"):
        raise ArgumentError(f"{name} must be one of yes, no; got {text!r}")
    return text == "yes"


def _seed(name: str, text: str) -> int:
    """A whole number."""
    if not (text.isascii() and text.isdigit()):
        raise ArgumentError(f"{name} must be a whole number >= 0; got {text!r}")
    return int(text)


class _Option(NamedTuple):
    """An option of a URL."""

    read: Callable[[str, str], object]
    """Function of the option's name and text that gives its value."""
    usual: str
    """Text where the URL says nothing."""


_REPLAY_OPTIONS: Final = {"speed": _Option(_speed, "1"), "gap": _Option(_number, "0.5")}
_TWIN_OPTIONS: Final = {
    "rate": _Option(_number, "100"),
    "seed": _Option(_seed, "0"),
    "speed": _Option(_speed, "1"),
    "mechanics": _Option(_mechanics, "whole"),
    "manufactured": _Option(_yes, "no"),
    "creep": _Option(_yes, "yes"),
    "temperature": _Option(_temperature, "25"),
}


def _require_positive(name: str, value: float) -> None:
    if not value > 0.0:
        raise ArgumentError(f"{name} must be positive; got {value}")
