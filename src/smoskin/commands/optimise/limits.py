"""What a workshop can make and a skin must stand, and what of it a design uses.

Decides the limits within which a design may be varied, each with its reason, how a design and made
skins of it are held against them, and how small a gap may be: as small as the chip's range and the
clearance allow, whatever manufacture does to both.
"""

import math
from dataclasses import dataclass, replace
from itertools import product
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
from smoskin.origami.geometry import from_columns, geometry
from smoskin.records import Motion
from smoskin.twin.manufacture import Deviations, Tolerances
from smoskin.twin.readout import Readout

_EXTREME: Final = 8
"""States that decide a gap: so many with the strongest field, and so many with the magnet farthest
off."""
_DEEPEST: Final = 12e-3
"""Largest gap, m: a usual base's thickness, and more than any column has room for."""
GAP_STEP: Final = 0.05e-3
"""Steps in which gaps are made, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits to keep. The paper prints none of them; each value is assumed, with its reason."""

    column_radius: tuple[float, float] = (1.0e-3, 3.5e-3)
    """Range, m: a thinner column tears when it leaves its mould, a thicker one fills the cell."""
    column_height: tuple[float, float] = (6.0e-3, 20.0e-3)
    """Range, m: below, no magnet fits under the sheet; above, the skin is thicker than a finger."""
    rubbers: tuple[str, ...] = tuple(ELASTOMERS)
    """Rubbers of the columns: those whose modulus is known."""
    frame_clearance: tuple[float, float] = (0.3e-3, 2.0e-3)
    """Range, m: below, the frame touches columns at rest; above, it stops nothing."""
    margin: float = 2.0
    """Least buckling load of a column over its load under the rated touch."""
    sway: float = 0.1
    """Share of a column's height by which a rated drag may sway the rim, which meets no frame:
    columns that bend farther hold so much less that tables follow neither drags nor pairs."""
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
    made_skins: int = 8
    """Sheets on which fields, columns and clearances are checked at the end."""
    made_draws: int = 8
    """Draws of magnets and chips on each of them."""
    deviations: float = 1.3
    """Standard deviations of manufacture that all go against a chip's range at once; together
    they are about as rare as the worst of the made skins."""


@dataclass(frozen=True, slots=True)
class Reached:
    """One limit and what a design makes of it."""

    name: str
    """Name, with its unit."""
    value: float
    least: float = -math.inf
    most: float = math.inf
    chip: str = ""
    """Name of the chip that it limits; empty where it limits the whole skin."""

    @property
    def slack(self) -> float:
        """How far within, as a share of the limit; negative where it is broken."""
        if not math.isfinite(self.value):
            return -1.0
        ends = [(1.0, self.least), (-1.0, self.most)]
        return min(
            sign * (self.value - end) / (abs(end) or 1.0)
            for sign, end in ends
            if math.isfinite(end)
        )

    @property
    def kept(self) -> bool:
        """Whether the limit is kept."""
        return self.slack >= -1e-9

    def as_json(self) -> dict[str, object]:
        """Plain values for machines; None for what is infinite."""
        numbers = {"value": self.value, "least": self.least, "most": self.most}
        finite = {name: x if math.isfinite(x) else None for name, x in numbers.items()}
        return {"name": self.name, **finite, "kept": self.kept}


def allowed_field(design: SkinDesign, limits: Limits) -> Floats:
    """Largest magnitude on each axis of a chip, shape (3,), T."""
    return np.minimum(MARGIN * mlx90393.full_scale(design.hall_setting), limits.front_end)


def largest_field(design: SkinDesign, motion: Motion, made: Deviations | None = None) -> Floats:
    """Largest magnitude on each axis of each chip over these states, (S, 3), T."""
    return np.asarray(np.abs(Readout(design, made).seen(motion)).max(axis=0))


