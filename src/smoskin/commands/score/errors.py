"""Touches of an exam with what was answered, one by one, and the figures that are taken from them.

Every touch counts. One that was missed, or told as another number of touches, counts as a place in
the middle of the skin, as no force at all and as outside every stated region; so does a force that
an estimator does not tell.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.commands.score.evaluate import Judged

CONFIDENCE: Final = 0.9
"""Confidence of the regions whose share of truths is told."""
BLIND: Final = 5e-3
"""m: errors are compared with the bound where it is smaller."""


class Errors(NamedTuple):
    """The size of an error over some touches."""

    mean: float
    median: float
    most: float
    """Size that 90 % of the touches do not exceed."""
    rms: float

    @classmethod
    def of(cls, size: Floats) -> "Errors":
        """The figures of these sizes."""
        mean, median, rms = np.mean(size), np.median(size), np.sqrt(np.mean(size**2))
        return cls(float(mean), float(median), float(np.percentile(size, 90)), float(rms))


class Held(NamedTuple):
    """Share of truths in the stated 90 % regions."""

    place: float
    force: float
    """Share for the normal force."""
    drag: float | None
    """None where nothing was dragged."""


class Nearness(NamedTuple):
    """Root mean square error of place over the Cramer-Rao bound's, where that is below 5 mm."""

    share: float
    """Share of the touches with such a bound by noise alone."""
    noise: float | None
    """Ratio to the bound by the chips' noise alone, on a skin known exactly."""
    known: float | None
    """Ratio to the bound of whoever knows no more of the skin than the table; None, as above,
    where no touch has a bound below 5 mm."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Marks:
    """B touches, one by one."""

    extent: Floats
    """(2,), size of the skin, m."""
    truth: Floats
    """(B, 5): x, y, Fx, Fy, Fz."""
    error: Floats
    """(B, 5): answer less truth; NaN where there was none."""
    spread: Floats
    """(B, 5, 5): covariance that was stated."""
    bound: Floats
    """(B, 2), m: Cramer-Rao's for the place, by noise alone and by what the table knows; NaN where
    there is none."""

    @property
    def found(self) -> Bools:
        """Whether as many touches were told as there were, (B,)."""
        return np.isfinite(self.error[:, 0])

    @property
    def distance(self) -> Floats:
        """Distance of the place told from the true one, (B,), m."""
        middle = np.hypot(*(self.truth[:, :2] - self.extent / 2).T)
        return np.where(self.found, np.hypot(self.error[:, 0], self.error[:, 1]), middle)

    @property
    def force_error(self) -> Floats:
        """Error of the normal force, (B,), N."""
        return np.abs(self._forces[:, 2])

    @property
    def drag_error(self) -> Floats:
        """Length of the drag's error, (B,), N."""
        return np.asarray(np.hypot(self._forces[:, 0], self._forces[:, 1]))

    @property
    def _forces(self) -> Floats:
        """Errors of the forces, (B, 3), N, in size; a force that was not told counts as none."""
        return np.where(np.isfinite(self.error[:, 2:]), self.error[:, 2:], self.truth[:, 2:])

    def confidence(self, axes: Sequence[int]) -> Floats:
        """The least confidence at which the region stated for these of the five holds the truth.

        1 where nothing was stated, shape (B,); even over 0..1 where statements are right.
        """
        from scipy.stats import chi2

        columns = list(axes)
        error, spread = self.error[:, columns], self.spread[:, columns][:, :, columns]
        numbers = np.isfinite(error).all(axis=1) & np.isfinite(spread).all(axis=(1, 2))
        rows = np.flatnonzero(numbers)
        rows = rows[np.linalg.eigvalsh(spread[rows])[:, 0] > 0]
        off, inverse = error[rows], np.linalg.inv(spread[rows])
        levels = np.ones(len(self.truth))
        levels[rows] = chi2.cdf(np.einsum("bi,bij,bj->b", off, inverse, off), len(columns))
        return levels

    def where(self, chosen: Bools) -> "Marks":
        """Some of the touches."""
        return Marks(
            extent=self.extent,
            **{name: getattr(self, name)[chosen] for name in _COLUMNS},
        )


_COLUMNS: Final = tuple(field.name for field in fields(Marks) if field.name != "extent")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Figures of some touches."""

    name: str
    touches: int
    """Number of touches."""
    found: float
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
        near = self.near
        return {
            "name": self.name,
            "touches": self.touches,
            "found_percent": 100 * self.found,
            "location_mm": {name: 1e3 * size for name, size in self.location._asdict().items()},
            "force_percent": 100 * self.force,
            "force_N": self.force_size,
            "drag_percent": None if self.drag is None else 100 * self.drag,
            "drag_N": self.drag_size,
            "held_percent": {
                name: None if share is None else 100 * share
                for name, share in self.held._asdict().items()
            },
            "bound": None
            if near is None
            else {
                "below_5_mm_percent": 100 * near.share,
                "rms_over_noise_bound": near.noise,
                "rms_over_known_bound": near.known,
            },
        }


def marks_of(judged: Judged, extent: Floats, bound: Floats | None = None) -> Marks:
    """A session's touches, one by one, pairs apart.

    Parameters
    ----------
    judged : Judged
        Answers, (B, K).
    extent : Floats, shape (2,)
        Size of the skin, m.
    bound : Floats, shape (B, 2), optional
        Bounds as `Marks.bound`.
    """
    count = judged.truth[..., 0].size
    return Marks(
        extent=extent,
        truth=judged.truth.reshape(count, 5),
        error=judged.error.reshape(count, 5),
        spread=judged.spread.reshape(count, 5, 5),
        bound=np.full((count, 2), np.nan) if bound is None else bound,
    )


def together(parts: Sequence[Marks]) -> Marks:
    """Marks of several sessions as one."""
    return Marks(
        extent=parts[0].extent,
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS},
    )


def grid_places(position: Floats, extent: Floats, places: tuple[int, int]) -> Ints:
    """Which of a grid's places, row by row, each position (B, 2) is, (B,)."""
    cells = np.rint(position / extent * (np.array(places) - 1)).astype(np.int64)
    return np.asarray(np.ravel_multi_index((cells[:, 0], cells[:, 1]), places), np.int64)


def tally(name: str, marks: Marks) -> Tally:
    """The figures of at least one touch."""
    normal = np.abs(marks.truth[:, 4])
    drag = np.hypot(marks.truth[:, 2], marks.truth[:, 3])
    dragged = bool(drag.any())

    def held(axes: Sequence[int]) -> float:
        return float((marks.confidence(axes) <= CONFIDENCE).mean())

    return Tally(
        name=name,
        touches=len(marks.truth),
        found=float(marks.found.mean()),
        location=Errors.of(marks.distance),
        force=float((marks.force_error / normal).mean()),
        force_size=float(marks.force_error.mean()),
        drag=float(marks.drag_error.mean() / drag.mean()) if dragged else None,
        drag_size=float(marks.drag_error.mean()) if dragged else None,
        held=Held(held((0, 1)), held((4,)), held((2, 3)) if dragged else None),
        near=_nearness(marks),
    )


def _nearness(marks: Marks) -> Nearness | None:
    """How near the touches are whose bound by noise, and by what is known, is below 5 mm."""
    if not np.isfinite(marks.bound).any():
        return None
    squared = marks.distance**2
    ratios: list[float | None] = []
    for limit in marks.bound.T:
        seen = limit < BLIND
        ratios.append(
            float(np.sqrt(squared[seen].sum() / (limit[seen] ** 2).sum())) if seen.any() else None
        )
    return Nearness(float((marks.bound[:, 0] < BLIND).mean()), *ratios)
