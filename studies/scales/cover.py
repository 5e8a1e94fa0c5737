"""An elastomer cover cast on rigid facets, under a finger, by linear finite elements.

Decides the body (two by two cells of the folded sheet, filled to a flat top some millimetres over
its ridges, bonded to the facets), the finger (Hertz's pressure on a disc) and what is taken from
it: where the facets feel the press. Hides FElupe, which assembles the stiffness at rest of nearly
incompressible rubber, cells of mean dilatation.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from paper.models.block_mesh import BlockMesh
from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry

_BULK: Final = 200.0
"""Bulk over shear modulus, Poisson's ratio 0.4975: ten times more moves no result here."""
_CELLS: Final = 2
"""Cells of the sheet along each axis."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cover:
    """The cover's mesh and what it stands on."""

    mesh: BlockMesh
    bonded: Ints
    """(Q,): nodes on the facets."""
    upper: Ints
    """(Q,): nodes of the flat top."""
    corners: Floats
    """(Q, W): share of each of the sheet's vertices in a force on each bonded node."""
    vertices: Floats
    """(W, 3), m: the sheet's vertices under it."""

    @property
    def middle(self) -> Floats:
        """Middle of the top, (2,), m."""
        outline = self.vertices[:, :2]
        return np.asarray((outline.min(axis=0) + outline.max(axis=0)) / 2)


def build_cover(design: SkinDesign, thickness: float, fineness: int = 6) -> Cover:
    """A cover so thick over the ridges, m, with so many elements along each facet's edges."""
    columns, rows = (2 * count + 1 for count in design.cells)
    sheet = geometry(design).sheet.vertices.reshape(columns, rows, 3)
    part = sheet[: 2 * _CELLS + 1, : 2 * _CELLS + 1]
    steps = 2 * _CELLS * fineness + 1
    line = np.arange(steps) / fineness
    before = np.minimum(line.astype(int), 2 * _CELLS - 1)
    share = np.zeros((steps, 2 * _CELLS + 1))
    share[np.arange(steps), before] = 1 - (line - before)
    share[np.arange(steps), before + 1] += line - before
    corners = np.einsum("ik,jl->ijkl", share, share).reshape(steps**2, -1)
    lower = corners @ part.reshape(-1, 3)
    top = part[..., 2].max() + thickness
    layers = max(3, round(fineness * 0.75))
    # Thin elements at the top, where the finger presses.
    levels = np.linspace(0, 1, layers + 1) ** 0.8
    nodes = np.concatenate([lower + [0, 0, 1] * (top - lower[:, 2:]) * level for level in levels])
    at = np.arange(steps**2).reshape(steps, steps)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    cells = np.concatenate(
        [np.concatenate([quads, quads + steps**2], axis=1) + steps**2 * k for k in range(layers)]
    )
    return Cover(
        mesh=BlockMesh(nodes=nodes, cells=cells),
        bonded=np.arange(steps**2),
        upper=np.arange(steps**2) + steps**2 * layers,
        corners=corners,
        vertices=part.reshape(-1, 3),
    )


def facet_forces(cover: Cover, places: Floats, patch: float, drag: float = 0.0) -> Floats:
    """What the bonded nodes feel of presses of a newton, (P, Q, 3), N, at places (P, 2), m.

    Hertz's pressure acts on a disc of radius `patch`, m, with a drag along x of so many newtons.
    """
    import felupe
    from scipy.sparse.linalg import splu

    nodes = cover.mesh.nodes
    length = float(np.ptp(nodes[:, 2]))
    grid = felupe.Mesh(nodes / length, cover.mesh.cells, "hexahedron")
    motion: Any = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(grid), dim=3)])
    body: Any = felupe.SolidBodyNearlyIncompressible(felupe.NeoHooke(mu=1.0), motion, bulk=_BULK)
    stiffness = body.assemble.matrix().tocsc()
    free = np.ones(nodes.shape, dtype=bool)
    free[cover.bonded] = False
    inside, held = np.flatnonzero(free), np.flatnonzero(~free)
    loads = np.zeros((len(places), *nodes.shape))
    weights = _pressure(nodes[cover.upper, :2], places, patch)
    loads[:, cover.upper, 2], loads[:, cover.upper, 0] = -weights, drag * weights
    inner = splu(stiffness[inside][:, inside], permc_spec="MMD_AT_PLUS_A",
                 options={"SymmetricMode": True}, diag_pivot_thresh=0.0)  # fmt: skip
    moved = inner.solve(loads.reshape(len(places), -1)[:, inside].T)
    return np.asarray(-(stiffness[held][:, inside] @ moved).T.reshape(len(places), -1, 3))


def _pressure(nodes: Floats, places: Floats, patch: float) -> Floats:
    """Nodal loads of Hertz's pressure, (P, Q), with the sum 1 and their middles at the places."""
    steps = round(len(nodes) ** 0.5)
    plan = nodes.reshape(steps, steps, 2)
    edge = np.stack(np.gradient(plan, axis=(0, 1)))
    area = np.abs(edge[0, ..., 0] * edge[1, ..., 1] - edge[0, ..., 1] * edge[1, ..., 0]).ravel()
    away = np.linalg.norm(nodes - places[:, None], axis=-1)
    weights = area * np.sqrt(np.maximum(1 - (away / patch) ** 2, 0.0))
    weights /= weights.sum(axis=1, keepdims=True)
    # A coarse mesh puts the middle off: tilt the pressure back.
    for _ in range(20):
        arms = nodes - places[:, None]
        middle = np.einsum("pq,pqd->pd", weights, arms)
        spread = np.einsum("pq,pqd,pqe->pde", weights, arms, arms) + 1e-12 * np.eye(2)
        tilt = np.linalg.solve(spread, middle[..., None])[..., 0]
        weights *= np.maximum(1 - np.einsum("pqd,pd->pq", arms, tilt), 0.0)
        weights /= weights.sum(axis=1, keepdims=True)
    return np.asarray(weights)
