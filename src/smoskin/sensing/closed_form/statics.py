"""Theory's sheet under a finger that sticks to it or presses through covers, read by statics.

Decides which cell a touch lies on where a drag moves the sheet farther than a press folds it. For
each cell the board's statics turn the lower chip's motion into the whole force; S11 then says what
the magnets of the sheet move by the press, `smoskin.mechanics.reduced.drag` what they move by the
drag alone, without what the finger holds anyway; the likeliest cell is the one that leaves least.
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
_CHIP_OFF: Final = 0.03
"""Share of the lower chip's motion that reads as one across, on made skins."""
_DRAGS: Final = 0.3
"""N: deviation of drags, where there is one."""


class StaticSheet(Sheet):
    """Theory's sheet on columns that bend, under a touch that grips it as said.

    Notes
    -----
    Source: SI Eqs. (S11), (S25) and (S26) with moments: a touch on the vertex of cell c moves the
    lower chip by M_c F. With f = -F_z of F = M_c^-1 u_1, the magnets move by

        u = U_c f + D_c (F_xy - R_c f),

    U_c those of S11 by a newton, D_c those by a drag, R_c the columns' pull on a guided vertex. A
    straight press has F_xy = r_c f with the hold that leaves the vertex in place,
    (V_c + B_c) r_c = V_c R_c - t_c: V_c the vertex' motion over the board by a drag, B_c the
    board's there, t_c its by a newton's press. Under covers D_c = R_c = r_c = 0.
    What is left is normal with a deviation in shares of what moves; straight presses and drags are
    as likely beforehand.
    Valid for touches on top vertices of a flat skin.
    """

    most_misfit = 0.5
    presses: Floats
    """(N, M, 3S), m/N: motions of the chips by a newton's straight press on each cell."""
    loads: Floats
    """(N, M, 3, 3S), N/m: times motions, the force on the cell that they show."""

    def __init__(
        self, design: SkinDesign, calibration: Calibration, grip: Sticking | Covered
    ) -> None:
        if design.curvature != 0.0:
            raise ArgumentError(f"design must be flat where grip is given; got {design.name!r}")
        coefficients = calibration.coefficients
        mounts = [design.magnet(site.magnet).mount for site in design.halls]
        self._lower = mounts.index("base")
        self._upper = [s for s, mount in enumerate(mounts) if mount == "sheet"]
        self._rows = design.cells[1]
        cells = design.cells[0] * design.cells[1]
        stiffness = stiffness_map(design, coefficients).reshape(-1, 1)
        unit = unit_press(design, coefficients)
        self._press = unit.reshape(cells, -1) / stiffness
        chip, vertex = _board_motions(design, calibration)
        self._force = np.linalg.inv(chip)
        self._drag = np.zeros((*self._press.shape, 2))
        self._pull, self._hold = np.zeros((2, cells, 2))
        if isinstance(grip, Sticking):
            moved, given = drag_motions(design), -vertex[:, :2]
            watched = [design.magnet(design.halls[s].magnet).name for s in self._upper]
            on_sheet = [m.name for m in design.magnets if m.mount == "sheet"]
            order = [on_sheet.index(name) for name in watched]
            self._drag = moved.magnets[:, :, order].reshape(*self._drag.shape)
            over = moved.vertex.reshape(cells, 2, 2)
            self._pull = _column_pull(design, calibration) / stiffness
            held = np.einsum("cab,cb->ca", over, self._pull) - given[..., 2]
            self._hold = np.linalg.solve(over - given[..., :2], held[..., None])[..., 0]
        noise = motion_noise(design).reshape(len(mounts), 3)
        of_force = (self._force * noise[self._lower]) @ np.swapaxes(self._force, 1, 2)
        self.noise = of_force.reshape(*design.cells, 3, 3)
        self._noise = noise[self._upper, :2].mean()
        self._force_noise = np.einsum("caa->c", of_force[:, :2, :2]) / 2
        self._folding_noise = of_force[:, 2, 2]
        self._turned = _CHIP_OFF**2 * (self._force[:, 2] ** 2).mean(axis=1)
        self.presses, self.loads = self._linear(design, chip)
        self.place = place_scatter(design, self.presses, self.loads)

    def solve(self, motions: Floats) -> Solution | None:
        """Touch by motions (3S,), m, of the chips against their magnets; None where none fits."""
        moved = motions.reshape(-1, 3)
        force = self._force @ moved[self._lower]
        press = -force[:, 2:]
        if not (press > 0).any():
            return None
        seen = -moved[self._upper, :2].ravel()
        folded = self._press * press
        off = force[:, :2] - self._hold * press
        swayed = np.einsum("cka,ca->ck", self._drag, off)
        held = np.einsum("cka,ca->ck", self._drag, (self._hold - self._pull) * press)
        straight = seen - folded - held
        left = np.stack([straight, straight - swayed])  # if straight, and if dragged
        of_press = _PRESS_OFF**2 * (folded**2).mean(axis=1) + self._noise
        of_drag = of_press + _DRAG_OFF**2 * (swayed**2).mean(axis=1)
        of_drag += (self._drag**2).mean(axis=(1, 2)) * 2 * self._force_noise
        spread = np.stack([of_press, of_drag])
        of_hold = _HOLD_OFF**2 * (self._hold**2).mean(axis=1) + _HOLD_LEAST**2
        prior = np.stack([of_hold * press[:, 0] ** 2 + self._force_noise, 0 * of_hold + _DRAGS**2])
        # What is wrong of the force along z is wrong of all that the press folds.
        weighed = self._folding_noise + (moved[self._lower] @ moved[self._lower]) * self._turned
        along = np.einsum("hck,ck->hc", left, self._press)
        common = spread / weighed + (self._press**2).sum(axis=1)
        cost = ((left**2).sum(axis=2) - along**2 / common) / spread
        cost += seen.size * np.log(spread) + np.log(common * weighed / spread)
        cost += (off**2).sum(axis=1) / prior + 2 * np.log(prior)
        cost = np.where(press[:, 0] > 0, cost, np.inf)
        dragged, number = divmod(int(cost.argmin()), len(press))
        chances = np.exp((cost.min() - cost) / 2)
        confidence = float(chances[:, number].sum() / chances.sum())
        moving = seen @ seen + folded[number] @ folded[number] + swayed[number] @ swayed[number]
        misfit = float((left[dragged, number] ** 2).sum() / moving)
        answer = np.array([*(off[number] * dragged).tolist(), -press[number, 0]])
        answer[2] -= along[dragged, number] / common[dragged, number]
        return Solution(divmod(number, self._rows), answer, confidence, misfit)

    def _linear(self, design: SkinDesign, chip: Floats) -> tuple[Floats, Floats]:
        """Motions by a newton's straight press on each cell, and the loads that it shows there."""
        chips, cells = len(design.halls), len(chip)
        force = np.column_stack([self._hold, -np.ones(cells)])
        motions = np.zeros((cells, chips, 3))
        motions[:, self._lower] = np.einsum("cab,cb->ca", chip, force)
        held = np.einsum("cka,ca->ck", self._drag, self._hold - self._pull)
        motions[:, self._upper, :2] = -(self._press + held).reshape(cells, -1, 2)
        loads = np.zeros((cells, 3, chips, 3))
        loads[:, :, self._lower] = self._force
        loads[:, :2, self._lower] += self._hold[..., None] * self._force[:, 2:]
        shape = design.cells
        return motions.reshape(*shape, -1), loads.reshape(*shape, 3, -1)


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