def clearances(design: SkinDesign, motion: Motion) -> Floats:
    """Least distance from each chip's sensing point to its magnet's rim over these states, m."""
    watched, radius = _watched(design), np.array([magnet.radius for magnet in design.magnets])
    moved = motion.magnets[:, watched]
    low = moved[..., 2] - radius[watched] * np.hypot(moved[..., 3], moved[..., 4])
    return np.asarray([site.gap for site in design.halls] + low.min(axis=0))


def _watched(design: SkinDesign) -> list[int]:
    """Which magnet each chip watches."""
    names = [magnet.name for magnet in design.magnets]
    return [names.index(site.magnet) for site in design.halls]


def made_allowance(limits: Limits) -> tuple[float, float, float]:
    """What manufacture may do to a chip's range: m off the gap, and factors on field and motion."""
    scatter, count = Tolerances(), limits.deviations
    return (
        count * math.hypot(scatter.magnet_place, scatter.chip_place),
        1 + count * math.hypot(scatter.remanence, scatter.chip_sensitivity),
        1 + count * math.hypot(scatter.stiffness_variation, scatter.column_stiffness),
    )


def own_limits(design: SkinDesign, limits: Limits) -> list[Reached]:
    """What a design's own numbers decide, held against it."""

    def between(name: str, value: float, ends: tuple[float, float], scale: float) -> Reached:
        return Reached(name, value * scale, ends[0] * scale, ends[1] * scale)

    columns, rate = design.columns, 1 / mlx90393.conversion_time(design.hall_setting, 0)
    reached = [
        between("columns.radius, mm", columns.radius, limits.column_radius, 1e3),
        between("columns.height, mm", columns.height, limits.column_height, 1e3),
        between("frame.clearance, mm", design.frame.clearance, limits.frame_clearance, 1e3),
        Reached("readings a second", rate, least=limits.rate),
    ]
    for index, magnet in enumerate(design.magnets):
        name = magnet.name
        reached += [
            between(f"{name}.radius, mm", magnet.radius, limits.magnet_radius, 1e3),
            between(f"{name}.height, mm", magnet.height, limits.magnet_height, 1e3),
        ]
        if magnet.mount == "sheet":
            # Cells' lengths follow from sides and angles that are written to five digits.
            wall = round(_wall(design, index) * 1e3, 4)
            reached.append(Reached(f"{name}'s holder wall, mm", wall, least=limits.wall * 1e3))
    try:
        check_design(design)
        feasible = 1.0
    except DesignError:
        feasible = 0.0
    return [*reached, Reached("feasible", feasible, least=1.0)]


def _wall(design: SkinDesign, index: int) -> float:
    """Room round a magnet of the sheet that is left for its holder, m."""
    skin, magnet = geometry(design), design.magnets[index]
    place, extent = skin.magnet_places[index], skin.extent
    beside = from_columns(skin, skin.magnets[index]).min() - design.columns.radius
    rim = min(*place, *(extent - place))
    gap = max((site.gap for site in design.halls if site.magnet == magnet.name), default=0.0)
    above = design.columns.height - design.board.sensing_height - gap - magnet.height
    return float(min(min(beside, rim) - magnet.radius, above))


def stood_limits(design: SkinDesign, sheet: PressedSheet, limits: Limits) -> list[Reached]:
    """What a design must stand under the rated touches, held against its pressed sheet."""
    height, motion = design.columns.height, sheet.rated(design)
    used = largest_field(design, motion) / allowed_field(design, limits)
    left = clearances(design, motion)
    return [
        Reached("column pressed, of its height", sheet.sunk / height, most=limits.crush),
        Reached("column pulled, of its bond", sheet.pull / sheet.bond, most=limits.pull),
        Reached("column's buckling load, of its load", sheet.margin, least=limits.margin),
        Reached("rim's sway, of its height", sheet.sway / height, most=limits.sway),
        Reached("rim's sway, of the way to the frame", sheet.sway / sheet.free_sway, most=1.0),
        *_chip_limits(design, used, "of what is allowed", left, limits),
    ]


