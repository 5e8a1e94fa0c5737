"""Answers of an exam touch by touch, and the figures that are taken from them.

Every touch counts. One that was missed, or told as another number of touches, counts as a place in
the middle of the skin, as no force at all and as outside every stated region; so does a force that
an estimator does not tell.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.stats import chi2

from smoskin.arrays import Bools, Floats, Ints

_CONFIDENCE: Final = 0.9
"""Confidence of the regions whose share of truths is told."""
_BLIND: Final = 5e-3
"""Bound of place below which errors are compared with it, m."""
_TOUCHES: Final = ("truth", "error", "spread", "bound")
"""Fields of answers with a row for each touch."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answers:
    """An estimator's answers to B touches, made in P presses of one touch or several at once."""

    extent: Floats
    """Size of the skin, (2,), m."""
    truth: Floats
    """Place and force as made, (B, 5): x, y, Fx, Fy, Fz."""
    error: Floats
    """Answer less truth, (B, 5); NaN where another number of touches was told."""
    spread: Floats
    """Covariance that was stated, (B, 5, 5)."""
    bound: Floats
    """Cramer-Rao bounds of the place, by noise alone and by what the table knows, (B, 2), m; NaN
    where there is none."""
    count: Ints
    """Touches that were told of each press, (P,); -1 where the estimator could not tell."""
    idle: Ints
    """Touches that were told just before each press, (P,), where there is none."""

    @property
    def detected(self) -> Bools:
        """Whether as many touches were told as there were, (B,)."""
        return np.isfinite(self.error[:, 0])

    @property
    def distance(self) -> Floats:
        """Distance of the place told from the true one, (B,), m."""
        middle = np.hypot(*(self.truth[:, :2] - self.extent / 2).T)
        return np.where(self.detected, np.hypot(self.error[:, 0], self.error[:, 1]), middle)

    @property
    def force_error(self) -> Floats:
        """Sizes of the errors of Fx, Fy and Fz, (B, 3), N; no answer counts as no force."""
        off = np.where(np.isfinite(self.error[:, 2:]), self.error[:, 2:], self.truth[:, 2:])
        return np.abs(off)

    def confidence(self, axes: Sequence[int]) -> Floats:
        """The least confidence at which the region stated for these of the five holds the truth.

        1 where nothing was stated, shape (B,); even over 0..1 where statements are right.
        """
        columns = list(axes)
        error, spread = self.error[:, columns], self.spread[:, columns][:, :, columns]
        numbers = np.isfinite(error).all(axis=1) & np.isfinite(spread).all(axis=(1, 2))
        rows = np.flatnonzero(numbers)
        rows = rows[np.linalg.eigvalsh(spread[rows])[:, 0] > 0]
        off, inverse = error[rows], np.linalg.inv(spread[rows])
        levels = np.ones(len(self.truth))
        levels[rows] = chi2.cdf(np.einsum("bi,bij,bj->b", off, inverse, off), len(columns))
        return levels

    def where(self, chosen: Bools) -> "Answers":
        """Some of the touches (B,), of the same presses."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in _TOUCHES})


def together(parts: Sequence[Answers]) -> Answers:
    """Answers of several sessions as one."""
    return Answers(
        extent=parts[0].extent,
        **{
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in (*_TOUCHES, "count", "idle")
        },
    )


class Errors(NamedTuple):
    """The size of an error over some touches."""

    mean: float
    median: float
    most: float
    """Size that 90 % of the touches do not exceed."""
    rms: float


class Held(NamedTuple):
    """Share of truths in the stated 90 % regions."""

    place: float
    force: float
    """Share for the normal force."""
    drag: float | None
    """None where nothing was dragged."""


class Nearness(NamedTuple):
    """Root mean square error of place over the Cramer-Rao bound's, where that is below 5 mm.

    Ratios are None where no touch has such a bound.
    """

    share: float
    """Share of the touches with such a bound by noise alone."""
    noise: float | None
    """Ratio to the bound by the chips' noise alone, on a skin known exactly."""
    known: float | None
    """Ratio to the bound of whoever knows no more of the skin than the table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Figures of some touches."""

    name: str
    touches: int
    """Number of touches."""
    detected: float
    """Share told with the right number of touches."""
    location: Errors
    """Error of the place, m."""
    force: float
    """Mean error of the normal force, as a share of it."""
    force_size: float
    """Mean error of the normal force, N."""
    drag: float | None
    """Mean error of the drag over the mean drag; None where nothing was dragged."""
    drag_size: float | None
    """Mean error of the drag, N."""
    held: Held
    near: Nearness | None
    """None where no bound is known."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        share, noise, known = self.near or (None, None, None)
        bound = {
            "below_5_mm_percent": _percent(share),
            "rms_over_noise_bound": noise,
            "rms_over_known_bound": known,
        }
        return {
            "name": self.name,
            "touches": self.touches,
            "found_percent": 100 * self.detected,
            "location_mm": {name: 1e3 * size for name, size in self.location._asdict().items()},
            "force_percent": 100 * self.force,
            "force_N": self.force_size,
            "drag_percent": _percent(self.drag),
            "drag_N": self.drag_size,
            "held_percent": {name: _percent(part) for name, part in self.held._asdict().items()},
            "bound": bound if self.near else None,
        }


def tally(name: str, answers: Answers) -> Tally:
    """The figures of at least one touch."""
    distance, off = answers.distance, answers.force_error
    normal = np.abs(answers.truth[:, 4])
    drag, drag_off = (float(np.hypot(a[:, 0], a[:, 1]).mean()) for a in (answers.truth[:, 2:], off))

    def held(axes: Sequence[int]) -> float:
        return float((answers.confidence(axes) <= _CONFIDENCE).mean())

    return Tally(
        name=name,
        touches=len(answers.truth),
        detected=float(answers.detected.mean()),
        location=Errors(
            mean=float(np.mean(distance)),
            median=float(np.median(distance)),
            most=float(np.percentile(distance, 90)),
            rms=float(np.sqrt(np.mean(distance**2))),
        ),
        force=float((off[:, 2] / normal).mean()),
        force_size=float(off[:, 2].mean()),
        drag=drag_off / drag if drag else None,
        drag_size=drag_off if drag else None,
        held=Held(held((0, 1)), held((4,)), held((2, 3)) if drag else None),
        near=_nearness(answers),
    )


def _nearness(answers: Answers) -> Nearness | None:
    """How near the touches are whose bound by noise, and by what is known, is below 5 mm."""
    if not np.isfinite(answers.bound).any():
        return None
    ratios: list[float | None] = []
    for bound in answers.bound.T:
        seen = bound < _BLIND
        squares = (answers.distance[seen] ** 2).sum(), (bound[seen] ** 2).sum()
        ratios.append(float(np.sqrt(squares[0] / squares[1])) if seen.any() else None)
    return Nearness(float((answers.bound[:, 0] < _BLIND).mean()), *ratios)


def _percent(share: float | None) -> float | None:
    """A share in per cent, where there is one."""
    return None if share is None else 100 * share
