"""What a workshop can make and a skin must stand, and what of it a design uses.

Decides the limits within which a design may be varied, each with its reason, and how a design is
held against them: by its own numbers, by the fields and columns of the twin under the rated
touches, and by `smoskin.feasibility`; and how small a gap may be, as small as the chip's range and
the clearance allow, whatever manufacture does to both.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import brentq

from smoskin.arrays import Floats
from smoskin.commands.optimise.pressed import PressedSheet
from smoskin.design.materials import ELASTOMERS
from smoskin.design.skin import HallSetting, HallSite, SkinDesign
from smoskin.errors import ArgumentError, DesignError
from smoskin.feasibility import MARGIN, check_design
from smoskin.magnetics import mlx90393
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.twin.manufacture import Deviations, Tolerances
from smoskin.twin.readout import Readout

_EXTREME: Final = 8
"""States that decide a gap: so many with the magnet lowest, and so many with it farthest off."""
_DEEPEST: Final = 12e-3
"""Largest gap of a magnet on the base, m: a usual base's thickness."""
GAP_STEP: Final = 0.05e-3
"""Steps in which gaps are made, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits to keep. The paper prints none of them; each value is assumed, with its reason."""

    column_radius: tuple[float, float] = (1.0e-3, 3.0e-3)
    """Range, m: a thinner column tears when it leaves its mould, a thicker one fills the cell."""
    column_height: tuple[float, float] = (6.0e-3, 15.0e-3)
    """Range, m: below, no magnet fits under the sheet; above, the skin is thicker than a finger."""
    rubbers: tuple[str, ...] = tuple(ELASTOMERS)
    """Rubbers of the columns: those whose modulus is known."""
    frame_stiffness: tuple[float, float] = (20.0, 2000.0)
    """Range for each rim column, N/m: from a strip of soft foam to a printed rail."""
    magnet_radius: tuple[float, float] = (2.5e-3, 6.0e-3)
    """Range, m: below, the coil that magnetises four sectors does not fit; above, no corner is wide
    enough."""
    magnet_height: tuple[float, float] = (1.5e-3, 5.0e-3)
    """Range, m: a thinner disc of bonded powder breaks in the holder."""
    wall: float = 1.0e-3
    """Printed holder between a magnet and the columns, the rim and the sheet, m."""
    clearance: float = 1.0e-3
    """Room left between a magnet and its chip's sensing point under the rated touch, m; of it,
    0.4 mm lie within the package."""
    front_end: float = 50e-3
    """Largest field along each axis for which the chip's front end is specified, T."""
    rate: float = 100.0
    """Readings a second, temperature included: a robot's loop."""
    crush: float = 0.35
    """Share of a column's height by which a rated touch may press it; at half the model ends."""
    pull: float = 0.8
    """Share of the bond's strength by which a column may be pulled."""
    buckling: float = 1.0
    """Share of Euler's load of a column clamped at both ends, pi^2 r^2 / h of shortening: past it
    the model, whose columns stay straight, does not hold."""
    made_skins: int = 8
    """Sheets on which fields, columns and clearances are checked at the end."""
    made_draws: int = 8
    """Draws of magnets and chips on each of them."""
    deviations: float = 1.3
    """Standard deviations of manufacture that all go against a chip's range at once; together
    they are about as rare as the worst of the made skins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reached:
    """One limit and what a design makes of it."""

    name: str
    """Name, with its unit."""
    value: float
    least: float = -math.inf
    most: float = math.inf

    @property
    def slack(self) -> float:
        """How far within, as a share of the limit; negative where it is broken."""
        parts = [
            sign * (self.value - bound) / (abs(bound) or 1.0)
            for sign, bound in ((1.0, self.least), (-1.0, self.most))
            if math.isfinite(bound)
        ]
        return min(parts) if math.isfinite(self.value) else -1.0

    @property
    def kept(self) -> bool:
        """Whether the limit is kept."""
        return self.slack >= -1e-9


def allowed_field(design: SkinDesign, limits: Limits) -> Floats:
    """Largest magnitude on each axis of a chip, shape (3,), T."""
    return np.minimum(MARGIN * mlx90393.full_scale(design.hall_setting), limits.front_end)


def largest_field(
    design: SkinDesign, motion: Motion, readout: Readout | None = None
) -> tuple[Floats, ...]:
    """Largest magnitude on each axis of each chip over these states, (3,) T each."""
    seen = np.abs((readout or Readout(design)).seen(motion)).max(axis=0)
    return tuple(seen)


def clearances(design: SkinDesign, motion: Motion) -> list[float]:
    """Least distance from each chip's sensing point to its magnet's rim over these states, m."""
    names = [magnet.name for magnet in design.magnets]
    left = []
    for site in design.halls:
        g = names.index(site.magnet)
        moved = motion.magnets[:, g]
        low = moved[:, 2] - design.magnets[g].radius * np.hypot(moved[:, 3], moved[:, 4])
        left.append(site.gap + float(low.min()))
    return left


def made_allowance(limits: Limits) -> tuple[float, float, float]:
    """What manufacture may do to a chip's range: m off the gap, and factors on field and motion."""
    scatter = Tolerances()
    count = limits.deviations
    return (
        count * math.hypot(scatter.magnet_place, scatter.chip_place),
        1 + count * math.hypot(scatter.remanence, scatter.chip_sensitivity),
        1 + count * math.hypot(scatter.stiffness_variation, scatter.column_stiffness),
    )


