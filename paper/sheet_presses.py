"""What presses do to the whole sheet, as arrays: its motion under one press, and Figure S16.

Decides where it is pressed and how hard; what the sheet does is the twin's. The cover panels of
Figure S16 are presses whose grip is `smoskin.mechanics.sheet.touches.Covered`.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.attenuation import column_displacements, profiles
from smoskin.mechanics.reduced.stiffness import stiffness_map
from smoskin.mechanics.sheet.holders import magnet_motion
from smoskin.mechanics.sheet.lattice import axial_stiffness
from smoskin.mechanics.sheet.touches import Covered, Sticking, Touches
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.location import unit_press

if TYPE_CHECKING:
    from smoskin.mechanics.sheet.touches import Grip

PRESSED: Final = (2, 2)
"""The cell of the displacement field, from 0: (3,3) of the SI."""
FORCE: Final = 0.5
"""N."""
_PLACES: Final = 5
"""Places along each axis of a cell at which it is pressed, evenly spread."""
_POINT: Final = 1e-6
"""m: radius of a touch on one vertex."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressField:
    """The whole sheet under a press on one vertex, and the reduced one under the same force."""

    vertices: Floats
    """(V, 3), m: at rest."""
    moved: Floats
    """(V, 3), m: displacements over the board."""
    magnets: Floats
    """(G, 6), m and rad: of each magnet; zero on the base."""
    reduced: Floats
    """(2N + 1, M + 1, 2), m: of the columns, by the reduced model; they sink by nothing."""
    press: float
    """m: sink of the loaded vertex."""
    reduced_press: float
    """m: the same by the reduced model."""
    plate: float
    """m: mean sink of a rigid plate on the same columns."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coverage:
    """Presses spread over every cell, by one way to touch; P places a cell."""

    motion: Floats
    """(N, M, P, H, 2), m: in the plane, of the H magnets on the sheet."""
    table: Floats
    """(N, M, H, 2), m: of a press on the cell's own vertex."""
    answered: Floats
    """(N, M, P, 2), m: middle of the cell whose press in the table is most alike."""
    places: Floats
    """(N, M, P, 2), m: where it was pressed."""
    agreeing: int
    """Cells in whose table all signs are those of theory (Table S1)."""

    @property
    def spread(self) -> Floats:
        """(N, M): motion's standard deviation over a cell's places, over its mean."""
        mean = self.motion.mean(axis=2)
        off = self.motion - mean[:, :, None]
        spread = np.sqrt(np.square(off).sum(axis=(-1, -2)).mean(axis=-1))
        return np.asarray(spread / np.linalg.norm(mean, axis=(-1, -2)))

    @property
    def found(self) -> Floats:
        """(N, M): share of a cell's places that are taken for this cell."""
        right = np.isclose(self.answered, self._middles()).all(axis=-1)
        return np.asarray(right.mean(axis=-1))

    @property
    def place_error(self) -> Floats:
        """(N, M, P), m: from where it was pressed to the middle of the cell that is named."""
        return np.asarray(np.linalg.norm(self.answered - self.places, axis=-1))

    def _middles(self) -> Floats:
        """Of each cell, (N, M, 1, 2), m."""
        return np.asarray(self.places.mean(axis=2, keepdims=True))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Covers:
    """The skin touched by bare fingers, and through cover panels (Figure S16)."""

    bare: Coverage
    covered: Coverage


def press_field(design: SkinDesign) -> PressField:
    """Press one cell's vertex with a finger that sticks to it."""
    from smoskin.mechanics.sheet.model import BarHinge

    sheet = geometry(design).sheet
    vertex = sheet.loaded[PRESSED]
    pressed = BarHinge(design, grip=Sticking()).press(
        Touches(
            position=geometry(design).tops.reshape(-1, 1, 2),
            force=np.broadcast_to([0.0, 0.0, -FORCE], (sheet.loaded.size, 1, 3)),
            radius=_POINT,
        )
    )
    moved = pressed.displacements.reshape(*design.cells, -1, 3)[PRESSED]
    coefficients = design.coefficients
    reduced_press = FORCE / float(stiffness_map(design, coefficients)[PRESSED])
    parts = profiles(design.cell, design.cells, coefficients.attenuation, -reduced_press)
    return PressField(
        vertices=sheet.vertices,
        moved=moved,
        magnets=magnet_motion(design, moved),
        reduced=column_displacements(parts, PRESSED),
        press=float(-moved[vertex, 2]),
        reduced_press=reduced_press,
        plate=FORCE / (sheet.columns.size * axial_stiffness(design.columns)),
    )


def covers(design: SkinDesign) -> Covers:
    """Press every cell at places all over it, with and without cover panels."""
    return Covers(bare=_coverage(design, Sticking()), covered=_coverage(design, Covered()))


def _coverage(design: SkinDesign, grip: "Grip") -> Coverage:
    from smoskin.mechanics.sheet.model import BarHinge

    extent = geometry(design).cell
    cell = np.array([float(extent.length), float(extent.width)])
    corners = np.moveaxis(np.indices(design.cells), 0, -1) * cell
    share = (np.arange(_PLACES) + 0.5) / _PLACES
    inside = np.stack(np.meshgrid(share, share, indexing="ij"), axis=-1).reshape(-1, 2)
    places = corners[:, :, None] + inside * cell
    every = np.concatenate([geometry(design).tops[:, :, None], places], axis=2)
    position = every.reshape(-1, 1, 2)
    push = np.broadcast_to([0.0, 0.0, -FORCE], (len(position), 1, 3))
    pressed = BarHinge(design, grip=grip).press(
        Touches(position=position, force=push), tolerance=1e-6
    )
    carried = [magnet.mount == "sheet" for magnet in design.magnets]
    moved = magnet_motion(design, pressed.displacements)[:, carried, :2]
    moved = moved.reshape(*every.shape[:3], -1, 2)
    table, motion = moved[:, :, 0], moved[:, :, 1:]
    flat = table.reshape(-1, table[0, 0].size)
    units = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    named = (motion.reshape(-1, units.shape[1]) @ units.T).argmax(axis=1)
    middles = (corners + cell / 2).reshape(-1, 2)
    agree = np.sign(table) == np.sign(unit_press(design))
    return Coverage(
        motion=motion,
        table=table,
        answered=middles[named].reshape(places.shape),
        places=places,
        agreeing=int(agree.all(axis=(2, 3)).sum()),
    )
