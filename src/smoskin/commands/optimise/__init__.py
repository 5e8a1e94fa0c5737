"""Varies a design within what can be made, so that its chips tell most about a touch.

Decides what counts as found: the search's best design, its gaps widened until made skins keep
their chips in range, compared with the one it came from on a finer grid and on made skins.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from smoskin.commands.optimise.comparison import (
    Optimised,
    changes_of,
    check_made,
    coarser,
    compare_bounds,
    made_sheets,
    with_reasons,
)
from smoskin.commands.optimise.limits import Limits, own_limits, stood_limits
from smoskin.commands.optimise.objective import Objective
from smoskin.commands.optimise.placing import GAP_STEP, fit_gaps
from smoskin.commands.optimise.search import Effort, Progress, find_design
from smoskin.commands.optimise.slopes import Places, PressedSheet, design_bound
from smoskin.design.skin import SkinDesign

__all__ = ["Effort", "Limits", "Objective", "Optimised", "design_bound", "optimise"]

_WIDER: Final = 0.3
"""Standard deviations by which gaps give way more where a made skin leaves its range."""
_TRIES: Final = 6


def optimise(
    design: SkinDesign,
    *,
    name: str = "optimised",
    objective: Objective | None = None,
    limits: Limits | None = None,
    effort: Effort | None = None,
    places: Places = (25, 33),
    progress: Progress = lambda task, share: None,
    clock: Callable[[], float] = time.monotonic,
) -> Optimised:
    """The design of lowest bound that is found from this one, beside it.

    Parameters
    ----------
    design : SkinDesign
        Where the search starts. Cells, creases, panels, board and shear layer stay as they are.
    name : str, optional
        Of the new design.
    objective : Objective, optional
        What is made small.
    limits : Limits, optional
        Within which.
    effort : Effort, optional
        How long is searched.
    places : tuple of int, optional
        Along x and y, of the maps that are compared.
    progress : callable, optional
        Called with what is being done and the share of the search that is done.
    clock : callable, optional
        Seconds, rising.

    Returns
    -------
    Optimised
        Its `kept` says whether all limits are.

    Raises
    ------
    ArgumentError
        If no setting of the chips is fast enough.
    MissingExtraError
        If the extra ``twin`` is not installed.
    """
    aim, within = objective or Objective(), limits or Limits()
    found = find_design(design, aim, within, effort or Effort(), progress, clock).design
    progress("made skins", 1.0)
    sheet = PressedSheet(found, force=aim.force, places=(2, 2), rated_places=coarser(places))
    sheets, margin = made_sheets(found, within), within
    made = check_made(found, sheets, within)
    for _ in range(_TRIES):
        if all(one.kept for one in made):
            break
        margin = replace(margin, deviations=margin.deviations + _WIDER)
        found = fit_gaps(found, sheet, margin, step=GAP_STEP)
        made = check_made(found, sheets, within)
    progress("comparison", 1.0)
    limits_reached = (*own_limits(found, within), *stood_limits(found, sheet, within))
    changes = changes_of(design, found)
    return Optimised(
        before=design,
        after=with_reasons(found, name, changes),
        changes=changes,
        bounds=compare_bounds(
            design, found, force=aim.force, unmodelled=aim.unmodelled, places=places
        ),
        limits=limits_reached,
        made=made,
    )
