"""How stiff a sheet is at rest, flat or on a surface, and how much of a press folds its cell.

Decides nothing about touches: small presses along the normal, free to slide. What grips, buckles
or turns far is left to the whole model.
"""

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from smoskin.arrays import Floats
from smoskin.mechanics.sheet.lattice import Springs
from smoskin.origami.sheet import Sheet
from smoskin.origami.tessellation.conditions import gather
from smoskin.origami.tessellation.hinges import fold_slopes, frame_of
from smoskin.origami.tessellation.unfold import lengths_of


def fold_shares(sheet: Sheet, normals: Floats, springs: Springs) -> Floats:
    """Share of the sink of each loaded vertex that folds its cell, (N, M).

    The rest sinks the cell's six columns: 1 less their mean sink over the vertex's, all along the
    surface's normals.

    Parameters
    ----------
    normals : array, shape (2N + 1, M + 1, 3)
        Directions in which the columns stand.
    """
    stiffness = sheet_stiffness(sheet, normals, springs)
    loads = _presses(sheet, normals)
    sinks = -splu(stiffness.tocsc()).solve(loads.T).T.reshape(len(loads), -1, 3)
    pressed = -(sinks.reshape(len(loads), -1) * loads).sum(axis=1)
    share = np.empty(sheet.loaded.shape)
    for k, (n, m) in enumerate(np.ndindex(*share.shape)):
        part = np.s_[2 * n : 2 * n + 3, m : m + 2]
        feet = (sinks[k, sheet.columns[part]] * normals[part]).sum(axis=-1)
        share[n, m] = 1 - feet.mean() / pressed[k]
    return share


def _presses(sheet: Sheet, normals: Floats) -> Floats:
    """A newton on each loaded vertex, against the mean normal of the columns round it."""
    mean = _loaded_normals(normals)
    loads = np.zeros((sheet.loaded.size, sheet.vertices.size))
    rows = np.arange(sheet.loaded.size)
    for axis in range(3):
        loads[rows, 3 * sheet.loaded.ravel() + axis] = -mean[..., axis].ravel()
    return loads


def _loaded_normals(normals: Floats) -> Floats:
    """Unit normals at the loaded vertices, (N, M, 3): each has a column on either side along y."""
    between = normals[1::2, :-1] + normals[1::2, 1:]
    return np.asarray(between / np.linalg.norm(between, axis=-1, keepdims=True))


def sheet_stiffness(sheet: Sheet, normals: Floats, springs: Springs) -> Any:
    """Stiffness of a sheet on its columns at rest, sparse, (3 V, 3 V), N/m.

    Columns stand along `normals`, (2N + 1, M + 1, 3).
    """
    places, facets = sheet.vertices, sheet.facets
    count = len(places)
    pairs = lengths_of(facets)
    spans = places[pairs[:, 0]] - places[pairs[:, 1]]
    lengths = np.linalg.norm(spans, axis=1)
    units = spans / lengths[:, None]
    bars = gather(pairs, np.stack([units, -units], axis=1), count)
    p, q, r, s = (places[facets[:, k]] for k in range(4))
    area = float(np.linalg.norm(np.cross(r - p, s - q), axis=1).mean()) / 2
    frame = frame_of(places, facets, sheet.creases)
    ends = sheet.creases
    crease_lengths = np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1)
    slopes = sparse.vstack(
        [bars, fold_slopes(places, frame.panels), fold_slopes(places, frame.creases)]
    ).tocsr()
    weights = np.concatenate(
        [
            springs.panel_membrane * area / (2 * lengths**2),
            np.full(len(facets), springs.panel_bending),
            springs.crease * crease_lengths,
        ]
    )
    return slopes.T @ sparse.diags_array(weights) @ slopes + _columns(sheet, normals, springs)


def _columns(sheet: Sheet, normals: Floats, springs: Springs) -> Any:
    """Stiffness of the columns, which no frame touches."""
    along = normals[..., :, None] * normals[..., None, :]
    blocks = springs.column_lateral * (np.eye(3) - along) + springs.column_axial * along
    count = len(sheet.vertices)
    whole = np.zeros((count, 3, 3))
    whole[sheet.columns.ravel()] = blocks.reshape(-1, 3, 3)
    return sparse.bsr_array(
        (whole, np.arange(count), np.arange(count + 1)), shape=(3 * count, 3 * count)
    ).tocsr()
