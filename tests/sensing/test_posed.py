"""What poses change is learned untouched, taken off, and no touch is taken for it."""

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.magnetics import mlx90393
from smoskin.magnetics.arrangement import rotation_matrix
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.temperature import temperature_factor
from smoskin.mechanics.viscoelasticity import Memory, elastomer_prony
from smoskin.mechanics.weight import GRAVITY, sags
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Pose, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.posed import PosedEstimator
from smoskin.sensing.signals.turning import change_by_weight

DESIGN = read_design("curved")
CHIPS = len(DESIGN.halls)
EARTH = np.array([20e-6, 5e-6, -45e-6])
MAGNETS = point_charges([DESIGN.magnet(site.magnet) for site in DESIGN.halls])
LYING = np.array([0.0, 0.0, -1.0])
"""Pull, g, on a skin that lies face up, as it is calibrated."""
RATE = 50.0
ONE = Contact(position=(0.06, 0.08), force=(0.0, 0.0, -0.5))


class Still(Estimator):
    """Feels what differs from its first reading by more than 15 uT, and keeps it."""

    def __init__(self):
        self.first = None
        self.felt = 0.0

    @property
    def drift(self):
        return np.zeros((CHIPS, 3))

    def zero(self, readings, *, force=False):
        self.first = np.mean([reading.field for reading in readings], axis=0)

    def unzero(self):
        self.first = None

    def reset(self):
        self.first = None

    def step(self, reading):
        if self.first is None:
            self.first = reading.field
        self.felt = np.abs(reading.field - self.first).max()
        if self.felt < 15e-6:
            return Estimate(time=reading.time, status=Status.NO_CONTACT)
        return Estimate(
            time=reading.time,
            status=Status.CONTACT,
            contacts=(ONE,),
            covariance=np.zeros((1, 5, 5)),
        )


class Arm:
    """Readings of a made skin, unlike the designed one, on an arm that turns.

    Weight moves magnets in proportion, a touch moves them on from there, and the rubber creeps.
    """

    def __init__(self, seed=0):
        self.rng = np.random.default_rng(seed)
        self.turn = np.eye(3)
        self.time = 0.0
        skin = geometry(DESIGN)
        designed = [change_by_weight(DESIGN, chip, sags(DESIGN)) for chip in range(CHIPS)]
        weight = [one * self.rng.uniform(0.8, 1.2, (3, 3)) for one in designed]
        self.rest = skin.rest
        slope = charge_field_and_gradient(*MAGNETS, self.rest)[1]
        self.sag = np.linalg.solve(slope, np.array(weight))  # m at 1 g
        self.pressed = np.linalg.inv(slope).sum(axis=2)  # m, for 1 T more of each field
        self.own = [mlx90393.rotation(site).T for site in DESIGN.halls]
        self.inward = np.swapaxes(skin.chip_axes, 1, 2)
        self.pull = Memory(elastomer_prony(DESIGN.columns.material), [0.0, 0.0, -1.0])
        self.crept = Memory(elastomer_prony(DESIGN.columns.material), 0.0)
        self.inner = Still()
        self.posed = PosedEstimator(self.inner, DESIGN, lambda: self.pose)

    def step(self, turn, touch=0.0, warmer=0.0, acceleration=(0.0, 0.0, 0.0)):
        """Status of the next reading at a turn (rotation vector), under a touch, T."""
        self.turn = rotation_matrix(np.asarray(turn, dtype=float))
        self.pose = Pose(turn=self.turn, acceleration=acceleration)
        self.time += 1 / RATE
        down = self.pull.step(1 / RATE, self.turn.T @ (LYING - np.array(acceleration) / GRAVITY))
        self.touched = float(self.crept.step(1 / RATE, touch))
        moved = self.sag @ (down - LYING) + self.touched * self.pressed
        around = np.array(self.inward) @ self.turn.T @ EARTH
        field = [
            own @ part for own, part in zip(self.own, self.magnets(moved) + around, strict=True)
        ]
        factor = temperature_factor(25.0 + warmer)
        degrees = np.full(CHIPS, 25.0 + warmer)
        noise = 2e-6 * self.rng.normal(size=(CHIPS, 3))
        warm = factor * np.array(field) + noise
        reading = Reading(time=self.time, field=warm, temperature=degrees)
        return self.posed.step(reading).status

    def magnets(self, moved):
        """Fields where magnets have moved so, (S, 3), m, from the lying skin."""
        return charge_field_and_gradient(*MAGNETS, self.rest + moved)[0]

    def swing(self):
        """Swing about three axes, untouched."""
        statuses = []
        for axis in np.eye(3):
            for phase in np.linspace(0, 2 * np.pi, 100):
                statuses.append(self.step(0.5 * np.sin(phase) * axis))
        return set(statuses)


