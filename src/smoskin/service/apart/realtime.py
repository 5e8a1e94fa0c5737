"""A live program that is not held up: by its own threads and garbage, nor by other programs.

Decides how long a thread may keep the others waiting, how urgent a program in real time is, and
that the system must have been asked to allow it.
"""

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

from smoskin.errors import ArgumentError

_PRIORITY: Final = 10
"""Priority from 1 to 99: before all ordinary programs, behind the system's own urgent threads."""
_TURN: Final = 0.5e-3
"""s for which a thread may compute while another waits; Python's own 5 ms are a reading's time."""


@contextmanager
def undisturbed(*, realtime: bool = False) -> Iterator[None]:
    """Let nothing hold up this process's threads, those that begin meanwhile too.

    Threads take turns sooner, so that a reading does not wait for what is done with the one before.
    What there is already is not searched for garbage: with all libraries loaded a search stops
    every thread for 0.1 s. With `realtime` the threads run before those of ordinary programs,
    as in a process of `SCHED_FIFO`.

    Raises
    ------
    ArgumentError
        If the system does not let this user run programs in real time.
    """
    if realtime:
        _schedule(os.SCHED_FIFO, _PRIORITY)
    turn = sys.getswitchinterval()
    sys.setswitchinterval(_TURN)
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(turn)
        if realtime:
            _schedule(os.SCHED_OTHER, 0)


def _schedule(policy: int, priority: int) -> None:
    """Schedule all threads of this process so."""
    for thread in os.listdir("/proc/self/task"):
        with suppress(ProcessLookupError):  # a thread that has ended meanwhile
            try:
                os.sched_setscheduler(int(thread), policy, os.sched_param(priority))
            except PermissionError as error:
                raise ArgumentError(
                    f"realtime needs leave of the system: root, or rtprio {_PRIORITY} for this "
                    "user in /etc/security/limits.conf"
                ) from error
