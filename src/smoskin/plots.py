"""Pictures of a skin: its outline, touches with their uncertainty, maps, and what chips read.

Decides how every figure of the project looks: millimetres and microtesla on the axes, one style,
and colours that differ for every kind of colour vision. Needs Matplotlib, the extra ``plots``.
"""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError
from smoskin.origami.geometry import geometry
from smoskin.origami.pattern import BrokenRule, CreasePattern
from smoskin.origami.sheet import Sheet
from smoskin.outputs import check_output, write_output
from smoskin.records import Contact, Estimate, Reading

try:
    from matplotlib import rc_context
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import FigureCanvasBase
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Ellipse, Rectangle
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection
except ImportError as error:
    raise MissingExtraError("drawing", "plots") from error

BLUE: Final = "#0072B2"
ORANGE: Final = "#E69F00"
GREEN: Final = "#009E73"
RED: Final = "#D55E00"
PINK: Final = "#CC79A7"
GREY: Final = "#8c8c8c"
INK: Final = "#222222"

_STYLE: Final[Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 6.5,
    "svg.hashsalt": "smoskin",  # the same data give the same bytes
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}
_REGION: Final = 4.605
"""Chi-square that 90 % of two normal errors stay below."""
_ARROW: Final = 20e-3
"""Length of an arrow for a newton of drag, m."""
_CREASES: Final = {"M": (RED, "-"), "V": (BLUE, "--"), "B": (INK, "-"), "C": (INK, ":")}
"""Colour and dashes of a pattern's lines, by FOLD's letter; others are grey."""
_LINES: Final = 12
"""Vertices of a pattern whose broken rules are written out."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plate:
    """A figure with its name, title and caption."""

    name: str
    """Stem of its file, such as `figure_s7`."""
    title: str
    """Title, a line."""
    caption: str
    """Caption, a few sentences."""
    figure: Figure
    """Figure as drawn."""

    def write(self, folder: Path) -> Path:
        """Write it as SVG; the same data give the same bytes."""
        path = folder / f"{self.name}.svg"
        with styled():
            save_figure(self.figure, path, metadata={"Date": None, "Title": self.title})
        return path


def check_figure(path: Path, *, force: bool = False) -> None:
    """Refuse a figure's file as `smoskin.outputs.check_output` does, and of an unknown format."""
    check_output(path, force=force)
    kinds = FigureCanvasBase.get_supported_filetypes()
    if path.suffix[1:].lower() not in kinds:
        raise ArgumentError(
            f"a figure's file must end with one of {', '.join(kinds)}; got {path.name!r}"
        )


def save_figure(figure: Figure, path: Path, **options: Any) -> None:
    """Write a figure in the format that its file's name ends with."""
    kind = path.suffix[1:].lower()
    write_output(path, lambda part: figure.savefig(part, format=kind, **options))


def styled() -> AbstractContextManager[None]:
    """The project's style, while the context lasts."""
    return rc_context(_STYLE)


def lay_out(figure: Figure) -> None:
    """Find the layout once and keep it, instead of finding it again at each drawing."""
    figure.draw_without_rendering()
    # A placeholder engine, "none", would have each file drawn twice.
    figure.set_layout_engine(None)


def draw_skin(design: SkinDesign, axes: Axes | None = None) -> Axes:
    """Outline, cells, magnets and chips of a skin, seen from above.

    They are drawn into the given axes, in millimetres, or into those of a new figure.
    """
    axes = _axes(axes, (3.6, 4.4))
    length, width = 1e3 * geometry(design).extent
    cell = geometry(design).cell
    axes.add_patch(Rectangle((0, 0), length, width, fill=False, edgecolor=INK, linewidth=1.0))
    axes.vlines(1e3 * cell.length * np.arange(1, design.cells[0]), 0, width, GREY, linewidth=0.3)
    axes.hlines(1e3 * cell.width * np.arange(1, design.cells[1]), 0, length, GREY, linewidth=0.3)
    _draw_magnets(design, axes, {"sheet": ORANGE, "base": GREY})
    chips = 1e3 * geometry(design).chips
    axes.plot(chips[:, 0], chips[:, 1], "s", color=GREEN, markersize=3)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title=design.name)
    axes.set_aspect("equal")
    return axes


