"""The virtual rig: what it promises as a rig, and what spoils its touches."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError, SourceError
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.records import Contact, HeldTouch, Motion, Reading, Status
from smoskin.sensing.response.labels import Labeller, labelled_touches
from smoskin.twin.rig import VirtualRig
from tables_of_response import motions, plain, signals
from virtual_skins import MadeTwin, Saturating

PRESS = Contact(position=(0.05, 0.07), force=(0.1, 0.0, -0.6))


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def test_a_rig_gives_rest_and_hold_of_each_touch(skin):
    with VirtualRig(MadeTwin(skin), np.random.default_rng(0)) as rig:
        last = -np.inf
        for _ in range(3):
            touch = rig.press(PRESS)
            times = [one.time for one in touch.readings]
            assert times == sorted(times)
            assert times[0] > last
            last = times[-1]
            for start, end in (touch.rest, touch.held):
                assert sum(start <= time <= end for time in times) >= 5
            assert touch.rest[1] < touch.held[0]
            assert touch.held[1] == times[-1]


def test_reported_touches_are_off_by_stage_and_gauge(skin):
    rig = VirtualRig(MadeTwin(skin), np.random.default_rng(0), stage=1e-3, gauge=0.05)
    said = [rig.press(PRESS).contact for _ in range(60)]
    place = np.stack([one.position for one in said]) - PRESS.position
    force = np.stack([one.force for one in said]) - PRESS.force
    assert rig.place_spread == 1e-3
    assert rig.force_spread == 0.05
    assert np.std(place) == pytest.approx(1e-3, rel=0.25)
    assert np.std(force) == pytest.approx(0.05, rel=0.25)


def test_the_same_generator_gives_the_same_touches(skin):
    one, other = (VirtualRig(MadeTwin(skin), np.random.default_rng(5)).press(PRESS)
                  for _ in range(2))  # fmt: skip
    assert one.readings == other.readings
    assert one.contact == other.contact


def test_a_rig_that_is_given_no_time_says_so(skin):
    rig = VirtualRig(MadeTwin(skin), np.random.default_rng(0))
    with pytest.raises(SourceError, match=r"within 0\.5 s"):
        rig.press(PRESS, 0.5)


def test_absurd_rigs_are_refused(skin):
    with pytest.raises(ArgumentError, match="gauge must be finite"):
        VirtualRig(MadeTwin(skin), np.random.default_rng(0), gauge=-1.0)


def test_times_of_a_held_touch_follow_each_other():
    reading = Reading(time=0.0, field=np.zeros((3, 3)))
    with pytest.raises(ArgumentError, match="rest must end before held begins"):
        HeldTouch(contact=PRESS, readings=(reading,), rest=(0.0, 2.0), held=(1.0, 3.0))
    with pytest.raises(ArgumentError, match="readings must be there"):
        HeldTouch(contact=PRESS, readings=(), rest=(0.0, 1.0), held=(1.0, 3.0))


# What labels make of held touches


def exact(skin, twin):
    """Of the press, settled, as the estimators' signals define it, (S, 3), T."""
    motion = motions(skin, PRESS.position[None], PRESS.force[None])
    return signals(skin, twin.readout, motion)[0]


def pressed_labels(skin, rig, count, creep=None):
    labeller = Labeller(skin, creep)
    return [labeller.label(rig.press(PRESS)) for _ in range(count)]


def test_labels_say_what_a_settled_touch_reads(skin):
    twin = MadeTwin(skin)
    rubber = elastomer_prony(skin.columns.material)
    size = np.linalg.norm(exact(skin, twin))
    errors = []
    for creep in (rubber, None):
        rig = VirtualRig(twin, np.random.default_rng(1))
        off = [one.values - exact(skin, twin) for one in pressed_labels(skin, rig, 5, creep)]
        errors.append(np.linalg.norm(off, axis=(1, 2)).max() / size)
    # Creep undone leaves the signals' curvature; not undone, the creep itself.
    assert errors[0] < 0.02
    assert errors[1] > 0.04


def test_drift_takes_no_part_in_labels(skin):
    twin = MadeTwin(skin)
    rig = VirtualRig(twin, np.random.default_rng(1), drift=20e-6, creep=False)
    off = np.array([one.values for one in pressed_labels(skin, rig, 40)]) - exact(skin, twin)
    # 20 uT a second would come to 130 uT in the end; within half a second to a few.
    assert np.sqrt(np.mean(off[20:] ** 2)) < 25e-6


def test_a_touch_that_ends_a_chips_range_is_not_labelled(skin):
    rig = VirtualRig(Saturating(skin, 1.2e-3), np.random.default_rng(1), creep=False)
    labeller = Labeller(skin)
    light = Contact(position=PRESS.position, force=0.3 * PRESS.force)
    labels = [labeller.label(rig.press(one)) for one in (light, PRESS, light)]
    assert [one.status for one in labels] == [None, Status.SATURATED, None]
    touches = labelled_touches(labels, (1, 2), place_spread=0.0, force_spread=0.0)
    assert touches.signals.shape == (2, 2, 3)
    with pytest.raises(ArgumentError, match="at least one that can be used; got 1"):
        labelled_touches(labels[1:2], (1, 2), place_spread=0.0, force_spread=0.0)


def test_an_invalid_state_is_not_labelled(skin):
    twin = MadeTwin(skin)
    rig = VirtualRig(twin, np.random.default_rng(1))
    lost = Motion.rest(3).scaled(np.nan)
    labeller = Labeller(skin, elastomer_prony(skin.columns.material))
    assert labeller.label(rig.hold(PRESS, lost)).status is not None
    after = labeller.label(rig.press(PRESS))
    assert after.status is None
    assert np.linalg.norm(after.values - exact(skin, twin)) < 0.03 * np.linalg.norm(after.values)
