"""A switch that must be held: by signs that come in time, and by nothing else."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.errors import ArgumentError
from smoskin.robot.holding import Holding


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=20), st.floats(0.0, 0.5))
def test_it_is_held_while_each_sign_follows_the_one_before_in_time(gaps, since):
    clock = Clock()
    switch = Holding(clock=clock, deadline=0.2)
    assert not switch()
    for gap in gaps:
        clock.now += gap
        switch.sign()
    clock.now += since
    assert switch() == (len(gaps) > 1 and gaps[-1] <= 0.2 + 1e-9 and since <= 0.2 + 1e-9) or (
        min(abs(gaps[-1] - 0.2), abs(since - 0.2)) < 1e-6
    )


@pytest.mark.parametrize("deadline", [0.0, -1.0, float("inf"), float("nan")])
def test_a_deadline_that_is_none_is_refused(deadline):
    with pytest.raises(
        ArgumentError, match=f"deadline must be positive and finite; got {deadline}"
    ):
        Holding(deadline=deadline)
