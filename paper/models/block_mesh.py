"""Hexahedra of a block that is pressed in the middle, and the quarter that stands for them.

Decides where the nodes lie: the mesh's lines follow the pressed disc, and cells grow outwards
from it. Hides the seams between disc, rings and rim, and the images of the quarter. The origin is
the middle of the block's lower face, z upwards.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats, Ints, assign, freeze
from smoskin.errors import ArgumentError

_CROWDING: Final = 0.2
"""How much thinner than the mean the uppermost layer of cells is, the lowest thicker."""
_CORE: Final = 0.6
"""Half the side of the square in the middle of the patch's mesh, in patch radii."""
_NEIGHBOURS: Final = np.array(
    [[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]]
)
"""Neighbours of each corner of a cell, right-handed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockMesh:
    """Hexahedra of a block at rest."""

    nodes: Floats
    """(P, 3), m."""
    cells: Ints
    """(C, 8): nodes of each; four counter-clockwise seen from above, then the four over them."""

    def __post_init__(self) -> None:
        freeze(self, nodes=(None, 3))
        cells = np.array(self.cells, dtype=np.int64)
        if cells.ndim != 2 or cells.shape[1] != 8:
            raise ArgumentError(f"cells must have shape (C, 8); got {cells.shape}")
        if not np.all((cells >= 0) & (cells < len(self.nodes))):
            raise ArgumentError(f"cells must name nodes 0..{len(self.nodes) - 1}")
        corners = self.nodes[cells]
        edges = corners[:, _NEIGHBOURS] - corners[:, :, None]
        if not np.all(np.linalg.det(edges) > 0.0):
            raise ArgumentError("cells must be convex and not turned inside out; some are not")
        cells.flags.writeable = False
        assign(self, cells=cells)


class Quarter(NamedTuple):
    """The part of a symmetric mesh where x >= 0 and y >= 0, which stands for the whole."""

    mesh: BlockMesh
    node: Ints
    """(P,): of each node of the whole, its image in the quarter."""
    cell: Ints
    """(C,): likewise of each cell."""
    sign: Floats
    """(P, 3): of each component of a displacement, against its image's."""
    share: Floats
    """(P, 3): of each component of a force, over its image's."""


def mesh_block(size: tuple[float, float, float], *, radius: float, fineness: int = 8) -> BlockMesh:
    """Mesh whose lines follow a disc in the middle of the upper face.

    Parameters
    ----------
    size : tuple of float
        Of the block, m, along x, y and z.
    radius : float
        Of the disc, m.
    fineness : int, optional
        Cells across the square inside the disc, even; the number of nodes grows as its cube.

    Returns
    -------
    BlockMesh
        Symmetric about x = 0 and y = 0, which are mesh planes. Cells are nearly square in plan
        and grow with the distance from the disc; layers are thinner near the upper face.

    Raises
    ------
    ArgumentError
        If the disc does not fit the face or `fineness` is not even and positive.
    """
    length, width, height = size
    if not 0.0 < radius < 0.45 * min(length, width):
        raise ArgumentError(
            f"radius must lie in (0, {0.45 * min(length, width):.4g}) m, on the upper face; "
            f"got {radius}"
        )
    if fineness < 2 or fineness % 2:
        raise ArgumentError(f"fineness must be an even number >= 2; got {fineness}")
    places, quads = _plan(0.5 * length, 0.5 * width, radius, fineness)
    layers = max(2, round(fineness * min(1.5, 0.5 * height / radius)))
    tau = np.linspace(0.0, 1.0, layers + 1)
    heights = height * tau * (1.0 + _CROWDING * (1.0 - tau))
    heights[-1] = height
    nodes = np.concatenate(
        [np.column_stack([places, np.full(len(places), level)]) for level in heights]
    )
    lower = np.concatenate([quads + len(places) * layer for layer in range(layers)])
    return BlockMesh(nodes=nodes, cells=np.concatenate([lower, lower + len(places)], axis=1))


def quarter(mesh: BlockMesh) -> Quarter:
    """The quarter of a mesh of `mesh_block`, whose halves mirror each other to the last bit."""
    nodes, node = np.unique(np.abs(mesh.nodes), axis=0, return_inverse=True)
    node = node.ravel()
    folded = np.sort(node[mesh.cells], axis=1)
    distinct, cell = np.unique(folded, axis=0, return_inverse=True)
    inside = (mesh.nodes[mesh.cells][..., :2] >= 0.0).all(axis=(1, 2))
    cells = np.empty(distinct.shape, dtype=np.int64)
    cells[cell.ravel()[inside]] = node[mesh.cells[inside]]
    sign = np.ones(mesh.nodes.shape)
    sign[:, :2] = np.sign(mesh.nodes[:, :2])
    # What holds a node in a plane of symmetry: as much from either side, and none across it.
    twice = 2.0 ** (sign[:, :2] == 0.0).sum(axis=1)
    return Quarter(
        mesh=BlockMesh(nodes=nodes, cells=cells),
        node=node,
        cell=cell.ravel(),
        sign=sign,
        share=sign * twice[:, None],
    )


def _plan(half_x: float, half_y: float, radius: float, fineness: int) -> tuple[Floats, Ints]:
    """Nodes (P, 2) and counter-clockwise quadrilaterals (C, 4) of the upper face.

    A square inside the disc, rings from it to the circle, rings from there to the rim.
    """
    half = np.tan(0.25 * np.pi * np.arange(1, fineness // 2 + 1) / (fineness // 2))
    half[-1] = 1.0
    t = np.concatenate([-half[::-1], [0.0], half])
    side = np.stack([np.ones(fineness), t[:-1]], axis=-1)
    rotation = np.array([[0.0, 1.0], [-1.0, 0.0]])
    square = np.concatenate([side @ np.linalg.matrix_power(rotation, k) for k in range(4)])
    core = _CORE * radius * square
    circle = radius * square / np.linalg.norm(square, axis=1, keepdims=True)
    rim = square * [half_x, half_y]

    index = np.arange((fineness + 1) ** 2).reshape(fineness + 1, fineness + 1)
    places = [_CORE * radius * np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1).reshape(-1, 2)]
    corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    quads = [np.stack(corners, axis=-1).reshape(-1, 4)]
    inner = np.concatenate([index[-1, :-1], index[:0:-1, -1], index[0, :0:-1], index[:-1, 0]])
    inside = np.arange(1, fineness // 2 + 1) / (fineness // 2)
    growth = max(half_x, half_y) / radius
    rings = max(2, round(math.log(growth) * 2.0 * fineness / math.pi))
    outside = (growth ** (np.arange(1, rings + 1) / rings) - 1.0) / (growth - 1.0)
    blends = [(core, circle, share) for share in inside] + [
        (circle, rim, share) for share in outside
    ]
    start = len(places[0])
    for near, far, share in blends:
        places.append((1.0 - share) * near + share * far)
        outer = start + np.arange(4 * fineness)
        quads.append(np.stack([inner, outer, np.roll(outer, -1), np.roll(inner, -1)], axis=-1))
        inner, start = outer, start + 4 * fineness
    return np.concatenate(places), np.concatenate(quads)
