"""Varies a design within what can be made, so that its chips tell most about a touch.

Decides what is taken: the search's best design, its gaps widened until made skins keep their chips
in range; and how it is compared with the one it came from, on a finer grid and on made skins: as
tables, as JSON, and as reasons in the new design's own document.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.optimise.limits import (
    GAP_STEP,
    Limits,
    Reached,
    made_limits,
    own_limits,
    slowest_setting,
    stood_limits,
)
from smoskin.commands.optimise.pressed import Places, PressedSheet, design_bound, unknown_of
from smoskin.commands.optimise.search import Objective, Search, SearchEffort
from smoskin.design.document import design_values, format_design
from smoskin.design.skin import Provenance, SkinDesign
from smoskin.outputs import write_output
from smoskin.roles import Progress, stopwatch, unheard
from smoskin.sensing.response.bound import bound_of_slopes, figures
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import draw

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["Limits", "Objective", "Optimised", "SearchEffort", "design_bound", "optimise"]

_TRIES: Final = 12
"""Steps by which the gap of a chip whose made skins leave its range gives way, at most."""
_MADE: Final = 3
"""Made skins over which their bounds are averaged."""
_SEED: Final = 500_000
"""Seed of the first made skin: far from those of judgements and of response tables."""
_FINE: Final = 40.0
"""Time of a search over that of a rough comparison from which a finer one is made."""
_WIDENING: Final = 1.5
"""Time of widening the gaps over that of checking all made skins once."""
_HIGHER: Final = "super-resolution"
"""Quantities of which more is better."""


Numbers: TypeAlias = dict[tuple[str, str], float]
"""Numbers of one design by case and quantity."""


class Change(NamedTuple):
    """One value that differs, as documents write it."""

    path: str
    key: str
    before: str | int | float
    after: str | int | float


class Side(NamedTuple):
    """One number of both designs."""

    case: str
    """What is read and what is unknown, in words."""
    quantity: str
    """Name of the number, with its unit."""
    before: float
    after: float

    @property
    def gain(self) -> float:
        """How many times better: a bound lower, a super-resolution higher."""
        less, more = sorted((self.before, self.after))
        times = more / less if less else math.inf
        higher = self.quantity.startswith(_HIGHER)
        return times if (self.after > self.before) == higher else 1 / times


@dataclass(frozen=True, slots=True, kw_only=True)
class Optimised:
    """A design that a search has found, beside the one that it came from."""

    before: SkinDesign
    after: SkinDesign
    """New design, with its provenance."""
    changes: tuple[Change, ...]
    bounds: tuple[Side, ...]
    limits: tuple[Reached, ...]
    """Limits on the new design."""
    made: tuple[Reached, ...]
    """Limits on the worst of some made skins of it."""
    warning: str = ""
    """Why the design is hardly searched for; empty where it is."""

    @property
    def kept(self) -> bool:
        """Whether the new design keeps every limit, also as made."""
        return all(limit.kept for limit in (*self.limits, *self.made))

    def verdict(self) -> str:
        """What the exit code says, in a sentence."""
        if self.kept:
            return "The design keeps every limit: exit code 0."
        broken = [limit.name for limit in self.limits if not limit.kept]
        broken += [f"{limit.name} of made skins" for limit in self.made if not limit.kept]
        return (
            f"Do not build this design, which breaks {len(broken)} limits ({', '.join(broken)}): "
            "exit code 1. A longer search may find one that keeps them."
        )

    @property
    def gain(self) -> float:
        """Mean bound of location of the old design over that of the new one, drags unknown."""
        return self.bounds[0].gain

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        return {
            "before": {"name": self.before.name, "content_hash": self.before.content_hash},
            "after": {"name": self.after.name, "content_hash": self.after.content_hash},
            "gain": self.gain,
            "kept": self.kept,
            "warning": self.warning or None,
            "changes": [change._asdict() for change in self.changes],
            "bounds": [{**side._asdict(), "gain": side.gain} for side in self.bounds],
            "limits": [limit.as_json() for limit in self.limits],
            "made_skins": [limit.as_json() for limit in self.made],
        }

    def tables(self) -> "list[Table]":
        """Three tables for people."""
        from rich.table import Table

        changes = Table("value", "before", "after", title="Changed values")
        for change in self.changes:
            name = f"{change.path.rpartition('.')[0]}.{change.key}".removeprefix(".")
            changes.add_row(name, str(change.before), str(change.after))
        bounds = Table("signals", "bound", "before", "after", "times better", title="Bounds")
        for side in self.bounds:
            sizes = f"{side.before:.4g}", f"{side.after:.4g}", f"{side.gain:.2f}"
            bounds.add_row(side.case, side.quantity, *sizes)
        limits = Table("limit", "reached", "allowed", "", title="Limits")
        for group, reached in (("", self.limits), ("made skins: ", self.made)):
            for limit in reached:
                ends = ((">=", limit.least), ("<=", limit.most))
                allowed = ", ".join(f"{sign} {x:.4g}" for sign, x in ends if math.isfinite(x))
                verdict = "kept" if limit.kept else "broken"
                limits.add_row(group + limit.name, f"{limit.value:.4g}", allowed, verdict)
        return [changes, bounds, limits]

    def write(self, path: Path | str) -> tuple[Path, Path]:
        """Write the new design to this TOML document and the comparison beside it, as JSON.

        It raises a `MissingExtraError` if the TOML writer is not installed.
        """
        document = Path(path)
        warning = "" if self.kept else f"# {self.verdict()}\n"
        write_output(document, (warning + format_design(self.after)).encode())
        beside = document.with_suffix(".json")
        write_output(beside, (json.dumps(self.as_json(), indent=2) + "\n").encode())
        return document, beside


def optimise(
    design: SkinDesign,
    *,
    name: str = "optimised",
    objective: Objective | None = None,
    limits: Limits | None = None,
    effort: SearchEffort | None = None,
    places: Places = (25, 33),
    progress: Progress = unheard,
    clock: Callable[[], float] | None = None,
) -> Optimised:
    """The design of lowest bound that is found from this one, beside it.

    Parameters
    ----------
    design : SkinDesign
        Start of the search. Cells, creases, panels, board and shear layer stay as they are.
    name : str
        Name of the new design.
    objective, limits, effort : optional
        What is made small, what is kept, and how long is searched.
    places : tuple of int
        Numbers of places along x and y of the maps that are compared; half as many where the time
        is short.
    clock : callable, optional
        Seconds since the work began; since the call by default.

    Raises
    ------
    ArgumentError
        If no setting of the chips is fast enough.
    MissingExtraError
        If the extra ``twin`` is not installed.
    """
    aim, within, work = objective or Objective(), limits or Limits(), effort or SearchEffort()
    clock = clock or stopwatch()
    slowest_setting(design, within)  # refuses before anything takes long
    search = Search(design, aim, within, work, progress, clock)
    progress("comparison", 0.0)
    compare = partial(_bounds, force=aim.force, unmodelled=aim.unmodelled)
    places, old = _judged_first(search, design, within, places, compare, clock)
    warning = ""
    if not search.has_time():
        least = work.seconds - search.left + search.rest
        warning = f"no time was left to search: compiling and judging alone take {least:.0f} s here"
    new = search.run().design
    progress("made skins", 1.0)
    sheet = PressedSheet(new, force=aim.force, places=(2, 2), rated_places=coarser(places))
    new, made = widened(new, within)
    progress("comparison", 1.0)
    changes = changes_of(design, new)
    return Optimised(
        before=design,
        after=with_reasons(new, name, changes),
        changes=changes,
        bounds=_sides(old, compare(new, places)),
        limits=(*own_limits(new, within), *stood_limits(new, sheet, within)),
        made=made,
        warning=warning,
    )


def _judged_first(
    search: Search,
    design: SkinDesign,
    limits: Limits,
    places: Places,
    compare: Callable[[SkinDesign, Places], Numbers],
    clock: Callable[[], float],
) -> tuple[Places, Numbers]:
    """The start's bounds at places for which there is time; the search leaves what they took."""
    if not math.isfinite(search.left):
        return places, compare(design, places)
    search.measure()
    begun = clock()
    check_made(design, made_sheets(design, replace(limits, made_skins=1)), limits)
    checking = _WIDENING * limits.made_skins * (clock() - begun)
    begun = clock()
    old = compare(design, coarser(places))
    took = clock() - begun
    if search.left < _FINE * took:
        places = coarser(places)
    else:
        begun = clock()
        old = compare(design, places)
        took = clock() - begun
    search.rest = checking + _WIDENING * took
    return places, old


