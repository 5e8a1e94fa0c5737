"""Draws what a score has found: maps of the error, histograms as Figure S12, stated confidence.

Loaded on demand alone, as Matplotlib is an extra.
"""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from smoskin.arrays import Bools, Floats
from smoskin.commands.score.evaluate import HEADLINE
from smoskin.commands.score.report import FORCE, LEVELS, LOCATION, Case, ScoreSheet, regions
from smoskin.plots import BLUE, GREEN, GREY, ORANGE, PINK, RED, Plate, draw_map, lay_out, styled

_COLOURS: Final = (BLUE, ORANGE, GREEN, RED, PINK)
_BANDS: Final = ((0.1, 0.2), (0.3, 0.5), (0.6, 0.8), (0.9, 1.0))
"""Ranges of forces whose errors share a histogram, N."""
_BINS: Final = 41
_BRIGHT: Final = 95.0
"""Per cent of a map's values that its colours span."""
_SHOWN: Final = 98.0
"""Per cent of the errors that a histogram's axis spans; the others stand in its end bins."""


def score_plates(sheet: ScoreSheet) -> list[Plate]:
    """Maps, histograms of each case on the grid, and the confidence of all cases."""
    pressed = [case for case in sheet.cases if case.map is not None]
    with styled():
        return [
            _map_plate(sheet, pressed),
            *(_histogram_plate(sheet, case) for case in pressed),
            _confidence_plate(sheet),
        ]


def _map_plate(sheet: ScoreSheet, cases: list[Case]) -> Plate:
    """Mean errors of place and force over the skin."""
    figure = Figure(figsize=(6.2, 3.9 * len(cases)), layout="constrained")
    for row, case in zip(figure.subplots(len(cases), 2, squeeze=False), cases, strict=True):
        if case.map is None:
            continue
        quantities = (
            ("place (mm)", 1e3 * case.map.location, 1e3 * LOCATION),
            ("force (%)", 100 * case.map.force, 100 * FORCE),
        )
        for axis, (label, values, target) in zip(row, quantities, strict=True):
            seen = values[np.isfinite(values)]
            limits = (0.0, max(float(np.percentile(seen, _BRIGHT)), 1e-9))
            draw_map(sheet.design, values, axis, label=f"error of the {label}", limits=limits)
            share = (seen <= target).mean()
            axis.set_title(f"{case.name}: target {target:g} met at {share:.0%}")
    lay_out(figure)
    return Plate(
        name="score_maps",
        title="Errors over the skin",
        caption=f"Mean errors over {len(sheet.exam.skins)} made skins and forces from "
        f"{HEADLINE:g} N; a missed touch counts as one in the middle of the skin without force. "
        "Circles are magnets; blank places were not pressed.",
        figure=figure,
    )


def _histogram_plate(sheet: ScoreSheet, case: Case) -> Plate:
    """Figures S12a to S12c for a planar skin, by force and by region."""
    truth, error = case.answers.truth, case.answers.error
    force = -truth[:, 4]
    bands = {
        f"{low:g} to {high:g} N": (force > low - 0.05) & (force < high + 0.05)
        for low, high in _BANDS
    }
    chief = force > HEADLINE - 0.05
    places = {name: rows & chief for name, rows in regions(sheet.design, truth[:, :2]).items()}
    errors = (
        ("error of x (mm)", 1e3 * error[:, 0]),
        ("error of y (mm)", 1e3 * error[:, 1]),
        ("error of the normal force (%)", -100 * error[:, 4] / force),
    )
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    axes = figure.subplots(2, 3)
    for row, groups in zip(axes, (bands, places), strict=True):
        for axis, (label, values) in zip(row, errors, strict=True):
            _draw_histogram(axis, values, groups, chief)
            axis.set_xlabel(label)
        row[0].set_ylabel("share of the touches (%)")
        row[0].legend(fontsize=6.5, handlelength=1.2)
    for letter, axis in zip("abcdef", axes.flat, strict=True):
        axis.set_title(f"({letter})")
    lay_out(figure)
    headline = case.headline
    return Plate(
        name=f"score_histograms_{case.name}",
        title=f"Distribution of the errors, {case.name} touches",
        caption=f"As Figure S12: signed errors of {len(truth)} touches, by force (a to c) "
        f"and, from {HEADLINE:g} N, by region of the skin (d to f). Mean error of the place "
        f"{1e3 * headline.location.mean:.2f} mm, of the force {headline.force:.1%}; "
        f"{1 - headline.detected:.1%} of the touches were missed and stand in no bin. End bins "
        "hold what lies beyond.",
        figure=figure,
    )


def _draw_histogram(axis: Axes, values: Floats, groups: dict[str, Bools], chief: Bools) -> None:
    """Signed errors of each group; a missed touch has none."""
    answers = values[chief & np.isfinite(values)]
    reach = max(float(np.percentile(np.abs(answers), _SHOWN)), 1e-9) if len(answers) else 1.0
    edges = np.linspace(-reach, reach, _BINS + 1)
    for (name, rows), colour in zip(groups.items(), _COLOURS[: len(groups)], strict=True):
        part = values[rows]
        if len(part):
            inside = np.clip(part[np.isfinite(part)], -reach, reach)
            shares = 100 * np.histogram(inside, edges)[0] / len(part)
            axis.stairs(shares, edges, color=colour, label=name, linewidth=1.0)
    axis.axvline(0.0, color=GREY, linewidth=0.5)
    axis.spines[["top", "right"]].set_visible(False)


def _confidence_plate(sheet: ScoreSheet) -> Plate:
    """Share of truths in regions of each stated confidence."""
    figure = Figure(figsize=(6.2, 3.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for k, (axis, name) in enumerate(zip(axes, ("place", "normal force"), strict=True)):
        axis.plot([0, 100], [0, 100], color=GREY, linewidth=0.6, linestyle="--")
        for case, colour in zip(sheet.cases, _COLOURS[: len(sheet.cases)], strict=True):
            stated, inside = 100 * np.array(LEVELS), 100 * case.confidence[:, k]
            style = {"color": colour, "markersize": 2.5, "linewidth": 1.0}
            axis.plot(stated, inside, "o-", label=case.name, **style)
        axis.set(title=f"({'ab'[k]}) regions of the {name}", xlabel="stated confidence (%)")
        axis.set(xlim=(0, 100), ylim=(0, 100), aspect="equal")
    axes[0].set_ylabel("truths inside (%)")
    axes[0].legend(fontsize=7)
    lay_out(figure)
    return Plate(
        name="score_confidence",
        title="Stated and observed confidence",
        caption=f"Share of the touches from {HEADLINE:g} N whose truth lies in the region that "
        "the estimator states for each confidence; a missed touch lies outside all of them. Above "
        "the dashed line regions are too wide, below it too narrow.",
        figure=figure,
    )