def own_limits(design: SkinDesign, limits: Limits) -> list[Reached]:
    """What a design's own numbers decide, held against it."""
    columns, setting = design.columns, design.hall_setting
    reached = [
        _between("columns.radius, mm", columns.radius, limits.column_radius, 1e3),
        _between("columns.height, mm", columns.height, limits.column_height, 1e3),
        _between("frame.stiffness, N/mm", design.frame.stiffness, limits.frame_stiffness, 1e-3),
        Reached(
            name="readings a second",
            value=1 / mlx90393.conversion_time(setting, 0),
            least=limits.rate,
        ),
    ]
    walls = _walls(design)
    for magnet in design.magnets:
        name = magnet.name
        reached += [
            _between(f"{name}.radius, mm", magnet.radius, limits.magnet_radius, 1e3),
            _between(f"{name}.height, mm", magnet.height, limits.magnet_height, 1e3),
        ]
        if name in walls:
            wall, least = walls[name] * 1e3, limits.wall * 1e3
            reached.append(Reached(name=f"{name}'s holder wall, mm", value=wall, least=least))
    return [*reached, _feasible(design)]


def stood_limits(design: SkinDesign, sheet: PressedSheet, limits: Limits) -> list[Reached]:
    """What a design must stand under the rated touches, held against its pressed sheet."""
    height, motion = design.columns.height, sheet.rated(design)
    euler = math.pi**2 * design.columns.radius**2 / height
    allowed = allowed_field(design, limits)
    fields, left = largest_field(design, motion), clearances(design, motion)
    return [
        Reached(name="column pressed, of its height", value=sheet.sunk / height, most=limits.crush),
        Reached(name="column pulled, of its bond", value=sheet.pull / sheet.bond, most=limits.pull),
        Reached(name="column's load, of Euler's", value=sheet.sunk / euler, most=limits.buckling),
        *_chip_limits(design, fields, allowed, left, limits, "of what is allowed"),
    ]


def made_limits(
    design: SkinDesign, sheet: PressedSheet, made: Deviations, limits: Limits
) -> list[Reached]:
    """What one made skin must stand, held against a made sheet with these magnets and chips.

    Its fields may use the chips' whole range; buckling, which a softer rubber brings nearer, is
    held against the design alone.
    """
    stands = Reached(name="stands under the rated touch", value=float(sheet.stands()), least=1.0)
    if not stands.kept:
        return [stands]
    motion, pressed = sheet.rated(design), sheet.sunk / design.columns.height
    allowed = np.minimum(mlx90393.full_scale(design.hall_setting), limits.front_end)
    fields = largest_field(design, motion, Readout(design, made))
    names = [magnet.name for magnet in design.magnets]
    left = clearances(design, motion)
    for s, site in enumerate(design.halls):
        g = names.index(site.magnet)
        shift = float(made.magnet_place[g, 2] - made.chips.place[s, 2])
        left[s] += shift if design.magnets[g].mount == "sheet" else -shift
    return [
        stands,
        Reached(name="column pressed, of its height", value=pressed, most=limits.crush),
        *_chip_limits(design, fields, allowed, left, limits, "of its range"),
    ]


