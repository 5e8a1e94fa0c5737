"""What a workshop can make and a skin must stand, and what of it a design uses.

Decides the limits within which a design may be varied, each with its reason, and how a design is
held against them: by its own numbers, by the fields and columns of the twin under the rated
touches, and by `smoskin.feasibility`.
"""

import math
from dataclasses import dataclass

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.optimise.slopes import PressedSheet
from smoskin.design.materials import ELASTOMERS
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.feasibility import MARGIN, check_design
from smoskin.magnetics import mlx90393
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.twin.manufacture import Deviations, Tolerances
from smoskin.twin.readout import Readout


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What must be kept. The paper prints none of it; each value is assumed, with its reason."""

    column_radius: tuple[float, float] = (1.0e-3, 3.0e-3)
    """m: a thinner column tears when it leaves its mould, a thicker one fills the cell."""
    column_height: tuple[float, float] = (6.0e-3, 15.0e-3)
    """m: below, no magnet fits under the sheet; above, the skin is thicker than a finger."""
    rubbers: tuple[str, ...] = tuple(ELASTOMERS)
    """Of the columns: those whose modulus is known."""
    frame_stiffness: tuple[float, float] = (20.0, 2000.0)
    """N/m for each rim column: from a strip of soft foam to a printed rail."""
    magnet_radius: tuple[float, float] = (2.5e-3, 6.0e-3)
    """m: below, the coil that magnetises four sectors does not fit; above, no corner is wide
    enough."""
    magnet_height: tuple[float, float] = (1.5e-3, 5.0e-3)
    """m: a thinner disc of bonded powder breaks in the holder."""
    wall: float = 1.0e-3
    """m: of the printed holder, between a magnet and the columns, the rim and the sheet."""
    clearance: float = 1.0e-3
    """m: left between a magnet and its chip's sensing point under the rated touch; of it, 0.4 mm
    lie within the package."""
    front_end: float = 50e-3
    """T, along each axis: up to which the chip's front end is specified."""
    rate: float = 100.0
    """Readings a second, temperature included: a robot's loop."""
    crush: float = 0.35
    """Of a column's height by which a rated touch may press it; at half of it the model ends."""
    pull: float = 0.8
    """Of the bond's strength by which one may be pulled."""
    buckling: float = 1.0
    """Of Euler's load of a column clamped at both ends, pi^2 r^2 / h of shortening: past it the
    model, whose columns stay straight, does not hold."""
    made_skins: int = 8
    """Sheets on which fields, columns and clearances are checked at the end."""
    made_draws: int = 8
    """Of magnets and chips on each of them."""
    deviations: float = 1.3
    """Standard deviations of manufacture that all go against a chip's range at once; together
    they are about as rare as the worst of the made skins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reached:
    """One limit and what a design makes of it."""

    name: str
    """With its unit."""
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
        """Whether it is."""
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
    found = [
        _between("columns.radius, mm", columns.radius, limits.column_radius, 1e3),
        _between("columns.height, mm", columns.height, limits.column_height, 1e3),
        _between("frame.stiffness, N/mm", design.frame.stiffness, limits.frame_stiffness, 1e-3),
        Reached(
            name="readings a second",
            value=1 / mlx90393.conversion_time(setting, 0),
            least=limits.rate,
        ),
    ]
    spaces = _walls(design)
    for magnet in design.magnets:
        found += [
            _between(f"{magnet.name}.radius, mm", magnet.radius, limits.magnet_radius, 1e3),
            _between(f"{magnet.name}.height, mm", magnet.height, limits.magnet_height, 1e3),
        ]
        if magnet.name in spaces:
            wall = spaces[magnet.name]
            found.append(
                Reached(
                    name=f"{magnet.name}'s holder wall, mm",
                    value=wall * 1e3,
                    least=limits.wall * 1e3,
                )
            )
    return [*found, _feasible(design)]


def stood_limits(design: SkinDesign, sheet: PressedSheet, limits: Limits) -> list[Reached]:
    """What a design must stand under the rated touches, held against its pressed sheet."""
    height, motion = design.columns.height, sheet.rated(design)
    euler = math.pi**2 * design.columns.radius**2 / height
    found = [
        Reached(name="column pressed, of its height", value=sheet.sunk / height, most=limits.crush),
        Reached(name="column pulled, of its bond", value=sheet.pull / sheet.bond, most=limits.pull),
        Reached(name="column's load, of Euler's", value=sheet.sunk / euler, most=limits.buckling),
    ]
    most = allowed_field(design, limits)
    fields = largest_field(design, motion)
    for site, seen, left in zip(design.halls, fields, clearances(design, motion), strict=True):
        axis = int(np.argmax(seen / most))
        found += [
            Reached(
                name=f"{site.name} field, of what is allowed", value=float(seen[axis] / most[axis]),
                most=1.0,
            ),
            Reached(
                name=f"{site.name} clearance, mm", value=left * 1e3, least=limits.clearance * 1e3
            ),
        ]  # fmt: skip
    return found


def made_limits(
    design: SkinDesign, sheet: PressedSheet, made: Deviations, limits: Limits
) -> list[Reached]:
    """What one made skin must stand, held against a made sheet with these magnets and chips.

    Its fields may use the chips' whole range; buckling, which a softer rubber brings nearer, is
    held against the design alone.
    """
    motion = sheet.rated(design)
    if not sheet.stands():
        return [Reached(name="stands under the rated touch", value=0.0, least=1.0)]
    most = np.minimum(mlx90393.full_scale(design.hall_setting), limits.front_end)
    names = [magnet.name for magnet in design.magnets]
    fields = largest_field(design, motion, Readout(design, made))
    found = [
        Reached(name="stands under the rated touch", value=1.0, least=1.0),
        Reached(
            name="column pressed, of its height",
            value=sheet.sunk / design.columns.height,
            most=limits.crush,
        ),
    ]
    left = clearances(design, motion)
    for s, (site, seen) in enumerate(zip(design.halls, fields, strict=True)):
        axis = int(np.argmax(seen / most))
        g = names.index(site.magnet)
        shift = made.magnet_place[g, 2] - made.chip_pose.offset[s, 2]
        side = 1.0 if design.magnets[g].mount == "sheet" else -1.0
        found += [
            Reached(
                name=f"{site.name} field, of its range", value=float(seen[axis] / most[axis]),
                most=1.0,
            ),
            Reached(
                name=f"{site.name} clearance, mm", value=(left[s] + side * float(shift)) * 1e3,
                least=limits.clearance * 1e3,
            ),
        ]  # fmt: skip
    return found


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
    """Room round each magnet that is left for its holder, m; of the sheet's magnets."""
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