def widened(design: SkinDesign, limits: Limits) -> tuple[SkinDesign, tuple[Reached, ...]]:
    """The design with gaps so wide that made skins of it keep the limits, and the worst of them.

    The gaps of chips that keep theirs stay.
    """
    sheets = made_sheets(design, limits)
    made = check_made(design, sheets, limits)
    for _ in range(_TRIES):
        broken = {limit.chip for limit in made if limit.chip and not limit.kept}
        if not broken:
            break
        halls = [
            replace(site, gap=round(site.gap + GAP_STEP * (site.name in broken), 9))
            for site in design.halls
        ]
        design = replace(design, halls=tuple(halls))
        made = check_made(design, sheets, limits)
    return design, made


def changes_of(before: SkinDesign, after: SkinDesign) -> tuple[Change, ...]:
    """Changed values, but the name."""
    rows = zip(design_values(before), design_values(after), strict=True)
    return tuple(
        Change(path, key, old, new)
        for (path, key, old), (_, _, new) in rows
        if old != new and path != "name"
    )


def with_reasons(design: SkinDesign, name: str, changes: Sequence[Change]) -> SkinDesign:
    """The design under its own name, each changed value saying what it was."""
    reason = "found by smoskin optimise, which lowers the bound of location; {} before"
    reasons = {
        change.path: Provenance(origin="assumed", reason=reason.format(change.before))
        for change in changes
    }
    return replace(design, name=name, provenance={**design.provenance, **reasons})


