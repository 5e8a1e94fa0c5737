"""Sources by URL, and the twin at its own pace.

Decides what a source's URL may say and when a twin's readings come; hides waiting and closing.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, final
from urllib.parse import parse_qsl

from smoskin.errors import ArgumentError, RecordingError, SmoskinError, SourceError
from smoskin.hardware.wire.packet import FORMATS
from smoskin.magnetics.temperature import check_temperature
from smoskin.pace import SPEEDS, Pace, require_between
from smoskin.records import Contact, Reading
from smoskin.roles import Source, VirtualSkin
from smoskin.service.replay import ReplaySource
from smoskin.twin.hand import contacts_of, scripted_hand

if TYPE_CHECKING:
    from smoskin.design.skin import SkinDesign
    from smoskin.twin.creep import Creep

_FORMS: Final = (
    "replay:FILE[?speed=1&gap=0.5], serial://PORT[?format=smoskin], "
    "i2c://DEVICE[?design=planar&rate=100] or twin://DESIGN[?rate=100&seed=0&speed=1]"
)
_UNTOUCHED: Final = 25
"""Readings before the hand begins, in which an estimator finds its zero."""
_RATES: Final = (0.01, 1e5)
"""Least and most readings a second, Hz."""


def open_source(url: str | os.PathLike[str]) -> Source:
    """The source that a URL names, open; close it, or use it in a ``with`` statement.

    Parameters
    ----------
    url : str or path-like
        A path is that of a recording, to be played back.

        ``replay:FILE`` plays a recording back. Options: ``speed``, times the original (1) or
        ``max``, as fast as possible; ``gap``, s, the longest wait for the next reading (0.5).

        ``twin://DESIGN`` simulates a skin, DESIGN being a name shipped with the package or the
        path of a TOML document. Options: ``rate``, Hz (100); ``seed`` of the noise and of the
        made skin (0); ``speed``, times real time (1) or ``max``; ``mechanics``, the ``whole``
        sheet (which needs the extra ``twin``) or the ``reduced`` model; ``manufactured``, whether
        the skin is drawn from the tolerances, ``yes`` or ``no`` (``no``); ``creep``, whether the
        rubber creeps, as estimators take it to (``yes``); ``hand``, whether a scripted hand
        touches it anywhere, again and again (``no``); ``temperature``, degC (25).

        ``i2c://DEVICE``, such as ``i2c:///dev/i2c-1``, reads chips on the computer's own bus.
        Options: ``design``, whose chips they are (``planar``); ``rate``, Hz (100); ``mode``,
        ``single``, in which all chips measure at one moment, or ``burst``, which is faster.

        ``serial://PORT``, such as ``serial:///dev/ttyACM0``, or ``serial://usb:SERIAL`` by the
        board's USB serial number, reads a board on a serial port. Options: ``format``, ``smoskin``
        (`docs/wire.md`), ``anyskin`` for ReSkin and AnySkin boards, or ``eflesh``; ``design`` of
        the skin, ``planar`` for the format ``smoskin`` and none for the others; ``chips`` of a
        board without a design (5); ``rate`` to ask of a board of the format ``smoskin``, Hz;
        ``baud``; ``patience``, s for which a port that is gone is waited for (10).

    Raises
    ------
    ArgumentError
        If the URL names no kind of source, or an option is unknown or out of its range.
    SourceError
        If the recording or the device cannot be opened, or a chip does not answer.
    DesignError
        If there is no such design.
    MissingExtraError
        If the whole sheet is asked for without the extra ``twin``, or a device or a port without
        ``hardware``.
    """
    if isinstance(url, os.PathLike):
        return _open_replay(os.fspath(url), **_options("", "", _REPLAY_OPTIONS))
    if not isinstance(url, str):
        raise ArgumentError(f"url must be {_FORMS}, or a path; got {url!r}")
    scheme, colon, rest = url.partition(":")
    place, _, query = rest.removeprefix("//").partition("?")
    if not colon or scheme not in _KINDS or not place:
        raise ArgumentError(f"url must be {_FORMS}; got {url!r}")
    opened, options = _KINDS[scheme]
    return opened(place, **_options(url, query, options))


@final
class TwinSource(Source):
    """A simulated skin, read at a steady rate, that can be touched meanwhile.

    Readings are timed from 0 in steps of 1 / rate. As with a real skin, the readings that
    nobody asked for in time are never made: their times are skipped, and `missed` counts them.

    Parameters
    ----------
    twin : VirtualSkin
    rate, speed : float
        Readings a second of the twin's time, Hz, and its pace over real time, which may be
        infinite.
    creep : Creep, optional
        Creep of the skin under a touch and after it; by default there is none.
    hand : sequence of Contact
        Touches of a hand, one after the other and over again, while nothing else touches.
    temperature : float
        Temperature of skin and chips, degC.
    pace : Pace, optional
        Clock by which the readings come.
    """

    def __init__(
        self,
        twin: VirtualSkin,
        *,
        rate: float = 100.0,
        speed: float = 1.0,
        creep: "Creep | None" = None,
        hand: Sequence[Contact] = (),
        temperature: float = 25.0,
        pace: Pace | None = None,
    ) -> None:
        require_between("rate", rate, *_RATES)
        require_between("speed", speed, *SPEEDS, unless=math.inf)
        check_temperature(temperature)
        self.twin = twin
        """Skin that is read."""
        self.contacts: tuple[Contact, ...] = ()
        """What touched it in the last reading."""
        self._hand = tuple(hand)
        self._rate = rate
        self._period = 1.0 / (rate * speed)
        self._pace = Pace() if pace is None else pace
        self._temperature = temperature
        self._creep = creep
        self._contacts: tuple[Contact, ...] = ()
        self._index = 0
        self.missed = 0
        """How many readings were skipped because nobody asked in time."""

    @property
    def chips(self) -> int:
        """Number of chips in every reading."""
        return len(self.twin.design.halls)

    @property
    def design(self) -> "SkinDesign":
        """Design of the skin."""
        return self.twin.design

    @property
    def design_hash(self) -> str:
        """Content hash of the skin's design."""
        return self.design.content_hash

    def touch(self, contacts: Sequence[Contact]) -> None:
        """Touch the skin so from the next reading on, if it can be; from any thread."""
        self.twin.check(contacts)  # raises here, not in the thread that reads
        self._contacts = tuple(contacts)

    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading, when its time has come; None when closed."""
        if not self._pace.wait(timeout):
            return None
        missed = int(self._pace.lateness / self._period) if self._period > 0.0 else 0
        self._index += missed
        self.missed += missed
        self.contacts = self._contacts
        if self._hand and not self.contacts and self._index >= _UNTOUCHED:
            since = (self._index - _UNTOUCHED) / self._rate
            self.contacts = contacts_of(self._hand, since)
        motion = self.twin.motion(self.contacts, temperature=self._temperature)
        if self._creep is not None:
            since = (missed + 1) / self._rate if self._index > missed else 0.0
            motion = self._creep.step(since, motion)
        reading = self.twin.sense(
            motion, time=self._index / self._rate, temperature=self._temperature
        )
        self._index += 1
        self._pace.advance((missed + 1) * self._period)
        return reading

    def close(self) -> None:
        """End the readings; a waiting `read` returns."""
        self._pace.close()


def _open_replay(path: str, *, speed: float, gap: float) -> ReplaySource:
    from smoskin.service.recording import open_recording

    try:
        recording = open_recording(path)
    except RecordingError as error:
        raise SourceError(str(error)) from error
    return ReplaySource(recording, speed=speed, longest_gap=gap)


def _open_twin(
    name_or_path: str,
    *,
    seed: int,
    mechanics: str,
    manufactured: bool,
    creep: bool,
    hand: bool,
    **pace: Any,
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
    script = scripted_hand(design, 60.0, seed) if hand else ()
    return TwinSource(skin, creep=Creep(design) if creep else None, hand=script, **pace)


def _open_i2c(device: str, *, design: str, rate: float, mode: str) -> Source:
    from smoskin.feasibility import load_design
    from smoskin.hardware.i2c import ChipSource, SmbusBus

    skin, bus = load_design(design), SmbusBus(device)
    try:
        return ChipSource(skin, bus, rate=rate, mode=mode)  # type: ignore[arg-type]
    except SmoskinError:
        bus.close()
        raise


def _open_serial(port: str, *, format: str, design: str, **more: Any) -> Source:
    from smoskin.feasibility import load_design
    from smoskin.hardware.serial import SerialSource

    name = design or ("planar" if format == "smoskin" else "")
    given = {option: value for option, value in more.items() if value is not None}
    return SerialSource(port, format=format, design=load_design(name) if name else None, **given)


class _Option(NamedTuple):
    """An option of a URL."""

    usual: str
    """Text where the URL says nothing."""
    valid: str
    """What the option must be, for messages."""
    read: Callable[[str], object]
    """Function of a text that gives its value, or raises ValueError or KeyError."""


def _options(url: str, query: str, known: Mapping[str, _Option]) -> dict[str, Any]:
    """Values of all options, from a URL's query where it gives them."""
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
    except ValueError as error:
        raise ArgumentError(
            f"options must be written NAME=VALUE&NAME=VALUE; got {query!r} in {url!r}"
        ) from error
    given = dict(pairs)
    for name in given:
        if name not in known:
            raise ArgumentError(f"options must be of {', '.join(known)}; got {name!r} in {url!r}")
        if [other for other, _ in pairs].count(name) > 1:
            raise ArgumentError(f"option {name!r} must be given once; got {url!r}")
    values = {}
    for name, option in known.items():
        text = given.get(name, option.usual)
        try:
            values[name] = option.read(text)
        except (ValueError, KeyError) as error:
            raise ArgumentError(f"{name} must be {option.valid}; got {text!r}") from error
    return values


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError
    return value


