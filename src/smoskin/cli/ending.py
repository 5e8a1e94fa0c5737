"""How the program ends: done, failed, stopped by a signal, or by an error of its own.

Decides exit codes (0 done, 1 the asked-for thing failed or was missed, 2 wrong use, 70 a bug, 128
and the signal's number where one stopped it), what is said, and when a signal may break the work:
never within JAX, whose compiler crashes by it, nor while a file or a module is half done.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Final

from smoskin.errors import LONGEST, SmoskinError, one_line

_SIGNALS: Final = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
    signal.SIGHUP: "SIGHUP: the terminal is closed",
}
_UNBROKEN: Final = (
    *("jax", "jaxlib", "importlib", "_frozen_importlib", "_frozen_importlib_external"),
    *("smoskin.service.recorder", "smoskin.outputs"),
)
"""Modules that a signal waits for, with those in them."""
_AGAIN: Final = 0.02
"""s after which a waiting signal tries again."""
_BUG: Final = 70
"""Exit code of a bug; EX_SOFTWARE of sysexits.h."""

_heard: list[int] = []
_kept: list[str] = []


class Interrupted(KeyboardInterrupt):
    """The user, or the system, wants the program to end; `number` is the signal's."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


def heed_signals() -> None:
    """End by `Interrupted` on each signal that is not ignored already, as `nohup` has it."""
    for number in _SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _hear)


def _hear(number: int, frame: FrameType | None) -> None:
    """Unwind by the first signal; end at once by a second Ctrl-C."""
    if not _heard:
        _heard.append(number)
        signal.signal(signal.SIGALRM, _unwind)
        _unwind(number, frame)
    elif number == signal.SIGINT:
        os._exit(128 + number)


def _unwind(number: int, frame: FrameType | None) -> None:
    """Raise what was heard, or try again soon where the work must not be broken."""
    while frame is not None:
        name = str(frame.f_globals.get("__name__"))
        if any(name == module or name.startswith(f"{module}.") for module in _UNBROKEN):
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
            return
        frame = frame.f_back
    raise Interrupted(_heard[0])


@contextmanager
def if_stopped(kept: Callable[[], str]) -> Iterator[None]:
    """Tell what is kept of the work within, and how to go on, if a signal stops it."""
    try:
        yield
    except KeyboardInterrupt:
        _kept.append(kept())
        raise


def run_to_end(work: Callable[[], object]) -> int:
    """The exit code of the work, whatever it raises, said in one line on standard error."""
    code: object = 0
    with suppress(KeyboardInterrupt):  # a signal may come, or a waiting one, as the work ends
        with suppress(KeyboardInterrupt):
            code = _code_of(work)
        _go_deaf()
    _go_deaf()
    if _heard:
        _say(f"Stopped by {'; '.join((_SIGNALS[signal.Signals(_heard[0])], *_kept))}.")
        code = 128 + _heard[0]
    for stream in (sys.stdout, sys.stderr):
        _let_go(stream)
    return code if isinstance(code, int) else 0


def _go_deaf() -> None:
    """Ignore signals once one was heard, else give them back to the system: the work is over."""
    for number in (*_SIGNALS, signal.SIGALRM):
        if _heard:
            signal.signal(number, signal.SIG_IGN)
        elif signal.getsignal(number) is _hear:
            signal.signal(number, signal.SIG_DFL)


def _code_of(work: Callable[[], object]) -> object:
    """The exit code of the work, its errors said."""
    try:
        try:
            work()
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except SystemExit as end:
        if isinstance(end.code, str):
            _say(end.code)
            return 1
        return end.code
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    except Exception as error:
        return 0 if _of_signal(error) else _code_of_error(error)
    return 0


def _code_of_error(error: Exception) -> int:
    """The exit code of an error, which is said."""
    if isinstance(error, SmoskinError):
        _say(f"error: {error}")
        return 1
    if isinstance(error, BrokenPipeError):
        return 1
    if isinstance(error, OSError):  # an output that cannot be written: readers refuse their inputs
        where = f"{error.filename}: " if error.filename else ""
        _say(f"error: {one_line(f'{where}{error.strerror or error}')}")
        return 1
    _say(_bug(error))
    return _BUG


def _of_signal(error: BaseException | None) -> bool:
    """Whether a signal lies at its root: compiled code makes errors of its own of one."""
    return error is not None and (
        isinstance(error, Interrupted)
        or _of_signal(error.__cause__)
        or _of_signal(error.__context__)
    )


def _bug(error: Exception) -> str:
    """The sentence of an error that nobody foresaw, whose report is written first."""
    import tempfile
    import traceback

    from smoskin import __version__

    trace = "".join(traceback.format_exception(error))
    if os.environ.get("SMOSKIN_DEBUG"):
        sys.stderr.write(trace)

    report = f"smoskin {__version__}, Python {sys.version}\n{sys.argv}\n\n{trace}"
    home = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    lies = "could not be written"
    for folder in (Path(home) / "smoskin", Path(tempfile.gettempdir())):
        file = folder / f"bug-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.txt"
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            file.write_text(report, encoding="utf-8", errors="backslashreplace")
            lies = f"lies at {file}"
            break
    what = one_line(f"{type(error).__name__}: {error}", LONGEST - len(lies) - 48)
    return f"error: this is a bug in smoskin: {what}; the report {lies}"


def _say(sentence: str) -> None:
    """Write a line to standard error, where anybody listens."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.write(f"{one_line(sentence, 2 * LONGEST)}\n")
        sys.stderr.flush()


def _let_go(stream: object) -> None:
    """Write what a stream still holds, or throw it away where nobody takes it."""
    try:
        stream.flush()  # type: ignore[attr-defined]
    except (OSError, ValueError, AttributeError):
        with suppress(OSError, ValueError, AttributeError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())  # type: ignore[attr-defined]
            stream.flush()  # type: ignore[attr-defined]
