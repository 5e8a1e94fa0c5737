"""Touches of an exam with what was said of them, and the figures that are taken from them.

Every touch counts. One that was missed, or told as another number of touches, counts as a place in
the middle of the skin, as no force at all and as outside every stated region.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.commands.score.evaluate import Judged

CONFIDENCE: Final = 0.9
"""Of the regions whose share of truths is told."""
BLIND: Final = 5e-3
"""m: errors are compared with the bound where it is smaller."""


class Errors(NamedTuple):
    """Of an error's size."""

    mean: float
    median: float
    most: float
    """That 90 % do not exceed."""
    rms: float


class Held(NamedTuple):
    """Share of truths in the stated 90 % regions."""

    place: float
    force: float
    """Normal."""
    drag: float | None
    """None where nothing was dragged."""


class Nearness(NamedTuple):
    """Root mean square error of place over the Cramer-Rao bound's, where that is below 5 mm."""

    share: float
    """Of the touches, with such a bound by noise alone."""
    noise: float | None
    """Over the bound by the chips' noise alone, on a skin known exactly."""
    known: float | None
    """Over the bound of whoever knows no more of the skin than the table; None, as above, where
    no touch has a bound below 5 mm."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Marks:
    """B touches, one by one."""

    extent: Floats
    """(2,), m, of the skin."""
    truth: Floats
    """(B, 5): x, y, Fx, Fy, Fz."""
    error: Floats
    """(B, 5): said less true; NaN where it was missed."""
    spread: Floats
    """(B, 5, 5): covariance that was stated."""
    bound: Floats
    """(B, 2), m: Cramer-Rao's for the place, by noise alone and by what the table knows; NaN where
    there is none."""
    skin: Ints
    """(B,): seed."""

    @property
    def found(self) -> Bools:
        """Whether as many touches were said as there were, (B,)."""
        return np.isfinite(self.error[:, 0])

    @property
    def distance(self) -> Floats:
        """Of the place said from the true one, (B,), m."""
        middle = np.hypot(*(self.truth[:, :2] - self.extent / 2).T)
        return np.where(self.found, np.hypot(self.error[:, 0], self.error[:, 1]), middle)

    @property
    def force_error(self) -> Floats:
        """Of the normal force, (B,), N."""
        return np.abs(np.where(self.found, self.error[:, 4], self.truth[:, 4]))

    @property
    def drag_error(self) -> Floats:
        """Length of the drag's error, (B,), N."""
        missed = np.where(self.found[:, None], self.error[:, 2:4], self.truth[:, 2:4])
        return np.asarray(np.hypot(missed[:, 0], missed[:, 1]))

    def confidence(self, axes: Sequence[int]) -> Floats:
        """The least confidence at which the region stated for these of the five holds the truth.

        1 where nothing was stated, shape (B,); even over 0..1 where statements are right.
        """
        from scipy.stats import chi2

        used = list(axes)
        stated = self.spread[:, used][:, :, used]
        known = self.found & np.isfinite(stated).all(axis=(1, 2))
        known[known] = np.linalg.eigvalsh(stated[known])[:, 0] > 0
        sure = np.ones(len(self.truth))
        off = self.error[known][:, used]
        away = np.einsum("bi,bi->b", off, np.linalg.solve(stated[known], off[..., None])[..., 0])
        sure[known] = chi2.cdf(away, len(used))
        return sure

    def where(self, chosen: Bools) -> "Marks":
        """Some of the touches."""
        picked = {
            one.name: getattr(self, one.name)[chosen]
            for one in fields(Marks)
            if one.name != "extent"
        }
        return Marks(extent=self.extent, **picked)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Figures of some touches."""

    name: str
    touches: int
    found: float
    """Share told with the right number of touches."""
    location: Errors
    """m."""
    force: float
    """Mean error of the normal force, as a share of it."""
    force_size: float
    """The same in N."""
    drag: float | None
    """Mean error of the drag over the mean drag; None where nothing was dragged."""
    drag_size: float | None
    """The mean error in N."""
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
            "location_mm": {name: 1e3 * v for name, v in self.location._asdict().items()},
            "force_percent": 100 * self.force,
            "force_N": self.force_size,
            "drag_percent": None if self.drag is None else 100 * self.drag,
            "drag_N": self.drag_size,
            "held_percent": {
                name: None if value is None else 100 * value
                for name, value in self.held._asdict().items()
            },
            "bound": None
            if near is None
            else {
                "below_5_mm_percent": 100 * near.share,
                "rms_over_noise_bound": near.noise,
                "rms_over_known_bound": near.known,
            },
        }


def marks_of(found: Judged, extent: Floats, skin: int, bound: Floats | None = None) -> Marks:
    """A session's touches, one by one, pairs apart.

    Parameters
    ----------
    found : Judged
        (B, K).
    extent : Floats, shape (2,)
        m, of the skin.
    skin : int
        Its seed.
    bound : Floats, shape (B, 2), optional
        m; see `Marks.bound`.
    """
    count = found.truth[..., 0].size
    return Marks(
        extent=extent,
        truth=found.truth.reshape(count, 5),
        error=found.error.reshape(count, 5),
        spread=found.spread.reshape(count, 5, 5),
        bound=np.full((count, 2), np.nan) if bound is None else bound,
        skin=np.full(count, skin, dtype=np.int64),
    )


def grid_places(position: Floats, extent: Floats, places: tuple[int, int]) -> Ints:
    """Which of a grid's places, row by row, each position (B, 2) is, (B,)."""
    cells = np.rint(position / extent * (np.array(places) - 1)).astype(np.int64)
    return np.asarray(np.ravel_multi_index((cells[:, 0], cells[:, 1]), places), np.int64)


def together(parts: Sequence[Marks]) -> Marks:
    """Marks of several sessions as one."""
    joined = {
        one.name: np.concatenate([getattr(part, one.name) for part in parts])
        for one in fields(Marks)
        if one.name != "extent"
    }
    return Marks(extent=parts[0].extent, **joined)


def tally(name: str, marks: Marks) -> Tally:
    """The figures of at least one touch."""
    pressed = np.abs(marks.truth[:, 4])
    dragged = np.hypot(marks.truth[:, 2], marks.truth[:, 3])
    sideways = bool(dragged.any())
    return Tally(
        name=name,
        touches=len(marks.truth),
        found=float(marks.found.mean()),
        location=_errors(marks.distance),
        force=float((marks.force_error / pressed).mean()),
        force_size=float(marks.force_error.mean()),
        drag=float(marks.drag_error.mean() / dragged.mean()) if sideways else None,
        drag_size=float(marks.drag_error.mean()) if sideways else None,
        held=Held(
            place=_held(marks, (0, 1)),
            force=_held(marks, (4,)),
            drag=_held(marks, (2, 3)) if sideways else None,
        ),
        near=_nearness(marks),
    )


def _held(marks: Marks, axes: Sequence[int]) -> float:
    """Share of truths in the regions stated for these of the five."""
    return float((marks.confidence(axes) <= CONFIDENCE).mean())


def _errors(size: Floats) -> Errors:
    """Of sizes."""
    return Errors(
        float(size.mean()),
        float(np.median(size)),
        float(np.percentile(size, 90)),
        float(np.sqrt(np.mean(size**2))),
    )


def _nearness(marks: Marks) -> Nearness | None:
    """Of the touches whose bound by noise, and by what is known, is below 5 mm."""
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
