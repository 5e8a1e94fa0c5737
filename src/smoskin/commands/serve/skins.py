"""Skins that are read side by side, each by a loop in a thread of its own.

Decides that a skin which fails leaves the others alone, when one counts as silent, and what is
told of each. Hides the threads.
"""

import logging
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Protocol

from smoskin.commands.run import Watch
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SmoskinError
from smoskin.roles import Resource, Sink
from smoskin.service.bridges.values import number

_LOG: Final = logging.getLogger(__name__)
_NAMED: Final = re.compile(r"(?P<name>[A-Za-z][\w-]*)=(?P<value>.+)", re.DOTALL)
_SILENT: Final = 0.5
"""s without an estimate after which a skin counts as silent."""
_LOOK: Final = 0.1
"""s between two looks at the loops."""
_CLOSE_DEADLINE: Final = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SkinWanted:
    """What is to be read, and how."""

    name: str
    url: str
    calibration: Path | None = None
    record: Path | None = None
    estimators: tuple[Path, ...] = ()


def wanted_skins(
    sources: Sequence[str],
    calibrations: Sequence[str] = (),
    folder: Path | None = None,
    estimators: Sequence[str] = (),
) -> tuple[SkinWanted, ...]:
    """Skins from ``SOURCE`` or ``NAME=SOURCE``, each with its ``FILE`` or ``NAME=FILE``.

    A single source without a name is called skin, several are skin1, skin2 and so on. A file
    without a name is the calibration of every skin that has none of its own, or one more of every
    skin's estimators. In `folder` each skin is recorded, as ``NAME.mcap``. It raises an
    `ArgumentError` if a name is there twice or unknown.

    Examples
    --------
    >>> [skin.name for skin in wanted_skins(["left=twin://planar", "serial:///dev/ttyACM0"])]
    ['left', 'skin2']
    """
    if not sources:
        raise ArgumentError("sources must be at least one; got none")
    own = "skin" if len(sources) == 1 else "skin{}"
    urls: dict[str, str] = {}
    for place, source in enumerate(sources, start=1):
        match = _NAMED.fullmatch(source)
        name, url = match.group("name", "value") if match else (own.format(place), source)
        if name in urls:
            raise ArgumentError(f"names of skins must differ; got {name!r} twice")
        urls[name] = url
    files: dict[str, Path] = {}
    for name, path in _files("calibration", calibrations, urls):
        if name in files:
            raise ArgumentError(f"a skin has one calibration; got two of {name or 'all skins'!r}")
        files[name] = path
    others = list(_files("estimator", estimators, urls))
    return tuple(
        SkinWanted(
            name=name,
            url=url,
            calibration=files.get(name, files.get("")),
            record=None if folder is None else folder / f"{name}.mcap",
            estimators=tuple(path for own, path in others if own in ("", name)),
        )
        for name, url in urls.items()
    )


def _files(what: str, given: Sequence[str], names: Iterable[str]) -> Iterator[tuple[str, Path]]:
    """Names of skins, empty for all of them, and files of ``FILE`` or ``NAME=FILE``."""
    for file in given:
        match = _NAMED.fullmatch(file)
        name, path = match.group("name", "value") if match else ("", file)
        if name and name not in names:
            raise ArgumentError(f"{what} must be of one of {', '.join(names)}; got {name!r}")
        yield name, Path(path)


class Bridge(Protocol):
    """A server of other programs, such as `smoskin.service.bridges.feed.Feed`."""

    def add(
        self,
        name: str,
        chips: int,
        design: SkinDesign | None,
        *,
        zero: Callable[[], None],
        counters: Callable[[], Mapping[str, Any]],
    ) -> Sink:
        """A sink that hands on a skin's readings and estimates, as `Feed.add`."""


