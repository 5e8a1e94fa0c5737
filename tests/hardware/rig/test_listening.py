"""What a rig hears of its skin: the host's times on a clock that is set and runs otherwise."""

import threading
import time

import numpy as np
from numpy.testing import assert_allclose

from smoskin.hardware.rig.listening import Listener
from smoskin.records import Reading
from smoskin.roles import Source

OFFSET, FAST = 1234.5, 4e-4
"""s by which the board's clock was set otherwise, and s a second by which it gains."""


class Late(Source):
    """A chip whose readings come up to 20 ms late by chance, on the board's own clock."""

    chips = 1

    def __init__(self) -> None:
        self._rng, self._closed = np.random.default_rng(0), threading.Event()

    def read(self, timeout: float = 1.0) -> Reading | None:
        made = time.monotonic()
        self._closed.wait(0.001 + float(self._rng.uniform(0.0, 0.02)))
        if self._closed.is_set():
            return None
        return Reading(time=OFFSET + (1.0 + FAST) * made, field=np.zeros((1, 3)))

    def close(self) -> None:
        self._closed.set()


def test_the_hosts_times_are_told_on_the_clock_of_the_readings() -> None:
    with Listener(Late()) as listener:
        listener.now()
        time.sleep(1.2)
        moments = time.monotonic() + np.array([-1.0, -0.5, 0.0, 0.3])
        stamps = listener.clock(moments)
    # Nothing arrives early: the least late reading, some 2 ms, is what stays.
    late = OFFSET + (1.0 + FAST) * moments - stamps
    assert (np.diff(stamps) > 0.0).all()
    assert (late > -2e-3).all()
    assert_allclose(late, 0.0, atol=0.02)
