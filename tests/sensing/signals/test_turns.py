"""A zero that turns: for how long a turn goes on, what tells that it does, and how far it may go.

Each against the filter of zero, speed and acceleration in one state, which is told what turns.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from smoskin.magnetics import mlx90393
from smoskin.records import Reading, Status
from smoskin.sensing.signals.course import scatter, turned
from smoskin.sensing.signals.estimator import FOLLOWING, ON_AN_ARM
from smoskin.sensing.signals.idle import IdleNoise
from smoskin.sensing.signals.signals import Signals, rest_field, signal_noise
from smoskin.sensing.signals.turning import TurnsSeen, turning
from smoskin.sensing.signals.zero import Zero, ZeroTracking

FORGETS, LASTS, STEADY = 2.0, 3.0, 2.0
"""s: time constants of what is known, of a speed and of an acceleration."""
SWERVES = 0.08
"""rad/s^2: spread of the accelerations of a turn."""


@pytest.fixture(scope="module")
def noise(planar):
    return signal_noise(planar)


@pytest.fixture(scope="module")
def whole(planar):
    return turning(planar).whole


def zero_of(planar, noise, **tracking):
    given = {"hold": 0.0, "time_constant": FORGETS, "widening_rate": 0.0} | tracking
    return Zero(
        ZeroTracking(**given), IdleNoise(noise, 1e-6), np.zeros(9), noise, turning=turning(planar)
    )


class Filter:
    """Zero, speed and acceleration of nine signals in one state, by matrix exponentials."""

    def __init__(self, noise):
        self.noise = noise
        self.state = np.zeros(27)
        self.covariance = np.kron(np.diag([1.0, 1.0, 0.0]), noise / 20)

    def stirred(self, turns):
        """A turn with this covariance for a radian begins."""
        self.covariance[18:, 18:] += SWERVES**2 * turns

    def go_on(self, step, turns):
        """So many seconds, in which jerks act along this covariance, that of a radian."""
        rates = np.array([[0.0, 1.0, 0.0], [0.0, -1 / LASTS, 1.0], [0.0, 0.0, -1 / STEADY]])
        jerks = np.diag([0.0, 0.0, 2 * SWERVES**2 / STEADY])
        # C. F. Van Loan, "Computing integrals involving the matrix exponential", 1978.
        both = expm(step * np.block([[-rates, jerks], [np.zeros((3, 3)), rates.T]]))
        moves = both[3:, 3:].T
        self.state = np.kron(moves, np.eye(9)) @ self.state
        self.covariance = np.kron(moves, np.eye(9)) @ self.covariance @ np.kron(
            moves, np.eye(9)
        ).T + np.kron(moves @ both[:3, 3:], turns)

    def see(self, step, read):
        self.covariance = self.covariance * np.exp(step / FORGETS)
        gain = self.covariance[:, :9] @ np.linalg.inv(self.covariance[:9, :9] + self.noise)
        self.state = self.state + gain @ (read - self.state[:9])
        self.covariance = self.covariance - gain @ self.covariance[:9]

    @property
    def moves(self):
        """Squared speed, of its variance and a hundredth of the noise a second squared."""
        speed, variance = self.state[9:18], self.covariance[9:18, 9:18]
        return speed @ np.linalg.solve(variance + 0.01 * self.noise, speed)


def turned_for(seconds):
    """Variance of the angle of a turn that began so long ago, rad^2."""
    angle = Filter(np.eye(9))
    angle.covariance[:] = 0.0
    angle.stirred(np.eye(9))
    angle.go_on(seconds, np.eye(9))
    return angle.covariance[0, 0]


@pytest.mark.parametrize("seconds", [1e-3, 0.1, 1.0, 5.0])
def test_jerks_scatter_a_course_as_their_integral_says(seconds):
    course = Filter(np.eye(9))
    course.covariance[:] = 0.0
    course.go_on(seconds, np.eye(9))
    np.testing.assert_allclose(scatter(seconds), course.covariance[::9, ::9], rtol=1e-4)
    assert turned(seconds)[0, 0] == pytest.approx(turned_for(seconds), rel=1e-5)


@pytest.mark.parametrize("speed", [0.0, 15e-6, 45e-6, 60e-6])
def test_a_turn_goes_on_for_two_seconds_after_the_skin_was_seen_to_move(
    planar, noise, whole, speed
):
    """Its speed is told once its square is three times its variance along each of nine axes."""
    zero, known = zero_of(planar, noise), Filter(noise)
    assert zero.step(0.0, np.zeros(9))
    known.see(0.0, np.zeros(9))
    zero.stir()  # nothing can have turned unseen since the reading just now
    known.stirred(whole)
    zero._steady = None  # and it is believed at once
    seen, gone, turning_for = 0.0, 0.0, 0
    axes, turned_about = [0.1], [whole]  # what is known before counts as 0.1 s of turning
    step = 0.13  # never two seconds sharp
    for k in range(1, 92):
        time = step * k
        gone += step * speed * np.interp(time, [0.0, 2.0, 4.0, 6.0], [0.0, 1.0, 1.0, 0.0])
        read = gone * np.tile([1.0, -0.5, 0.0], 3)
        turns = time - seen <= 2.0
        turning_for += turns
        along = np.average(turned_about, axis=0, weights=axes)
        known.go_on(step, along if turns else 0 * whole)
        known.see(step, read)
        assert zero.step(time, read)
        if turns and known.moves > 3 * 9:
            seen = time
            went, unsure = known.state[9:18], known.covariance[9:18, 9:18]
            rate = went @ np.linalg.solve(whole, went)
            axes.append(step)
            turned_about.append((np.outer(went, went) + unsure) / rate)
        np.testing.assert_allclose(zero.offset, known.state[:9], rtol=1e-6, atol=1e-13)
        np.testing.assert_allclose(zero.covariance, known.covariance[:9, :9], rtol=1e-5, atol=1e-17)
    # About two seconds after the start, or after the skin stood still.
    assert turning_for in ((15, 16) if speed < 20e-6 else range(50, 60))


def test_what_turns_of_a_skin_change_is_learned_from_how_fast_it_turns(planar, whole):
    """Of a skin unlike the design, about two axes in turn: what both change, and no more."""
    root = np.linalg.cholesky(whole)
    axes, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(9, 2)))
    about, seen = root @ axes, TurnsSeen(turning(planar))
    for angle in np.arange(0.0, 2 * np.pi, 0.05):
        speed = 0.2 * about @ [np.cos(angle), np.sin(angle)]
        seen.learn(0.1, speed, np.zeros((9, 9)))
    likened = np.linalg.solve(root, np.linalg.solve(root, seen.whole).T)  # 1 if nothing was seen
    # About either axis half of the time, and a tenth of a second in 12.7 s of what was known.
    np.testing.assert_allclose(axes.T @ likened @ axes, 0.5 * np.eye(2), atol=0.01)
    outside = np.eye(9) - axes @ axes.T
    np.testing.assert_allclose(outside @ likened @ outside, 0.1 / 12.7 * outside, atol=1e-9)


def test_a_zero_is_believed_up_to_six_radians_past_its_bound(planar, noise, whole):
    zero = zero_of(planar, noise, drift_bound=50e-6)
    bound = np.linalg.inv(50e-6**2 * np.eye(9) + 6.0**2 * whole)
    alike, believed = np.tile([0.0, 1.0, 0.0], 3), []
    for k in range(400):
        assert zero.step(0.1 * k, 0.5e-6 * min(k, 20) * max(k - 10, k / 2) * alike)
        squared = zero.drift @ bound @ zero.drift
        if abs(squared - 1) > 1e-6:
            assert zero.believed == (squared < 1)
        believed.append(zero.believed)
    assert believed[0]
    assert not believed[-1]


def test_a_skin_touched_from_its_first_reading_may_have_turned_for_a_second(planar, noise, whole):
    touch = np.full(9, 1e-3) * (-1.0) ** np.arange(9)
    zero = zero_of(planar, noise)
    assert not zero.turned.any()  # no reading, no time to turn in
    for _ in range(2):  # and so again where its clock starts anew
        assert not zero.step(5.0, touch)
        begun = zero.turned
        np.testing.assert_allclose(begun, turned_for(1.0) * whole, rtol=1e-6, atol=1e-18)
        assert zero.step(5.1, np.zeros(9))
        assert not zero.step(5.2, touch)
        begun = zero.turned
        np.testing.assert_allclose(begun, turned_for(0.1) * whole, rtol=1e-3, atol=1e-16)
        zero.rest()


ALIKE = np.tile([1.0, -0.5, 0.0], 3)


def began(planar, noise, readings, step=0.1):
    """A still zero, and one of which so many readings showed what only a turn explains."""
    still, zero = zero_of(planar, noise), zero_of(planar, noise)
    for k in range(30):
        for each in (still, zero):
            assert each.step(0.1 * (k - 30), np.zeros(9))
    for k in range(readings):
        assert zero.step(step * k, 40e-6 * (1 + step * k) * ALIKE)
    return still, zero


@pytest.mark.parametrize(
    ("readings", "step", "believed"),
    [(1, 0.1, False), (3, 0.1, False), (4, 0.1, True), (2, 0.5, False), (3, 0.16, True)],
)
def test_a_turn_is_believed_after_three_tenths_of_a_second_and_three_readings(
    planar, noise, readings, step, believed
):
    """What touches the skin before began as slowly as a turn: the zero is what it was."""
    still, zero = began(planar, noise, readings, step)
    assert np.abs(zero.offset).max() > 20e-6
    time, touch = step * readings, 2e-3 * (-1.0) ** np.arange(9)
    assert not zero.step(time, touch)
    still.interrupt(time)
    if believed:
        assert np.abs(zero.offset - still.offset).max() > 20e-6
    else:
        np.testing.assert_allclose(zero.offset, still.offset, atol=1e-9)
        np.testing.assert_allclose(zero.covariance, still.covariance, rtol=1e-9, atol=1e-18)


def test_a_turn_that_a_reading_does_without_is_taken_back(planar, noise):
    """The last of a touch that was let go."""
    still, zero = began(planar, noise, 2)
    for k in range(2, 30):
        for each in (still, zero):
            assert each.step(0.1 * k, np.zeros(9))
    np.testing.assert_allclose(zero.offset, 0.0, atol=0.1e-6)
    assert (zero.covariance.diagonal() < 1.5 * still.covariance.diagonal()).all()


def test_a_turn_found_under_a_touch_is_taken_back_where_the_rest_needs_none(planar, noise):
    _, zero = began(planar, noise, 0)
    touch = 2e-3 * (-1.0) ** np.arange(9)
    for k in range(10):
        assert not zero.step(0.1 * k, touch)
    zero.stir()
    unsure = zero.covariance.diagonal().copy()
    assert not zero.step(1.0, touch)
    assert (zero.covariance.diagonal() > 0.9 * unsure).all()
    assert zero.step(1.1, np.zeros(9))
    assert (zero.covariance.diagonal() < 0.1 * unsure).all()


def test_a_skins_weight_is_followed_on_an_arm_alone(planar, noise):
    """What lifts the sheet as the arm turns it presses a skin that stands."""
    lifted = np.linalg.eigh(turning(planar).whole - turning(planar).field)[1][:, -1]
    for arm, idle in ((True, True), (False, False)):
        tracking = replace(FOLLOWING, arm=arm)
        signals = Signals(planar, tracking=tracking, idle=IdleNoise(noise, 1e-6))
        rest = np.einsum("sji,sj->si", mlx90393.rotations(planar.halls), rest_field(planar))
        own = np.einsum("sji,sj->si", mlx90393.rotations(planar.halls), lifted.reshape(3, 3))
        signals.zero([Reading(time=0.0, field=rest)])
        seen = []
        for k in range(100):
            gone = 0.5e-3 * np.interp(0.02 * k, [0.5, 1.5], [0.0, 1.0])
            seen.append(signals.step(Reading(time=0.02 * k + 0.02, field=rest + gone * own)).status)
        assert (set(seen) == {Status.NO_CONTACT}) is idle
    assert replace(FOLLOWING, arm=True) == ON_AN_ARM
    still = turning(planar, weight=False)
    np.testing.assert_array_equal(still.whole, still.field)
    np.testing.assert_array_equal(still.field, turning(planar).field)
