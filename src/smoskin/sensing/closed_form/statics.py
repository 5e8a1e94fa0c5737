"""Theory's sheet under a finger that sticks to it or presses through covers, read by statics.

Decides which cell a touch lies on where a drag moves the sheet farther than a press folds it. For
each cell the board's statics say what the lower chip moves by a force, S11 what the magnets of the
sheet move by the press, `smoskin.mechanics.reduced.drag` what they move by the drag alone, without
what the finger holds anyway; all chips together give the force, and the likeliest cell is the one
that leaves least.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.mechanics.board import board_of, carried, turned
from smoskin.mechanics.reduced.attenuation import column_displacements, profiles
from smoskin.mechanics.reduced.drag import drag_motions
from smoskin.mechanics.reduced.stiffness import stiffness_map
from smoskin.mechanics.sheet.lattice import column_beam
from smoskin.mechanics.sheet.touches import Covered, Sticking
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import motion_noise
from smoskin.sensing.closed_form.location import unit_press
from smoskin.sensing.closed_form.sheets import Sheet, Solution, place_scatter

_PRESS_OFF: Final = 0.2
"""Share by which theory misses what a press moves."""
_DRAG_OFF: Final = 0.06
"""Share by which it misses what a drag moves."""
_HOLD_OFF: Final = 0.2
"""Share by which it misses what the finger holds."""
_HOLD_LEAST: Final = 0.01
"""N/N: the same, at least."""
_FORCE_LEAST: Final = 3e-4
"""N: no drag is known better beforehand."""
_CHIP_OFF: Final = 0.03
"""Share of the lower chip's motion that theory misses on made skins, along each axis."""
_DRAGS: Final = 0.3
"""N: deviation of drags, where there is one."""
_PASSES: Final = 2
"""Fits of a touch: deviations are shares of what moves, the first guesses them by the press."""


