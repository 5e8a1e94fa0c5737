"""The sheet of one skin, read cell by cell from its response table.

Decides which touch explains motions of the chips best where no rule of signs and ratios holds. A
press and a drag on a cell move the chips in proportion, within the cell's own three-dimensional
subspace of all motions; the likeliest cell is the one whose subspace, measured in the chips'
noise, comes nearest. Hides how a table becomes answers of cells.
"""

from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError
from smoskin.magnetics.inversion import FieldInverse
from smoskin.mechanics.reduced.stiffness import shear_gain
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.confidence import motion_noise, total_tail
from smoskin.sensing.closed_form.sheets import Sheet, Solution, place_scatter, presses_anywhere
from smoskin.sensing.response.table import ResponseTable

_PRESS: Final = 0.3
"""N: press at which the answers of cells are taken; so light that no chip ends its range."""
_DRAG: Final = 0.2
"""N: drag that is added to it, each way."""
_ALIKE: Final = 1e-6
"""Squared standard deviations: two cells' explanations closer than this are one."""
_SCATTER: Final = 40.0
"""Squared standard deviations that noise alone leaves unexplained at most."""


class CellAnswers(NamedTuple):
    """What every cell of a skin answers; N x M cells, S chips."""

    motions: Floats
    """(N, M, 3S, 3), m/N: motions of the chips against their magnets for a press, a drag in x and a
    drag in y of a newton each."""
    folding: Floats
    """(N, M, 2), N: v_f of S27, by which a drag in x and one in y stiffen the cell; infinite where
    a drag does not."""


def cell_answers(design: SkinDesign, table: ResponseTable) -> CellAnswers:
    """The answers of the cells' top vertices by a skin's response table of all its chips.

    It raises a `ModelError` if the table belongs to another design or lacks chips, or a cell does
    not answer a press and both drags each in its own way.

    Notes
    -----
    With u(F) the motions under a force F = P + D of press and drag, the answer to a press is
    u(P) / |P| and that to a drag (u(P + D) - u(P - D)) / 2 |D|. A stiffer cell moves less by the
    same press: S27's gain is g = |u(P)|^2 / (u(P) . m), with m the mean of u(P + D) and u(P - D),
    and v_f = |D| / (g - 1).
    """
    design.check_own("table", table.design_hash)
    if table.chips != tuple(range(len(design.halls))):
        raise ModelError(
            f"table must be of all {len(design.halls)} chips of the skin; got those at "
            f"{table.chips}"
        )
    places = geometry(design).tops.reshape(-1, 2)
    press = np.array([0.0, 0.0, -_PRESS])
    drags = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]) * _DRAG
    forces = np.repeat(press + drags, len(places), axis=0)
    signals = table.signals(np.tile(places, (len(drags), 1)), forces)
    inverse = FieldInverse(design)
    moved, within = inverse.displacements(inverse.rest_field + signals.reshape(len(forces), -1, 3))
    straight, *dragged = moved.reshape(len(drags), len(places), -1)
    ahead, back = np.stack(dragged[::2], axis=-1), np.stack(dragged[1::2], axis=-1)
    motions = np.concatenate([straight[..., None] / _PRESS, (ahead - back) / (2 * _DRAG)], axis=-1)
    if not within.all() or (np.linalg.matrix_rank(motions) < 3).any():
        raise ModelError(
            "table must answer a press, a drag in x and a drag in y on every cell, each in its own "
            "way and within the stroke"
        )
    shared = np.einsum("ck,ckd->cd", straight, (ahead + back) / 2)
    stiffened = (straight**2).sum(axis=1)[:, None] / shared - 1
    with np.errstate(divide="ignore"):
        folding = _DRAG / np.maximum(stiffened, 0.0)
    return CellAnswers(motions.reshape(*design.cells, -1, 3), folding.reshape(*design.cells, 2))


