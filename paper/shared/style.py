"""How every figure looks, what a figure is, and the pieces that several are drawn of.

One plain style, colours that differ for every kind of colour vision.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import QuadMesh
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike

from paper.shared.rows import Row, table
from smoskin.arrays import Floats
from smoskin.plots import BLUE, GREEN, GREY, INK, ORANGE, RED, lay_out, styled

__all__ = [
    "BLUE",
    "COLOURS",
    "GREEN",
    "GREY",
    "INK",
    "ORANGE",
    "PLAIN",
    "RED",
    "SMALL",
    "Look",
    "Plate",
    "canvas",
    "colour_bar",
    "draw_map",
    "draw_shares",
    "lay_out",
    "logarithmic",
    "note",
    "open_axes",
    "percent",
    "show_rows",
    "styled",
]

Look = dict[str, Any]
"""How something is drawn: arguments for Matplotlib."""
COLOURS: Final = "cividis"
SMALL: Final = 6.5
"""pt: letters of legends and notes."""
PLAIN: Final = FuncFormatter(lambda value, _: f"{value:g}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plate:
    """One figure with what the paper says on it, beside what was computed."""

    name: str
    """Stem of its file, such as `figure_s7`."""
    title: str
    caption: str
    figure: Figure
    rows: tuple[Row, ...] = ()

    def write(self, folder: Path) -> Path:
        """Write it as SVG; the same data give the same bytes."""
        path = folder / f"{self.name}.svg"
        with styled():
            self.figure.savefig(path, metadata={"Date": None, "Title": self.title})
        return path

    def show(self) -> None:
        """Print its rows and caption, assert that every row holds, and open its window."""
        show_rows(self.rows)
        print(self.caption)
        if plt.get_backend().lower() != "agg":
            plt.show()


def show_rows(rows: Sequence[Row]) -> None:
    """Print rows and assert that each is reproduced or corrected."""
    if rows:
        print(table(rows))
    failed = [row.id for row in rows if row.verdict == "unresolved"]
    assert not failed, f"not as printed: {', '.join(failed)}"


def canvas(width: float, height: float) -> Figure:
    """Return an empty figure of so many inches."""
    return plt.figure(figsize=(width, height), layout="constrained")


def open_axes(*axes: Axes) -> None:
    """Leave out the lines at the top and on the right."""
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)


def logarithmic(axis: Axis) -> None:
    """Scale an axis by logarithms, with plain numbers."""
    axis._set_axes_scale("log")  # type: ignore[attr-defined]
    axis.set_major_formatter(PLAIN)
    axis.axes.minorticks_off()


def draw_map(
    axis: Axes,
    values: Floats,
    norm: Normalize,
    *,
    edges: tuple[Floats, Floats] | None = None,
    texts: Sequence[Sequence[str]] | None = None,
    size: float = 6,
    line: float = 0.6,
) -> QuadMesh:
    """Draw values as a map of tiles.

    Parameters
    ----------
    axis : Axes
    values : Floats, shape (X, Y)
        The first index runs along x; NaN leaves a tile empty.
    norm : Normalize
        From values to colours.
    edges : tuple of Floats, shapes (X + 1,) and (Y + 1,), optional
        Ends of the tiles; by default these are cells counted from 1, and the axes say so.
    texts : sequence of sequence of str, optional
        What is written on each tile.
    size : float, optional
        pt, of these letters.
    line : float, optional
        pt, between tiles.
    """
    if edges is None:
        across, along = (np.arange(count + 1) + 0.5 for count in values.shape)
        edges = across, along
        axis.set(xlabel="cell n along x", xticks=range(1, values.shape[0] + 1))
        axis.set(ylabel="cell m along y", yticks=range(1, values.shape[1] + 1))
        axis.set_aspect("equal")
    tiles = axis.pcolormesh(
        *edges,
        np.ma.masked_invalid(values.T),
        cmap=COLOURS,
        norm=norm,
        edgecolor="white" if line else "face",
        linewidth=line or 0.2,
    )
    for place in np.ndindex(values.shape) if texts else ():
        x, y = ((ends[k] + ends[k + 1]) / 2 for ends, k in zip(edges, place, strict=True))
        dark = np.isfinite(values[place]) and float(norm(values[place])) <= 0.5
        style: Look = {"ha": "center", "va": "center", "linespacing": 1.1}
        style |= {"fontsize": size, "color": "white" if dark else "black", "in_layout": False}
        axis.text(x, y, texts[place[0]][place[1]] if texts else "", **style)
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    return tiles


def draw_shares(axis: Axes, values: Floats, label: str, colour: str) -> None:
    """Draw the share of values, in per cent, up to each of them."""
    ordered = np.sort(values.ravel())
    share = 100 * (np.arange(len(ordered)) + 1) / len(ordered)
    axis.plot(ordered, share, color=colour, linewidth=1.2, label=label)


def colour_bar(
    figure: Figure | SubFigure, shown: Any, axes: Any, label: str, **rest: Any
) -> Colorbar:
    """Draw a colour bar without a frame, as vectors."""
    bar = figure.colorbar(shown, ax=axes, label=label, format=PLAIN, **rest)
    bar.outline.set_visible(False)
    if bar.solids is not None:
        bar.solids.set(rasterized=False, edgecolor="face")
    return bar


def note(axis: Axes, text: str, at: ArrayLike, apart: tuple[float, float], **rest: Any) -> None:
    """Write a small text so many points apart from a place."""
    style: Look = {"textcoords": "offset points", "fontsize": SMALL} | rest
    x, y = np.asarray(at, dtype=np.float64).tolist()
    axis.annotate(text, (x, y), apart, **style)


def percent(share: float) -> str:
    """Return a share in whole per cent."""
    return f"{100 * share:.0f} %"
