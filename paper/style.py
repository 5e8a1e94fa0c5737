"""How every figure of the report looks, and what a figure is.

One quiet style, colours that differ for every kind of colour vision. Loaded on demand alone, as
Matplotlib is an extra.
"""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from matplotlib import rc_context
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, RED, GREY, INK = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#8c8c8c", "#222222",
)  # fmt: skip
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
    "svg.hashsalt": "smoskin",  # the same data give the same bytes
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plate:
    """One figure of the report."""

    name: str
    """Stem of its file, such as `figure_s7`."""
    title: str
    caption: str
    figure: Figure

    def write(self, folder: Path) -> Path:
        """Write it as SVG; the same data give the same bytes."""
        path = folder / f"{self.name}.svg"
        with styled():
            self.figure.savefig(path, metadata={"Date": None, "Title": self.title})
        return path


def styled() -> AbstractContextManager[None]:
    """The report's style, while it lasts."""
    return rc_context(_STYLE)


def lay_out(figure: Figure) -> None:
    """Find the layout once and keep it, instead of finding it again at each drawing."""
    figure.draw_without_rendering()
    # A placeholder engine, "none", would have each file drawn twice.
    figure.set_layout_engine(None)


def quiet(bar: Colorbar) -> None:
    """A colour bar without a frame, as vectors."""
    bar.outline.set_visible(False)
    if bar.solids is not None:
        bar.solids.set(rasterized=False, edgecolor="face")