def draw_touches(
    axes: Axes, touches: Estimate | Sequence[Contact], *, colour: str = RED, label: str = ""
) -> None:
    """Touches on a skin: a point each, an arrow for the drag, the region that holds 90 %.

    The axes are in millimetres, as `draw_skin` gives them; an estimate has the regions of its
    covariance drawn; the label is the name in a legend.
    """
    contacts = touches.contacts if isinstance(touches, Estimate) else tuple(touches)
    for k, contact in enumerate(contacts):
        x, y = (1e3 * float(value) for value in contact.position)
        axes.plot(x, y, "o", color=colour, markersize=4, label=label if k == 0 and label else None)
        dx, dy = (1e3 * _ARROW * float(value) for value in contact.force[:2])
        if np.hypot(dx, dy) > 0.5:
            axes.annotate(
                "", (x + dx, y + dy), (x, y), arrowprops={"arrowstyle": "->", "color": colour}
            )
        if isinstance(touches, Estimate):
            spread = touches.covariance[k, :2, :2]
            if np.isfinite(spread).all():
                axes.add_patch(_region((x, y), spread, colour))


def draw_judgement(
    design: SkinDesign, places: Floats, off: Floats, missed: Mapping[str, Floats], title: str
) -> Figure:
    """Touches that a fit has not seen: arrows to where it locates each, and how far it is off.

    `places` are true, (N, 2), m; `off` is how far each is located from there, (N, 2), m, drawn ten
    times as long; `missed` are residuals in standard deviations, by what they are of.
    """
    with styled():
        figure = Figure(figsize=(7.5, 4.6), layout="constrained")
        panels = figure.subplot_mosaic([["skin", name] for name in missed])
        skin, others = panels["skin"], [panels[name] for name in missed]
        draw_skin(design, skin)
        skin.plot(*(1e3 * places.T), ".", color=BLUE, markersize=3)
        arrows = 1e4 * off.T
        skin.quiver(*(1e3 * places.T), *arrows, color=RED, angles="xy", scale_units="xy", scale=1)
        skin.set_title(f"{title}, 10 x")
        for axes, (name, values) in zip(others, missed.items(), strict=True):
            axes.hist(values.ravel(), 30, color=BLUE)
            axes.set(ylabel="number", title=name)
        others[-1].set_xlabel("missed (standard deviations)")
        lay_out(figure)
    return figure


def draw_map(
    design: SkinDesign,
    values: ArrayLike,
    axes: Axes | None = None,
    *,
    label: str = "",
    limits: tuple[float, float] | None = None,
) -> Axes:
    """Values over the skin as a map.

    Parameters
    ----------
    values : array_like, shape (P, Q)
        Values on a grid along x and y that reaches from rim to rim, or one a cell; NaN stays blank.
    axes : Axes, optional
        Axes to draw into; those of a new figure by default.
    label : str, optional
        Name and unit of the values, for the colour bar.
    limits : tuple of float, optional
        Values at the ends of the colours; all finite values by default.
    """
    axes = _axes(axes, (4.2, 4.4))
    grid = floats("values", values, (None, None))
    low, high = limits or (float(np.nanmin(grid)), float(np.nanmax(grid)))
    length, width = 1e3 * geometry(design).extent
    cells = grid.shape == design.cells
    dx, dy = (
        (0.0, 0.0) if cells else (length / (2 * len(grid) - 2), width / (2 * grid.shape[1] - 2))
    )
    image = axes.imshow(
        np.ma.masked_invalid(grid.T),
        origin="lower",
        cmap="cividis",
        vmin=low,
        vmax=high,
        extent=(-dx, length + dx, -dy, width + dy),
    )
    _draw_magnets(design, axes, {"sheet": "white", "base": "white"})
    bar = axes.figure.colorbar(image, ax=axes, shrink=0.8, label=label)
    bar.outline.set_visible(False)
    axes.set(xlabel="x (mm)", ylabel="y (mm)")
    axes.set_aspect("equal")
    return axes


def draw_readings(readings: Sequence[Reading], axes: Axes | None = None) -> Axes:
    """Fields of all chips over time, less those of the first reading.

    They are drawn into the given axes or into those of a new figure.
    """
    axes = _axes(axes, (5.6, 2.6))
    time = np.array([reading.time for reading in readings])
    field = 1e6 * np.array([reading.field - readings[0].field for reading in readings])
    for s in range(field.shape[1]):
        for axis, (colour, dash) in enumerate(((BLUE, "-"), (ORANGE, "--"), (GREEN, ":"))):
            axes.plot(
                time,
                field[:, s, axis],
                dash,
                color=colour,
                alpha=1 / (1 + s),
                linewidth=0.9,
                label=f"chip {s + 1}, {'xyz'[axis]}",
            )
    axes.set(xlabel="time (s)", ylabel="change of field (µT)")
    axes.legend(fontsize=6, ncols=3)
    return axes


