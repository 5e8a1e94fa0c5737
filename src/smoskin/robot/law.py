r"""The law by which an arm yields: from a force on a place to speeds of joints, within limits.

Pure functions; "Yielding to touch" in `docs/derivations_robot.md`. Hides no state.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats, freeze
from smoskin.errors import ArgumentError
from smoskin.robot.chain import Chain, Posture

_WEAK: Final = 0.05
"""Singular value of a place's Jacobian below which it is damped, m."""
_DAMPING: Final = 0.02
"""Damping where it is 0, m."""
HARD_LIMIT: Final = 0.25
"""Fastest that any part may ever move, m/s (reduced speed of ISO 10218-1)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """What the arm may do. Numbers out of their range raise an `ArgumentError`."""

    begin: float = 0.55
    """N: force from which the arm moves."""
    end: float = 0.45
    """N: force below which it stands again."""
    resistance: float = 6.0
    """N s/m: force over `end` for a speed of 1 m/s."""
    excessive: float = 1.25
    """N: force from which the arm gives way a little and stops for good. The shipped tables know
    touches up to 1.4 N; what is harder is out of range."""
    speed: float = 0.1
    """m/s: fastest of any part, at most 0.25."""
    acceleration: float = 1.0
    """m/s^2: fastest gain of speed of any part."""
    braking: float = 2.0
    """m/s^2: deceleration that the arm is trusted with near the end of what it may do."""
    distance: float = 0.1
    """m: longest way of the touched place in one touch."""
    duration: float = 5.0
    """s: longest time of moving in one touch."""
    release: float = 0.01
    """m: longest way in which the arm gives way to an excessive force."""
    release_speed: float = 0.03
    """m/s: speed at which it does."""
    ellipse: float = 0.02
    """m: longest half axis of a place's 95 % ellipse that is believed."""
    low: Floats = (-2.0, -2.0, 0.05)  # type: ignore[assignment]
    """(3,), m: lowest coordinates of the touched place, in the base's frame."""
    high: Floats = (2.0, 2.0, 2.0)  # type: ignore[assignment]
    """(3,), m: highest."""
    floor: float = 0.02
    """m: height below which no part of the arm that moves may go."""
    angle: float = 5.0
    """degrees: largest angle between the force and the way that the place can go."""
    patience: float = 0.05
    """s: oldest estimate that is acted on, by its arrival."""
    cycle: float = 0.025
    """s: longest time between two looks at it all."""

    def __post_init__(self) -> None:
        freeze(self, low=(3,), high=(3,))
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if name not in ("low", "high", "floor") and not 0.0 < value < np.inf:
                raise ArgumentError(f"{name} must be positive and finite; got {value}")
        if not self.end < self.begin < self.excessive:
            raise ArgumentError(
                "end must be below begin, and that below excessive; got "
                f"{self.end}, {self.begin} and {self.excessive} N"
            )
        if not (self.speed <= HARD_LIMIT and self.release_speed <= self.speed):
            raise ArgumentError(f"speed must be at most {HARD_LIMIT} m/s; got {self.speed}")
        if not (self.low < self.high).all():
            raise ArgumentError(f"low must be below high; got {self.low} and {self.high} m")


def is_pushed(force: float, before: bool, limits: Limits) -> bool:
    """Whether a force moves the arm: from `begin` on, and then until it falls below `end`."""
    return force >= (limits.end if before else limits.begin)


def yielding(force: Floats, limits: Limits) -> Floats:
    r"""Velocity of a place that is pushed, (3,), m/s, by the force (3,), N.

    Notes
    -----
    :math:`v = \min((|F| - F_0) / b, v_{max})\, F / |F|`, zero below the end :math:`F_0` of the dead
    band.

    Examples
    --------
    >>> yielding(np.array([0.0, 0.0, -0.75]), Limits()).round(3).tolist()
    [0.0, 0.0, -0.05]
    """
    size = float(np.linalg.norm(force))
    speed = min(max(size - limits.end, 0.0) / limits.resistance, limits.speed)
    return np.asarray(force * (speed / size if size else 0.0))


