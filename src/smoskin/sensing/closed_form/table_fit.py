"""A calibration that rests on a press on every cell: the skin's own answers, and no theory of it.

Decides how a bench's touches become a press table: what the untouched skin says of the chips, how
each cell answers a press and a drag, and how much a drag stiffens it (S27). Forces are taken as
the gauge gave them. Nothing here knows how the sheet unfolds, so a skin that the reduced model
does not fit is calibrated all the same.
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.inversion import FieldInverse, rest_cross_talk
from smoskin.magnetics.temperature import temperature_factor
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.stiffness import cell_layers, folding_correction_map, shear_gain
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import (
    Calibration,
    Evidence,
    ResidualSummary,
    Uncertainty,
)
from smoskin.sensing.closed_form.fitting import Fit, check_touches
from smoskin.sensing.closed_form.press_model import triples
from smoskin.sensing.closed_form.press_table import PressTable, uniform_drag

_STRAIGHT: Final = 0.05
"""Drag over press up to which a load counts as straight."""
_SHEARED: Final = 0.3
"""Drag over press from which on a load tells how the skin answers a drag."""
_LEAST_PRESS: Final = 0.05
"""N: a lighter touch tells nothing of a cell."""
_GAUGE: Final = 0.02
"""Relative noise of a gauge, for the uncertainty of v_f. Assumed."""
_LEAST_SPARE: Final = 10
"""Touches beyond those that the answers take up, from which on the rest tells the noise."""
_FULL: Final = 0.999
"""Of a chip's range: a field beyond may have been cut."""
_FACTORS: Final = (0.5, 2.0)
"""k_c that a made skin can have."""
_STIFFEST: Final = 1e3
"""N: v_f of a skin that no drag is seen to stiffen; its uncertainty is infinite."""
_SOFTEST: Final = 0.05
"""N: least v_f looked for."""


def presses_every_cell(design: SkinDesign, touches: TouchTable) -> bool:
    """Whether the touches hold a straight press on each cell, with all chips read."""
    if touches.field.shape[1] != len(design.halls):
        return False
    good = _straight(touches) & np.isfinite(touches.field).all(axis=(1, 2))
    return not _unpressed(design, touches, good).any()


def drags_every_cell(design: SkinDesign, touches: TouchTable) -> bool:
    """Whether the touches also drag each cell in x and in y."""
    for axis in range(2):
        drag = np.abs(touches.force[:, axis])
        chosen = _pressed(touches) & (drag >= _SHEARED * -touches.force[:, 2])
        if _unpressed(design, touches, chosen).any():
            return False
    return True


def learn_press_table(
    design: SkinDesign, calibration: Calibration, touches: TouchTable
) -> PressTable:
    """How each cell of a skin answers, from touches on all of them.

    Parameters
    ----------
    design : SkinDesign
    calibration : Calibration
        Its chips' numbers and v_f are used and, where not every cell was dragged in both
        directions, its K_sf and the sheet's stiffness.
    touches : TouchTable
        At least one straight press on each cell with all chips read. Several on one cell are
        weighed so that each counts for its relative error.

    Raises
    ------
    ModelError
        If a cell was not pressed straight; cells are named.

    Notes
    -----
    Source: SI Text S5 with Eqs. (S26) and (S27): a load is a press, stiffened by its drag, and
    the drag. Valid for answers in proportion to the load: best learned at the forces to be felt.
    """
    loads = _Loads.of(design, calibration, touches)
    gain = shear_gain(loads.drag, _folding(design, calibration)[loads.cell])
    drag = None if drags_every_cell(design, touches) else uniform_drag(
        design, calibration.board_stiffness, calibration.sheet_stiffness
    )  # fmt: skip
    press, drag = _answers(design, loads, gain, drag)
    return PressTable(press=press, drag=drag)


