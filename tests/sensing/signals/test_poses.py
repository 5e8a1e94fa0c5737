"""What poses change is learned untouched, taken off, and no touch is taken for it."""

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.arrangement import rotation_matrix
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.inversion import rest_cross_talk
from smoskin.magnetics.temperature import temperature_factor
from smoskin.mechanics.masses import GRAVITY
from smoskin.mechanics.viscoelasticity import Memory, elastomer_prony
from smoskin.mechanics.weight import sags
from smoskin.origami.geometry import geometry
from smoskin.records import Estimate, Pose, Reading, Status
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.learned.gaussian_process import LearnedEstimator
from smoskin.sensing.signals.estimator import SignalEstimator
from smoskin.sensing.signals.poses import Poses
from smoskin.sensing.signals.turning import change_by_weight

DESIGN = read_design("curved")
CHIPS = len(DESIGN.halls)
EARTH = np.array([20e-6, 5e-6, -45e-6])
MAGNETS = point_charges([DESIGN.magnet(site.magnet) for site in DESIGN.halls])
CROSS_TALK = rest_cross_talk(DESIGN)
LYING = np.array([0.0, 0.0, -1.0])
"""Pull, g, on a skin that lies face up, as it is calibrated."""
RATE = 50.0


class Felt(SignalEstimator):
    """Feels any touch, and keeps its signals."""

    def __init__(self):
        super().__init__(DESIGN, range(CHIPS), creep=None, tracking=None)
        self.signals = np.zeros((CHIPS, 3))

    def _read(self, time, signals, temperature):
        self.signals = signals.reshape(CHIPS, 3)
        return Estimate(time=time, status=Status.AMBIGUOUS)


class Arm:
    """Readings of a made skin, unlike the designed one, on an arm that turns.

    Weight moves magnets in proportion, a touch moves them on from there, and the rubber creeps.
    """

    def __init__(self, seed=0, first=(0.0, 0.0, 0.0)):
        self.rng = np.random.default_rng(seed)
        self.time = 0.0
        skin = geometry(DESIGN)
        designed = [change_by_weight(DESIGN, chip, sags(DESIGN)) for chip in range(CHIPS)]
        weight = [part * self.rng.uniform(0.8, 1.2, (3, 3)) for part in designed]
        self.rest = skin.rest
        slope = charge_field_and_gradient(*MAGNETS, self.rest)[1]
        self.sag = np.linalg.solve(slope, np.array(weight))  # m at 1 g
        self.pressed = np.linalg.inv(slope).sum(axis=2)  # m, for 1 T more of each field
        self.own = [mlx90393.rotation(site).T for site in DESIGN.halls]
        self.inward = np.swapaxes(skin.chip_axes, 1, 2)
        self.pose = Pose(turn=rotation_matrix(np.asarray(first, dtype=float)))
        self.pull = Memory(elastomer_prony(DESIGN.columns.material), self.pose.turn.T @ LYING)
        self.crept = Memory(elastomer_prony(DESIGN.columns.material), 0.0)
        self.felt = Felt()
        self.estimator = ZeroFirst(self.felt)
        self.estimator.carried_by(lambda: self.pose)
        for _ in range(20):
            self.step(first)

    def step(self, turn, touch=0.0, warmer=0.0, acceleration=(0.0, 0.0, 0.0)):
        """Status of the next reading at a turn (rotation vector), under a touch, T."""
        turned = rotation_matrix(np.asarray(turn, dtype=float))
        self.pose = Pose(turn=turned, acceleration=acceleration)
        self.time += 1 / RATE
        down = self.pull.step(1 / RATE, turned.T @ (LYING - np.array(acceleration) / GRAVITY))
        self.touched = float(self.crept.step(1 / RATE, touch))
        moved = self.sag @ (down - LYING) + self.touched * self.pressed
        around = np.array(self.inward) @ turned.T @ EARTH + CROSS_TALK
        fields = self.magnets(moved) + around
        field = [own @ part for own, part in zip(self.own, fields, strict=True)]
        factor = temperature_factor(25.0 + warmer)
        noise = 2e-6 * self.rng.normal(size=(CHIPS, 3))
        reading = Reading(
            time=self.time,
            field=factor * np.array(field) + noise,
            temperature=np.full(CHIPS, 25.0 + warmer),
        )
        return self.estimator.step(reading).status

    def magnets(self, moved):
        """Fields where magnets have moved so, (S, 3), m, from the lying skin."""
        return charge_field_and_gradient(*MAGNETS, self.rest + moved)[0]

    def on_the_lying(self, touch):
        """Signals of such a touch on the skin that lies, (S, 3), T."""
        still = self.magnets(np.zeros((CHIPS, 3)))
        return self.magnets(touch * self.pressed) - still

    def swing(self, first=(0.0, 0.0, 0.0)):
        """Swing about three axes, untouched."""
        statuses = []
        for axis in np.eye(3):
            for phase in np.linspace(0, 2 * np.pi, 100):
                statuses.append(self.step(np.asarray(first) + 0.5 * np.sin(phase) * axis))
        return set(statuses)


@pytest.mark.parametrize("seed", range(2))
def test_a_skin_that_turns_untouched_feels_nothing_and_poses_are_learned(seed):
    arm = Arm(seed)
    assert arm.swing() == {Status.NO_CONTACT}
    # A pose that it has not been at, all at once.
    assert arm.step([0.3, -0.3, 0.1]) is Status.NO_CONTACT
    assert np.abs(arm.felt.drift).max() < 5e-6