def _positive(text: str) -> float:
    value = _finite(text)
    if value <= 0.0:
        raise ValueError
    return value


def _not_negative(text: str) -> float:
    value = _finite(text)
    if value < 0.0:
        raise ValueError
    return value


def _speed(text: str) -> float:
    """A positive number; infinity where the text says ``max`` or 0."""
    unpaced = text == "max" or _finite(text) == 0.0
    return math.inf if unpaced else _positive(text)


def _whole(text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        raise ValueError
    return int(text)


def _one_of(words: Mapping[str, object]) -> tuple[str, Callable[[str], object]]:
    """What an option of few words must be, and its reading."""
    return f"one of {', '.join(words)}", words.__getitem__


_SPEED: Final = _Option("1", "a number >= 0 or 'max'", _speed)
_YES_NO: Final = _one_of({"yes": True, "no": False})
_REPLAY_OPTIONS: Final = {"speed": _SPEED, "gap": _Option("0.5", "a positive number", _positive)}
_TWIN_OPTIONS: Final = {
    "rate": _Option("100", "a positive number", _positive),
    "seed": _Option("0", "a whole number >= 0", _whole),
    "speed": _SPEED,
    "mechanics": _Option("whole", *_one_of({"whole": "whole", "reduced": "reduced"})),
    "manufactured": _Option("no", *_YES_NO),
    "creep": _Option("yes", *_YES_NO),
    "hand": _Option("no", *_YES_NO),
    "temperature": _Option("25", "a number of degC", _finite),
}
_I2C_OPTIONS: Final = {
    "design": _Option("planar", "a design's name or path", str),
    "rate": _Option("100", "a positive number", _positive),
    "mode": _Option("single", *_one_of({"single": "single", "burst": "burst"})),
}
_SERIAL_OPTIONS: Final = {
    "format": _Option("smoskin", *_one_of({format: format for format in FORMATS})),
    "design": _Option("", "a design's name or path", str),
    "chips": _Option("", "a whole number", lambda text: _whole(text) if text else None),
    "rate": _Option("", "a positive number", lambda text: _positive(text) if text else None),
    "baud": _Option("", "a whole number", lambda text: _whole(text) if text else None),
    "patience": _Option("10", "a number >= 0", _not_negative),
}
_KINDS: Final[Mapping[str, tuple[Callable[..., Source], Mapping[str, _Option]]]] = {
    "replay": (_open_replay, _REPLAY_OPTIONS),
    "twin": (_open_twin, _TWIN_OPTIONS),
    "i2c": (_open_i2c, _I2C_OPTIONS),
    "serial": (_open_serial, _SERIAL_OPTIONS),
}
"""Function that opens each kind of source, and the options that its URL may have."""
