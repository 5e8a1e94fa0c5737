"""The scripted hand: where and when it touches, what pushes it aside, and how it is judged."""

import numpy as np
import pytest

from smoskin.commands.demo.hand import Hand, judge
from smoskin.errors import ArgumentError
from smoskin.records import Contact, Estimate, Status
from smoskin.twin.hand import PERIOD, scripted_hand

PRESS = Contact(position=(0.05, 0.07), force=(0.0, 0.0, -0.5))
DRAG = Contact(position=(0.09, 0.02), force=(0.2, 0.1, -0.4))


def seen(time, *contacts, status=Status.CONTACT):
    return Estimate(
        time=time,
        status=status,
        contacts=contacts,
        covariance=np.full((len(contacts), 5, 5), np.nan),
    )


def test_the_hand_touches_anywhere_on_the_skin(planar):
    touches = scripted_hand(planar, 60.0, seed=0)
    assert len(touches) == 74
    places = np.array([touch.position for touch in touches])
    assert (places.min(axis=0) >= 4e-3).all()
    assert (places.max(axis=0) <= (0.116, 0.156)).all()
    cells = np.floor((places - 4e-3) / (0.112 / 6, 0.152 / 6)).astype(int)
    assert len({tuple(cell) for cell in cells[:36]}) == 36
    # Not only near the middles of the cells: each third of a cell's length is touched.
    share = (places[:, 0] - 4e-3) / (0.112 / 6) % 1
    assert np.histogram(share, bins=3, range=(0, 1))[0].min() > 12
    force = np.array([touch.force for touch in touches])
    assert (-force[:, 2]).min() >= 0.3
    assert (-force[:, 2]).max() <= 0.8
    drag = np.hypot(*force[:, :2].T)
    assert (drag[::2] == 0).all()
    assert ((drag[1::2] >= 0.1) & (drag[1::2] <= 0.3)).all()
    assert scripted_hand(planar, 60.0, seed=1)[0] != touches[0]


@pytest.mark.parametrize(
    ("seconds", "start", "count"), [(1.0, 0.2, 1), (1.79, 0.2, 1), (1.8, 0.2, 2), (2.0, 0.5, 1)]
)
def test_as_many_touches_as_fit(planar, seconds, start, count):
    assert len(scripted_hand(planar, seconds, seed=0, start=start)) == count


def test_too_short_a_time_is_refused(planar):
    with pytest.raises(ArgumentError, match=r"seconds must be at least 1; got 0\.99"):
        scripted_hand(planar, 0.99, seed=0)


def test_a_touch_rises_is_held_and_falls():
    hand = Hand((PRESS, DRAG), repeat=False)
    assert hand.contacts(0.3) == ()
    hand.begin(0.5)
    hand.begin(9.0)  # it has begun
    for time, strength in ((0.5, 0), (0.575, 0.5), (0.65, 1), (1.0, 1), (1.075, 0.5), (1.2, 0)):
        contacts = hand.contacts(time)
        assert len(contacts) == (strength > 0)
        if contacts:
            assert contacts[0].position == pytest.approx(PRESS.position)
            assert contacts[0].force == pytest.approx(strength * PRESS.force)
    assert hand.contacts(0.5 + PERIOD + 0.3)[0].force == pytest.approx(DRAG.force)
    assert hand.contacts(0.5 + 2 * PERIOD + 0.3) == ()
    again = Hand((PRESS, DRAG), repeat=True)
    again.begin(0.5)
    assert again.contacts(0.5 + 2 * PERIOD + 0.3) == (PRESS,)


def test_a_touch_that_nobody_read_is_told_and_one_unfinished_is_not_counted():
    """A loop that stalls while a touch is held must not lose it silently."""
    hand = Hand((PRESS, PRESS, PRESS), repeat=False)
    hand.begin(0.2)
    for time in (0.0, 0.25, 1.6, 1.9):  # the second hold ends at 1.5, the third begins at 1.95
        hand.note(seen(time, status=Status.NO_CONTACT))
    judged = hand.judge()
    assert [touch.status for touch in judged] == ["NO_READING", "NO_READING"]
    assert not any(touch.found or touch.was_read for touch in judged)
    hand.note(seen(2.2, PRESS))
    hand.note(seen(2.31, PRESS))  # the third hold ends at 2.3
    assert [touch.was_read for touch in hand.judge()] == [False, False, True]
    assert Hand((PRESS,), repeat=False).judge() == ()


def test_fingers_and_a_new_zero_push_the_hand_aside():
    hand = Hand((PRESS,) * 5, repeat=False)
    hand.begin(0.0)
    hand.fingers = (DRAG,)
    assert hand.contacts(0.3) == (DRAG,)
    hand.lift(PERIOD + 0.4)
    assert hand.contacts(PERIOD + 0.39) == ()
    assert hand.contacts(PERIOD + 0.4) == (DRAG,)
    hand.fingers = ()
    assert hand.contacts(2 * PERIOD + 0.3) == (PRESS,)
    hand.spoil(3 * PERIOD + 0.1)
    for k in range(5):
        hand.note(seen(k * PERIOD + 0.3, PRESS))
    hand.note(seen(5 * PERIOD))
    judged = hand.judge()
    assert len(judged) == 2  # the third and the fifth
    assert all(touch.found for touch in judged)


def test_a_touch_is_judged_by_the_median_of_its_hold():
    off = Contact(position=(0.053, 0.074), force=(0.0, 0.03, -0.54))
    wild = Contact(position=(0.10, 0.10), force=(1.0, 1.0, -1.0))
    touch = judge(PRESS, [seen(0, off), seen(1, off), seen(2, wild)])
    assert touch.position_error_mm == pytest.approx(5.0)
    assert touch.force_error_percent == pytest.approx(10.0)
    assert touch.found
    assert (touch.true.x_mm, touch.true.fz_N) == (50.0, -0.5)
    assert (touch.estimated.x_mm, touch.estimated.fy_N) == (53.0, 0.03)
    further = Contact(position=(0.0531, 0.074), force=off.force)
    assert not judge(PRESS, [seen(0, further)]).found
    lost = judge(PRESS, [seen(0, off), *(2 * [seen(1, status=Status.OUT_OF_RANGE)])])
    assert (lost.status, lost.found, lost.estimated) == ("OUT_OF_RANGE", False, None)
