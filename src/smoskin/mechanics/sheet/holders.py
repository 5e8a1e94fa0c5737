"""Magnets as rigid bodies on their holders, hung between the tops of the columns round them.

Decides which columns hold a magnet and how much of its six motions each decides. A holder is
notched to the two columns of the cells' middle lines on either side of it, which have no zigzag:
they carry it in the plane, and turn it about z and about the line across. About the line through
both it would be free; there the nearer of the two columns on its own line, ahead of it and behind
it, supports it in z alone. At the rim, where a side is missing, the three nearest columns hold it.
Where a column on the holder or the vertex above drives the magnet, notches have play: they bear it
and turn it, and the driver moves it in the plane.
"""

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import Magnet, SkinDesign
from smoskin.mechanics.sheet.lattice import nearest_foot
from smoskin.origami.geometry import geometry


def holder_columns(design: SkinDesign, magnet: Magnet) -> tuple[Ints, Ints]:
    """Vertices whose columns carry a sheet magnet in the plane, (2,) or (3,), and in z, (3,).

    Of those that carry it in z, the ones beside the magnet also carry it in the plane.
    """
    skin = geometry(design)
    sheet, extent = skin.sheet, skin.cell
    (columns, rows), (p, q) = design.cells, magnet.corner
    place = np.array([p * extent.length, q * extent.width])
    beside = [(i, q) for i in (2 * p - 1, 2 * p + 1) if 0 <= i <= 2 * columns]
    near = sorted(
        ((2 * p, k) for k in range(rows + 1)),
        key=lambda column: float(np.hypot(*(skin.developed[sheet.columns[column], :2] - place))),
    )
    # On the rim in x there is one column beside the magnet only.
    gripping = beside if len(beside) == 2 else [*beside, *near[:2]]
    bearing = [*beside, *near[: 3 - len(beside)]]
    return (
        np.array([sheet.columns[column] for column in gripping]),
        np.array([sheet.columns[column] for column in bearing]),
    )


def holder_matrix(design: SkinDesign) -> Floats:
    """Linear map from the vertices' displacements to the magnets' motion, shape (G, 6, V, 3).

    Over the board, each magnet's middle along its local x, y, z, m, then its rotation vector
    about them, rad; zero for a magnet on the base.

    Notes
    -----
    Source: SI Text S3, "Structure Connections": the holder is notched to the bottom support
    columns. Which columns, and that they hold it as rigidly as least squares says, is this
    project's reading: (t, r) of least squares of u - t - r x d over the tops that hold the magnet,
    d from its middle; t_z, r_x, r_y from u_z of the bearing ones, t_x, t_y, r_z from u_x, u_y of
    the gripping. Valid for small rotations. Where the sheet moves as a rigid plate, and where
    neighbouring cells grow alike (v_a = 1), the plane motion is that of
    `smoskin.mechanics.reduced.attenuation.magnet_displacements`; elsewhere x differs by a quarter
    of the difference of their growths, y not at all.
    """
    skin = geometry(design)
    matrix = np.zeros((len(design.magnets), 6, len(skin.sheet.vertices), 3))
    for g, magnet in enumerate(design.magnets):
        if magnet.mount != "sheet":
            continue
        vertices = (skin.sheet.vertices - skin.magnets[g]) @ skin.magnet_axes[g]
        gripping, bearing = holder_columns(design, magnet)
        # The rotations about x and y come from z alone; in the plane they shift by the lever d_z.
        dx, dy, _ = vertices[bearing].T
        tilt = np.linalg.pinv(np.stack([np.ones_like(dx), dy, -dx], axis=1))
        matrix[g, [[2], [3], [4]], bearing, 2] = tilt
        dx, dy, dz = vertices[gripping].T
        still = np.zeros_like(dx)
        of_x = np.stack([still + 1, still, -dy], axis=1)
        of_y = np.stack([still, still + 1, dx], axis=1)
        plane = np.linalg.pinv(np.concatenate([of_x, of_y]))
        half = len(gripping)
        rows = [[0], [1], [5]]
        matrix[g, rows, gripping, 0] = plane[:, :half]
        matrix[g, rows, gripping, 1] = plane[:, half:]
        # What the tilt moves at the columns' tops, the middle of the magnet lags behind.
        lever = float(dz.mean())
        if magnet.driver != "notches":
            lever = _drive(design, g, vertices, matrix[g])
        matrix[g, 0] -= lever * matrix[g, 4]
        matrix[g, 1] += lever * matrix[g, 3]
        matrix[g] = matrix[g] @ skin.magnet_axes[g].T
    return matrix


def _drive(design: SkinDesign, which: int, vertices: Floats, rows: Floats) -> float:
    """Let the sheet above move a magnet along x and y, and as a vertex along z, in `rows`.

    Vertices are as the magnet sees them; it returns the height at which it is driven.
    """
    sheet, middle = geometry(design).sheet, geometry(design).magnets[which]
    rows[:2] = 0.0
    if design.magnets[which].driver == "vertex":
        nodes, weights = sheet.columns.ravel()[[nearest_foot(design, middle)]], np.ones(1)
        rows[2] = 0.0
        rows[2, nodes, 2] = 1.0
    else:
        nodes, weights = _straight_above(sheet.facets, vertices)
    rows[0, nodes, 0] = rows[1, nodes, 1] = weights
    return float(weights @ vertices[nodes, 2])


def _straight_above(facets: Ints, vertices: Floats) -> tuple[Ints, Floats]:
    """Corners of the triangle of the sheet over the origin, (3,), and their shares, (3,)."""
    triangles = np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])
    above = (vertices[triangles, 2] > 0.0).all(axis=1)
    triangles = triangles[above]
    corners = vertices[triangles, :2]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    two = np.linalg.solve(edges, -corners[:, 0, :, None])[..., 0]
    shares = np.concatenate([1 - two.sum(axis=1, keepdims=True), two], axis=1)
    inside = int(shares.min(axis=1).argmax())
    return triangles[inside], shares[inside]