class MeasuredSheet(Sheet):
    """A sheet whose cells answer loads each in its own way.

    Notes
    -----
    Source: SI Eq. (S27); its v_s K_z U_z is the press that the answers find.
    """

    def __init__(self, design: SkinDesign, answers: CellAnswers) -> None:
        self._rows = design.cells[1]
        self._folding = answers.folding
        motions = answers.motions.reshape(-1, *answers.motions.shape[2:])
        self._subspaces = Subspaces(motions, np.diag(motion_noise(design)))
        # Loads come as press, drag in x, drag in y; forces as x, y, z with a press below zero.
        to_force = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
        noise = to_force @ self._subspaces.spread @ to_force.T
        self.noise = noise.reshape(*design.cells, 3, 3)
        loads = (to_force @ self._subspaces.loads).reshape(*design.cells, 3, -1)
        press = answers.motions[..., 0]
        self.place = place_scatter(design, press, loads)
        presses = presses_anywhere(design, press).reshape(-1, press.shape[-1])
        matches = [self._subspaces.match(motion) for motion in presses]
        # Twice that of a press between vertices: touches drag, and skins differ from their tables.
        self.most_misfit = 2 * max((match[3] for match in matches if match), default=0.5)

    def solve(self, motions: Floats) -> Solution | None:
        """Touch by motions (3S,), m, of the chips against their magnets; None where none fits."""
        match = self._subspaces.match(motions)
        if match is None:
            return None
        number, load, confidence, misfit = match
        cell = divmod(number, self._rows)
        press, *shear = load.tolist()
        gain = shear_gain(shear, self._folding[cell])
        return Solution(cell, np.array([*shear, -gain * press]), confidence, misfit)


class Subspaces:
    """The subspaces of C cells among K motions, whose noise has a covariance (K, K), m^2.

    Answers, (C, K, 3), m/N, are the motions for a press, a drag in x and a drag in y.

    Notes
    -----
    With A_c the answers of a cell and W W^T = N^-1 of the noise, W^T A_c = Q_c R_c; motions u have
    the coordinates Q_c^T W^T u, of which the squared length is what the cell explains, and the
    load R_c^-1 Q_c^T W^T u.
    """

    spread: Floats
    """(C, 3, 3), N^2: covariance that the noise makes in the loads."""
    loads: Floats
    """(C, 3, K), N/m: times a motion, the load on the cell that explains it best."""

    def __init__(self, answers: Floats, noise: Floats) -> None:
        whiten = np.linalg.inv(np.linalg.cholesky(noise))
        self._bases, coordinates = np.linalg.qr(whiten @ answers)
        inverse = np.linalg.inv(coordinates)
        self.spread = inverse @ np.swapaxes(inverse, 1, 2)
        self.loads = inverse @ np.swapaxes(self._bases, 1, 2) @ whiten
        # One product of a motion gives the first, second and third coordinate in every cell's
        # subspace, and every cell's press; one of a motion in the noise the coordinates alone.
        self._across = np.moveaxis(self._bases, 1, 0).transpose(0, 2, 1).reshape(len(noise), -1)
        self._product = np.concatenate([whiten.T @ self._across, self.loads[:, 0].T], axis=1)
        self._precision = whiten.T @ whiten

    def match(self, motion: Floats) -> tuple[int, Floats, float, float] | None:
        """The likeliest cell of a motion (K,), m, its load, how sure it is, and its misfit.

        The load (3,), N, is the press and the drags in x and y, the last a share of the squared
        motion. None without press.

        Notes
        -----
        The chance that noise carried a motion over the boundary to another cell is that of its
        distance from the boundary, along the normal there, in standard deviations. The doubts of
        all cells add up to at least the doubt.
        """
        products = (motion @ self._product).reshape(4, -1)
        inside = products[:3]
        explained = (inside * inside).sum(axis=0) * (products[3] > 0)
        cell = int(explained.argmax())
        most = explained[cell]
        if not most > 0:
            return None
        fitted = self._bases[cell] @ inside[:, cell]
        shared = ((fitted @ self._across).reshape(inside.shape) * inside).sum(axis=0)
        apart = np.maximum(explained - 2 * shared + most, _ALIKE)
        trail = (explained - most) / (2 * np.sqrt(apart))
        # The cell's own distance is zero and counts one half.
        confidence = max(1.5 - total_tail(-trail), 0.0)
        whole = float(motion @ self._precision @ motion)
        misfit = max(whole - float(most) - _SCATTER, 0.0) / whole
        return cell, self.loads[cell] @ motion, confidence, misfit
