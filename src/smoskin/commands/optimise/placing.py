"""Where magnets and chips go on a sheet that has been pressed: corners, gaps, the chips' setting.

Holders move with whatever sheet they hang on, so that none of this presses anything anew. Decides
how small a gap may be (as small as the chip's range and the clearance allow, whatever manufacture
does to both), which corners are free, and how magnets are moved about them; hides that each chip
is taken to see its own magnet alone, so that what chips tell adds up.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import brentq

from smoskin.arrays import Floats
from smoskin.commands.optimise.limits import (
    Limits,
    allowed_field,
    clearances,
    largest_field,
    made_allowance,
)
from smoskin.commands.optimise.objective import Objective, told_by, worth
from smoskin.commands.optimise.slopes import PressedSheet
from smoskin.design.skin import HallSetting, HallSite, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.origami.geometry import geometry
from smoskin.records import Motion

_EXTREME: Final = 8
"""States that decide a gap: so many with the magnet lowest, and so many with it farthest off."""
_DEEPEST: Final = 12e-3
"""m: largest gap of a magnet on the base, a usual base's thickness."""
_DRAWS: Final = 6
"""Random placements from which magnets are moved one by one, besides the one at hand."""
GAP_STEP: Final = 0.05e-3
"""m, in which gaps are made."""


def fit_gaps(
    design: SkinDesign, sheet: PressedSheet, limits: Limits, *, step: float = 0.0
) -> SkinDesign:
    """The design with every gap as small as range, clearance and manufacture allow.

    Parameters
    ----------
    design : SkinDesign
    sheet : PressedSheet
        Of this design's columns and frame.
    limits : Limits
    step : float
        m, to whose multiples gaps are rounded up; 0 leaves them as they come.
    """
    slip, stronger, further = made_allowance(limits)
    sites = []
    for site in design.halls:
        alone = _alone(design, site)
        magnet = alone.magnets[0]
        motion = _extremes(sheet.rated(alone), further)
        sunk = site.gap - clearances(alone, motion)[0]
        least = limits.clearance + sunk + slip
        most = _DEEPEST
        if magnet.mount == "sheet":
            used = design.board.sensing_height + magnet.height + limits.wall
            most = design.columns.height - used
        bound = allowed_field(design, limits) / stronger

        def excess(
            gap: float, alone: SkinDesign = alone, motion: Motion = motion, bound: Floats = bound
        ) -> float:
            nearer = replace(alone.halls[0], gap=max(gap - slip, 1e-4))
            seen = largest_field(replace(alone, halls=(nearer,)), motion)[0]
            return float((seen / bound).max()) - 1

        if least >= most or excess(most) > 0:
            gap = max(most, 1e-4)
        elif excess(least) <= 0:
            gap = least
        else:
            gap = float(brentq(excess, least, most, xtol=1e-6))
        if step:
            gap = round(math.ceil(gap / step - 1e-9) * step, 9)
        sites.append(replace(site, gap=gap))
    return replace(design, halls=tuple(sites))


def slowest_setting(design: SkinDesign, limits: Limits) -> HallSetting:
    """The setting of least noise that is fast enough, finest where a chip does not wrap."""
    settings = [
        replace(design.hall_setting, resolution=2, oversampling=over, digital_filter=smooth)
        for over in range(4)
        for smooth in range(8)
    ]
    fast = [
        one
        for one in settings
        if mlx90393.settles(one) and mlx90393.conversion_time(one, 0) * limits.rate <= 1
    ]
    if not fast:
        raise ArgumentError(f"rate must leave the chips a setting; got {limits.rate} Hz")
    return min(fast, key=lambda one: float(mlx90393.noise(one)[0]))


def _alone(design: SkinDesign, site: HallSite, corner: tuple[int, int] | None = None) -> SkinDesign:
    """The design with one chip over the magnet that it watches, at some corner."""
    magnet = design.magnet(site.magnet)
    return replace(
        design, magnets=(replace(magnet, corner=corner or magnet.corner),), halls=(site,)
    )


def _extremes(motion: Motion, further: float) -> Motion:
    """Of one magnet's states, those in which it comes nearest to its chip's range, and further."""
    moved, board = motion.magnets[:, 0], motion.board
    aside = np.hypot(*(moved[:, :2] - board[:, :2]).T)
    rows = np.unique(
        np.concatenate([np.argsort(moved[:, 2])[:_EXTREME], np.argsort(-aside)[:_EXTREME]])
    )
    return motion[rows].scaled(further)


def exchange(
    design: SkinDesign,
    sheet: PressedSheet,
    objective: Objective,
    limits: Limits,
    rng: np.random.Generator,
) -> SkinDesign:
    """Magnets moved one by one to the corner that tells most, from several placements.

    Each chip is taken to see its own magnet alone, so that what chips tell adds up.
    """
    cell, reach = geometry(design).cell, limits.wall + max(m.radius for m in design.magnets)
    within = [math.ceil(reach / float(length)) for length in (cell.length, cell.width)]
    corners = [
        (p, q)
        for p in range(within[0], design.cells[0] - within[0] + 1)
        for q in range(within[1], design.cells[1] - within[1] + 1)
    ]
    sites = design.halls
    if len(corners) <= len(sites):
        return design
    told = np.stack(
        [
            [told_by(_alone(design, site, one), sheet, objective.unmodelled) for one in corners]
            for site in sites
        ]
    )
    placed = {one.name: one.corner for one in design.magnets}
    free = list(range(len(corners)))
    present = [placed[site.magnet] for site in sites]
    starts = [list(map(int, rng.permutation(free)[: len(sites)])) for _ in range(_DRAWS)]
    if set(present) <= set(corners) and len(set(present)) == len(present):
        starts.insert(0, [corners.index(one) for one in present])
    found: tuple[float, list[int]] = (math.inf, [])
    for start in starts:
        found = min(found, _settle(start, told, sheet, objective))
    moved = {site.magnet: corners[at] for site, at in zip(sites, found[1], strict=True)}
    magnets = tuple(replace(m, corner=moved.get(m.name, m.corner)) for m in design.magnets)
    return replace(design, magnets=magnets)


def _settle(
    start: Sequence[int], told: Floats, sheet: PressedSheet, objective: Objective
) -> tuple[float, list[int]]:
    """Where single moves lead from a placement, and its objective."""
    at, chips = list(start), len(start)

    def value(places: Sequence[int]) -> float:
        together = sum(told[k, place] for k, place in enumerate(places))
        return worth(np.asarray(together), sheet, chips, objective)

    best, moving = value(at), True
    while moving:
        moving = False
        for k in range(chips):
            options = [p for p in range(told.shape[1]) if p not in at]
            values = [value([*at[:k], p, *at[k + 1 :]]) for p in options]
            least = int(np.argmin(values))
            if values[least] < best * (1 - 1e-9):
                best, at[k], moving = values[least], options[least], True
    return best, at