def draw_sheet(sheet: Sheet, pattern: Floats, title: str) -> Figure:
    """A folded sheet in space, and its flat pattern (V, 2), m, with ridges and valleys."""
    with styled():
        figure = Figure(figsize=(7.5, 3.9), layout="constrained")
        space = figure.add_subplot(1, 2, 1, projection="3d")
        panels = Poly3DCollection(
            1e3 * sheet.vertices[sheet.facets],
            facecolors=BLUE,
            edgecolors=INK,
            linewidths=0.3,
            shade=True,
        )
        space.add_collection3d(panels)
        low, high = 1e3 * sheet.vertices.min(axis=0), 1e3 * sheet.vertices.max(axis=0)
        half = (high - low).max() / 2
        middle = (low + high) / 2
        for axis, centre in zip("xyz", middle, strict=True):
            space.set(
                **{f"{axis}lim": (centre - half, centre + half), f"{axis}label": f"{axis} (mm)"}
            )
        space.set_title(title)
        flat = figure.add_subplot(1, 2, 2)
        flat.add_collection(
            PolyCollection(
                list(1e3 * pattern[sheet.facets]), facecolor="none", edgecolor=INK, linewidth=0.4
            )
        )
        for ridge, colour in ((True, RED), (False, BLUE)):
            ends = 1e3 * pattern[sheet.creases[sheet.mountain == ridge]]
            flat.add_collection(LineCollection(list(ends), colors=colour, linewidths=0.7))
        flat.autoscale_view()
        flat.set(xlabel="x (mm)", ylabel="y (mm)", title="flat; ridges red, valleys blue")
        flat.set_aspect("equal")
        lay_out(figure)
    return figure


def draw_pattern(pattern: CreasePattern, broken: Sequence[BrokenRule], title: str) -> Figure:
    """Draw a crease pattern, mountains red and valleys blue, with the rules that vertices break.

    A vertex that breaks one is ringed and numbered; what it breaks stands below.
    """
    rules: dict[int, list[str]] = {}
    for vertex, rule, finding in broken:
        rules.setdefault(vertex, []).append(f"{rule}: {finding}")
    lines = [f"{vertex}  {'; '.join(findings)}" for vertex, findings in rules.items()]
    more = [f"and {len(lines) - _LINES} more vertices"] if len(lines) > _LINES else []
    ends = pattern.vertices[pattern.edges]
    with styled():
        figure = Figure(figsize=(6.4, 5.2), layout="constrained")
        axes = figure.subplots()
        for letter in dict.fromkeys(pattern.assignments):
            colour, dash = _CREASES.get(letter, (GREY, "-"))
            some = ends[[assignment == letter for assignment in pattern.assignments]]
            axes.add_collection(
                LineCollection(list(some), colors=colour, linestyles=dash, linewidths=0.8)
            )
        for vertex in rules:
            place = tuple(pattern.vertices[vertex].tolist())
            axes.plot(*place, "o", markersize=8, fillstyle="none", color=INK, markeredgewidth=1.4)
            axes.annotate(str(vertex), place, (5, 5), textcoords="offset points", weight="bold")
        axes.autoscale_view()
        axes.set(aspect="equal", title=title)
        axes.set_xlabel("\n".join([*lines[:_LINES], *more]), loc="left", fontsize=6.5)
    return figure


def _axes(axes: Axes | None, inches: tuple[float, float]) -> Axes:
    """The given axes, or those of a new figure of pyplot, which notebooks show."""
    if axes is not None:
        return axes
    from matplotlib import pyplot as plt

    with styled():
        return plt.figure(figsize=inches, layout="constrained").add_subplot()


def _draw_magnets(design: SkinDesign, axes: Axes, colours: Mapping[str, str]) -> None:
    """Circles round the magnets, in the colour of their mount."""
    for magnet, place in zip(design.magnets, 1e3 * geometry(design).magnets, strict=True):
        colour, radius = colours[magnet.mount], 1e3 * magnet.radius
        axes.add_patch(Circle((place[0], place[1]), radius, fill=False, edgecolor=colour))


def _region(place: tuple[float, float], spread: Floats, colour: str) -> Ellipse:
    """The ellipse that holds 90 % of a normal distribution in the plane, mm."""
    values, axes = np.linalg.eigh(spread)
    half = 1e3 * np.sqrt(_REGION * np.clip(values, 0.0, None))
    angle = np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))
    return Ellipse(
        place, 2 * half[1], 2 * half[0], angle=angle, fill=False, edgecolor=colour, linewidth=0.9
    )