def fit_press_table(design: SkinDesign, touches: TouchTable, *, date: str, data_sha256: str) -> Fit:
    """Calibration of the skin on which these touches were measured, whatever its sheet is like.

    Parameters
    ----------
    design : SkinDesign
    touches : TouchTable
        Readings of all chips: some of the untouched skin, and at least one straight press on
        each cell. Loads that drag, in X and in Y, on each cell as well, tell how drags and
        presses are parted there; loads that drag one cell of a layer both ways tell its v_f.
    date : str
        ISO date of the measurement.
    data_sha256 : str
        Of the measured file.

    Returns
    -------
    Fit
        v_a, v_s and the chips' turns stay nominal, as do v_f, K_sf and the sheet's stiffness
        where nothing dragged; their uncertainty is NaN. So is the noise, unless enough cells
        were touched more often than their answers need: a table passes through its touches.

    Raises
    ------
    ArgumentError
        If a touch names a cell, or the readings a number of chips, that the design has not.
    ModelError
        If a cell or the untouched skin was not measured, or a chip does not see its magnet.

    Notes
    -----
    Source: SI Eqs. (S4), (S6), (S26), (S27). A magnet nearer to its chip and a stronger one are
    the same factor in S4; all else that the untouched skin differs by is taken for c_c.
    """
    check_touches(design, touches)
    calibration, chip_spread = _chips(design, touches)
    loads = _Loads.of(design, calibration, touches)
    calibration, slide_spread = _slides(design, calibration, loads)
    calibration, folding_spread = _stiffening(design, calibration, loads)
    table = learn_press_table(design, calibration, touches)
    calibration = replace(calibration, press_table=table)
    residual, drag = _residual(design, calibration, table, loads, len(touches.cell))
    answers = 3 if drags_every_cell(design, touches) else 1
    spare = len(loads.rows) - answers * design.cells[0] * design.cells[1]
    spare -= int((~np.isnan(folding_spread)).sum())
    nan = float("nan")
    noise = nan, nan, nan
    if spare >= _LEAST_SPARE:
        off, field = residual[loads.rows, 2] / loads.press, residual[loads.rows, 4:]
        relative = float(np.sqrt((off**2).sum() / spare))
        noise = relative, nan, float(np.sqrt((field**2).sum() / field.shape[1] / spare))
    uncertainty = Uncertainty(
        attenuation=(nan, nan),
        stiffness_variation=nan,
        folding_correction_x=tuple(folding_spread[:, 0].tolist()),
        folding_correction_y=tuple(folding_spread[:, 1].tolist()),
        board_stiffness=slide_spread[0],
        sheet_stiffness=slide_spread[1],
        chip_rotation=((nan,) * 3,) * len(design.halls),
        field_factor=tuple(chip_spread[:, 0].tolist()),
        field_offset=triples(chip_spread[:, 1:]),
    )
    evidence = Evidence(
        date=date,
        data_sha256=data_sha256,
        touches=len(touches.cell),
        freedom=max(spare, 1),
        uncertainty=uncertainty,
        residuals=_summaries(design, residual),
    )
    return Fit(
        calibration=replace(calibration, evidence=evidence),
        touches=touches,
        noise=noise,
        depth=np.full(len(touches.cell), np.nan),
        drag=drag,
        residual=residual,
    )


class _Loads(NamedTuple):
    """The touches that tell of a cell; R of them."""

    rows: Ints
    """(R,): in the table of touches."""
    cell: Ints
    """(R,): n M + m."""
    press: Floats
    """(R,), N."""
    drag: Floats
    """(R, 2), N."""
    motion: Floats
    """(R, 3S), m."""

    @classmethod
    def of(cls, design: SkinDesign, calibration: Calibration, touches: TouchTable) -> "_Loads":
        """All pressing touches whose readings can be trusted; each cell must have a straight one.

        Raises
        ------
        ModelError
        """
        motion, found = _motions(design, calibration, touches)
        good = _pressed(touches) & found
        missing = _unpressed(design, touches, good & _straight(touches))
        if missing.any():
            cells = [f"({n + 1}, {m + 1})" for n, m in np.argwhere(missing).tolist()]
            raise ModelError(
                "the touches must press every cell straight at least once, with all chips read "
                "within their range (press less where one stands at its end); "
                f"missing: {', '.join(cells)}"
            )
        rows = np.flatnonzero(good)
        return cls(
            rows=rows,
            cell=touches.cell[rows] @ np.array([design.cells[1], 1]),
            press=-touches.force[rows, 2],
            drag=touches.force[rows, :2],
            motion=motion[rows].reshape(len(rows), -1),
        )


