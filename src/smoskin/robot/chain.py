"""An arm's joints in a row: where its parts are, and how fast every part moves.

Decides that an arm is told by what its joints are at zero; hides the products of their turns.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints, assign, freeze, wholes
from smoskin.errors import ArgumentError
from smoskin.records import Pose

_ACROSS: Final = np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2).reshape(3, 9)
"""Directions to the matrices, row by row, of their cross products."""
_LONGEST: Final = 0.1
"""Longest time between two moments, s, over which an acceleration is told."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chain:
    """J joints that turn, one carried by the other, with the skin on a link; all at zero turn.

    Raises
    ------
    ArgumentError
        If shapes disagree, an axis is no direction, a range is empty, or a limit not positive.
    """

    axes: Floats
    """(J, 3): directions of the joints' axes, in the base's frame."""
    anchors: Floats
    """(J, 3), m: a point on each axis."""
    lower: Floats
    """(J,), rad: ends of the joints' ranges."""
    upper: Floats
    """(J,), rad."""
    speed: Floats
    """(J,), rad/s: fastest that each joint may turn."""
    acceleration: Floats
    """(J,), rad/s^2: how fast each joint changes its speed, and stops."""
    carriers: int
    """Number of joints that move the skin: the first so many."""
    origin: Floats
    """(3,), m: origin of the skin's frame."""
    turn: Floats
    """(3, 3): axes of the skin's frame, as columns."""
    corners: Floats
    """(P, 3), m: corners of boxes round all links, at which a link moves fastest."""
    moved_by: Ints
    """(P,): number of joints that move each corner."""

    def __post_init__(self) -> None:
        freeze(self, axes=(None, 3), anchors=(None, 3), origin=(3,), turn=(3, 3), corners=(None, 3))
        each = (len(self.axes),)
        freeze(self, lower=each, upper=each, speed=each, acceleration=each)
        assign(self, moved_by=wholes("moved_by", self.moved_by, (len(self.corners),)))
        if not np.allclose(np.linalg.norm(self.axes, axis=1), 1.0) or len(self.anchors) != each[0]:
            raise ArgumentError("axes must be directions of length 1, with an anchor for each")
        if not (self.lower < self.upper).all():
            raise ArgumentError(f"lower must be below upper; got {self.lower} and {self.upper}")
        if not (np.minimum(self.speed, self.acceleration) > 0.0).all():
            raise ArgumentError("speed and acceleration must be positive")
        if not 1 <= self.carriers <= each[0]:
            raise ArgumentError(f"carriers must be from 1 to {each[0]}; got {self.carriers}")

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.axes)

    def posture(self, angles: ArrayLike) -> "Posture":
        r"""The places of everything at these angles, (J,), rad.

        Notes
        -----
        Joint i turns what lies behind it about its axis through its anchor :math:`c_i`; parts that
        k joints move are at :math:`R_k x + t_k` with :math:`R_{i+1} = R_i Q_i` and
        :math:`t_{i+1} = t_i + R_i (c_i - Q_i c_i)`; :math:`Q = I + \sin q\, K + (1 - \cos q) K^2`
        with the matrix K of the cross product by the axis (Rodrigues).
        """
        given = np.asarray(angles, dtype=np.float64)[:, None, None]
        across = (self.axes @ _ACROSS).reshape(-1, 3, 3)
        links = np.zeros((self.joints, 4, 4))
        turned = np.eye(3) + np.sin(given) * across + (1.0 - np.cos(given)) * (across @ across)
        links[:, :3, :3], links[:, 3, 3] = turned, 1.0
        links[:, :3, 3] = self.anchors - (turned @ self.anchors[:, :, None])[:, :, 0]
        frames = [np.eye(4)]
        for link in links:
            frames.append(frames[-1] @ link)
        moved = np.array(frames)
        return Posture(self, moved[:, :3, :3], moved[:, :3, 3])


class Posture:
    """A chain at some angles."""

    def __init__(self, chain: Chain, rotations: Floats, shifts: Floats) -> None:
        self._chain, self._rotations, self._shifts = chain, rotations, shifts
        self.frames = tuple(zip(rotations, shifts, strict=True))
        """Turn and shift, (3, 3) and (3,), m, of the parts that no, one ... all joints move."""
        axes = (rotations[:-1] @ chain.axes[:, :, None])[:, :, 0]
        anchors = (rotations[:-1] @ chain.anchors[:, :, None])[:, :, 0] + shifts[:-1]
        across = (axes @ _ACROSS).reshape(-1, 3, 3)
        # A place p moves as a x (p - c) when a joint turns: by what is linear in p, and the rest.
        self._linear = across.swapaxes(0, 1).reshape(-1, 3).T
        self._rest = (across @ anchors[:, :, None])[:, :, 0].T

    @cached_property
    def corners(self) -> Floats:
        """(P, 3), m: corners of the links' boxes."""
        points, count = self._chain.corners, self._chain.moved_by
        turned = (self._rotations[count] @ points[:, :, None])[:, :, 0]
        return np.asarray(turned + self._shifts[count])

    @cached_property
    def corner_motions(self) -> Floats:
        """(P, 3, J), m: how each corner moves when a joint turns by a radian."""
        moved = np.arange(self._chain.joints) < self._chain.moved_by[:, None]
        return self._motions(self.corners) * moved[:, None, :]

    def on_skin(self, places: ArrayLike) -> Floats:
        """Places of the skin's frame, (..., 3), m, in the base's."""
        chain = self._chain
        at_zero = np.asarray(places) @ chain.turn.T + chain.origin
        turned = at_zero @ self._rotations[chain.carriers].T
        return np.asarray(turned + self._shifts[chain.carriers])

    def of_skin(self, directions: ArrayLike) -> Floats:
        """Directions of the skin's frame, (..., 3), in the base's."""
        turn = self._rotations[self._chain.carriers] @ self._chain.turn
        return np.asarray(np.asarray(directions) @ turn.T)

    def jacobian(self, place: Floats) -> Floats:
        """How a place (3,) on the skin's link moves when a joint turns by a radian, (3, J), m."""
        motions = np.asarray(self._motions(place[None])[0])
        motions[:, self._chain.carriers :] = 0.0
        return motions

    def _motions(self, points: Floats) -> Floats:
        """Velocities of points (P, 3) when each joint turns by a radian, (P, 3, J), m."""
        moving = (points @ self._linear).reshape(-1, 3, self._chain.joints)
        return np.asarray(moving - self._rest)


class Carriage:
    """Poses of the skin that a chain carries, by its joints one moment after the other.

    Parameters
    ----------
    chain : Chain
    middle : Floats, shape (3,)
        Middle of the skin in its frame, m.
    """

    def __init__(self, chain: Chain, middle: Floats) -> None:
        self._chain, self._middle = chain, middle
        self._before: tuple[float, Floats] | None = None
        self.pose = Pose(turn=np.eye(3))
        """Pose at the newest moment; its acceleration is the mean since the one before."""

    def look(self, time: float, angles: Floats, speeds: Floats) -> Pose:
        """The pose at a moment, s, by angles and speeds of the joints, (J,), rad and rad/s."""
        posture = self._chain.posture(angles)
        velocity = posture.jacobian(posture.on_skin(self._middle)) @ speeds
        acceleration = np.zeros(3)
        if self._before is not None and 0.0 < time - self._before[0] < _LONGEST:
            acceleration = (velocity - self._before[1]) / (time - self._before[0])
        self._before = time, velocity
        self.pose = Pose(turn=posture.of_skin(np.eye(3)).T, acceleration=acceleration)
        return self.pose