def test_a_skin_that_is_shaken_untouched_feels_nothing_where_its_acceleration_is_known():
    arm = Arm()
    arm.swing()
    shaken = 2.0 * np.sin(np.linspace(0.0, 12.0, 300))  # m/s^2, some 700 uT
    felt = [arm.step([0.2, 0.0, 0.0], acceleration=(x, 0.0, -x)) for x in shaken]
    assert set(felt) == {Status.NO_CONTACT}


def test_magnets_that_warm_are_still_corrected():
    arm = Arm()
    arm.swing()
    warm = [arm.step([0.0, 0.0, 0.0], warmer=warmer) for warmer in np.linspace(0.0, 3.0, 200)]
    assert set(warm) == {Status.NO_CONTACT}
    assert np.abs(arm.felt.drift).max() < 5e-6


def test_a_touch_at_rest_is_no_pose_however_slowly_it_comes():
    arm = Arm()
    arm.swing()
    ramp = np.linspace(0.0, 300e-6, 200)  # 4 s to about half a newton
    statuses = [arm.step([0.0, 0.0, 0.0], touch) for touch in ramp]
    assert statuses[-1] is Status.AMBIGUOUS
    expected = arm.on_the_lying(300e-6)
    assert np.abs(arm.felt.signals - expected).max() < 0.05 * np.abs(expected).max()


def test_a_touch_moves_magnets_that_have_sunk_and_reads_as_it_does_on_the_lying_skin():
    arm = Arm()
    arm.swing()
    hung = rotation_matrix([np.pi / 2, 0.0, 0.0])
    sunk = arm.sag @ (hung.T @ LYING - LYING)
    for angle in np.linspace(0.0, np.pi / 2, 200):
        arm.step([angle, 0.0, 0.0])
    for _ in range(50):
        arm.step([np.pi / 2, 0.0, 0.0], 300e-6)
    lying = arm.on_the_lying(300e-6)
    size = np.abs(lying).max()
    added = arm.magnets(sunk + 300e-6 * arm.pressed) - arm.magnets(sunk)
    assert np.abs(added - lying).max() > 0.05 * size
    assert np.abs(arm.felt.signals - lying).max() < 8e-6 + 0.02 * size


def test_a_touch_that_moves_the_arm_reads_the_same_and_leaves_nothing_when_it_goes():
    arm = Arm()
    arm.swing()
    turns = np.linspace(0.0, 0.3, 100)
    assert {arm.step([angle, 0.0, 0.0], 300e-6) for angle in turns} == {Status.AMBIGUOUS}
    assert np.abs(arm.felt.signals - arm.on_the_lying(300e-6)).max() < 25e-6
    after = [arm.step([0.3, 0.0, 0.0]) for _ in range(25)]
    assert after[-1] is Status.NO_CONTACT


@pytest.mark.parametrize("rate", [100, 500])
def test_shaking_makes_no_pose_unsure_however_often_it_is_read(rate):
    """All that is left of a second of it is half a microtesla of what wanders anyway."""
    rng, pose = np.random.default_rng(0), [Pose(turn=np.eye(3))]
    noise = 4e-12 * np.eye(3 * CHIPS)
    poses = Poses(DESIGN, range(CHIPS), noise, lambda: pose[0])
    for shake in (*rng.normal(0.0, 0.5, (rate, 3)), np.zeros(3), np.zeros(3)):
        pose[0] = Pose(turn=np.eye(3), acceleration=shake)
        poses.step(1 / rate)
    np.testing.assert_allclose(poses.covariance, 0.25e-12 * np.eye(3 * CHIPS), rtol=0.05)


def test_a_skin_may_be_zeroed_at_any_pose():
    hung = (1.2, 0.0, 0.0)
    arm = Arm(first=hung)
    assert arm.swing(hung) == {Status.NO_CONTACT}
    for _ in range(50):
        arm.step(hung, 300e-6)
    expected = arm.on_the_lying(300e-6)
    assert np.abs(arm.felt.signals - expected).max() < 0.1 * np.abs(expected).max()


def test_a_zero_that_is_taken_back_leaves_the_poses_of_the_one_before():
    arm = Arm()
    arm.swing()
    arm.estimator.zero([Reading(time=0.0, field=geometry_fields(arm))], force=True)
    arm.estimator.unzero()
    assert [arm.step([0.2, 0.1, 0.0]) for _ in range(5)][-1] is Status.NO_CONTACT


def geometry_fields(arm):
    """Fields of the skin at rest as the chips stand, (S, 3), T, a millitesla off."""
    fields = arm.magnets(np.zeros((CHIPS, 3))) + CROSS_TALK + 1e-3
    return np.array([own @ part for own, part in zip(arm.own, fields, strict=True)])


def test_reset_forgets_poses():
    arm = Arm()
    arm.swing()
    arm.estimator.reset()
    assert not arm.felt.drift.any()
    assert arm.step([0.0, 0.0, 0.0]) is Status.NOT_CALIBRATED


def test_an_estimator_that_knows_no_design_takes_no_poses():
    with pytest.raises(ArgumentError, match="must be of a skin's design to take poses"):
        LearnedEstimator.carried_by(object.__new__(LearnedEstimator), Pose)
