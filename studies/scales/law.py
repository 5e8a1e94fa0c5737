"""The contact law that loads a sheet most nearly as an elastomer cover does.

Decides where a cover is pressed and what "alike" means: the motion of the sheet's magnets, small
loads, by touches that stick. Hides the sheet's answer to a force on any of its vertices.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import minimize

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.sheet.contact import ScaleContact
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.lattice import build_lattice
from smoskin.mechanics.sheet.tangent import Tangent
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from studies.scales.cover import build_cover, facet_forces

_ARM: Final = 8e-3
"""m: turns of a magnet count as motions so far from its middle."""
_LINES: Final = 5
"""Places along each axis of a region."""
_HERTZ: Final = 1.25**0.5
"""Radius of Hertz's patch over that of an even one as wide, in standard deviation."""
REGIONS: Final = ("inside", "rim along x", "rim along y")


class LawFit(NamedTuple):
    """The best law for one cover, one patch and one region, and what it misses."""

    region: str
    thickness: float
    """m."""
    patch: float
    """Radius of Hertz's patch, m."""
    spread: float
    """m."""
    rim: float
    missed: float
    """Motion of the magnets that the law misses, as a share."""
    missed_bilinear: float
    """Likewise by bilinear shares of the patch alone."""


class Sheet:
    """Motions of the magnets by forces on any vertex of a design's sheet at rest."""

    def __init__(self, design: SkinDesign) -> None:
        self.design = design
        lattice = build_lattice(design)
        self.loaded, self.count = lattice.loaded, len(lattice.nodes)
        board = board_of(design)
        tangent = Tangent(lattice, board)
        units = np.eye(3 * self.count).reshape(self.count, 3, self.count, 3)
        self._moves = tangent.solve(tangent.at(np.zeros_like(lattice.nodes), np.zeros(6)), units)
        on_sheet = [k for k, magnet in enumerate(design.magnets) if magnet.mount == "sheet"]
        holders = holder_matrix(design)[on_sheet].reshape(6 * len(on_sheet), -1)
        holders *= np.tile(np.repeat([1.0, _ARM], 3), len(on_sheet))[:, None]
        flat = holders @ self._moves.reshape(3 * self.count, -1)
        self._magnets = flat.reshape(-1, self.count, 3)
        self._carried = carried(board, lattice.nodes)
        self._board = board.stiffness

    def magnets(self, forces: Floats, patches: Floats) -> Floats:
        """Motions (P, .) by forces (P, V, 3), N, the patches (P, V) held in the plane."""
        out = []
        for force, patch in zip(forces, patches, strict=True):
            moved = np.einsum("v,vdwe,we->d", patch, self._moves[:, :2], force, optimize=True)
            stiff = np.einsum(
                "v,vdwe,w->de", patch, self._moves[:, :2, :, :2], patch, optimize=True
            )
            arm = np.einsum("v,vdb->db", patch, self._carried[:, :2])
            moved += arm / self._board @ np.einsum("vdb,vd->b", self._carried, force)
            give = arm / self._board @ arm.T
            held = force.copy()
            held[:, :2] -= patch[:, None] * np.linalg.solve(stiff + give, moved)
            out.append(np.einsum("mvd,vd->m", self._magnets, held))
        return np.stack(out)


def fit_law(sheet: Sheet, region: str, thickness: float, patch: float, fineness: int = 6) -> LawFit:
    """The law of a cover so thick, m, pressed in one of `REGIONS` on patches so wide, m."""
    places, corner = _places(sheet.design, region)
    whole = tuple(2 * count + 1 for count in sheet.design.cells)
    index = np.arange(sheet.count).reshape(whole)
    cover = build_cover(sheet.design, thickness, fineness)
    under = _vertices(index, corner)
    start = geometry(sheet.design).sheet.vertices[under[0]] - cover.vertices[0]
    felt = facet_forces(cover, places - start[:2], patch)
    forces, patches = np.zeros((len(places), sheet.count, 3)), np.zeros((len(places), sheet.count))
    forces[:, under] = np.einsum("pqd,qv->pvd", felt, cover.corners)
    patches[:, under] = np.einsum("pq,qv->pv", -felt[..., 2], cover.corners)
    computed = sheet.magnets(forces, patches)

    def missed(numbers: Floats) -> float:
        law = ScaleContact(spread=abs(numbers[0]) * 1e-3, rim=abs(numbers[1]), patch=0.0, tilt=0.0)
        press = np.broadcast_to([0.0, 0.0, -1.0], (len(places), 1, 3))
        touches = Touches(position=places[:, None], force=press, radius=patch / _HERTZ)
        shares = np.zeros_like(patches)
        shares[:, sheet.loaded.ravel()] = law.shares(sheet.design, touches).reshape(len(places), -1)
        down = np.zeros_like(forces)
        down[..., 2] = -shares
        off = sheet.magnets(down, shares) - computed
        return float(np.linalg.norm(off) / np.linalg.norm(computed))

    best = minimize(
        missed, [4.0, 1.0], method="Nelder-Mead", options={"xatol": 0.05, "fatol": 1e-4}
    )
    spread, rim = np.abs(best.x)
    least = missed(np.array([0.0, 1.0]))
    return LawFit(region, thickness, patch, 1e-3 * spread, rim, float(best.fun), least)


def _places(design: SkinDesign, region: str) -> tuple[Floats, tuple[int, int]]:
    """Places of a region, (P, 2), m, and the cell in whose lower corner its cover begins."""
    tops = geometry(design).tops
    first = {"inside": (2, 2), "rim along x": (0, 2), "rim along y": (2, 0)}[region]
    low, high = tops[first].copy(), tops[first[0] + 1, first[1] + 1].copy()
    if region == "rim along x":
        low[0], high[0] = 1e-3, tops[0, 0, 0]
    elif region == "rim along y":
        # The zigzag rim is 10 mm in at its farthest.
        low[1], high[1] = 11e-3, tops[0, 0, 1]
    lines = [np.linspace(start, end, _LINES) for start, end in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2), first


def _vertices(index: Ints, corner: tuple[int, int]) -> Ints:
    """The sheet's vertices under a cover that begins at a cell."""
    i, j = 2 * corner[0], 2 * corner[1]
    return index[i : i + 5, j : j + 5].ravel()