@pytest.mark.parametrize("seed", range(2))
def test_a_skin_that_turns_untouched_feels_nothing_and_poses_are_learned(seed):
    arm = Arm(seed)
    assert arm.swing() == {Status.NO_CONTACT}
    # A pose that it has not been at, all at once.
    assert arm.step([0.3, -0.3, 0.1]) is Status.NO_CONTACT
    assert arm.inner.felt < 15e-6


def test_a_skin_that_is_shaken_untouched_feels_nothing_where_its_acceleration_is_known():
    arm = Arm()
    arm.swing()
    shaken = 2.0 * np.sin(np.linspace(0.0, 12.0, 300))  # m/s^2, some 700 uT
    felt = [arm.step([0.2, 0.0, 0.0], acceleration=(x, 0.0, -x)) for x in shaken]
    assert set(felt) == {Status.NO_CONTACT}
    assert arm.inner.felt < 60e-6  # it changes by 0.1 m/s^2 a reading


def test_magnets_that_warm_are_the_estimators_to_correct():
    arm = Arm()
    arm.swing()
    before = arm.posed.drift
    for warmer in np.linspace(0.0, 0.3, 100):  # it feels 15 uT, half a degree
        assert arm.step([0.0, 0.0, 0.0], warmer=warmer) is Status.NO_CONTACT
    rest = np.abs(arm.magnets(np.zeros((CHIPS, 3)))).max()
    expected = rest * abs(temperature_factor(25.3) - 1.0)
    assert arm.inner.felt == pytest.approx(expected, abs=7e-6)
    assert np.abs(arm.posed.drift - before).max() < 3e-6


def test_a_touch_at_rest_is_no_pose_however_slowly_it_comes():
    arm = Arm()
    arm.swing()
    ramp = np.linspace(0.0, 300e-6, 200)  # 4 s to about half a newton
    statuses = [arm.step([0.0, 0.0, 0.0], touch) for touch in ramp]
    assert statuses[-1] is Status.CONTACT
    assert arm.inner.felt > 0.95 * arm.touched > 250e-6


def test_a_touch_moves_magnets_that_have_sunk_and_reads_as_it_does_on_the_lying_skin():
    arm = Arm()
    arm.swing()
    hung = rotation_matrix([np.pi / 2, 0.0, 0.0])
    sunk = arm.sag @ (hung.T @ LYING - LYING)
    for angle in np.linspace(0.0, np.pi / 2, 200):
        arm.step([angle, 0.0, 0.0])
    for _ in range(50):
        arm.step([np.pi / 2, 0.0, 0.0], 300e-6)
    unmoved = arm.magnets(np.zeros((CHIPS, 3)))
    lying = np.abs(arm.magnets(arm.touched * arm.pressed) - unmoved).max()
    added = np.abs(arm.magnets(sunk + arm.touched * arm.pressed) - arm.magnets(sunk)).max()
    assert abs(added - lying) > 0.05 * lying
    assert arm.inner.felt == pytest.approx(lying, abs=8e-6 + 0.02 * lying)


def test_a_touch_that_moves_the_arm_leaves_nothing_when_it_goes():
    arm = Arm()
    arm.swing()
    turns = np.linspace(0.0, 0.3, 100)
    felt = {arm.step([angle, 0.0, 0.0], 300e-6) for angle in turns}
    assert felt == {Status.CONTACT}
    assert arm.inner.felt == pytest.approx(arm.touched, abs=20e-6)
    after = [arm.step([0.3, 0.0, 0.0]) for _ in range(25)]
    assert after[-1] is Status.NO_CONTACT


def test_reset_forgets_poses_and_other_shapes_are_left_to_the_estimator():
    arm = Arm()
    arm.swing()
    drifted = arm.posed.drift
    arm.posed.reset()
    assert arm.inner.first is None
    assert drifted.shape == arm.posed.drift.shape == (CHIPS, 3)
    assert not arm.posed.drift.any()
    arm.posed.step(Reading(time=0.0, field=np.zeros((2, 3))))
    readings = [Reading(time=t / 10, field=np.full((CHIPS, 3), 0.03)) for t in range(5)]
    arm.posed.zero(readings)
    arm.posed.unzero()