def made_limits(
    design: SkinDesign, sheet: PressedSheet, made: Deviations, limits: Limits
) -> list[Reached]:
    """What one made skin must stand, held against a made sheet with these magnets and chips.

    Its fields may use the chips' whole range; buckling, which a softer rubber brings nearer, is
    held against the design alone.
    """
    stands = Reached("stands under the rated touch", float(sheet.stands()), least=1.0)
    if not stands.kept:
        return [stands]
    motion, pressed = sheet.rated(design), sheet.sunk / design.columns.height
    whole = np.minimum(mlx90393.full_scale(design.hall_setting), limits.front_end)
    used = largest_field(design, motion, made) / whole
    watched = _watched(design)
    sides = np.array([1.0 if design.magnets[g].mount == "sheet" else -1.0 for g in watched])
    shifts = made.magnet_place[watched, 2] - made.chips.place[:, 2]
    return [
        stands,
        Reached("column pressed, of its height", pressed, most=limits.crush),
        *_chip_limits(
            design, used, "of its range", clearances(design, motion) + sides * shifts, limits
        ),
    ]


def _chip_limits(
    design: SkinDesign, used: Floats, share: str, left: Floats, limits: Limits
) -> list[Reached]:
    """Limits of each chip: its largest field as a share of what is allowed, and its clearance."""
    reached = []
    for site, field, room in zip(design.halls, used.max(axis=1), left, strict=True):
        chip, least = site.name, limits.clearance * 1e3
        reached += [
            Reached(f"{chip} field, {share}", float(field), most=1.0, chip=chip),
            Reached(f"{chip} clearance, mm", float(room) * 1e3, least=least, chip=chip),
        ]
    return reached


def fit_gaps(
    design: SkinDesign, sheet: PressedSheet, limits: Limits, *, step: float = 0.0
) -> SkinDesign:
    """The design with every gap as small as range, clearance and manufacture allow.

    `sheet` is the pressed one of this design's columns and frame. Gaps are rounded up to multiples
    of a step, m; 0 leaves them as they come. A column too short for the gap breaks a limit of
    `own_limits`: nothing is left for its magnet's holder.
    """
    slip, stronger, further = made_allowance(limits)
    bound = allowed_field(design, limits) / stronger
    sites = []
    for site in design.halls:
        alone = alone_over(design, site)
        motion = _extremes(alone, sheet.rated(alone), further)
        least = limits.clearance + site.gap - float(clearances(alone, motion)[0]) + slip

        def excess(gap: float, alone: SkinDesign = alone, motion: Motion = motion) -> float:
            nearer = replace(alone.halls[0], gap=max(gap - slip, 1e-4))
            seen = largest_field(replace(alone, halls=(nearer,)), motion)
            return float((seen / bound).max()) - 1

        gap, most = least, max(least, _DEEPEST)
        if excess(least) > 0:
            gap = most if excess(most) > 0 else float(brentq(excess, least, most, xtol=1e-6))
        if step:
            gap = round(math.ceil(gap / step - 1e-9) * step, 9)
        sites.append(replace(site, gap=gap))
    return replace(design, halls=tuple(sites))


def slowest_setting(design: SkinDesign, limits: Limits) -> HallSetting:
    """The setting of least noise that is fast enough, finest where a chip does not wrap."""
    settings = [
        replace(design.hall_setting, resolution=2, oversampling=over, digital_filter=smooth)
        for over, smooth in product(range(4), range(8))
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
    moved = replace(magnet, corner=corner or magnet.corner)
    return replace(design, magnets=(moved,), halls=(site,))


def _extremes(alone: SkinDesign, motion: Motion, further: float) -> Motion:
    """States of one magnet in which it comes nearest to its chip's range, moved further."""
    moved, board = motion.magnets[:, 0], motion.board
    aside = np.hypot(*(moved[:, :2] - board[:, :2]).T)
    field = np.abs(Readout(alone).seen(motion)).max(axis=(1, 2))
    strongest, farthest = np.argsort(-field)[:_EXTREME], np.argsort(-aside)[:_EXTREME]
    return motion[np.union1d(strongest, farthest)].scaled(further)
