"""What a skin reads untouched at every pose of its arm, learned while nothing touches it.

Decides that whoever knows how the arm holds the skin need not guess how it turns. Hides the least
squares.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.masses import GRAVITY
from smoskin.mechanics.weight import sags
from smoskin.origami.geometry import geometry
from smoskin.records import Pose
from smoskin.sensing.signals.turning import change_by_weight

_EARTH: Final = 40e-6
"""Spread of the Earth's field along each axis of the room, T."""
_UNLIKE: Final = 0.3
"""Share of a chip's change by weight in which a made skin differs from the designed one."""
_WANDERS: Final = 0.5e-6
"""Random walk of all else in a second, T."""
_BENDS: Final = (10e-6, 1e-3)
"""Random walk of all else, T, over so much that poses change, T: made skins are not linear."""
_JOLT: Final = 0.02
"""Acceleration that an untouched skin may have unseen, m/s^2: how it begins is seen too late."""
_LYING: Final = np.array([0.0, 0.0, -1.0])
"""Pull on a skin that lies face up, as it is calibrated, g."""


class Stand(NamedTuple):
    """The pose at which a zero was taken."""

    pattern: Floats
    """What E and G change there, (C, 3 + 3 C)."""
    sunk: Floats
    """Linear signals by the skin's weight there, of the skin that lies, (C,), T."""


class Poses:
    """Changes of C signals with how an arm holds and moves the skin.

    Parameters
    ----------
    design : SkinDesign
    chips : sequence of int
        Chips whose signals they are.
    noise : Floats, shape (C, C)
        Covariance N of an idle sensor's signals, T^2.
    pose : callable
        Function that gives the pose at the newest reading.

    Notes
    -----
    Linear signals of chip s are :math:`y_s = c_s + A_s^T R^T E + G_s (R^T (d - a / g) - d_0)`: E
    the Earth's field, d down, a the acceleration, :math:`d_0` that of the skin that lies face up,
    :math:`G_s` (3, 3) the change by 1 g along its local axes :math:`A_s`, :math:`c_s` all else. E,
    G and c are followed by recursive least squares; a priori G is the designed one. Here are their
    differences from the pose of the zero ("What a pose changes" in `docs/derivations_robot.md`).
    """

    def __init__(
        self, design: SkinDesign, chips: Sequence[int], noise: Floats, pose: Callable[[], Pose]
    ) -> None:
        self._pose, self._noise, self._size = pose, noise, len(noise)
        self._inward = np.swapaxes(geometry(design).chip_axes[list(chips)], 1, 2)
        sagged = sags(design)
        self._designed = np.stack([change_by_weight(design, chip, sagged) for chip in chips])
        self.forget()

    def forget(self) -> None:
        """Know no more than the design."""
        apart = _UNLIKE / 3 * np.linalg.norm(self._designed, axis=(1, 2))
        spread = np.append(np.full(3, _EARTH), np.repeat(apart, 9))
        self._known = np.concatenate([np.zeros(3), self._designed.ravel(), np.zeros(self._size)])
        self._spread = np.diag(np.append(spread, np.zeros(self._size)) ** 2)
        self._at = self._pose()
        self._pattern = self._changed(self._at)
        self.begin()

    @property
    def stand(self) -> Stand:
        """The pose of the zero."""
        return self._stand

    def begin(self, stand: Stand | None = None) -> None:
        """Count from a pose at which a zero was taken, by default the present one."""
        weight = slice(3, 3 + 3 * self._size)
        sunk = self._pattern[:, weight] @ self._known[weight]
        self._stand = Stand(self._pattern, sunk) if stand is None else stand
        else_ = slice(-self._size, None)
        self._known[else_] = 0.0
        self._spread[else_] = self._spread[:, else_] = 0.0
        self._learned, self._walked = self._pattern, np.zeros(self._size)
        self._shaken = np.zeros_like(self._noise)
        self.jolted = self._shaken
        """Covariance (C, C), T^2, of what an untouched skin may read besides: it is jolted."""

    def step(self, elapsed: float) -> None:
        """Go on to the present pose, so many seconds later."""
        before, pattern = self._at, self._pattern
        self._at = pose = self._pose()
        self._pattern = self._changed(pose)
        # The acceleration told is the mean since a reading ago: half its change is as good as none.
        weighs = self._known[3 : -self._size].reshape(-1, 3) / GRAVITY
        shaken = 0.5 * weighs @ (pose.turn.T * (pose.acceleration - before.acceleration))
        self._shaken = shaken @ shaken.T
        self.jolted = _JOLT**2 * weighs @ weighs.T
        walk, over = _BENDS
        # Shaking is no pose: a path through accelerations is the longer the more of them are read.
        by_shaking = -2.0 * shaken.sum(axis=1)
        changed = (self._pattern - pattern) @ self._known[: -self._size]
        by_pose = np.abs(changed - by_shaking)
        self._walked = self._walked + _WANDERS**2 * elapsed + walk**2 * by_pose / over

    @property
    def even(self) -> Floats:
        """Change (C,), T, by what moves no magnet: the Earth's field."""
        return np.asarray((self._pattern - self._stand.pattern)[:, :3] @ self._known[:3])

    @property
    def moved(self) -> Floats:
        """Change (C,), T, of linear signals by the skin's weight, and all else."""
        weight, all_else = np.split(self._known[3:], [-self._size])
        return np.asarray((self._pattern - self._stand.pattern)[:, 3:] @ weight + all_else)

    @property
    def covariance(self) -> Floats:
        """Covariance (C, C), T^2, of what was not known of that when something was learned last."""
        gone, known = self._pattern - self._learned, slice(0, -self._size)
        spread = gone @ self._spread[known, known] @ gone.T
        return np.asarray(spread + np.diag(self._walked) + self._shaken)

    def learn(self, signals: Floats) -> None:
        """Take in linear signals (C,), T, of the untouched skin, less `even`."""
        walked = np.arange(-self._size, 0)
        self._spread[walked, walked] += self._walked
        self._learned, self._walked = self._pattern, np.zeros(self._size)
        pattern = np.hstack([self._pattern - self._stand.pattern, np.eye(self._size)])
        met = pattern @ self._spread
        noise = self._noise + self._shaken + self.jolted
        gain = np.linalg.solve(met @ pattern.T + noise, met).T
        self._known = self._known + gain @ (signals + self.even - pattern @ self._known)
        spread = self._spread - gain @ met
        self._spread = (spread + spread.T) / 2

    def _changed(self, pose: Pose) -> Floats:
        """What E and G change of signals at a pose, (C, 3 + 3 C)."""
        turned = pose.turn.T
        pull = turned @ (_LYING - pose.acceleration / GRAVITY) - _LYING
        rows = np.arange(self._size)
        pattern = np.zeros((self._size, 3 + 3 * self._size))
        pattern[:, :3] = np.concatenate(self._inward @ turned)
        pattern[rows[:, None], 3 + 3 * rows[:, None] + np.arange(3)] = pull
        return pattern