def made_sheets(design: SkinDesign, limits: Limits) -> list[PressedSheet]:
    """Sheets of some made skins; they serve whatever magnets hang on them."""
    return [
        PressedSheet(design, draw(design, np.random.default_rng([_SEED, skin])), places=(2, 2))
        for skin in range(limits.made_skins)
    ]


def check_made(
    design: SkinDesign, sheets: Sequence[PressedSheet], limits: Limits
) -> tuple[Reached, ...]:
    """The worst of made skins against what they must stand.

    Each sheet is read with the magnets and chips of several draws, which cost next to nothing.
    """
    worst: dict[str, Reached] = {}
    for skin, sheet in enumerate(sheets):
        rng = np.random.default_rng([_SEED, skin, 1])
        for _ in range(limits.made_draws):
            for limit in made_limits(design, sheet, draw(design, rng), limits):
                before = worst.setdefault(limit.name, limit)
                worst[limit.name] = min(before, limit, key=lambda reached: reached.slack)
    return tuple(worst.values())


def coarser(places: Places) -> Places:
    """Every other place of a map, for made skins and rated touches."""
    return max((places[0] + 1) // 2, 2), max((places[1] + 1) // 2, 2)


def compare_bounds(
    before: SkinDesign, after: SkinDesign, *, force: float, unmodelled: float, places: Places
) -> tuple[Side, ...]:
    """Bounds of both designs, as designed and as made."""
    return _sides(
        *(_bounds(design, places, force=force, unmodelled=unmodelled) for design in (before, after))
    )


def _sides(before: Numbers, after: Numbers) -> tuple[Side, ...]:
    """The numbers of both designs, side by side."""
    return tuple(Side(*case, value, after[case]) for case, value in before.items())


def _bounds(design: SkinDesign, places: Places, *, force: float, unmodelled: float) -> Numbers:
    """Numbers of one design by case and quantity."""
    sheet = PressedSheet(design, force=force, places=places, rated_places=(2, 2))
    signals, slopes = sheet.slopes(design)
    noise = signal_noise(design)
    sites = list(enumerate(design.halls))
    upper = [s for s, site in sites if design.magnet(site.magnet).mount == "sheet"]
    numbers: Numbers = {}

    def note(case: str, slopes: Floats, noise: Floats, *, drags: bool) -> None:
        bound = bound_of_slopes(sheet.x, sheet.y, slopes, noise, drags=drags)
        quantities = {"location, mm": bound.location, "normal force, mN": bound.force}
        if drags:
            quantities["drag, mN"] = np.hypot(bound.drag[..., 0], bound.drag[..., 1])
        for name, values in quantities.items():
            for kind, number in figures(values * 1e3)._asdict().items():
                numbers[case, f"{kind} {name}"] = number
        for kind, number in bound.super_resolution._asdict().items():
            numbers[case, f"{_HIGHER} by {kind}"] = number

    note("all chips, drag unknown", slopes, noise, drags=True)
    note("all chips, no drag", slopes, noise, drags=False)
    if upper and len(upper) < len(design.halls):
        part = slopes[..., [3 * s + axis for s in upper for axis in range(3)], :]
        note("the sheet's chips, no drag", part, signal_noise(design, upper), drags=False)
    unknown = noise + unknown_of(design, signals, unmodelled)
    note("all chips, drag and a share of signals unknown", slopes, unknown, drags=True)
    means = []
    for skin in range(_MADE):
        made = draw(design, np.random.default_rng([_SEED, skin]))
        rough = design_bound(design, made, force=force, places=coarser(places))
        means.append(figures(rough.location * 1e3))
    for kind, mean in zip(means[0]._fields, np.mean(means, axis=0).tolist(), strict=True):
        numbers["all chips, drag unknown, made skins", f"{kind} location, mm"] = mean
    return numbers
