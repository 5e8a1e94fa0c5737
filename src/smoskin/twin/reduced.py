"""The forward chain of one skin: contacts to displacements to fields to readings.

Mechanics are those of the SI's reduced model (attenuated, linear presses on top vertices); the
fields are exact and include every magnet at every chip; the chips add noise, quantisation and
their limits. A touch between top vertices presses the four round it, in shares.
"""

from collections.abc import Sequence

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, check_temperature
from smoskin.mechanics.reduced.attenuation import (
    column_displacements,
    magnet_displacements,
    profiles,
)
from smoskin.mechanics.reduced.stiffness import (
    board_stiffness,
    folding_correction_map,
    press_depth,
    shear_gain,
    sheet_stiffness,
    stiffness_map,
)
from smoskin.mechanics.sheet.touches import Touches, touches_of, vertex_shares
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Motion
from smoskin.twin.manufacture import Deviations, as_designed
from smoskin.twin.readout import MagneticSkin, Readout


class ReducedTwin(MagneticSkin):
    """A virtual skin of the SI's reduced model, which knows no radius of touch.

    Presses add up; warm rubber is stiffer, so that presses and drags move all the less.

    Parameters
    ----------
    design : SkinDesign
        The skin, as designed.
    seed : int or None
        Seed of the chips' noise; the same seed gives the same readings. None gives ideal chips:
        no noise, no quantisation, no limits.
    deviations : Deviations, optional
        How the made skin's magnets and chips differ from the designed ones; by default not at
        all. The mechanics are those of the design.

    Notes
    -----
    Source: SI Eqs. (S7)-(S11), (S26) and (S27) forward; (S3) replaced by the exact field of the
    four-sector magnet.

    Examples
    --------
    >>> from smoskin.feasibility import load_design
    >>> twin = ReducedTwin(load_design("planar"), seed=0)
    >>> reading = twin.read([Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5))])
    >>> reading.field.shape
    (3, 3)
    """

    @typed
    def __init__(
        self, design: SkinDesign, *, seed: Seed | None = 0, deviations: Deviations | None = None
    ) -> None:
        self.design = design
        self.noise = None if seed is None else np.random.default_rng(seed)
        coefficients = design.coefficients
        self._unit_press = profiles(design.cell, design.cells, coefficients.attenuation, -1.0)
        self._stiffness = stiffness_map(design, coefficients)
        self._folding = folding_correction_map(design.cells, coefficients)
        self._per_press = np.stack(
            [
                magnet_displacements(self._unit_press, magnet.corner)
                if magnet.mount == "sheet"
                else np.zeros((*design.cells, 2))
                for magnet in design.magnets
            ]
        )
        self._on_sheet = np.array([magnet.mount == "sheet" for magnet in design.magnets])
        self.deviations = deviations or as_designed(design)
        self.readout = Readout(design, self.deviations)

    def check(self, contacts: Sequence[Contact]) -> None:
        """As `VirtualSkin.check`."""
        self._shares(touches_of([contacts]))

    def press_depths(
        self, touches: Touches, *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Floats:
        """How deep each state of touch presses each cell's top vertex, shape (B, N, M), m.

        U_z = F_z / ((1 + |F_p| / v_f) v_s K_z), the sum over the touches' shares of the vertex.
        """
        gain = shear_gain(touches.force[:, :, None, None, :2], self._folding)
        force = self._shares(touches) * -touches.force[..., 2, None, None]
        depths = press_depth(force, self._stiffness, gain).sum(axis=1)
        return np.asarray(self._softness(temperature) * depths)

    @typed
    def motion(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Motion:
        """As `VirtualSkin.motion`."""
        return self.motions(touches_of([contacts]), temperature=temperature)[0]

    @typed
    def motions(self, touches: Touches, *, temperature: float = REFERENCE_TEMPERATURE) -> Motion:
        """As `VirtualSkin.motions`."""
        depths = self.press_depths(touches, temperature=temperature)
        drag = self._softness(temperature) * touches.force[..., :2].sum(axis=1)
        magnets = np.zeros((len(depths), len(self._on_sheet), 6))
        magnets[..., :2] = np.einsum("gnmd,bnm->bgd", self._per_press, depths)
        magnets[:, self._on_sheet, :2] += (drag / sheet_stiffness(self.design))[:, None]
        board = np.zeros((len(depths), 6))
        board[:, :2] = drag / board_stiffness(self.design)
        return Motion(magnets=magnets, board=board)

    def sheet_vertices(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Floats:
        """As `VirtualSkin.sheet_vertices`.

        Notes
        -----
        For showing. Each cell's top vertex sinks by the press times the attenuation in both
        directions; the SI fixes heights only for the cells in line with the load.
        """
        cells, touches = self.design.cells, touches_of([contacts])
        skin = geometry(self.design)
        vertices = skin.developed.reshape(2 * cells[0] + 1, 2 * cells[1] + 1, 3).copy()
        depths = self.press_depths(touches, temperature=temperature)[0]
        v_x, v_y = self.design.coefficients.attenuation
        rows, lines = np.arange(2 * cells[0] + 1), np.arange(cells[1])
        for n0, m0 in np.argwhere(depths > 0):
            depth = depths[n0, m0]
            moved = depth * column_displacements(self._unit_press, (n0, m0))
            vertices[:, ::2, :2] += moved
            vertices[:, 1::2, :2] += (moved[:, :-1] + moved[:, 1:]) / 2
            sink_x = v_x ** np.abs((rows - 1) / 2 - n0)
            sink_y = v_y ** np.abs(lines - m0)
            vertices[:, 1::2, 2] -= depth * np.outer(sink_x, sink_y)
        drag = self._softness(temperature) * touches.force[0, :, :2].sum(axis=0)
        vertices[..., :2] += drag / sheet_stiffness(self.design)
        return skin.roll.places(vertices.reshape(-1, 3))

    def depths(
        self, contacts: Sequence[Contact], *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Floats:
        """As `VirtualSkin.depths`: the mean over the vertices that share each contact."""
        touches = touches_of([contacts])
        depths = self.press_depths(touches, temperature=temperature)[0]
        return np.asarray(np.einsum("knm,nm->k", self._shares(touches)[0], depths))

    def _shares(self, touches: Touches) -> Floats:
        """Share of each touch that each top vertex takes, (B, K, N, M); zero where none presses."""
        shares = np.zeros((*touches.pressed.shape, *self.design.cells))
        shares[touches.pressed] = vertex_shares(self.design, touches.position[touches.pressed])
        return shares

    def _softness(self, temperature: float) -> float:
        """Motion at this temperature over that at the reference."""
        degrees = float(check_temperature(temperature))
        return 1.0 / float(modulus_factor(self.design.columns.material, degrees))
