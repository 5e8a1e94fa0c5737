"""Judgement of a bench's sheet by the paper's model: the mistake that explains one that misfits.

Decides which mistakes are tried and when one is believed: a skin of the design must explain the
mended sheet well, and the sheet as it stands far worse.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, CalibrationError, ModelError
from smoskin.measurement import TouchTable
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.fitting import (
    Attenuation,
    Fit,
    RoughFit,
    fit_calibration,
    rough_fit,
)
from smoskin.sensing.response.judgement import (
    DRAGS,
    FIELDS,
    FORCES,
    chip_axes,
    exchanged,
    turned_places,
)
from smoskin.sensing.signals.signals import chip_noise

_WELL: Final = 12.0
"""Misfit of a touch up to which a rough fit explains it: 1 for each of its values."""
_FAR: Final = 8.0
"""Ratio of misfits from which a mistake is believed."""
_ROWS: Final = 50
"""Touches that a mistake of all is tried with."""
_SUSPECTS: Final = 4
"""Rows that may have exchanged their readings: those that fit worst."""
_ODD: Final = 5.0
"""Deviations of one touch from the others from which people are warned."""
_POOR: Final = (0.1, 30.0)
"""Noise of force, relative, and of fields, over the chips', from which a fit is doubted."""
_STIFF: Final = (1.5, 4.0)
"""Ratio of stiffnesses to the design's, either way, from which people are warned, and refused."""


def judged_fit(
    design: SkinDesign,
    touches: TouchTable,
    *,
    date: str,
    data_sha256: str,
    attenuation: Attenuation = "equal",
) -> tuple[Fit, tuple[str, ...]]:
    """The calibration of a sheet of touches, and what is odd about it without being wrong.

    It raises a `CalibrationError` that names the mistake which explains a sheet that fits badly,
    else as `fit_calibration`. Rows are numbered as in the sheet, from 1, untouched ones counted.
    """
    few = _few(touches)
    if (misfit := _misfit(design, few)) > _WELL:
        _refuse(_exchanged_rows(design, touches) or _mistake(design, few, misfit))
    try:
        fit = fit_calibration(
            design, touches, date=date, data_sha256=data_sha256, attenuation=attenuation
        )
    except ModelError:
        _refuse(_exchanged_rows(design, touches))
        raise
    force, _, field = fit.noise
    worse = 0.0 if np.isnan(field) else field / float(chip_noise(design)[0])
    warnings = []
    if force > _POOR[0] or worse > _POOR[1]:
        warnings.append(
            f"the touches fit the paper's model badly: forces to {100 * force:.0f} %, fields to "
            f"{worse:.0f} times the chips' noise"
        )
    stiffness = _sideways_stiffness(design, fit.calibration)
    ratio = max(stiffness, 1 / stiffness)
    if ratio > _STIFF[0]:
        cause = _force_scale(stiffness)
        if ratio > _STIFF[1]:
            _refuse(cause)
        warnings.append(f"stiffnesses are {stiffness:.2g} times the design's: {cause}")
    odd = np.flatnonzero(fit.oddness > _ODD)
    if len(odd) > 1:
        _refuse(_exchanged_rows(design, touches))
    for row in odd[:_SUSPECTS]:
        off = f"{fit.oddness[row]:.0f} deviations off"
        warnings.append(f"row {row + 1} does not fit the others: {off}")
    return fit, tuple(warnings)


def _refuse(mistake: str | None) -> None:
    """Raise the error of a sheet with this mistake."""
    if mistake is not None:
        raise CalibrationError(f"touches must fit a skin of the design: {mistake}")


def _sideways_stiffness(design: SkinDesign, calibration: Calibration) -> float:
    """Geometric mean of the two stiffnesses of a skin, over that of its design."""
    nominal = Calibration.nominal(design)
    squared = calibration.board_stiffness * calibration.sheet_stiffness
    return float(np.sqrt(squared / (nominal.board_stiffness * nominal.sheet_stiffness)))


