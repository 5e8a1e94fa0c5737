"""
How well a touch could be told, and is
======================================

Not in the paper: the Cramer-Rao bound by the chips' noise for a touch anywhere on the skin, and the
errors of the Bayesian estimator on made skins.
"""

from typing import Final

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm

from paper.shared.setting import Setting
from paper.shared.style import (
    COLOURS,
    Look,
    Plate,
    canvas,
    colour_bar,
    draw_map,
    lay_out,
    styled,
)
from paper.shared.touch_errors import DRAG, FORCE, TouchErrors, touch_errors
from smoskin.arrays import Floats
from smoskin.sensing.response.bound import BoundMap, SuperResolution

_TICKS: Final = (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50)
_COLUMNS: Final = ("place (mm)", "normal force (mN)", "drag (mN)")


def plate(setting: Setting) -> Plate:
    """Bounds above, errors below; each column has one scale."""
    return draw(touch_errors(setting.design, setting.skins))


def draw(result: TouchErrors) -> Plate:
    """Three maps of bounds and three of errors."""
    bound = result.bound
    bounds = (bound.location, bound.force, np.hypot(bound.drag[..., 0], bound.drag[..., 1]))
    errors = (result.distance, result.force, result.drag)
    with styled():
        figure = canvas(7.2, 6.4)
        axes = figure.subplots(2, 3, sharex=True, sharey=True)
        for column, (label, *values) in enumerate(zip(_COLUMNS, bounds, errors, strict=True)):
            low, high = _ends(1e3 * np.concatenate([item.ravel() for item in values]))
            norm = LogNorm(low, high)
            for row, (item, kind) in enumerate(zip(values, ("bound", "error"), strict=True)):
                axis = axes[row][column]
                edges = _edges(bound.x) * 1e3, _edges(bound.y) * 1e3
                draw_map(axis, np.maximum(1e3 * item, low), norm, edges=edges, line=0)
                letter, name = "abcdef"[3 * row + column], label.rpartition(" (")[0]
                axis.set(title=f"({letter}) {kind} of {name}", aspect="equal")
            look: Look = {"shrink": 0.6, "location": "bottom"}
            look["ticks"] = [item for item in _TICKS if low <= item <= high]
            bar = colour_bar(
                figure, ScalarMappable(norm, COLOURS), list(axes[:, column]), label, **look
            )
            bar.minorticks_off()
        for axis in axes[:, 0]:
            axis.set_ylabel("y (mm)")
        for axis in axes[1]:
            axis.set_xlabel("x (mm)")
        lay_out(figure)
    blind = blind_regions(bound)
    return Plate(
        name="touch_bound",
        title="How well a touch could be told, and is",
        caption=f"Not in the paper: a touch of {FORCE:g} N anywhere on the skin with a drag of up "
        f"to {DRAG:g} N in any direction. (a-c) Cramer-Rao bound by the chips' noise alone with "
        "place, drag and normal force unknown, standard deviations; blind where the place cannot "
        f"be told to 5 mm: {', '.join(blind) if blind else 'nowhere'}. (d-f) Mean errors of the "
        "Bayesian estimator on two made skins after 60 calibration touches each, at 15 to 35 °C, "
        "on rubber that creeps, under chips that drift: "
        f"{1e3 * result.distance.mean():.2f} mm in the mean, "
        f"{1e3 * np.median(result.distance):.2f} "
        f"in the median, {100 * result.force.mean() / FORCE:.1f} % of the normal force, "
        f"{1e3 * result.drag.mean():.1f} mN of the drag; {100 * result.counted:.0f} % are found as "
        "one touch, the others count as taken to lie in the middle. Root mean square place error "
        f"over bound: {result.over_bound:.1f}. Super-resolution with {bound.chips} chips, area a "
        "chip over mean square error and the root of the area over the mean error: "
        f"{_factors(bound.super_resolution)} by the bound, "
        f"{_factors(result.super_resolution)} reached.",
        figure=figure,
    )


def blind_regions(bound: BoundMap) -> list[str]:
    """Names of the strips along the rim, and of the rest, where the place cannot be told."""
    if bound.blind.all():
        return ["the whole skin"]
    rows, columns = (np.asarray(bound.blind.all(axis=axis)) for axis in (1, 0))
    named = []
    for axis, line, dark in (("x", bound.x, rows), ("y", bound.y, columns)):
        low = int(np.argmin(dark)) if not dark.all() else len(dark)
        high = int(np.argmin(dark[::-1])) if not dark.all() else 0
        if low:
            named.append(f"{axis} <= {line[low - 1] * 1e3:.0f} mm")
        if high:
            named.append(f"{axis} >= {line[-high] * 1e3:.0f} mm")
    inside = bound.blind & ~rows[:, None] & ~columns
    if inside.any():
        named.append(f"{inside.mean():.1%} of the skin elsewhere")
    return named


def _ends(values: Floats) -> tuple[float, float]:
    """The least and the largest of all but the outermost values, of which some may be zero."""
    low, high = np.quantile(values[values > 0], [0.01, 0.99])
    return float(low), float(max(high, 1.01 * low))


def _edges(middles: Floats) -> Floats:
    """Ends of tiles round evenly spread places."""
    half = (middles[1] - middles[0]) / 2
    return np.append(middles - half, middles[-1] + half)


def _factors(item: SuperResolution) -> str:
    return f"{item.area:.0f} and {item.spacing:.0f}"


if __name__ == "__main__":
    plate(Setting()).show()