def _pressed(touches: TouchTable) -> Bools:
    return np.asarray(touches.touched & (touches.force[:, 2] <= -_LEAST_PRESS))


def _straight(touches: TouchTable) -> Bools:
    drag = np.abs(touches.force[:, :2]).max(axis=1)
    return np.asarray(_pressed(touches) & (drag <= _STRAIGHT * -touches.force[:, 2]))


def _unpressed(design: SkinDesign, touches: TouchTable, chosen: Bools) -> Bools:
    """(N, M): cells on which none of the chosen touches lies."""
    left = np.ones(design.cells, dtype=bool)
    inside = chosen & (touches.cell < design.cells).all(axis=1)
    left[tuple(touches.cell[inside].T)] = False
    return left


def _folding(design: SkinDesign, calibration: Calibration) -> Floats:
    """v_f of each cell, (C, 2)."""
    return folding_correction_map(design.cells, calibration.coefficients).reshape(-1, 2)


def _fields(design: SkinDesign, touches: TouchTable) -> tuple[Floats, Bools]:
    """Of all magnets in the skin's axes at reference temperature, and rows within the range."""
    limit = _FULL * mlx90393.full_scale(design.hall_setting)
    with np.errstate(invalid="ignore"):
        whole = (np.abs(touches.field) < limit).all(axis=(1, 2))
    mounts = mlx90393.rotations(design.halls)
    seen = np.einsum("sij,tsj->tsi", mounts, touches.field)
    return seen / temperature_factor(touches.temperature)[..., None], np.asarray(whole)


def _motions(
    design: SkinDesign, calibration: Calibration, touches: TouchTable
) -> tuple[Floats, Bools]:
    """Of the chips against their magnets, (T, S, 3), m, and which rows have them."""
    from scipy.spatial.transform import Rotation

    seen, found = _fields(design, touches)
    turns = Rotation.from_rotvec(calibration.chip_rotation).as_matrix()
    turns = np.array(calibration.field_factor)[:, None, None] * turns
    field = np.einsum("sij,tsj->tsi", turns, seen) + np.array(calibration.field_offset)
    moved = np.full(field.shape, np.nan)
    inverse = FieldInverse(design).displacements(field[found] - rest_cross_talk(design))
    moved[found] = inverse.moved
    found[found] = inverse.found
    return moved, found


def _chips(design: SkinDesign, touches: TouchTable) -> tuple[Calibration, Floats]:
    """k_c and c_c by the untouched skin, and their standard uncertainties, (S, 4)."""
    seen, whole = _fields(design, touches)
    idle = seen[~touches.touched & whole]
    if len(idle) < 2:
        raise ModelError(
            "the touches must hold at least two readings of the untouched skin, rows without a "
            f"cell, within the chips' range; got {len(idle)}"
        )
    designed = FieldInverse(design).rest_field + rest_cross_talk(design)
    mean, spread = idle.mean(axis=0), idle.std(axis=0, ddof=1) / np.sqrt(len(idle))
    factor = designed[:, 2] / mean[:, 2]
    for s, site in enumerate(design.halls):
        if not _FACTORS[0] <= factor[s] <= _FACTORS[1]:
            raise ModelError(
                f"chip {site.name} must see its magnet: untouched it reads {mean[s, 2] * 1e3:.1f} "
                f"mT along the magnet's axis where the design has {designed[s, 2] * 1e3:.1f} mT; "
                "check its place, axes and polarity"
            )
    offset = designed - factor[:, None] * mean
    offset[:, 2] = 0.0
    calibration = replace(
        Calibration.nominal(design),
        field_factor=tuple(factor.tolist()),
        field_offset=triples(offset),
    )
    spread = np.abs(factor)[:, None] * spread
    of_factor = spread[:, 2] / np.abs(designed[:, 2])
    spread[:, 2] = 0.0
    return calibration, np.column_stack([of_factor * factor, spread])


