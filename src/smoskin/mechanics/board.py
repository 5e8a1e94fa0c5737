"""The board on its pillars: a rigid body that slides, sinks and turns under what pushes the skin.

The design does not place the pillars; they are taken as spread evenly under the sensing area, and
as standing along its normals. Under a limb's skin the board is a stiff shell that lies on them.
"""

from dataclasses import dataclass, replace

import numpy as np

from smoskin.arrays import Floats, freeze
from smoskin.design.materials import ELASTOMERS
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.mechanics.beam import beam, sway, unloaded
from smoskin.mechanics.masses import GRAVITY, mass_on_pillars
from smoskin.origami.geometry import geometry

_POINTS = 12
"""Points a side of the rule that adds up the pillars; far past rounding on limbs."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Board:
    """How stiffly the pillars hold the board, in six motions that they hold apart."""

    stiffness: Floats
    """(6,): against motion along x, y, z, N/m, and against turns about them, N m/rad."""
    middle: Floats
    """(3,), m: point of the board, on the pillars' tops, to which its motion refers."""
    modes: Floats
    """(6, 6): motion of the middle and turns, in rows, of each of the six, in columns: three
    motions along the axes, and turns about axes through points that the pillars then do not push
    aside. Each is its own where the pillars stand on a plane."""
    softening: Floats
    """(6, 6, 6): change of the stiffness between two of the six with each of them, as loaded
    pillars give way aside; zero where no load counts."""

    def __post_init__(self) -> None:
        freeze(self, stiffness=(6,), middle=(3,), modes=(6, 6), softening=(6, 6, 6))

    def stiffer(self, factor: float) -> "Board":
        """The board on pillars of stiffer rubber, their softening with it."""
        return replace(self, stiffness=factor * self.stiffness, softening=factor * self.softening)

    def carries(self, places: Floats) -> Floats:
        """Motion of places (..., 3), m, with each of the six motions held apart, (..., 3, 6)."""
        return np.asarray(carried(self, places) @ self.modes)

    def gives(self, loads: Floats) -> Floats:
        """Motion of its middle and turns, (6, K), by forces, N, and moments, N m, (6, K), there."""
        return np.asarray(self.modes @ ((self.modes.T @ loads) / self.stiffness[:, None]))


def board_of(design: SkinDesign) -> Board:
    """The board of a design.

    Notes
    -----
    Source: SI Eq. (S26), of pillars that bend as `smoskin.mechanics.beam.beam` says, the SI's in
    pure shear; their squared distances from the middle for the turns. Their own resistance to
    their tops' turning is left out. Of the load on them, `shear_layer.load_share` counts: the
    weight at rest, alike on all, as `smoskin.mechanics.beam.sway` says; what presses add to it,
    to the first order, with the energy k_a k'(N) d |u|^2 / 2 of a pillar that sways by u and
    sinks by d, k its stiffness against sway and k_a that along its axis.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> stiffness = board_of(read_design("planar")).stiffness
    >>> (stiffness[:3] / 1e3).round(2).tolist(), stiffness[3:].round(2).tolist()
    ([1.61, 1.61, 8.48], [18.1, 10.18, 5.38])
    """
    layer, skin = design.shear_layer, geometry(design)
    pillar = beam(layer.radius, layer.height, ELASTOMERS[layer.material].shear_modulus)
    unit = pillar.lateral / unloaded(pillar.shear_share)
    load = layer.load_share * GRAVITY * mass_on_pillars(design) / layer.pillars
    held = sway(load / (unit * layer.height), pillar.shear_share)
    if not held.value > 0:
        raise DesignError(
            f"shear_layer.height must let the pillars stand under {1e3 * load:.0f} mN each; got "
            f"{1e3 * layer.height:g} mm"
        )
    across, along = layer.pillars * unit * float(held.value), layer.pillars * pillar.axial
    depth = -design.columns.height - design.board.thickness
    middle = skin.roll.places([*skin.extent / 2, depth])
    local, share = _pillars(design, depth, middle)
    whole = np.einsum("pq,pqds,d,pqde->se", share, local, [across, across, along], local)
    modes, stiffness = _apart(whole)
    softening = np.zeros((6, 6, 6))
    if layer.load_share:
        x, y, z = np.moveaxis(local @ modes, 2, 0)
        part = layer.load_share * along * float(held.slope) / layer.height
        once = -part * sum(np.einsum("pq,pqi,pqj,pqk->ijk", share, z, u, u) for u in (x, y))
        softening = once + once.transpose(1, 0, 2) + once.transpose(1, 2, 0)
    return Board(stiffness=stiffness, middle=middle, modes=modes, softening=softening)


def _pillars(design: SkinDesign, depth: float, middle: Floats) -> tuple[Floats, Floats]:
    """Motion of pillars' tops along and across them with the board's six, (P, P, 3, 6).

    The second answer are the shares of all pillars that they stand for, (P, P).
    """
    skin = geometry(design)
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    x, y = (end * (1 + nodes) / 2 for end in skin.extent)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    places = skin.roll.places(np.concatenate([grid, np.full((*grid.shape[:2], 1), depth)], axis=-1))
    axes = skin.roll.axes(grid[..., 1])
    turns = turned(places - middle)
    moved = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=-1)
    local = np.swapaxes(axes, -1, -2) @ moved
    return local, np.outer(weights, weights) / 4


def _apart(whole: Floats) -> tuple[Floats, Floats]:
    """Motions (6, 6), in columns, that a stiffness (6, 6) holds apart, and how stiffly, (6,).

    Notes
    -----
    K = L D L' with ones on the diagonal of L; the motions are the columns of L'^-1.
    """
    modes, stiffness = np.eye(6), np.empty(6)
    for k in range(6):
        for before in range(k):
            share = modes[:, before] @ whole @ modes[:, k] / stiffness[before]
            modes[:, k] -= share * modes[:, before]
        stiffness[k] = modes[:, k] @ whole @ modes[:, k]
    return modes, stiffness


def carried(board: Board, places: Floats) -> Floats:
    """Motion of places (..., 3), m, with its middle's motions and its turns, (..., 3, 6)."""
    turns = turned(np.asarray(places) - board.middle)
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=-1)


def turned(arms: Floats) -> Floats:
    """Motion of the ends of arms (..., 3), m, with small turns about x, y and z, (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(arms), -1, 0)
    still = np.zeros_like(x)
    rows = np.array([[still, z, -y], [-z, still, x], [y, -x, still]])
    return np.moveaxis(rows, (0, 1), (-2, -1))