class StaticSheet(Sheet):
    """Theory's sheet on columns that bend, under a touch of a given grip.

    Notes
    -----
    Source: SI Eqs. (S11), (S25) and (S26) with moments. A touch F, f = -F_z, on the vertex of cell
    c moves the lower chip and the magnets of the sheet by

        u_1 = M_c F,  u = U_c f + D_c (F_xy - R_c f),

    U_c those of S11 by a newton, D_c those by a drag, R_c the columns' pull on a guided vertex. A
    straight press has F_xy = r_c f with the hold that leaves the vertex in place,
    (V_c + B_c) r_c = V_c R_c - t_c: V_c the vertex' motion over the board by a drag, B_c the
    board's there, t_c its by a newton's press. Under covers D_c = R_c = r_c = 0.
    With (F_xy - r_c f, f) unknown, both are linear; their errors are normal, with deviations in
    shares of what moves. Straight presses, whose drag is what the hold misses, and drags are as
    likely beforehand, and a force of any size is as likely as any other.
    Valid for touches on top vertices of a flat skin.
    """

    most_misfit = 0.5
    lower: Floats
    """(N, M, 3, 3), m/N: motions of the lower chip by a newton along each axis on each cell."""
    presses: Floats
    """(N, M, 3S), m/N: motions of the chips by a newton's straight press on each cell."""
    loads: Floats
    """(N, M, 3, 3S), N/m: times motions, the force on the cell that they show, about a newton's."""

    def __init__(
        self, design: SkinDesign, calibration: Calibration, grip: Sticking | Covered
    ) -> None:
        if design.curvature != 0.0:
            raise ArgumentError(f"design must be flat where grip is given; got {design.name!r}")
        coefficients = calibration.coefficients
        mounts = [design.magnet(site.magnet).mount for site in design.halls]
        upper = [s for s, mount in enumerate(mounts) if mount == "sheet"]
        # A touch is read by the lower chip and by x and y of the upper ones.
        lower = 3 * mounts.index("base") + np.arange(3)
        self._channels = np.concatenate([lower, *(3 * s + np.arange(2) for s in upper)])
        cells = design.cells[0] * design.cells[1]
        stiffness = stiffness_map(design, coefficients).reshape(-1, 1)
        folds = unit_press(design, coefficients).reshape(cells, -1) / stiffness
        chip, vertex = _board_motions(design, calibration)
        self.lower = chip.reshape(*design.cells, 3, 3)
        drag = np.zeros((*folds.shape, 2))
        pull, hold = np.zeros((2, cells, 2))
        if isinstance(grip, Sticking):
            moved, given = drag_motions(design), -vertex[:, :2]
            watched = [design.magnet(design.halls[s].magnet).name for s in upper]
            on_sheet = [m.name for m in design.magnets if m.mount == "sheet"]
            order = [on_sheet.index(name) for name in watched]
            drag = moved.magnets[:, :, order].reshape(*drag.shape)
            over = moved.vertex.reshape(cells, 2, 2)
            pull = _column_pull(design, calibration) / stiffness
            held = np.einsum("cab,cb->ca", over, pull) - given[..., 2]
            hold = np.linalg.solve(over - given[..., :2], held[..., None])[..., 0]
        # What the channels see of the unknown touch; magnets move one way, their chips the other.
        self._moves = np.zeros((cells, len(self._channels), 3))
        self._moves[:, :3, :2] = chip[:, :, :2]
        self._moves[:, :3, 2] = np.einsum("cab,cb->ca", chip[..., :2], hold) - chip[..., 2]
        self._moves[:, 3:, :2] = -drag
        self._moves[:, 3:, 2] = -folds - np.einsum("cka,ca->ck", drag, hold - pull)
        self._products = np.einsum("cka,ckb->ckab", self._moves, self._moves)
        self._per_fold = folds / (folds**2).sum(axis=1, keepdims=True)
        # Variances of what a newton folds, and of what the finger holds of it.
        self._folded = _PRESS_OFF**2 * (folds**2).mean(axis=1)
        self._held = _HOLD_OFF**2 * (hold**2).mean(axis=1) + _HOLD_LEAST**2
        noise = motion_noise(design)
        self._noise = noise[self._channels]
        self.presses, self.loads = self._linear(design)
        self.noise = (self.loads * noise) @ np.swapaxes(self.loads, -1, -2)
        self.place = place_scatter(design, self.presses, self.loads)

    def solve(self, motions: Floats) -> Solution | None:
        """Touch by motions (3S,), m, of the chips against their magnets; None where none fits."""
        seen = motions[self._channels]
        touch = np.zeros((2, len(self._moves), 3))  # (F_xy - r f, f) if straight, and if dragged
        touch[..., 2] = -self._per_fold @ seen[3:]
        for _ in range(_PASSES):
            weights, prior = self._certainty(touch, seen)
            normal = self._normal(weights, prior)
            pulled = np.einsum("hck,cka->hca", weights * seen, self._moves)
            touch = np.linalg.solve(normal, pulled[..., None])[..., 0]
        left = seen - np.einsum("cka,hca->hck", self._moves, touch)
        cost = (weights * left**2 - np.log(weights)).sum(axis=2) + np.linalg.slogdet(normal)[1]
        cost += (touch[..., :2] ** 2).sum(axis=2) * prior - 2 * np.log(prior)
        cost = np.where(touch[..., 2] > 0, cost, np.inf)
        dragged, number = divmod(int(cost.argmin()), len(self._moves))
        if cost[dragged, number] == np.inf:
            return None
        chances = np.exp((cost.min() - cost) / 2)
        confidence = float(chances[:, number].sum() / chances.sum())
        by_touch, unlike = seen - left[dragged, number], left[dragged, number]
        misfit = float(unlike @ unlike / (seen @ seen + by_touch @ by_touch))
        *drag, press = touch[dragged, number].tolist()
        force = np.array([*drag, -press]) if dragged else np.array([0.0, 0.0, -press])
        return Solution(divmod(number, self.lower.shape[1]), force, confidence, misfit)

    def _certainty(self, touch: Floats, seen: Floats) -> tuple[Floats, Floats]:
        """Inverse variances of what is seen, (2, C, K), m^-2, and of each axis' drag, (2, C), N^-2.

        For motions (K,) or (C, K) of about a touch (2, C, 3) on each cell, straight and dragged.
        """
        drag, press = touch[..., :2], touch[..., 2]
        variance = np.broadcast_to(self._noise, (2, *self._moves.shape[:2])).copy()
        variance[..., :3] += _CHIP_OFF**2 * (seen[..., :3] ** 2).sum(axis=-1)[..., None]
        swayed = np.einsum("cka,hca->hck", self._moves[:, 3:, :2], drag)
        of_touch = self._folded * press**2 + _DRAG_OFF**2 * (swayed**2).mean(axis=2)
        variance[..., 3:] += of_touch[..., None]
        held = self._held * press[0] ** 2 + _FORCE_LEAST**2
        return 1 / variance, 1 / np.stack([held, np.full_like(held, _DRAGS**2)])

    def _normal(self, weights: Floats, prior: Floats) -> Floats:
        """Normal matrices of the touch on each cell, (..., C, 3, 3)."""
        normal: Floats = np.einsum("...ck,ckab->...cab", weights, self._products)
        normal[..., (0, 1), (0, 1)] += prior[..., None]
        return normal

    def _linear(self, design: SkinDesign) -> tuple[Floats, Floats]:
        """Motions by a newton's straight press on each cell, and the loads that it shows there."""
        pressed, cells = self._moves[..., 2], len(self._moves)
        weights, prior = self._certainty(np.broadcast_to([0.0, 0.0, 1.0], (2, cells, 3)), pressed)
        gains = np.swapaxes(self._moves, 1, 2) * weights[1][:, None]
        gains = np.linalg.solve(self._normal(weights[1], prior[1]), gains)
        gains[:, 2] *= -1.0
        signals = 3 * len(design.halls)
        motions, loads = np.zeros((cells, signals)), np.zeros((cells, 3, signals))
        motions[:, self._channels], loads[..., self._channels] = pressed, gains
        return motions.reshape(*design.cells, -1), loads.reshape(*design.cells, 3, -1)


