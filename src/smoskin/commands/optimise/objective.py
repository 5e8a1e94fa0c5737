"""What a search makes small, and one design held against it.

Decides which bound counts: of location, with drags unknown and with drags known to be none, over
the mean and the worst place, when besides the chips' noise a share of every signal is unknown.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.optimise.limits import Limits, Reached, own_limits, stood_limits
from smoskin.commands.optimise.pressed import Places, PressedSheet
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.sensing.response import bound
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import Deviations

_GAP: Final = 5.5e-3
"""Gap of the reference design, m, for which the unknown share of signals is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """The bound of location that is made small, drags unknown and drags known to be none.

    Over a map of bounds b, the mean of b plus a weight times its 99 % quantile, averaged over both.

    Raises
    ------
    ArgumentError
        If a number is out of its range.
    """

    force: float = 0.5
    """Normal force of the touch, N."""
    worst_weight: float = 0.25
    """Weight of the worst place (99 %) against the mean over the skin."""
    unmodelled: float = 0.005
    """Share of each signal that counts as noise besides the chips' own, of a chip 5.5 mm from its
    magnet; it grows with the inverse square of the gap, as what a calibration cannot follow of
    magnets that sit askew. The value is the reference design's: there it raises the bound as
    much as does what 60 touches leave open of a made skin."""
    places: Places = (5, 7)
    """Places of the touches, from rim to rim."""

    def __post_init__(self) -> None:
        if not (self.force > 0 and self.worst_weight >= 0 and self.unmodelled >= 0):
            raise ArgumentError(
                "force must be positive, worst_weight and unmodelled >= 0; got "
                f"{self.force}, {self.worst_weight} and {self.unmodelled}"
            )


class Trial(NamedTuple):
    """One design, tried."""

    design: SkinDesign
    value: float
    """Objective, m."""
    own: list[Reached]
    """Limits on its own numbers."""
    stood: list[Reached]
    """Limits under the rated touches; empty where the skin has no equilibrium."""

    @property
    def merit(self) -> float:
        """The objective, the larger the more limits are broken."""
        if not self.stood:
            return math.inf
        broken = sum(max(-limit.slack, 0.0) for limit in (*self.own, *self.stood))
        return self.value * (1 + 20 * broken)


def try_design(
    design: SkinDesign, sheet: PressedSheet, objective: Objective, limits: Limits
) -> Trial:
    """A design on its pressed sheet, against objective and limits."""
    own = own_limits(design, limits)
    if not sheet.stands():
        return Trial(design, math.inf, own, [])
    fisher = design_information(design, sheet, objective.unmodelled)
    value = worth(fisher, sheet, len(design.halls), objective)
    return Trial(design, value, own, stood_limits(design, sheet, limits))


def design_information(design: SkinDesign, sheet: PressedSheet, unmodelled: float) -> Floats:
    """Information of a design's signals at every place, (L, W, 5, 5)."""
    signals, slopes = sheet.slopes(design)
    noise = signal_noise(design) + unknown_of(design, signals, unmodelled)
    return bound.information(slopes, noise)


def unknown_of(design: SkinDesign, signals: Floats, unmodelled: float) -> Floats:
    """Covariance of what is not known of signals (..., C), shape (..., C, C), T^2."""
    gaps = np.array([site.gap for site in design.halls])
    share = unmodelled * np.repeat((_GAP / gaps) ** 2, 3)
    return np.asarray((share * signals)[..., None] ** 2 * np.eye(len(share)))


def worth(fisher: Floats, sheet: PressedSheet, chips: int, objective: Objective) -> float:
    """The objective of this information, m."""
    both = [
        bound.figures(
            bound.bound_of_information(sheet.x, sheet.y, fisher, chips, drags=drags).location
        )
        for drags in (True, False)
    ]
    return sum(part.mean + objective.worst_weight * part.worst for part in both) / len(both)


def design_bound(
    design: SkinDesign,
    made: Deviations | None = None,
    *,
    force: float = 0.5,
    drags: bool = True,
    places: Places = (13, 17),
) -> bound.BoundMap:
    """The bound of a design, or of one made skin of it, that has no response table.

    Touches have this normal force, N, and no drag; `drags` says whether drags are unknown too.

    Raises
    ------
    ArgumentError
        If the force or the places are not positive, or a touch has no equilibrium.
    """
    sheet = PressedSheet(design, made, force=force, places=places, rated_places=(2, 2))
    slopes = sheet.slopes(design)[1]
    if not np.isfinite(slopes).all():
        raise ArgumentError(f"force must leave the skin an equilibrium everywhere; got {force} N")
    return bound.bound_of_slopes(sheet.x, sheet.y, slopes, signal_noise(design), drags=drags)
