"""
The attenuation model fitted to the whole sheet
===============================================

Not in the paper: with which v_a the reduced model (S7-S11) stands for the whole sheet, and what it
would need to do so. Columns that bend and a frame that keeps clear of them decide; beyond those the
SI's assumptions are granted to the whole sheet one after the other, and its columns made stiffer.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from paper.models.press_energy import EnergyShares, energy_shares
from paper.models.reduction import (
    LEAST_ATTENUATION,
    Reduction,
    UnitPresses,
    cells_named,
    fit_columns,
    fit_magnets,
    fit_stiffness,
    signs_agree,
    unit_presses,
)
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    RED,
    SMALL,
    Plate,
    canvas,
    draw_map,
    lay_out,
    logarithmic,
    note,
    open_axes,
    percent,
    styled,
)
from smoskin.arrays import Bools
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.stiffness import column_stiffness
from smoskin.mechanics.sheet.lattice import Lattice, Springs, build_lattice, springs_of
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Covered, Grip, Sticking

AXIALLY_RIGID: Final = 1e4
"""Factor on the columns' axial stiffness at which they hardly sink any more."""
_RIGID_BENDING, _RIGID_MEMBRANE = 1e3, 10.0
"""Factors on the panels' stiffness at which cells fold, and hardly anything else."""
AXIAL_FACTORS: Final = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, AXIALLY_RIGID)
"""On the designed axial stiffness; sideways as designed."""
COLUMN_SIZES: Final = (
    (3.5e-3, 13e-3),
    (2.5e-3, 13e-3),
    (3.5e-3, 20e-3),
    (4.5e-3, 5e-3),
)
"""m: radius and height of columns that a mould could make, the designed ones first."""
_TOUCHING: Final = 1e-9
"""m: sway over which a frame without clearance sets in."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Variant:
    """The whole sheet with some of the SI's assumptions granted, and the model fitted to it."""

    name: str
    """What is granted."""
    presses: UnitPresses
    columns: Reduction
    """Fitted to the columns' motion, its scale too."""
    unscaled: Reduction
    """The same with the whole press folding the cell, as the SI has it."""
    magnets: Reduction
    """Fitted to the magnets' motion, its scale too."""
    stiffness: Reduction
    """v_a and v_s by the SI's own procedure."""
    agree: Bools
    """(N, M, 2, 2): signs of both magnets' motion along both axes are Table S1's."""

    named: int
    """Cells that S12 names right with the v_a of the magnets' motion."""

    @property
    def cells_agreeing(self) -> int:
        """Cells with all four signs of Table S1."""
        return int(self.agree.all(axis=(2, 3)).sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnSize:
    """What columns of one size would change."""

    radius: float
    """m."""
    height: float
    """m."""
    axial: float
    """N/m."""
    folding: float
    """Share of the sink that folds the pressed cell, mean over all cells."""
    stiffness: float
    """N/m, mean over all cells."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assumptions:
    """All variants, and how the share of folding hangs on the columns."""

    variants: tuple[Variant, ...]
    """As built first."""
    axial_factors: tuple[float, ...]
    """On the designed axial stiffness."""
    folding: tuple[float, ...]
    """Share of the sink that folds the pressed cell."""
    folding_sheared: tuple[float, ...]
    """The same with columns that shear and do not bend (S21)."""
    sizes: tuple[ColumnSize, ...]
    energy: EnergyShares
    """As built, vertices guided along z."""


def assumptions(design: SkinDesign) -> Assumptions:
    """Press the whole sheet in all its variants."""
    springs = springs_of(design)
    sheared = replace(springs, column_lateral=column_stiffness(design))
    hard = _axially(springs, AXIALLY_RIGID)
    rigid = replace(
        hard,
        panel_bending=_RIGID_BENDING * springs.panel_bending,
        panel_membrane=_RIGID_MEMBRANE * springs.panel_membrane,
    )
    built, stiff = build_lattice(design, springs), build_lattice(design, sheared)
    cases: tuple[tuple[str, Lattice, Grip], ...] = (
        ("as built, a finger sticks", built, Sticking()),
        ("loaded vertex guided along z", built, Covered()),
        ("guided, frame touching", _touching(built), Covered()),
        ("guided, columns in shear alone (S21)", stiff, Covered()),
        ("guided, columns rigid along z", build_lattice(design, hard), Covered()),
        ("... and nearly rigid panels", build_lattice(design, rigid), Covered()),
    )
    return Assumptions(
        variants=tuple(
            _variant(name, unit_presses(BarHinge(design, grip=grip, lattice=lattice)))
            for name, lattice, grip in cases
        ),
        axial_factors=AXIAL_FACTORS,
        folding=tuple(_folding(design, _axially(springs, k)) for k in AXIAL_FACTORS),
        folding_sheared=tuple(_folding(design, _axially(sheared, k)) for k in AXIAL_FACTORS),
        sizes=tuple(_column_size(design, radius, height) for radius, height in COLUMN_SIZES),
        energy=energy_shares(BarHinge(design, grip=Covered())),
    )


def _touching(lattice: Lattice) -> Lattice:
    """A lattice whose frame has no clearance."""
    near = np.full(len(lattice.stops.free), _TOUCHING)
    return replace(lattice, stops=replace(lattice.stops, free=0 * near, rounding=near))


def _axially(springs: Springs, factor: float) -> Springs:
    """Columns so many times as stiff along z."""
    return replace(springs, column_axial=factor * springs.column_axial)


def _guided(design: SkinDesign, springs: Springs) -> UnitPresses:
    """Presses of vertices guided along z."""
    return unit_presses(BarHinge(design, grip=Covered(), lattice=build_lattice(design, springs)))


def _folding(design: SkinDesign, springs: Springs) -> float:
    """Share of the sink that folds the pressed cell, mean over all cells."""
    return float(_guided(design, springs).folding.mean())


def _variant(name: str, presses: UnitPresses) -> Variant:
    magnets = fit_magnets(presses)
    return Variant(
        name=name,
        presses=presses,
        columns=fit_columns(presses),
        unscaled=fit_columns(presses, scale=1.0),
        magnets=magnets,
        stiffness=fit_stiffness(presses),
        agree=signs_agree(presses),
        named=cells_named(presses, magnets.attenuation),
    )


def _column_size(design: SkinDesign, radius: float, height: float) -> ColumnSize:
    made = replace(
        design,
        columns=replace(design.columns, radius=radius, height=height),
        frame=replace(design.frame, held_height=height / 2),
    )
    springs = springs_of(made)
    presses = _guided(made, springs)
    return ColumnSize(
        radius=radius,
        height=height,
        axial=springs.column_axial,
        folding=float(presses.folding.mean()),
        stiffness=float(presses.stiffness.mean()),
    )


# %%
# Drawn

_MAPPED: Final = (0, 3, 4)
"""Variants that are drawn as maps."""


def plate(setting: Setting) -> Plate:
    """Maps of what the fitted reduced model leaves, and the share of folding over the columns."""
    return draw(assumptions(setting.design))


def draw(result: Assumptions) -> Plate:
    """Three maps, a table of all variants, and the columns' curve."""
    with styled():
        figure = canvas(7.2, 7.8)
        grid = figure.add_gridspec(3, 3, height_ratios=(1.15, 0.75, 1))
        for column, (letter, k) in enumerate(zip("abc", _MAPPED, strict=True)):
            axis = figure.add_subplot(grid[0, column])
            _draw_map(axis, result.variants[k])
            axis.set_title(f"({letter}) {_short(result.variants[k].name)}")
            axis.label_outer()
        _draw_table(figure.add_subplot(grid[1, :]), result)
        _draw_columns(figure.add_subplot(grid[2, :]), result)
        lay_out(figure)
    built, guided, sheared, hard = (result.variants[k] for k in (0, 1, 3, 4))
    half = float(np.interp(0.5, result.folding, np.log10(result.axial_factors)))
    return Plate(
        name="attenuation_fit",
        title="The reduced model fitted to the whole sheet",
        caption="Not in the paper: the attenuation model (S7-S11) fitted to the columns' motion in "
        "the plane on the whole sheet, for a small press on each cell. Maps: what is left, over "
        "that motion; a cross marks cells where some magnet moves against Table S1. As built "
        f"(columns bend, the frame keeps clear) Table S1 holds on {built.cells_agreeing} of "
        f"{built.agree[..., 0, 0].size} cells, and S12 names {built.named} of them; "
        f"{percent(guided.presses.folding.mean())} of a press folds its cell, the rest sinks the "
        f"columns, so that v_a = {_pair(built)} needs a scale "
        f"of {built.columns.scale:.2f} and leaves {percent(built.columns.residual)}. Of the energy "
        f"{percent(result.energy.sink)} is in columns along z, {percent(result.energy.sway)} in "
        f"columns sideways, {percent(result.energy.panels)} in panels and "
        f"{100 * result.energy.creases:.1f} % in creases. Were the "
        "columns to shear alone, as S21 has it, the sheet would sink on them like a plate: "
        f"{percent(sheared.presses.folding.mean())} folds, {sheared.cells_agreeing} cells hold "
        f"Table S1. With columns rigid along z v_a = {_pair(hard)} leaves "
        f"{percent(hard.columns.residual)}, and Text S5's procedure finds nearly the same v_a by "
        f"the stiffness, {_bound(hard.stiffness)} left; as built it finds none. Half of the press "
        f"folds the cell with columns {10**half:.1f} times as stiff along z (d). The columns' size "
        "is assumed, not printed (U5).",
        figure=figure,
    )


def _pair(variant: Variant) -> str:
    """v_aX and v_aY, fitted to the columns."""
    return "{:.2f}, {:.2f}".format(*variant.columns.attenuation)


def _bound(fit: Reduction) -> str:
    """v_a, unless the search ended at its lower end, and what is left."""
    v = fit.attenuation[0]
    return f"{f'{v:.2f}' if v > 2 * LEAST_ATTENUATION else 'none'}, {percent(fit.residual)}"


def _short(name: str) -> str:
    """A variant's name that fits over its map."""
    return name.removeprefix("guided, ").replace("...", "same").replace(", a finger sticks", "")


def _draw_map(axis: Axes, variant: Variant) -> None:
    """What is left for a press on each cell."""
    left = variant.columns.cell_residual
    draw_map(axis, left, Normalize(0, 1), texts=[[f"{item:.2f}" for item in line] for line in left])
    for n, m in np.argwhere(~variant.agree.all(axis=(2, 3))):
        axis.plot(n + 1.32, m + 1.32, "x", color=RED, markersize=4, markeredgewidth=1.2)


_COLUMNS: Final[tuple[tuple[float, str, Callable[[Variant], str]], ...]] = (
    (0.0, "granted to the whole sheet", lambda item: item.name),
    (0.27, "v_aX, v_aY", lambda item: _pair(item)),
    (0.375, "scale", lambda item: f"{item.columns.scale:.3f}"),
    (0.445, "left", lambda item: percent(item.columns.residual)),
    (0.5, "magnets\nalone, left", lambda item: percent(item.magnets.residual)),
    (0.6, "named\n(S12)", lambda item: f"{item.named} of {item.agree[..., 0, 0].size}"),
    (
        0.685,
        "signs as\nTable S1",
        lambda item: f"{item.cells_agreeing} of {item.agree[..., 0, 0].size}",
    ),
    (0.77, "press that\nfolds", lambda item: percent(item.presses.folding.mean())),
    (0.855, "K mean\n(N/mm)", lambda item: f"{item.presses.stiffness.mean() / 1e3:.1f}"),
    (0.925, "S5: v_a,\nleft of K", lambda item: _bound(item.stiffness)),
)
"""Columns of the table: left edge, head and text."""


def _draw_table(axis: Axes, result: Assumptions) -> None:
    """All variants, one a line."""
    axis.axis("off")
    axis.set(xlim=(0, 1), ylim=(-len(result.variants) - 0.2, 1.2))
    for left, head, _ in _COLUMNS:
        axis.text(left, 0.1, head, va="bottom", fontsize=SMALL, weight="bold")
    axis.axhline(-0.1, color=GREY, linewidth=0.5)
    for line, variant in enumerate(result.variants):
        for left, _, text in _COLUMNS:
            axis.text(left, -line - 0.65, text(variant), va="center", fontsize=SMALL)


def _draw_columns(axis: Axes, result: Assumptions) -> None:
    """Share of the press that folds, over the columns' stiffness along z."""
    factors, folding = np.asarray(result.axial_factors), 100 * np.asarray(result.folding)
    sheared = 100 * np.asarray(result.folding_sheared)
    alone = "stiffer along z alone"
    axis.plot(factors, folding, "-o", color=BLUE, markersize=3, label=alone)
    label: str | None = "the same, columns in shear alone"
    axis.plot(factors, sheared, "-s", color=ORANGE, markersize=3, label=label)
    label = "columns of another size (r x h)"
    for item in result.sizes:
        at = item.axial / result.sizes[0].axial, 100 * item.folding
        axis.plot(*at, "D", color=RED, markersize=4, label=label)
        text = f"{item.radius * 1e3:g} x {item.height * 1e3:g} mm\n{item.stiffness / 1e3:.1f} N/mm"
        note(axis, text, at, (4, -11), fontsize=6, color=INK, linespacing=1.1)
        label = None
    logarithmic(axis.xaxis)
    axis.set(title="(d) what the SI's assumption needs of the columns", ylim=(-6, 105))
    axis.set(xlabel="stiffness of a column along z over the designed one")
    axis.set(ylabel="press that folds the cell (%)")
    axis.legend(loc="lower right")
    open_axes(axis)


if __name__ == "__main__":
    plate(Setting()).show()
