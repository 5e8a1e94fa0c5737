"""An object in a process of its own, so that its work takes no time from this one.

Decides which calls wait for others and which the newest replaces, that what the object calls is
called here, and that errors and the log come here too. Hides the process, pipes and threads.
"""

import logging
import logging.handlers
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, BinaryIO, Final, TypeAlias, final

from smoskin.errors import SmoskinError

_START_DEADLINE: Final = 60.0
"""s for a process to import what it needs and to make the object."""
_CLOSE_DEADLINE: Final = 10.0
_LOG: Final = logging.getLogger("smoskin")

_Call: TypeAlias = tuple[str, tuple[object, ...], dict[str, object]]
"""A method's name, and what it is given."""


@final
class Remote:
    """An object that is made and called in a process of its own; closing it ends that.

    Parameters
    ----------
    make : callable
        Class or function of a module that makes the object, which has a method `close`.
    *args, **options
        What it is given, to be pickled; callables among the options are called here, by a thread
        of the remote, with what the object gives them, and what they return is dropped.
    attributes : sequence of str
        Attributes of the new object to be kept in `values`.
    every : float
        Shortest time between two deliveries of calls, s.

    Raises
    ------
    Exception
        What making the object raises.
    SmoskinError
        If the process ends before, or takes longer than a minute.
    """

    def __init__(
        self,
        make: Callable[..., object],
        *args: object,
        attributes: Sequence[str] = (),
        every: float = 0.0,
        **options: object,
    ) -> None:
        self._name, self._every = make.__name__, every
        self._callables: dict[str, Callable[..., object]] = {
            name: value for name, value in options.items() if callable(value)
        }
        given = {name: value for name, value in options.items() if name not in self._callables}
        self._waiting: dict[object, _Call] = {}
        self._lock = threading.Lock()
        self._news, self._closing = threading.Event(), threading.Event()
        self._failure: Exception | None = None
        self._made: SimpleQueue[dict[str, Any] | Exception] = SimpleQueue()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,  # Ctrl-C is for this process, which closes the other
        )
        level = _LOG.getEffectiveLevel()
        making = make, args, given, tuple(self._callables), tuple(attributes), level
        self._threads = [
            threading.Thread(target=run, name=f"smoskin-{self._name}", daemon=True)
            for run in (partial(self._send, making), self._listen)
        ]
        for thread in self._threads:
            thread.start()
        try:
            made = self._made.get(timeout=_START_DEADLINE)
        except BaseException as error:
            self._process.kill()
            if not isinstance(error, Empty):
                raise
            made = SmoskinError(f"{self._name} was not made within {_START_DEADLINE} s")
        if isinstance(made, Exception):
            self._end()
            raise made
        self.values = made
        """Attributes of the new object, by their names."""

    def tell(self, method: str, *args: object, **options: object) -> None:
        """Call a method there, never waiting; a call of it that still waits is forgotten.

        Raises what the object, or a callable that it called, has raised since the last call.
        """
        self._raise_failure()
        with self._lock:
            self._waiting.pop(method, None)  # the newest goes last
            self._waiting[method] = method, args, options
        self._news.set()

    def add(self, method: str, *args: object) -> None:
        """Call a method there, never waiting, behind all calls that wait: none is forgotten.

        Raises as `tell`.
        """
        self._raise_failure()
        with self._lock:
            self._waiting[object()] = method, args, {}
        self._news.set()

    @property
    def waiting(self) -> int:
        """Number of calls that are not on their way yet."""
        return len(self._waiting)

    def close(self) -> None:
        """Deliver what waits, close the object and end its process. Any number of times.

        Raises what was raised there, and `SmoskinError` if it does not end within ten seconds.
        """
        if self._closing.is_set():
            return
        ended = self._end()
        self._raise_failure()
        if not ended:
            raise SmoskinError(f"{self._name} has not ended within {_CLOSE_DEADLINE} s")

    def _end(self) -> bool:
        """End the process; whether it and the threads ended by themselves."""
        self._closing.set()
        self._news.set()
        try:
            self._process.wait(_CLOSE_DEADLINE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False
        finally:
            for thread in self._threads:
                thread.join(_CLOSE_DEADLINE)
        return not any(thread.is_alive() for thread in self._threads)

    def _raise_failure(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _send(self, making: object) -> None:
        """Deliver what is to be made and then the calls, until closed."""
        pipe = self._process.stdin
        assert pipe is not None
        with suppress(OSError), pipe:  # of a process that has ended the other thread tells
            pickle.dump(making, pipe)
            pipe.flush()
            last = False
            while not last:
                self._news.wait()
                self._news.clear()
                last = self._closing.is_set()
                with self._lock:
                    waiting, self._waiting = self._waiting, {}
                pickle.dump(list(waiting.values()), pipe)
                pipe.flush()
                if not last:
                    self._closing.wait(self._every)

    def _listen(self) -> None:
        """Hear what the process tells, until it ends."""
        pipe = self._process.stdout
        assert pipe is not None
        with pipe, suppress(EOFError):
            while True:
                self._heed(*pickle.load(pipe))
        gone = SmoskinError(f"the process of {self._name} has ended")
        if not self._closing.is_set():
            self._failure = self._failure or gone
        self._made.put(gone)

    def _heed(self, kind: str, what: Any, *more: object) -> None:
        """Act on one thing that the process tells."""
        if kind == "made":
            self._made.put(what)
        elif kind == "log":
            if (log := logging.getLogger(what.name)).isEnabledFor(what.levelno):
                log.handle(what)
        elif kind == "failed":
            self._failure = what
        else:
            try:
                self._callables[what](*more)
            except Exception as error:  # carried over to whoever tells or closes
                self._failure = error


class _Told(logging.handlers.QueueHandler):
    """A handler that hands every record to a function."""

    def __init__(self, send: Callable[[str, object], None]) -> None:
        super().__init__(SimpleQueue())
        self._send = send

    def enqueue(self, record: logging.LogRecord) -> None:
        """Hand a record on."""
        self._send("log", record)


def _serve(incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Make an object and call it as is told, until nobody tells any more."""
    lock = threading.Lock()

    def send(*message: object) -> None:
        with lock, suppress(OSError):  # nobody hears any more: nobody tells either
            outgoing.write(pickle.dumps(message))
            outgoing.flush()

    make, args, options, callables, attributes, level = pickle.load(incoming)
    _LOG.addHandler(_Told(send))
    _LOG.setLevel(level)
    options |= {name: partial(send, "called", name) for name in callables}
    try:
        thing = make(*args, **options)
        send("made", {name: getattr(thing, name) for name in attributes})
    except Exception as error:
        send("made", _portable(error))
        return
    while True:
        try:
            calls = pickle.load(incoming)
        except EOFError:
            break
        for method, args, options in calls:
            _attempt(partial(getattr(thing, method), *args, **options), send)
    _attempt(thing.close, send)


def _attempt(call: Callable[[], object], send: Callable[[str, object], None]) -> None:
    """Call, and send what that raises."""
    try:
        call()
    except Exception as error:
        send("failed", _portable(error))


def _portable(error: Exception) -> Exception:
    """An error, or one with its words where it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return SmoskinError(f"{type(error).__name__}: {error}")
    return error


if __name__ == "__main__":
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # whatever the other one is
    stdout = os.dup(1)
    os.dup2(2, 1)  # what libraries print is no message
    with os.fdopen(stdout, "wb") as outgoing:
        _serve(sys.stdin.buffer, outgoing)
