"""The SI's way to use a model that was trained without shear under shear: take the shear out first.

The lower chip tells the drag (S26); the drag slides the sheet over the board by a known share; the
field that this slide makes at the upper chips is deducted from their signals, and the force that
the model finds is multiplied by 1 + |F_p| / v_f. Decides how that is done on signals
(`smoskin.sensing.signals.signals`); what it is worth on a sheet that does not slide as a whole is
another matter, which `python -m paper` shows (Figure S11).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import sector
from smoskin.magnetics.inversion import FieldInverse
from smoskin.mechanics.reduced.stiffness import shear_gain
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration


class Preprocessed(NamedTuple):
    """Signals of T readings without what the drag makes of them."""

    signals: Floats
    """(T, S, 3), T; those of the lower chip as they came."""
    shear: Floats
    """(T, 2), N: the drag F_p that the lower chip tells."""


def shear_force(displacement: ArrayLike, calibration: Calibration) -> Floats:
    """F_p from how far the drag has moved the board over its base, shape (T, 2), N.

    Parameters
    ----------
    displacement : array_like, shape (T, 2)
        U_p, m.
    calibration : Calibration
        Its K_sf is used.

    Notes
    -----
    Source: SI Eq. (S26): F_p = K_sf U_p.
    """
    return np.asarray(calibration.board_stiffness * floats("displacement", displacement, (None, 2)))


def shear_displacement(shear: ArrayLike, calibration: Calibration) -> Floats:
    """How far a drag slides the sheet, and its magnets, over the board, shape (T, 2), m.

    Parameters
    ----------
    shear : array_like, shape (T, 2)
        F_p, N.
    calibration : Calibration
        Its sheet's stiffness is used.

    Notes
    -----
    Source: SI Text S7: the shear force-induced displacement can be calculated from the force.
    Valid for a sheet that slides as a whole, wherever the drag acts.
    """
    return np.asarray(floats("shear", shear, (None, 2)) / calibration.sheet_stiffness)


def shear_signals(displacement: ArrayLike, design: SkinDesign) -> Floats:
    """What the upper chips read when their magnets slide, less what they read at rest.

    Parameters
    ----------
    displacement : array_like, shape (T, 2)
        m, of the sheet's magnets over the board.
    design : SkinDesign
        With S chips.

    Returns
    -------
    Floats, shape (T, S, 3)
        T, in the skin's frame; zero for chips over a magnet of the base.

    Notes
    -----
    Source: SI Text S7: the shear force-induced magnetic flux density variation. Computed with the
    exact field of each chip's own magnet.
    """
    moved = floats("displacement", displacement, (None, 2))
    signals = np.zeros((len(moved), len(design.halls), 3))
    for s, site in enumerate(design.halls):
        magnet = design.magnet(site.magnet)
        if magnet.mount == "sheet":
            # Seen from the magnet the chip moves the other way; the first place is that of rest.
            at = np.zeros((len(moved) + 1, 3))
            at[1:, :2], at[:, 2] = -moved, geometry(design).rest[s, 2]
            field = sector.field(magnet, at)
            signals[:, s] = field[1:] - field[0]
    return signals


def without_shear(
    signals: ArrayLike,
    design: SkinDesign,
    calibration: Calibration,
    *,
    inverse: FieldInverse | None = None,
) -> Preprocessed:
    """Signals as the press alone would make them: the input of a model that knows no shear.

    Parameters
    ----------
    signals : array_like, shape (T, S, 3)
        T, as `smoskin.sensing.signals.signals` gives them.
    design : SkinDesign
        With one magnet on the base, over which the lower chip stands.
    calibration : Calibration
        Of this skin: the stiffness of its shear layer and of its sheet.
    inverse : FieldInverse, optional
        The design's, for whoever calls often: making one takes a tenth of a second.

    Raises
    ------
    ArgumentError
        If signals have another shape, or the design has not one chip over a magnet of the base.

    Notes
    -----
    Source: SI Text S7: shear-induced flux variation, found from the lower chip, is deducted from
    the upper chips' signals.
    Valid where shear and press add up in the field, and the sheet slides as a whole.
    """
    values = floats("signals", signals, (len(design.halls), 3))
    lower = [s for s, site in enumerate(design.halls) if design.magnet(site.magnet).mount == "base"]
    if len(lower) != 1:
        raise ArgumentError(
            f"design must have one chip over a magnet of the base; {design.name!r} has {len(lower)}"
        )
    values = values.reshape(-1, len(design.halls), 3)
    inverse = inverse or FieldInverse(design)
    # The upper chips' part is left at rest: only the lower one is asked for its motion.
    asked = np.tile(inverse.rest_field, (len(values), 1, 1))
    asked[:, lower[0]] += values[:, lower[0]]
    board = inverse.displacements(asked).moved[:, lower[0], :2]
    shear = shear_force(board, calibration)
    slid = shear_signals(shear_displacement(shear, calibration), design)
    return Preprocessed(values - slid, shear)


def folding_corrections(position: ArrayLike, design: SkinDesign, folding: ArrayLike) -> Floats:
    """v_f for shear in X and in Y of the cells under these places, shape (T, 2), N.

    Parameters
    ----------
    position : array_like, shape (T, 2)
        m; a place past the rim counts to the cell beside it.
    design : SkinDesign
        With N x M cells.
    folding : array_like, shape (N, M, 2)
        v_f of each cell, N (`smoskin.mechanics.reduced.stiffness.folding_correction_map`).

    Raises
    ------
    ArgumentError
        If shapes disagree.

    Notes
    -----
    Source: SI Text S5: v_f of the outer, mid and inner layer.
    """
    where, table = floats("position", position, (None, 2)), floats("folding", folding, (None, 2))
    if table.shape[:-1] != design.cells:
        raise ArgumentError(
            f"folding must have shape ({design.cells[0]}, {design.cells[1]}, 2); got {table.shape}"
        )
    extent = geometry(design).cell
    cell = np.floor(where / [extent.length, extent.width]).astype(np.int64)
    n, m = np.clip(cell, 0, np.array(design.cells) - 1).T
    return np.asarray(table[n, m])


def corrected_force(force: ArrayLike, shear: ArrayLike, folding_correction: ArrayLike) -> Floats:
    """The normal force that a model without shear finds, corrected for the drag, shape (T,), N.

    Parameters
    ----------
    force : array_like, shape (T,)
        As the model finds it, N.
    shear : array_like, shape (T, 2)
        F_p, N.
    folding_correction : array_like, shape (T, 2)
        v_f for shear in X and in Y, N.

    Notes
    -----
    Source: SI Text S7, erratum E19: the correction term 1 + |F_p| / v_f of S27 is multiplied with
    the estimated normal force.

    Examples
    --------
    >>> corrected_force([0.5], [[0.3, 0.0]], [[0.6, 0.9]]).tolist()
    [0.75]
    """
    return np.asarray(floats("force", force, (None,)) * shear_gain(shear, folding_correction))