def _chip_limits(
    design: SkinDesign,
    fields: Sequence[Floats],
    allowed: Floats,
    left: Sequence[float],
    limits: Limits,
    share: str,
) -> list[Reached]:
    """Limits of each chip: its largest field as a share of what is allowed, and its clearance."""
    reached = []
    for site, seen, room in zip(design.halls, fields, left, strict=True):
        used, least = float((seen / allowed).max()), limits.clearance * 1e3
        reached += [
            Reached(name=f"{site.name} field, {share}", value=used, most=1.0),
            Reached(name=f"{site.name} clearance, mm", value=room * 1e3, least=least),
        ]
    return reached


def _between(name: str, value: float, ends: tuple[float, float], scale: float) -> Reached:
    """A design's own number within its range, in the unit that it is named in."""
    return Reached(name=name, value=value * scale, least=ends[0] * scale, most=ends[1] * scale)


def _feasible(design: SkinDesign) -> Reached:
    """What `smoskin.feasibility` says, as a limit: 1 where the design can work."""
    try:
        check_design(design)
    except DesignError:
        return Reached(name="feasible", value=0.0, least=1.0)
    return Reached(name="feasible", value=1.0, least=1.0)


def _walls(design: SkinDesign) -> dict[str, float]:
    """Room round each magnet of the sheet that is left for its holder, m."""
    sheet = geometry(design).sheet
    feet = sheet.vertices[sheet.columns.ravel(), :2]
    extent = geometry(design).extent
    gaps = {site.magnet: site.gap for site in design.halls}
    walls = {}
    for magnet, place in zip(design.magnets, geometry(design).magnets[:, :2], strict=True):
        if magnet.mount != "sheet":
            continue
        beside = np.linalg.norm(feet - place, axis=1).min() - design.columns.radius
        rim = min(*place, *(extent - place))
        used = design.board.sensing_height + gaps.get(magnet.name, 0.0) + magnet.height
        above = design.columns.height - used
        walls[magnet.name] = float(min(min(beside, rim) - magnet.radius, above))
    return walls


def fit_gaps(
    design: SkinDesign, sheet: PressedSheet, limits: Limits, *, step: float = 0.0
) -> SkinDesign:
    """The design with every gap as small as range, clearance and manufacture allow.

    Parameters
    ----------
    design : SkinDesign
        Design whose gaps are set.
    sheet : PressedSheet
        Pressed sheet of this design's columns and frame.
    limits : Limits
        Limits to keep.
    step : float
        Length to whose multiples gaps are rounded up, m; 0 leaves them as they come.
    """
    slip, stronger, further = made_allowance(limits)
    sites = []
    for site in design.halls:
        alone = alone_over(design, site)
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
        setting
        for setting in settings
        if mlx90393.settles(setting) and mlx90393.conversion_time(setting, 0) * limits.rate <= 1
    ]
    if not fast:
        raise ArgumentError(f"rate must leave the chips a setting; got {limits.rate} Hz")
    return min(fast, key=lambda setting: float(mlx90393.noise(setting)[0]))


def alone_over(
    design: SkinDesign, site: HallSite, corner: tuple[int, int] | None = None
) -> SkinDesign:
    """The design with one chip over the magnet that it watches, at some corner."""
    magnet = design.magnet(site.magnet)
    return replace(
        design, magnets=(replace(magnet, corner=corner or magnet.corner),), halls=(site,)
    )


def _extremes(motion: Motion, further: float) -> Motion:
    """States of one magnet in which it comes nearest to its chip's range, moved further."""
    moved, board = motion.magnets[:, 0], motion.board
    aside = np.hypot(*(moved[:, :2] - board[:, :2]).T)
    rows = np.unique(
        np.concatenate([np.argsort(moved[:, 2])[:_EXTREME], np.argsort(-aside)[:_EXTREME]])
    )
    return motion[rows].scaled(further)
