"""The forward chain of one skin: contacts to displacements to fields to readings.

Mechanics are those of the SI's reduced model (attenuated, linear presses on top vertices); the
fields are exact and include every magnet at every chip; the chips add noise, quantisation and
their limits. A touch between top vertices presses the four round it, in shares.
"""

from collections.abc import Sequence

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
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
from smoskin.mechanics.sheet.touches import vertex_shares
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.origami.sheet import vertex_positions
from smoskin.records import Contact, Reading
from smoskin.twin.readout import Motion, Readout


class ReducedTwin:
    """A virtual skin that answers touches with readings.

    Parameters
    ----------
    design : SkinDesign
        The skin, as designed.
    seed : int or None
        Of the chips' noise; the same seed gives the same readings. None gives ideal chips:
        no noise, no quantisation, no limits.

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

    def __init__(self, design: SkinDesign, *, seed: int | None = 0) -> None:
        self.design = design
        self._noise = None if seed is None else np.random.default_rng(seed)
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
        self._readout = Readout(design)

    def check(self, contacts: Sequence[Contact]) -> None:
        """Raise unless the skin can be touched so.

        Raises
        ------
        ArgumentError
            If a contact lies off the skin or pulls at it.
        """
        self.press_depths(contacts)

    def press_depths(self, contacts: Sequence[Contact]) -> Floats:
        """How deep the contacts press each cell's top vertex, shape (N, M), m.

        Raises
        ------
        ArgumentError
            If a contact lies off the skin or pulls at it.
        """
        depth = np.zeros(self.design.cells)
        for contact in contacts:
            if not np.isfinite(contact.force).all() or contact.force[2] > 0:
                raise ArgumentError(
                    f"force must be finite and press, with z <= 0 N; got {contact.force} N"
                )
            gain = shear_gain(contact.force[:2], self._folding)
            share = vertex_shares(self.design, contact.position)
            depth += press_depth(share * contact.normal_force, self._stiffness, gain)
        return depth

    def magnet_motion(self, contacts: Sequence[Contact]) -> tuple[Floats, Floats]:
        """Motion of the magnets and of the board over the base.

        Returns
        -------
        magnets : Floats
            Shape (G, 3), m; those on the base stand still.
        board : Floats
            Shape (3,), m; the chips move with it.
        """
        drag = np.sum([contact.force[:2] for contact in contacts], axis=0) if contacts else 0.0
        board = np.zeros(3)
        board[:2] = drag / board_stiffness(self.design)
        magnets = np.zeros((len(self.design.magnets), 3))
        magnets[:, :2] = np.einsum("gnmd,nm->gd", self._per_press, self.press_depths(contacts))
        slide = board.copy()
        slide[:2] += drag / sheet_stiffness(self.design)
        return magnets + self._on_sheet[:, None] * slide, board

    def motion(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Motion:
        """Where these contacts hold magnets and board, as every twin says it.

        Warm rubber is stiffer: presses and drags move all the less.
        """
        moved, board = self.magnet_motion(contacts)
        soft = 1.0 / float(modulus_factor(self.design.columns.material, temperature))
        magnets = np.zeros((len(moved), 6))
        magnets[:, :3] = soft * (moved - self._on_sheet[:, None] * board)
        return Motion(
            magnets=magnets, board=soft * board, valid=np.array(np.isfinite(magnets).all())
        )

    def field(
        self,
        contacts: Sequence[Contact] = (),
        *,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Floats:
        """Exact field of all magnets at all chips, in the skin's frame, shape (S, 3), T."""
        return self._readout.field(self.motion(contacts, temperature=temperature), temperature)

    def sense(
        self,
        motion: Motion,
        *,
        time: float = 0.0,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Reading:
        """What the chips read when magnets and board have moved so."""
        return self._readout.read(motion, self._noise, time=time, temperature=temperature)

    def read(
        self,
        contacts: Sequence[Contact] = (),
        *,
        time: float = 0.0,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Reading:
        """What the chips read under these contacts.

        Parameters
        ----------
        contacts : sequence of Contact
            All that touches the skin now; none by default.
        time : float
            The reading's time, s.
        temperature : float
            Of magnets, rubber and chips, degC.

        Raises
        ------
        ArgumentError
            If a contact lies off the skin or pulls at it.
        """
        held = self.motion(contacts, temperature=temperature)
        return self.sense(held, time=time, temperature=temperature)

    def sheet_vertices(self, contacts: Sequence[Contact] = ()) -> Floats:
        """Vertices of the deformed sheet over the board, shape (V, 3), m.

        Notes
        -----
        For showing. Each cell's top vertex sinks by the press times the attenuation in both
        directions; the SI fixes heights only for the cells in line with the load.
        """
        cells = self.design.cells
        vertices = vertex_positions(self.design.cell, cells)
        depths = self.press_depths(contacts)
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
        drag = np.sum([contact.force[:2] for contact in contacts], axis=0) if contacts else 0.0
        vertices[..., :2] += drag / sheet_stiffness(self.design)
        return vertices.reshape(-1, 3)
