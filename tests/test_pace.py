"""The pace of a source, on a clock that passes when it is told to."""

import math
import threading
import time

import pytest

from smoskin.errors import SourceError
from smoskin.pace import Pace


class FakeTime:
    """A clock that moves by what is slept."""

    def __init__(self) -> None:
        self.now, self.slept = 100.0, []

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


@pytest.fixture
def fake() -> FakeTime:
    return FakeTime()


def test_the_first_reading_is_due_at_once_and_others_after_their_step(fake) -> None:
    pace = Pace(fake.clock, fake.sleep)
    pace.advance(5.0)  # before the first there is nothing to advance from
    assert pace.lateness == 0.0
    assert pace.wait(1.0)
    assert fake.slept == []
    pace.advance(0.25)
    assert pace.wait(1.0)
    assert fake.slept == pytest.approx([0.25])
    assert fake.now == pytest.approx(100.25)


def test_a_pace_that_is_late_is_caught_up_with(fake) -> None:
    pace = Pace(fake.clock, fake.sleep)
    pace.wait(1.0)
    fake.now += 0.35
    assert pace.lateness == pytest.approx(0.35)
    for step, lateness in ((0.1, 0.25), (0.1, 0.15), (0.1, 0.05), (0.1, 0.0)):
        pace.advance(step)
        assert pace.lateness == pytest.approx(lateness)
    assert pace.wait(1.0)
    assert fake.now == pytest.approx(100.4)


@pytest.mark.parametrize(("timeout", "in_time"), [(0.49, False), (0.51, True)])
def test_time_runs_out_just_before_and_not_just_after(fake, timeout, in_time) -> None:
    pace = Pace(fake.clock, fake.sleep)
    pace.wait(1.0)
    pace.advance(0.5)
    if in_time:
        assert pace.wait(timeout)
        return
    with pytest.raises(SourceError, match=r"no reading within 0\.49 s; the next is due in 0\.010"):
        pace.wait(timeout)
    assert fake.now == pytest.approx(100.49)
    assert pace.wait(timeout)  # it is not lost
    assert fake.now == pytest.approx(100.5)


def test_closing_ends_a_wait_and_every_later_one(fake) -> None:
    pace = Pace(time.monotonic, None)
    assert pace.wait(1.0)
    pace.advance(math.inf)
    timer = threading.Timer(0.05, pace.close)
    timer.start()
    begun = time.monotonic()
    assert not pace.wait(20.0)
    assert time.monotonic() - begun < 10.0
    timer.join(5.0)
    assert pace.closed
    assert not pace.wait(20.0)