def _board_motions(design: SkinDesign, calibration: Calibration) -> tuple[Floats, Floats]:
    """Motions by a newton along each axis on each of C top vertices, m/N.

    That which the lower chip shows, (C, 3, 3), and that of the board's point at the vertex.
    """
    skin, board = geometry(design), board_of(design)
    lower = next(s for s, h in enumerate(design.halls) if design.magnet(h.magnet).mount == "base")
    tops = skin.sheet.vertices[skin.sheet.loaded].reshape(-1, 3)
    at_tops = carried(board, tops)
    softer = board.stiffness[0] / calibration.board_stiffness
    moved = softer * np.stack([board.gives(part.T) for part in at_tops])
    # A chip that turns in its magnet's field reads as one that moves.
    magnets = [design.magnet(site.magnet) for site in design.halls]
    field, slope = (
        part[lower] for part in charge_field_and_gradient(*point_charges(magnets), skin.rest)
    )
    chip = carried(board, skin.chips[lower])
    chip[:, 3:] -= np.linalg.solve(slope, turned(field))
    return chip @ moved, at_tops @ moved


def _column_pull(design: SkinDesign, calibration: Calibration) -> Floats:
    """Force of all columns on a guided vertex by each cell's press of a metre, (C, 2), N/m."""
    parts = profiles(design.cell, design.cells, calibration.coefficients.attenuation, -1.0)
    moved = [column_displacements(parts, cell) for cell in np.ndindex(design.cells)]
    return np.asarray(column_beam(design).lateral * np.sum(moved, axis=(1, 2)))
