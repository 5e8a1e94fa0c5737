"""The touches so far: one from its first moment to its last, however often it is shown."""

import re

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


def touched(tally, begin, place, truth=None):
    """Twenty moments of one touch, a tenth of a second apart, and one after it."""
    contact = Contact(position=place, force=(0.0, 0.0, -0.5))
    for k in range(21):
        time = begin + 0.1 * k
        contacts = {"contacts": (contact,), "covariance": np.eye(5)[None]} if k < 20 else {}
        status = Status.CONTACT if k < 20 else Status.NO_CONTACT
        true = () if truth is None else (Contact(position=truth, force=(0.0, 0.0, -0.5)),)
        reading = Reading(time=time, field=np.zeros((3, 3)))
        estimate = Estimate(time=time, status=status, **contacts)
        tally.add(Moment(reading, estimate, true, None, 0.0, 0))


def test_touches_are_told_in_words_and_on_a_map_of_twelve_by_twelve():
    tally = Tally(np.array([0.1, 0.12]))
    touched(tally, 0.0, (0.051, 0.06), (0.051, 0.061))
    assert "1 touch so far, off by 1.0 mm (median)" in tally.html()
    touched(tally, 10.0, (0.052, 0.061), (0.049, 0.065))
    touched(tally, 20.0, (0.0999, 0.0))
    page = tally.html()
    assert "3 touches so far, off by 3.0 mm (median)" in page
    spots = re.findall(r'<rect x="(.*?)" y="(.*?)" width="(.*?)" height="(.*?)" fill="(.*?)"', page)
    # From the left, and from the top; the fullest square is opaque, one of half as many 5/8 so.
    assert sorted(spots[-2:]) == [
        ("50.0", "50.0", "8.3", "10.0", "rgba(213,94,0,1.00)"),
        ("91.7", "110.0", "8.3", "10.0", "rgba(213,94,0,0.62)"),
    ]


def test_the_trail_is_as_long_as_150_places():
    tally = Tally(np.array([0.1, 0.12]))
    for k in range(9):
        touched(tally, 10.0 * k, (0.01 * k, 0.02))
    assert len(tally.trail) == 150
    np.testing.assert_allclose(tally.trail[[0, 9, 10, -1], 0], [0.01, 0.01, 0.02, 0.08])
    np.testing.assert_allclose(tally.trail[:, 1], 0.02)