class Served(Resource):
    """One skin: its watch, and the thread that runs it.

    Parameters
    ----------
    wanted : SkinWanted
    bridges : sequence of Bridge
    arm, zero, view, force, say
        As of `smoskin.commands.run.Watch`.
    """

    def __init__(
        self,
        wanted: SkinWanted,
        bridges: Sequence[Bridge],
        *,
        arm: bool,
        zero: bool,
        view: bool,
        force: bool,
        say: Callable[[str], object],
    ) -> None:
        def joined(watch: Watch) -> Sequence[Sink]:
            self.watch = watch
            known = wanted.name, watch.chips, watch.design
            return [
                bridge.add(*known, zero=watch.ask_zero, counters=self.counters)
                for bridge in bridges
            ]

        self.name, self.failure, self.silent = wanted.name, "", False
        self.watch = Watch(
            wanted.url,
            calibration=wanted.calibration,
            estimators=wanted.estimators,
            arm=arm,
            zero=zero,
            record=wanted.record,
            force=force,
            view=view,
            say=lambda sentence: say(f"{wanted.name}: {sentence}"),
            bridges=joined,
        )
        self._thread = threading.Thread(
            target=self._run, name=f"smoskin-{wanted.name}", daemon=True
        )

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def _run(self) -> None:
        try:
            for _ in self.watch:
                pass
        except SmoskinError as error:
            self.failure = str(error)
            _LOG.error("%s ended: %s", self.name, error)
        except Exception as error:  # a bug must not look like a skin that is not touched
            self.failure = f"a bug: {type(error).__name__}: {error}"
            _LOG.exception("%s ended by a bug", self.name)

    @property
    def runs(self) -> bool:
        """Whether it is read still."""
        return self._thread.is_alive()

    def look(self) -> None:
        """Note whether estimates still come."""
        silent = self.runs and self.silence > _SILENT
        if silent != self.silent:
            _LOG.log(
                logging.WARNING if silent else logging.INFO,
                "%s %s",
                self.name,
                f"gives no estimates for {_SILENT} s" if silent else "gives estimates again",
            )
        self.silent = silent

    @property
    def silence(self) -> float:
        """Time since the last estimate, s; NaN before the first."""
        return time.monotonic() - self.watch.latest

    @property
    def state(self) -> str:
        """``runs``, ``silent``, ``ended`` or ``failed``."""
        if self.runs:
            return "silent" if self.silent else "runs"
        return "failed" if self.failure else "ended"

    def counters(self) -> dict[str, Any]:
        """What has been done so far, for machines."""
        counters, summary = self.watch.counters, self.watch.summary
        return {
            "state": self.state,
            **summary.as_json(),
            "failure": self.failure or summary.failure,
            "dropped": counters.dropped,
            "silence_s": number(self.silence, 3),
            "stages_ms": {
                stage: {name: number(1e3 * value, 3) for name, value in asdict(latency).items()}
                for stage, latency in counters.stages.items()
            },
        }

    def close(self) -> None:
        """End reading; what has been read is recorded first."""
        if self._thread.ident is not None:
            self.watch.stop()
            self._thread.join(_CLOSE_DEADLINE)
        self.watch.close()


class Service(Resource):
    """Skins that are read side by side.

    Parameters
    ----------
    wanted : sequence of SkinWanted
    bridges : sequence of Bridge
    arm, zero, view, force, say
        As of `smoskin.commands.run.Watch`, for every skin.

    Raises
    ------
    SmoskinError
        As `Watch` does, if one of the skins cannot be opened.
    """

    def __init__(
        self,
        wanted: Sequence[SkinWanted],
        bridges: Sequence[Bridge] = (),
        *,
        arm: bool = False,
        zero: bool = True,
        view: bool = False,
        force: bool = False,
        say: Callable[[str], object] = lambda sentence: None,
    ) -> None:
        self.skins: dict[str, Served] = {}
        with ExitStack() as stack:
            for skin in wanted:
                self.skins[skin.name] = stack.enter_context(
                    Served(skin, bridges, arm=arm, zero=zero, view=view, force=force, say=say)
                )
            stack.pop_all()
        for served in self.skins.values():
            served.start()

    def run(self, seconds: float | None = None, every: float = 10.0) -> Iterator[dict[str, Any]]:
        """Counters of all skins, one set in so many seconds, until the time is over or all end."""
        begun = time.monotonic()
        due = begun + every
        end = begun + (float("inf") if seconds is None else seconds)
        while any(skin.runs for skin in self.skins.values()):
            now = time.monotonic()
            if now >= end:
                break
            time.sleep(max(0.0, min(_LOOK, end - now)))
            for skin in self.skins.values():
                skin.look()
            if now >= due:
                due = max(due + every, now)
                yield self.counters()

    def counters(self) -> dict[str, Any]:
        """What each skin's loop has done so far."""
        return {name: skin.counters() for name, skin in self.skins.items()}

    @property
    def failures(self) -> dict[str, str]:
        """Why skins have ended that should not."""
        return {name: skin.failure for name, skin in self.skins.items() if skin.failure}

    def close(self) -> None:
        """End all of them, whatever any of them raises."""
        with ExitStack() as stack:
            for skin in self.skins.values():
                stack.callback(skin.close)


def counters_line(counters: dict[str, Any]) -> str:
    """Counters of all skins in a line for people."""
    return "; ".join(
        f"{name} {skin['state']}, {skin['readings']} readings"
        + (f" at {skin['rate_hz']:.0f} Hz" if skin["rate_hz"] else "")
        + f", {skin['touches']} touches"
        for name, skin in counters.items()
    )
