"""The touches so far: one from its first moment to its last, however often it is shown."""

import numpy as np
import pytest

from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.service.page.scene import Moment
from smoskin.service.page.tally import Tally

TOUCH = Contact(position=(0.05, 0.06), force=(0.0, 0.0, -0.5))


def shown(tally, begin, end):
    """Moments from begin to end, s, touched from 2 to 4 and from 6 to 8 s."""
    for time in np.arange(round(10 * begin), round(10 * end)) / 10:
        touched = 2 <= time < 4 or 6 <= time < 8
        contacts = {"contacts": (TOUCH,), "covariance": np.eye(5)[None]} if touched else {}
        status = Status.CONTACT if touched else Status.NO_CONTACT
        reading = Reading(time=time, field=np.zeros((3, 3)))
        tally.add(Moment(reading, Estimate(time=time, status=status, **contacts), (), None, 0.0, 0))
    return tally.touches


@pytest.mark.parametrize(
    ("plays", "touches"),
    [
        ([(0, 10)], [2]),
        ([(0, 10), (0, 10)], [2, 2]),
        ([(0, 10), (3, 10), (7, 9)], [2, 2, 2]),
        ([(0, 3), (1, 5), (1, 9)], [0, 1, 2]),
        ([(0, 3), (2.5, 5)], [0, 1]),
        ([(7, 9), (5, 9), (0, 9)], [1, 1, 2]),
        ([(0, 3), (9, 10), (5, 10)], [0, 1, 2]),
    ],
)
def test_what_is_shown_again_counts_once(plays, touches):
    tally = Tally(np.array([0.1, 0.12]), once=True)
    assert [shown(tally, *play) for play in plays] == touches


def test_a_clock_that_starts_again_is_no_moment_shown_again():
    tally = Tally(np.array([0.1, 0.12]))
    assert [shown(tally, 0, 10) for _ in range(2)] == [2, 4]