def _answers(
    design: SkinDesign, loads: _Loads, gain: Floats, drag: Floats | None
) -> tuple[Floats, Floats]:
    """Answers to a press, (N, M, S, 3), and to drags, (N, M, S, 3, 2), by least squares.

    Drags are fitted too where they are not given. A touch weighs by the inverse of its press: the
    gauge errs in proportion.
    """
    shape = (*design.cells, len(design.halls), 3)
    press = np.zeros((shape[0] * shape[1], loads.motion.shape[1]))
    found = np.zeros((*press.shape, 2))
    given = None if drag is None else drag.reshape(found.shape)
    for cell in range(len(press)):
        mine = loads.cell == cell
        pushed, dragged = (loads.press / gain)[mine], loads.drag[mine]
        weight = 1 / loads.press[mine, None]
        motion = loads.motion[mine]
        if given is None:
            by_load = np.column_stack([pushed, dragged])
            answer = np.linalg.lstsq(weight * by_load, weight * motion, rcond=None)[0]
            press[cell], found[cell] = answer[0], answer[1:].T
        else:
            rest = motion - dragged @ given[cell].T
            press[cell] = (weight * rest).sum(axis=0) / (weight[:, 0] * pushed).sum()
            found[cell] = given[cell]
    return press.reshape(shape), found.reshape(*shape, 2)


def _slides(
    design: SkinDesign, calibration: Calibration, loads: _Loads
) -> tuple[Calibration, tuple[float, float]]:
    """K_sf and the sheet's stiffness, the mean over all drags, with standard uncertainties.

    What a drag adds to a straight press on the same cell is taken for the drag's.
    """
    nan = float("nan")
    dragging = np.abs(loads.drag).max(axis=1) >= _SHEARED * loads.press
    if not dragging.any():
        return calibration, (nan, nan)
    straight = _Loads(*(column[~dragging] for column in loads))
    none = np.zeros((*design.cells, len(design.halls), 3, 2))
    press, _ = _answers(design, straight, np.ones(len(straight.press)), none)
    over = (
        loads.motion - loads.press[:, None] * press.reshape(-1, loads.motion.shape[1])[loads.cell]
    )
    moved = over[dragging].reshape(int(dragging.sum()), -1, 3)[..., :2]
    drag = loads.drag[dragging]
    power = float((drag**2).sum())
    on_base = np.array([design.magnet(s.magnet).mount == "base" for s in design.halls])
    found = []
    for name, chips, sign in (("board_stiffness", on_base, 1), ("sheet_stiffness", ~on_base, -1)):
        ahead = sign * moved[:, chips].mean(axis=1)
        slide = float((ahead * drag).sum()) / power
        if not slide > 0:
            raise ModelError(
                f"the touches fit no {name}: a drag does not move the skin forward; check the "
                "signs of the forces and the chips' axes"
            )
        left = float(((ahead - slide * drag) ** 2).sum()) / max(drag.size - 1, 1)
        found.append((1 / slide, float(np.sqrt(left / power)) / slide**2))
    (board, of_board), (sheet, of_sheet) = found
    measured = replace(calibration, board_stiffness=board, sheet_stiffness=sheet)
    return measured, (of_board, of_sheet)


