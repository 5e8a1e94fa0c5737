"""What labels make of the readings of a held touch."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.magnetics.straightening import Straightening
from smoskin.records import Contact, HeldTouch, Reading, Status
from smoskin.sensing.response import labels as module
from smoskin.sensing.response.labels import Label, Labeller, labelled_touches
from smoskin.sensing.signals.loops import Loops
from smoskin.sensing.signals.signals import rest_field

CONTACT = Contact(position=(0.03, 0.05), force=(0.1, 0.0, -0.5))


class Signal(NamedTuple):
    values: np.ndarray
    temperature: float
    status: Status | None


class PlainSignals:
    """Takes a reading's field for its signals, and what is not good for saturated."""

    zeroed: tuple = ()

    def __init__(self, design, *, creep):
        type(self).creep = creep
        self.straightening = Straightening(design, rest_field(design))

    def zero(self, readings, *, force):
        type(self).zeroed = tuple(reading.time for reading in readings)

    def step(self, reading):
        status = Status.SATURATED if reading.flags.any() else None
        return Signal(reading.field, float(reading.temperature[0]), status)


@pytest.fixture(autouse=True)
def plain_signals(monkeypatch):
    monkeypatch.setattr(module, "Signals", PlainSignals)
    PlainSignals.zeroed = ()


def held(values, bad=(), rest=(1.0, 2.0), hold=(4.0, 6.0)):
    """A touch with a reading every second from 0, of these fields."""
    readings = tuple(
        Reading(
            time=float(k),
            field=np.full((3, 3), value),
            temperature=np.full(3, 20.0 + k),
            flags=np.full(3, int(k in bad)),
        )
        for k, value in enumerate(values)
    )
    return HeldTouch(contact=CONTACT, readings=readings, rest=rest, held=hold)


VALUES = (90.0, 1.0, 3.0, 50.0, 10.0, 11.0, 15.0, 70.0)


def test_a_label_is_the_mean_of_the_hold_less_that_of_the_rest(planar):
    label = Labeller(planar, creep="rubber").label(held(VALUES))
    assert_allclose(label.values, 12.0 - 2.0)
    assert (label.contact, label.temperature, label.status) == (CONTACT, 26.0, None)
    # The rest before the first touch is the zero.
    assert PlainSignals.zeroed == (1.0, 2.0)
    assert PlainSignals.creep == "rubber"


def test_a_rest_that_was_not_read_is_that_of_the_touch_before(planar):
    labeller = Labeller(planar)
    labeller.label(held(VALUES))
    assert PlainSignals.zeroed == (1.0, 2.0)
    assert_allclose(labeller.label(held(VALUES, bad=(1, 2))).values, 12.0 - 2.0)
    assert_allclose(labeller.label(held(VALUES, bad=(2,))).values, 12.0 - 1.0)
    # Only the first rest is the zero.
    assert PlainSignals.zeroed == (1.0, 2.0)


def test_a_touch_that_was_not_read_says_why(planar):
    labeller = Labeller(planar)
    label = labeller.label(held(VALUES, bad=(5,)))
    assert label.status is Status.SATURATED
    assert_allclose(label.values, 12.5 - 2.0)
    none = labeller.label(held(VALUES, bad=(4, 5, 6)))
    assert none.status is Status.SATURATED
    assert np.isnan(none.values).all()
    assert none.values.shape == (3, 3)
    empty = labeller.label(held(VALUES, hold=(4.2, 4.8)))
    assert (empty.status, empty.temperature) == (Status.CHIP_MISSING, 22.0)
    # Without a rest there is no level to take off.
    lost = Labeller(planar).label(held(VALUES, rest=(0.2, 0.8)))
    assert lost.status is Status.CHIP_MISSING


def test_what_a_touch_leaves_is_the_change_of_rests(planar):
    """Each change is what one touch left less what the one before had: two of a size."""
    labeller = Labeller(planar)
    later = (90.0, 7.0, 9.0, *VALUES[3:])
    labels = [labeller.label(held(values)) for values in (VALUES, later, VALUES)]
    assert labels[0].left is None
    assert_allclose(labels[1].left, 6.0)
    assert_allclose(labels[2].left, -6.0)
    touches = labelled_touches(labels, (0, 2), place_spread=0.0, force_spread=0.0)
    assert touches.left == pytest.approx(6.0 / np.sqrt(2))
    alone = labelled_touches(labels[:1], (0, 2), place_spread=0.0, force_spread=0.0)
    assert alone.left == 0.0
    unread = Labeller(planar)
    unread.label(held(VALUES))
    assert unread.label(held(VALUES, bad=(1, 2))).left is None


def test_labels_that_can_be_used_are_given_with_the_chips_asked_for():
    values = np.arange(9.0).reshape(3, 3)
    good = Label(CONTACT, values, 24.0, None)
    bad = Label(CONTACT, values, np.nan, Status.SATURATED)
    touches = labelled_touches([bad, good], (2, 0), place_spread=1e-4, force_spread=2e-3)
    assert_allclose(touches.signals, values[None, [2, 0]])
    assert_allclose(touches.position, [CONTACT.position])
    assert_allclose(touches.force, [CONTACT.force])
    assert_allclose(touches.temperature, [24.0])
    assert (touches.place_spread, touches.force_spread) == (1e-4, 2e-3)
    with pytest.raises(ArgumentError, match="at least one that can be used; got 1"):
        labelled_touches([bad], (0, 1), place_spread=0.0, force_spread=0.0)


def test_hysteresis_is_undone_where_touches_left_something(planar):
    """Signals of the planar skin's size, with one play of 5 %."""
    elastic = np.outer(np.random.default_rng(0).choice([-1.0, 0.5, 1.0], 40), np.full(9, 1e-3))
    loops = Loops(weights=[0.1], plays=[0.05], reach=np.full(9, 1e-3))
    play, read = np.zeros(9), np.zeros((40, 2, 9))
    for row, touch in enumerate(elastic):
        for k, x in enumerate((np.zeros(9), touch)):
            play = np.clip(play, x - 5e-5, x + 5e-5)
            read[row, k] = 0.9 * x + 0.1 * play
    bend = Straightening(planar, rest_field(planar))
    read = bend.bent(read).reshape(40, 2, 3, 3)
    labels = [Label(CONTACT, held - rest, 25.0, None, None, np.stack([rest, held]))
              for rest, held in read]  # fmt: skip
    unread = Label(CONTACT, np.full((3, 3), np.nan), np.nan, Status.SATURATED)
    made, fitted = Labeller(planar).unlooped([*labels, unread])
    assert made[-1] is unread
    widths = loops.plays @ loops.weights
    assert fitted.plays @ fitted.weights == pytest.approx(widths, rel=0.05)
    values = np.array([label.values for label in made[1:-1]])
    assert_allclose(values, bend.bent(elastic[1:]).reshape(-1, 3, 3), atol=2e-7)
    touches = labelled_touches(made, (2, 1), place_spread=0.0, force_spread=0.0, loops=fitted)
    assert touches.left < 2e-7
    assert touches.loops.reach.shape == (6,)
    few, none = Labeller(planar).unlooped(labels[:2])
    assert few == labels[:2]
    assert none is None
