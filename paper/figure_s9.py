"""
Figure S9: recovery after a press
=================================

A load held on one cell after the other and taken away at once: how much of the field's change is
left, by the creep of the rubber. The paper prints no number.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    INK,
    ORANGE,
    SMALL,
    Look,
    Plate,
    canvas,
    lay_out,
    logarithmic,
    open_axes,
    styled,
)
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import Touches
from smoskin.mechanics.viscoelasticity import creep, elastomer_prony
from smoskin.origami.geometry import geometry
from smoskin.sensing.characteristics import recovery_time
from smoskin.twin.whole import Twin

FORCE: Final = 1.0
"""N, as printed."""
HELD: Final = 10.0
"""s for which the load rests before it is taken away. Assumed."""
PARTS: Final = (0.1, 0.05, 0.01)
"""Parts of the loaded signal that may be left."""
_POINT: Final = 1e-6
"""m: radius of a touch on one vertex."""
_SHOWN: Final = (-2.0, 12.0)
"""s round the release."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recovery:
    """Readings after a load is taken from one cell after the other (Figure S9); K cells."""

    cells: tuple[tuple[int, int], ...]
    """Pressed cells, from 1, as the SI counts."""
    times: Floats
    """(T,), s from the release."""
    signal: Floats
    """(K, T, S), T: how far each chip's field is from its rest; chips under the sheet's magnets."""
    settled: Floats
    """(K, 3), s until no more than `PARTS` of all chips' signal is left; 0 if at once."""
    noise: float
    """T: standard deviation of one reading, over the three axes."""

    @property
    def left(self) -> Floats:
        """(K, T): all chips' signal over what it was under load."""
        whole = np.linalg.norm(self.signal, axis=-1)
        return np.asarray(whole / whole.max(axis=1, keepdims=True))


def recovery(design: SkinDesign) -> Recovery:
    """Press each cell of the diagonal, hold, let go."""
    count = min(design.cells)
    vertices = geometry(design).tops[np.arange(count), np.arange(count)]
    twin = Twin(design, seed=None)
    settled = twin.motions(
        Touches(
            position=vertices[:, None],
            force=np.broadcast_to([0.0, 0.0, -FORCE], (count, 1, 3)),
            radius=_POINT,
        )
    )
    after = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 181)])
    times = np.concatenate([[-HELD, -HELD], np.linspace(-HELD, 0.0, 101)[1:], after])
    load = (times <= 0.0).astype(np.float64)
    load[0], load[len(times) - len(after)] = 0.0, 0.0
    # Magnets hang on the columns, the board on the shear layer.
    course = [
        creep(elastomer_prony(part.material), times, load)
        for part in (design.columns, design.shear_layer)
    ]
    motion = settled[:, None].scaled(*course)
    watched = [design.magnet(site.magnet).mount == "sheet" for site in design.halls]
    field = twin.field(motion)[:, :, watched]
    signal = np.linalg.norm(field - field[:, :1], axis=-1)
    whole = np.linalg.norm(signal, axis=-1).T
    return Recovery(
        cells=tuple((k + 1, k + 1) for k in range(count)),
        times=times,
        signal=signal,
        settled=np.stack([recovery_time(times, whole, 0.0, within=part) for part in PARTS], axis=1),
        noise=float(np.sqrt(np.square(mlx90393.noise(design.hall_setting)).mean())),
    )


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figures S9a to S9f: how much of the loaded signal is left after the release."""
    return draw(recovery(setting.design))


def draw(result: Recovery) -> Plate:
    """A part of the figure for each cell."""
    with styled():
        figure = canvas(7.2, 4.6)
        axes = figure.subplots(-(-len(result.cells) // 3), 3, sharex=True, sharey=True)
        for k, axis in enumerate(axes.flat):
            _draw_recovery(axis, result, k)
            axis.label_outer()
        axes[-1, 0].legend(loc=(0.3, 0.5), handlelength=1.6)
        lay_out(figure)
    returned = [
        f"to {100 * part:g} % {_after(seconds)}"
        for part, seconds in zip(PARTS, result.settled.max(axis=0), strict=True)
    ]
    return Plate(
        name="figure_s9",
        title="Figures S9a to S9f",
        caption=f"Figures S9a to S9f, by the model: a load of {FORCE:g} N held for {HELD:g} s on "
        "cells (1,1) to (6,6) of the whole sheet and taken away at once; change of the field at "
        f"the two chips under the sheet. The slowest cell is back {', '.join(returned)}. "
        "The values of the paper's figure are "
        "not in its text, and the rubber's series is assumed (design.materials): fit a recorded "
        "recovery (paper.models.recovery.fit_prony) before trusting the tail. The sheet's inertia "
        "is left out.",
        figure=figure,
    )


def _draw_recovery(axis: Axes, result: Recovery, k: int) -> None:
    """One cell."""
    n, m = result.cells[k]
    inside = (result.times >= _SHOWN[0]) & (result.times <= _SHOWN[1])
    for s, (name, colour) in enumerate((("chip 2", BLUE), ("chip 3", ORANGE))):
        signal = result.signal[k, inside, s] * 1e6
        axis.plot(result.times[inside], signal, color=colour, label=name, linewidth=1.1)
    line: Look = {"color": INK, "linewidth": 0.6, "linestyle": ":"}
    axis.axhline(result.noise * 1e6, label="noise of one reading", **line)
    logarithmic(axis.yaxis)
    axis.set(xlim=_SHOWN, ylim=(1, 2e4), title=f"({'abcdefghi'[k]}) cell ({n},{m})")
    axis.set(xlabel="time after the release (s)", ylabel="change of field (µT)")
    times = [
        f"to {100 * part:g} %: {_duration(seconds)}"
        for part, seconds in zip(PARTS, result.settled[k], strict=True)
    ]
    style: Look = {"ha": "right", "va": "top", "fontsize": SMALL, "linespacing": 1.3}
    axis.text(0.97, 0.95, "\n".join(times), transform=axis.transAxes, **style)
    open_axes(axis)


def _duration(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 1e-3:
        return "at once"
    return f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"


def _after(seconds: float) -> str:
    """The same in a sentence."""
    duration = _duration(seconds)
    return duration if duration == "at once" else f"after {duration}"


if __name__ == "__main__":
    plate(Setting()).show()