def _stiffening(
    design: SkinDesign, calibration: Calibration, loads: _Loads
) -> tuple[Calibration, Floats]:
    """v_f by the cells that were dragged both ways, and its standard uncertainties, (L, 2).

    A drag and the opposite one move the chips by opposite amounts; what they share beyond a
    straight press is the skin's stiffening.
    """
    from scipy.optimize import least_squares

    coefficients = calibration.coefficients
    count = len(coefficients.folding_correction_x)
    layer = np.minimum(cell_layers(design.cells), count - 1).ravel()
    nominal = np.stack(
        [coefficients.folding_correction_x, coefficients.folding_correction_y], axis=-1
    )
    cells, known = [], np.zeros((count, 2), dtype=bool)
    for cell in range(len(layer)):
        share = loads.drag[loads.cell == cell] / loads.press[loads.cell == cell, None]
        both = (share.max(axis=0) >= _SHEARED) & (share.min(axis=0) <= -_SHEARED)
        if both.any():
            cells.append(cell)
            known[layer[cell]] |= both
    spread = np.full((count, 2), np.nan)
    if not known.any():
        return calibration, spread

    def stiffening(values: Floats) -> Floats:
        """1 / v_f of each layer, with these for the known ones."""
        all_of_them = 1 / nominal
        all_of_them[known] = values
        return all_of_them

    def left(values: Floats) -> Floats:
        """What the cells' own answers leave over, relative to each touch."""
        per_layer, parts = stiffening(values), []
        for cell in cells:
            mine = loads.cell == cell
            push, drag, motion = loads.press[mine], loads.drag[mine], loads.motion[mine]
            gain = 1 + np.hypot(*(drag * per_layer[layer[cell]]).T)
            weight = 1 / np.linalg.norm(motion, axis=1)[:, None]
            by_load = weight * np.column_stack([push / gain, drag])
            answer = np.linalg.lstsq(by_load, weight * motion, rcond=None)[0]
            parts.append((weight * motion - by_load @ answer).ravel())
        return np.concatenate(parts)

    bounds = 1 / _STIFFEST, 1 / _SOFTEST
    result = least_squares(left, np.clip((1 / nominal)[known], *bounds), bounds=bounds)
    # Few touches decide a v_f, so that what they leave says little of how noisy they are.
    slope = np.asarray(result.jac)
    covariance = _GAUGE**2 * np.linalg.pinv(slope.T @ slope)
    found = 1 / stiffening(result.x)
    free = result.x > 1.01 / _STIFFEST
    spread[known] = np.where(free, np.sqrt(np.diag(covariance)) * found[known] ** 2, np.inf)
    measured = replace(
        coefficients,
        folding_correction_x=tuple(found[:, 0].tolist()),
        folding_correction_y=tuple(found[:, 1].tolist()),
    )
    return replace(calibration, coefficients=measured), spread


def _residual(
    design: SkinDesign, calibration: Calibration, table: PressTable, loads: _Loads, count: int
) -> tuple[Floats, Floats]:
    """What the table leaves of every touch, (T, 4 + 3S), and the drags that it finds, (T, 2).

    Forces are the gauge's less those that the table reads on the touch's own cell; fields are
    those of the motions left over.
    """
    answers = table.answers.reshape(-1, loads.motion.shape[1], 3)[loads.cell]
    found = np.einsum("rlk,rk->rl", np.linalg.pinv(answers), loads.motion)
    gain = shear_gain(found[:, 1:], _folding(design, calibration)[loads.cell])
    given_gain = shear_gain(loads.drag, _folding(design, calibration)[loads.cell])
    given = np.column_stack([loads.press / given_gain, loads.drag])
    left = loads.motion - np.einsum("rkl,rl->rk", answers, given)
    magnets = [design.magnet(site.magnet) for site in design.halls]
    rest = geometry(design).rest
    slope = charge_field_and_gradient(*point_charges(magnets), rest)[1]
    field = np.einsum("sij,rsj->rsi", slope, left.reshape(len(left), -1, 3))
    residual = np.full((count, 4 + loads.motion.shape[1]), np.nan)
    residual[loads.rows, :2] = loads.drag - found[:, 1:]
    residual[loads.rows, 2] = gain * found[:, 0] - loads.press
    residual[loads.rows, 4:] = field.reshape(len(left), -1)
    drag = np.full((count, 2), np.nan)
    drag[loads.rows] = found[:, 1:]
    return residual, drag


def _summaries(design: SkinDesign, residual: Floats) -> tuple[ResidualSummary, ...]:
    """Root mean square of each group of residuals."""
    groups = [("force_x", "N", residual[:, 0]), ("force_y", "N", residual[:, 1]),
              ("force_z", "N", residual[:, 2])]  # fmt: skip
    for s, site in enumerate(design.halls):
        groups.append((f"field of chip {site.name}", "uT", residual[:, 4 + 3 * s : 7 + 3 * s]))
    return tuple(
        ResidualSummary(
            group=name,
            unit=unit,
            values=int(np.isfinite(values).sum()),
            rms=float(np.sqrt(np.nanmean(values**2))),
        )
        for name, unit, values in groups
    )