def _force_scale(stiffness: float) -> str:
    """The mistake of forces that explains stiffnesses so many times the design's."""
    nearest = min(FORCES, key=lambda factor: abs(np.log(factor * stiffness)))
    if max(nearest * stiffness, 1 / (nearest * stiffness)) < _STIFF[0]:
        return FORCES[nearest]
    much = (
        f"{stiffness:.2g} times too large"
        if stiffness > 1
        else f"{1 / stiffness:.2g} times too small"
    )
    return f"forces seem to be {much}"


def _few(touches: TouchTable) -> TouchTable:
    """Some touches of a table, of all over it."""
    pressed = np.flatnonzero(touches.touched)
    some = pressed[:: -(-len(pressed) // _ROWS) or 1]
    return touches.rows(np.sort(np.append(np.flatnonzero(~touches.touched)[:3], some)))


def _rough(design: SkinDesign, touches: TouchTable) -> RoughFit | None:
    """The rough fit; None where there is none."""
    try:
        return rough_fit(design, touches)
    except (ModelError, ArgumentError, np.linalg.LinAlgError):
        return None


def _misfit(design: SkinDesign, touches: TouchTable) -> float:
    """Mean misfit of the touches; infinite where no skin explains them."""
    fit = _rough(design, touches)
    return np.inf if fit is None else float(fit.misfit.mean())


def _mistake(design: SkinDesign, few: TouchTable, misfit: float) -> str | None:
    """The mistake of all touches, by few that misfit so; None where none that is known does it."""
    limit = min(_WELL, misfit / _FAR)
    for sentence, meant in _mistakes(design, few):
        fit = _rough(design, meant)
        if fit is None or fit.misfit.mean() > limit:
            continue
        if not 0.5 < np.median(fit.calibration.field_factor) < 2.0:
            continue
        pressed, given = (np.abs(table.force).max() for table in (meant, few))
        stiffness = _sideways_stiffness(design, fit.calibration)
        return sentence or _force_scale(stiffness * given / pressed)
    return None


def _exchanged_rows(design: SkinDesign, touches: TouchTable) -> str | None:
    """Two rows far worse than the others that explain each other's readings."""
    fit = _rough(design, touches)
    if fit is None:
        return None
    misfit = fit.misfit
    odd = np.argsort(-misfit)[:_SUSPECTS]
    if misfit[odd[1]] < _FAR * max(float(np.median(misfit)), 1.0):
        return None
    for i, j in itertools.combinations(sorted(odd.tolist()), 2):
        order = np.arange(len(misfit))
        order[[i, j]] = j, i
        mended = _misfit(design, replace(touches, field=touches.field[order]))
        if mended < min(_WELL, misfit.mean() / 2):
            return f"rows {i + 1} and {j + 1} seem to have exchanged their readings"
    return None


def _mistakes(design: SkinDesign, touches: TouchTable) -> Iterator[tuple[str, TouchTable]]:
    """Mistakes and the sheet that was meant; without a sentence it is that of its stiffness."""
    field, force, place = touches.field, touches.force, touches.position
    chips = range(field.shape[1])
    if chips:
        for factor, text in FIELDS.items():
            yield text, replace(touches, field=factor * field)
        for order in itertools.permutations(chips):
            if order != tuple(chips):
                yield exchanged(order), replace(touches, field=field[:, order])
    for factor in (1e-3, 1e3, 0.1, 10.0):
        yield "", replace(touches, force=factor * force)
    for (x, y), text in DRAGS.items():
        yield text, replace(touches, force=force * [x, y, 1])
    yield "forces along x and y seem exchanged", replace(touches, force=force[:, [1, 0, 2]])
    for text, turned in turned_places(place, geometry(design).extent):
        yield text, replace(touches, position=turned)
    for factor, text in ((1e3, "too small"), (1e-3, "too large")):
        yield f"depths seem to be 1000 times {text}", replace(touches, depth=factor * touches.depth)
    for chip in chips:
        blind = np.array(field)
        blind[:, chip] = np.nan
        name = design.halls[chip].name
        text = f"chip {name} does not fit the others: are its axes or signs exchanged?"
        yield text, replace(touches, field=blind)
    for columns, matrix in chip_axes() if chips else ():
        text = f"Bx, By and Bz seem to stand in the columns {columns} of every chip"
        yield text, replace(touches, field=field @ matrix.T)
