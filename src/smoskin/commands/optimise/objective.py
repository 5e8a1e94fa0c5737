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
from smoskin.commands.optimise.slopes import Places, PressedSheet
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.sensing.response.bound import bound_of_information, figures, information
from smoskin.sensing.signals.signals import signal_noise

_GAP: Final = 5.5e-3
"""m, of the reference design, for which the unknown share of signals is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """What is made small: the bound of location, drags unknown and drags known to be none.

    Raises
    ------
    ArgumentError
        If a number is out of its range.
    """

    force: float = 0.5
    """N, normal, of the touch."""
    worst_weight: float = 0.25
    """Of the worst place (99 %) against the mean over the skin."""
    unmodelled: float = 0.005
    """Share of each signal that counts as noise besides the chips' own, of a chip 5.5 mm from its
    magnet; it grows with the inverse square of the gap, as what a calibration cannot follow of
    magnets that sit askew. The value is the reference design's: there it raises the bound as
    much as does what 60 touches leave open of a made skin."""
    places: Places = (5, 7)
    """Of the touches, from rim to rim."""

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
    """m: the objective."""
    own: list[Reached]
    """Limits of its own numbers."""
    stood: list[Reached]
    """Limits of the rated touches; empty where the skin has no equilibrium."""

    @property
    def merit(self) -> float:
        """The objective, the larger the more limits are broken."""
        if not self.stood:
            return math.inf
        broken = sum(max(-one.slack, 0.0) for one in (*self.own, *self.stood))
        return self.value * (1 + 20 * broken)


def try_design(
    design: SkinDesign, sheet: PressedSheet, objective: Objective, limits: Limits
) -> Trial:
    """A design on its pressed sheet, against objective and limits."""
    if not sheet.stands():
        return Trial(design, math.inf, own_limits(design, limits), [])
    told = told_by(design, sheet, objective.unmodelled)
    return Trial(
        design,
        worth(told, sheet, len(design.halls), objective),
        own_limits(design, limits),
        stood_limits(design, sheet, limits),
    )


def told_by(design: SkinDesign, sheet: PressedSheet, unmodelled: float) -> Floats:
    """Information of a design's signals at every place, (L, W, 5, 5)."""
    signals, slopes = sheet.slopes(design)
    return information(slopes, signal_noise(design) + unknown_of(design, signals, unmodelled))


def unknown_of(design: SkinDesign, signals: Floats, unmodelled: float) -> Floats:
    """Covariance of what is not known of signals (..., C), shape (..., C, C), T^2."""
    gaps = np.array([site.gap for site in design.halls])
    share = unmodelled * np.repeat((_GAP / gaps) ** 2, 3)
    return np.asarray((share * signals)[..., None] ** 2 * np.eye(len(share)))


def worth(told: Floats, sheet: PressedSheet, chips: int, objective: Objective) -> float:
    """The objective of this information, m."""
    both = [
        figures(bound_of_information(sheet.x, sheet.y, told, chips, drags=drags).location)
        for drags in (True, False)
    ]
    return sum(one.mean + objective.worst_weight * one.worst for one in both) / len(both)