def joint_speeds(jacobian: Floats, velocity: Floats) -> Floats:
    r"""Speeds of joints, (J,), rad/s, that move a place so, (3,), m/s, as far as they can.

    Notes
    -----
    Damped least squares: :math:`\dot q = J^T (J J^T + \lambda^2 I)^{-1} v` with
    :math:`\lambda^2 = \lambda_0^2 (1 - (\sigma / \sigma_0)^2)` where the least singular value
    :math:`\sigma` of J is below :math:`\sigma_0`, else 0 (Nakamura and Hanafusa, 1986).
    """
    left, values, right = np.linalg.svd(jacobian, full_matrices=False)
    weakness = max(1.0 - (values[-1] / _WEAK) ** 2, 0.0)
    damped = values / (values**2 + _DAMPING**2 * weakness)
    return np.asarray(right.T @ (damped * (left.T @ velocity)))


def turned_away(velocity: Floats, wanted: Floats) -> float:
    """Angle between two velocities, degrees; 180 where one of them is nothing."""
    size = float(np.linalg.norm(velocity) * np.linalg.norm(wanted))
    cosine = float(velocity @ wanted) / size if size > 1e-12 else -1.0
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def speed_factor(chain: Chain, posture: Posture, speeds: Floats, limits: Limits) -> float:
    """Largest factor up to 1 at which no joint and no part of the arm is too fast."""
    parts = np.linalg.norm(posture.corner_motions @ speeds, axis=1)
    return _factor(
        np.append(np.abs(speeds), parts), np.append(chain.speed, parts * 0 + limits.speed)
    )


def stopping_speed(room: Floats, deceleration: Floats | float, reaction: float) -> Floats:
    r"""Fastest speed from which one stops within a way, zero where there is none.

    Notes
    -----
    The largest v with :math:`v \tau + v^2 / 2 a \le d`.

    Examples
    --------
    >>> float(stopping_speed(np.array(0.01), 2.0, 0.0))
    0.2
    """
    way = np.maximum(room, 0.0)
    return np.asarray(deceleration * (np.sqrt(reaction**2 + 2.0 * way / deceleration) - reaction))


def range_factor(chain: Chain, angles: Floats, speeds: Floats, limits: Limits) -> float:
    """Largest factor at which every joint can stop inside its range by half its deceleration."""
    room = np.where(speeds > 0.0, chain.upper - angles, angles - chain.lower)
    return _factor(np.abs(speeds), stopping_speed(room, chain.acceleration / 2, limits.cycle))


def workspace_factor(
    posture: Posture, place: Floats, velocity: Floats, speeds: Floats, limits: Limits
) -> float:
    """Largest factor at which a place moving so, (3,), and all parts can stop in the workspace."""
    room = np.where(velocity > 0.0, limits.high - place, place - limits.low)
    sinking = -(posture.corner_motions[:, 2] @ speeds)
    height = posture.corners[:, 2] - limits.floor
    ways, rooms = np.append(np.abs(velocity), sinking), np.append(room, height)
    return _factor(ways, stopping_speed(rooms, limits.braking, limits.cycle))


def gained(
    chain: Chain, posture: Posture, before: Floats, speeds: Floats, elapsed: float, limits: Limits
) -> Floats:
    """Speeds of joints, (J,), as far towards new ones as may be reached in so many seconds."""
    change = speeds - before
    parts = np.linalg.norm(posture.corner_motions @ change, axis=1)
    most = elapsed * np.append(chain.acceleration, parts * 0 + limits.acceleration)
    return np.asarray(before + _factor(np.append(np.abs(change), parts), most) * change)


def _factor(values: Floats, most: Floats) -> float:
    """Largest factor up to 1 by which values stay at most as large."""
    shares = np.divide(most, values, out=np.ones_like(values), where=values > np.maximum(most, 0.0))
    return float(min(shares.min(initial=1.0), 1.0))
