"""The virtual rig: what it promises as a rig, and what spoils its touches."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError, SourceError
from smoskin.magnetics.temperature import temperature_factor
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.records import Contact, HeldTouch, Motion, Reading, Status
from smoskin.sensing.response.labels import Labeller, labelled_touches
from smoskin.twin.rig import VirtualRig, drifting_readings, open_rig
from smoskin.twin.whole import Twin
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
            times = [reading.time for reading in touch.readings]
            assert times == sorted(times)
            assert times[0] > last
            last = times[-1]
            for start, end in (touch.rest, touch.held):
                assert sum(start <= time <= end for time in times) >= 5
            assert touch.rest[1] < touch.held[0]
            assert touch.held[1] == times[-1]


def test_reported_touches_are_off_by_stage_and_gauge(skin):
    twin = MadeTwin(skin)
    rig = VirtualRig(twin, np.random.default_rng(0), creep=False, stage=1e-3, gauge=0.05)
    still = twin.motion((PRESS,))
    reported = [rig.hold(PRESS, still).contact for _ in range(600)]
    place = np.stack([contact.position for contact in reported]) - PRESS.position
    force = np.stack([contact.force for contact in reported]) - PRESS.force
    assert rig.place_spread == 1e-3
    assert rig.force_spread == 0.05
    np.testing.assert_allclose(place.std(axis=0), 1e-3, rtol=0.1)
    np.testing.assert_allclose(force.std(axis=0), 0.05, rtol=0.1)
    assert np.abs(place.mean(axis=0)).max() < 4 * 1e-3 / np.sqrt(600)
    assert np.abs(force.mean(axis=0)).max() < 4 * 0.05 / np.sqrt(600)


def test_a_rig_keeps_its_promised_times(skin):
    rig = VirtualRig(MadeTwin(skin), np.random.default_rng(0))
    first, second = rig.press(PRESS), rig.press(PRESS)
    assert first.rest == pytest.approx((-0.2, 0.0))
    assert first.held == pytest.approx((0.02, 0.3))
    assert second.rest == pytest.approx((0.8, 1.0))
    assert second.held == pytest.approx((1.02, 1.3))
    assert second.readings[0].time == pytest.approx(0.32)
    np.testing.assert_allclose(np.diff([r.time for r in first.readings]), 0.02)
    assert len(first.readings) == 26


def test_chips_walk_as_far_as_stated(skin):
    twin = MadeTwin(skin)
    rest = Motion.rest(3, (400,))
    times = 4.0 * np.arange(1, 401)
    walks = []
    for seed in range(8):
        read, walked = drifting_readings(
            twin, rest, times, np.full(400, 4.0), np.random.default_rng(seed),
            temperature=25.0, drift=5e-6, walked=np.full((3, 3), 1e-3),
        )  # fmt: skip
        walks.append(walked - 1e-3)
        still = twin.readout.seen(Motion.rest(3))
        np.testing.assert_allclose(read[-1].field - walked, still, atol=40e-6)
    # 400 steps of 5 uT in a second, each twice as far in four seconds.
    assert np.std(walks) == pytest.approx(5e-6 * np.sqrt(1600), rel=0.25)


def test_a_rig_s_temperature_is_the_skin_s_and_the_chips(skin):
    cold = VirtualRig(MadeTwin(skin), np.random.default_rng(0), temperature=10.0).press(PRESS)
    warm = VirtualRig(MadeTwin(skin), np.random.default_rng(0), temperature=40.0).press(PRESS)
    degrees = [np.mean([r.temperature for r in touch.readings], axis=0) for touch in (cold, warm)]
    np.testing.assert_allclose(degrees[1] - degrees[0], 30.0, atol=0.1)
    size = [np.abs(touch.readings[0].field[:, 2]) for touch in (cold, warm)]
    np.testing.assert_allclose(
        size[1] / size[0], temperature_factor(40.0) / temperature_factor(10.0), rtol=2e-3
    )


def test_a_rig_of_a_design_presses_the_made_skin_of_its_seed(planar):
    pytest.importorskip("jax")
    rig = open_rig("virtual?seed=5&temperature=31", planar)
    touch = rig.press(Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5)))
    twin = Twin(planar, seed=5, manufactured=True)
    rest = twin.read(temperature=31.0)
    np.testing.assert_allclose(touch.readings[0].field, rest.field, atol=60e-6)
    np.testing.assert_allclose(touch.readings[0].temperature, rest.temperature, atol=0.1)
    assert rig.place_spread == 20e-6
    assert rig.force_spread == 2e-3
    other = VirtualRig(planar, seed=6).press(touch.contact)
    assert np.abs(other.readings[0].field - rest.field).max() > 1e-4


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "robot",
            "rig must be virtual, with the options seed, temperature, ramp, recovery; got 'robot'",
        ),
        ("virtual?speed=1", "with the options seed, temperature, ramp"),
        ("virtual?seed=", "a rig's options must be numbers"),
        ("virtual?seed=1.5", "a rig's options must be numbers"),
        ("virtual?temperature=warm", "a rig's options must be numbers"),
        ("virtual?seed=-1", "seed of a rig must not be negative; got -1"),
        ("virtual?temperature=200", "temperature must"),
    ],
)
def test_rigs_that_there_are_not_are_named(planar, name, message):
    with pytest.raises(ArgumentError, match=message):
        open_rig(name, planar)


def test_the_same_generator_gives_the_same_touches(skin):
    first, second = (VirtualRig(MadeTwin(skin), np.random.default_rng(5)).press(PRESS)
                  for _ in range(2))  # fmt: skip
    assert first.readings == second.readings
    assert first.contact == second.contact


def test_a_rig_that_is_given_no_time_says_so(skin):
    rig = VirtualRig(MadeTwin(skin), np.random.default_rng(0))
    with pytest.raises(SourceError, match=r"within 0\.99 s; one takes 1 s"):
        rig.press(PRESS, 0.99)
    assert rig.press(PRESS, 1.0).held == pytest.approx((0.02, 0.3))


@pytest.mark.parametrize("name", ["drift", "stage", "gauge"])
@pytest.mark.parametrize("value", [-1e-12, np.inf, np.nan])
def test_absurd_rigs_are_refused(skin, name, value):
    with pytest.raises(ArgumentError, match=f"{name} must be finite and >= 0"):
        VirtualRig(MadeTwin(skin), np.random.default_rng(0), **{name: value})
    VirtualRig(MadeTwin(skin), np.random.default_rng(0), **{name: 0.0})


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
        off = [label.values - exact(skin, twin) for label in pressed_labels(skin, rig, 5, creep)]
        errors.append(np.linalg.norm(off, axis=(1, 2)).max() / size)
    # Creep undone leaves the signals' curvature; not undone, the creep itself.
    assert errors[0] < 0.02
    assert errors[1] > 0.04


def test_drift_takes_no_part_in_labels(skin):
    twin = MadeTwin(skin)
    rig = VirtualRig(twin, np.random.default_rng(1), drift=20e-6, creep=False)
    off = np.array([label.values for label in pressed_labels(skin, rig, 40)]) - exact(skin, twin)
    # 20 uT a second would come to 130 uT in the end; within half a second to a few.
    assert np.sqrt(np.mean(off[20:] ** 2)) < 25e-6


def test_a_touch_that_ends_a_chips_range_is_not_labelled(skin):
    rig = VirtualRig(Saturating(skin, 0.4e-3), np.random.default_rng(1), creep=False)
    labeller = Labeller(skin)
    light = Contact(position=PRESS.position, force=0.3 * PRESS.force)
    labels = [labeller.label(rig.press(contact)) for contact in (light, PRESS, light)]
    assert [label.status for label in labels] == [None, Status.SATURATED, None]
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
