"""
Figure S16: cover panels
========================

Presses all over each cell by a bare finger and through cover panels, which are presses whose grip
is `smoskin.mechanics.sheet.touches.Covered`. The paper prints no number.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from paper.models.reduction import magnet_motion
from paper.shared.rows import Row, stated
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    Look,
    Plate,
    canvas,
    draw_map,
    draw_shares,
    lay_out,
    open_axes,
    percent,
    styled,
)
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.touches import Covered, Sticking, Touches
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.location import unit_press

if TYPE_CHECKING:
    from smoskin.mechanics.sheet.touches import Grip

FORCE: Final = 0.5
"""N."""
_PLACES: Final = 5
"""Places along each axis of a cell at which it is pressed, evenly spread."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coverage:
    """Presses spread over every cell, by one way to touch; P places a cell."""

    motion: Floats
    """(N, M, P, H, 2), m: motion in the plane of the H magnets on the sheet."""
    table: Floats
    """(N, M, H, 2), m: the same for a press on the cell's own vertex."""
    answered: Floats
    """(N, M, P, 2), m: middle of the cell whose press in the table is most alike."""
    places: Floats
    """(N, M, P, 2), m: where it was pressed."""
    agreeing: int
    """Cells in whose table all signs are those of theory (Table S1)."""

    @property
    def spread(self) -> Floats:
        """(N, M): motion's standard deviation over a cell's places, over its mean."""
        mean = self.motion.mean(axis=2)
        off = self.motion - mean[:, :, None]
        spread = np.sqrt(np.square(off).sum(axis=(-1, -2)).mean(axis=-1))
        return np.asarray(spread / np.linalg.norm(mean, axis=(-1, -2)))

    @property
    def recall(self) -> Floats:
        """(N, M): share of a cell's places that are taken for this cell."""
        right = np.isclose(self.answered, self.places.mean(axis=2, keepdims=True)).all(axis=-1)
        return np.asarray(right.mean(axis=-1))

    @property
    def place_error(self) -> Floats:
        """(N, M, P), m: from where it was pressed to the middle of the cell that is named."""
        return np.asarray(np.linalg.norm(self.answered - self.places, axis=-1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Covers:
    """The skin touched by bare fingers, and through cover panels (Figure S16)."""

    bare: Coverage
    covered: Coverage


def covers(design: SkinDesign) -> Covers:
    """Press every cell at places all over it, with and without cover panels."""
    return Covers(bare=_coverage(design, Sticking()), covered=_coverage(design, Covered()))


def _coverage(design: SkinDesign, grip: "Grip") -> Coverage:
    from smoskin.mechanics.sheet.model import BarHinge

    extent = geometry(design).cell
    cell = np.array([float(extent.length), float(extent.width)])
    corners = np.moveaxis(np.indices(design.cells), 0, -1) * cell
    share = (np.arange(_PLACES) + 0.5) / _PLACES
    inside = np.stack(np.meshgrid(share, share, indexing="ij"), axis=-1).reshape(-1, 2)
    places = corners[:, :, None] + inside * cell
    every = np.concatenate([geometry(design).tops[:, :, None], places], axis=2)
    position = every.reshape(-1, 1, 2)
    push = np.broadcast_to([0.0, 0.0, -FORCE], (len(position), 1, 3))
    pressed = BarHinge(design, grip=grip).press(
        Touches(position=position, force=push), tolerance=1e-6
    )
    carried = [magnet.mount == "sheet" for magnet in design.magnets]
    moved = magnet_motion(design, pressed.displacements)[:, carried, :2]
    moved = moved.reshape(*every.shape[:3], -1, 2)
    table, motion = moved[:, :, 0], moved[:, :, 1:]
    flat = table.reshape(-1, table[0, 0].size)
    units = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    named = (motion.reshape(-1, units.shape[1]) @ units.T).argmax(axis=1)
    middles = (corners + cell / 2).reshape(-1, 2)
    agree = np.sign(table) == np.sign(unit_press(design))
    return Coverage(
        motion=motion,
        table=table,
        answered=middles[named].reshape(places.shape),
        places=places,
        agreeing=int(agree.all(axis=(2, 3)).sum()),
    )


# %%
# Printed beside computed


def cover_rows(result: Covers) -> list[Row]:
    """What the text says of the figure."""
    place, bare, covered = "text on Figure S16", result.bare, result.covered
    return [
        stated(
            "figure_s16.place",
            place,
            "a force anywhere above a cell becomes a displacement of its top vertex along z",
            f"the magnets' motion spreads by {100 * covered.spread.mean():.0f} % over the places "
            f"of a cell, by {100 * bare.spread.mean():.0f} % without covers",
            bool(covered.spread.max() < 1e-6 < bare.spread.min()),
            "0.5 N at 25 places of each cell of the whole sheet; a cover is taken as guided "
            "without play",
        ),
        stated(
            "figure_s16.resolution",
            place,
            "it does not increase the resolution, only the sensing points from the top vertices "
            "to anywhere above the cell",
            f"{100 * covered.recall.mean():.0f} % of the places are named right "
            f"({100 * bare.recall.mean():.0f} % without covers), "
            f"{1e3 * covered.place_error.mean():.1f} mm from the cell's middle in the mean "
            f"({1e3 * bare.place_error.mean():.1f} mm)",
            bool(covered.recall.min() == 1.0 >= bare.recall.mean()),
            "the nearest direction of both magnets' motion among 36 presses on the vertices, "
            "without noise; by theory's table instead of a measured one it fails (U5)",
        ),
    ]


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Presses all over each cell, by a bare finger and through cover panels."""
    return draw(covers(setting.design))


def draw(result: Covers) -> Plate:
    """Motion of the magnets, its spread within cells, and errors of the place."""
    bare, covered = result.bare, result.covered
    with styled():
        figure = canvas(7.2, 6.6)
        axes = figure.subplots(2, 2)
        axes[0, 1].sharex(axes[0, 0])
        axes[0, 1].sharey(axes[0, 0])
        _draw_motions(axes[0, 0], bare)
        _draw_motions(axes[0, 1], covered)
        axes[0, 0].legend(markerscale=3, ncols=2, handletextpad=0.1, columnspacing=0.8)
        axes[0, 0].set_title("(a) bare finger")
        axes[0, 1].set_title("(b) through cover panels")
        texts = [
            [f"{100 * spread:.0f}\n({100 * right:.0f})" for spread, right in np.stack(line, axis=1)]
            for line in zip(bare.spread, bare.recall, strict=True)
        ]
        draw_map(axes[1, 0], 100 * bare.spread, Normalize(0, 40), texts=texts)
        axes[1, 0].set_title("(c) spread in a cell (places found), %")
        draw_shares(axes[1, 1], bare.place_error * 1e3, "bare finger", BLUE)
        draw_shares(axes[1, 1], covered.place_error * 1e3, "cover panels", ORANGE)
        axes[1, 1].set(title="(d) place error", ylabel="share of places (%)", ylim=(0, 101))
        axes[1, 1].set(xlabel="touch to the middle of the cell named (mm)", xlim=(0, None))
        axes[1, 1].legend(loc="lower right")
        open_axes(axes[0, 0], axes[0, 1], axes[1, 1])
        lay_out(figure)
    return Plate(
        name="figure_s16",
        title="Figure S16",
        caption="What the structure of Figure S16 does, by the model; the paper prints no number. "
        f"{FORCE:g} N at {bare.places.shape[2]} places of each cell. (a, b) Motion in x of both "
        "magnets; rings: a press on the cell's vertex. Under a bare finger it spreads with the "
        f"place, by {percent(bare.spread.mean())} in the mean (c); a cover panel, guided along z, "
        f"makes it the same all over the cell, to {_rounding(float(covered.spread.max()))}. Named "
        "by the vertex whose press moves both magnets most nearly the same way, without noise, "
        f"{percent(bare.recall.mean())} and {percent(covered.recall.mean())} of the places fall "
        f"to their own cell, whose middle is {bare.place_error.mean() * 1e3:.1f} and "
        f"{covered.place_error.mean() * 1e3:.1f} mm away in the mean (d): covers make every place "
        "count, as the paper says, without making the skin finer. The theoretical table is not "
        f"enough on this sheet: its signs hold for {bare.agreeing} of {bare.spread.size} cells "
        f"under a finger and for {covered.agreeing} through covers.",
        figure=figure,
        rows=tuple(cover_rows(result)),
    )


def _rounding(spread: float) -> str:
    """A spread of rounding, or its percent."""
    return "rounding" if spread < 1e-9 else f"{100 * spread:.2g} %"


def _draw_motions(axis: Axes, result: Coverage) -> None:
    """Motion in x of the two magnets, for each place of each cell, µm."""
    ring: Look = {"marker": "o", "linestyle": "none", "markersize": 4.5, "markeredgecolor": INK}
    for n in range(len(result.motion)):
        points = result.motion[n, ..., 0].reshape(-1, result.motion.shape[-2]) * 1e6
        dots: Look = {"markersize": 2.2, "markeredgewidth": 0, "label": f"n = {n + 1}"}
        axis.plot(points[:, 0], points[:, 1], ".", color=f"C{n}", **dots)
        table = result.table[n, ..., 0] * 1e6
        axis.plot(table[:, 0], table[:, 1], color=f"C{n}", markeredgewidth=0.5, **ring)
    axis.axhline(0, color=GREY, linewidth=0.4)
    axis.axvline(0, color=GREY, linewidth=0.4)
    axis.set(xlabel="magnet 2, x (µm)", ylabel="magnet 3, x (µm)")


if __name__ == "__main__":
    plate(Setting()).show()
