"""Response tables of the reduced model, quickly made, for tests of what is done with them."""

from dataclasses import replace
from functools import cache

import numpy as np

from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.sensing.response.basis import TouchBasis
from smoskin.sensing.response.fit import add_modes, fit_response_table
from smoskin.sensing.response.table import ResponseTable
from smoskin.twin.readout import Readout
from smoskin.twin.reduced import ReducedTwin

POINT = 1e-4
"""m: the reduced model knows points of touch only."""


def plain(design):
    """The design without the SI's stiffening by drags, whose cusp no table can follow."""
    none = (1e6,) * len(design.coefficients.folding_correction_x)
    stiff = replace(design.coefficients, folding_correction_x=none, folding_correction_y=none)
    return replace(design, coefficients=stiff)


def extent(design):
    cell = geometry(design).cell
    return np.multiply(design.cells, [cell.length, cell.width])


def presses(design, count, seed=0, drag=0.3):
    """Places and forces all over the skin."""
    rng = np.random.default_rng(seed)
    where = rng.uniform(0, extent(design), (count, 2))
    push = np.empty((count, 3))
    push[:, 2] = -rng.uniform(0.05, 1.2, count)
    push[:, :2] = rng.uniform(-drag, drag, (count, 2))
    return where, push


def motions(design, where, push):
    """Of the reduced model."""
    twin = ReducedTwin(design, seed=None)
    return twin.motions(Touches(position=where[:, None], force=push[:, None]))


def signals(design, readout, motion):
    """Turned as designed, less those at rest."""
    rest = Motion.rest(len(design.magnets), (1,))
    turns = np.stack([mlx90393.rotation(site) for site in design.halls])
    return np.einsum("sij,bsj->bsi", turns, readout.seen(motion) - readout.seen(rest))


@cache
def reduced_table(design):
    """The table of the design's reduced model."""
    where, push = presses(design, 4000)
    simulated = signals(design, Readout(design), motions(design, where, push))
    return fit_response_table(design, where, push, simulated, radius=POINT)


@cache
def table_with_modes(design, skins=40):
    """The same with how skins with other magnets and chips differ."""
    from smoskin.twin.manufacture import draw

    where, push = presses(design, 600, seed=1)
    motion = motions(design, where, push)
    designed = signals(design, Readout(design), motion)
    ways = [
        signals(design, Readout(design, draw(design, np.random.default_rng([9, k]))), motion)
        - designed
        for k in range(skins)
    ]
    return add_modes(reduced_table(design), where, push, np.stack(ways))


BASIS = TouchBasis(
    extent=(0.06, 0.05), lines_x=(0.01, 0.028, 0.05), lines_y=(0.012, 0.036), radius=0.005
)
"""Unlike along x and y, and small."""


def random_table(seed=0, modes=3, chips=(0, 1, 2)):
    """A table of a small skin that is nobody's, with everything that a table can have."""
    rng = np.random.default_rng(seed)
    shape, count, vertices = BASIS.shape, 3 * len(chips), BASIS.vertices
    order = BASIS.exponents.sum(axis=1)[:, None]
    size = 1e-3 * 0.1 ** (order - 1)
    mean = rng.normal(size=(*shape, count)) * size
    root = 3e-6 * rng.normal(size=(2, count, count))
    half = 1e-3 * rng.normal(size=(3 * vertices, 3 * vertices))
    give = (half @ half.T).reshape(vertices, 3, vertices, 3)[:, :2]
    curvature = 20.0 * rng.normal(size=(len(chips), 3, 3, 3))
    return ResponseTable(
        design_hash="nobody's",
        basis=BASIS,
        chips=chips,
        forces=(0.05, 1.2),
        mean=mean,
        softening=0.004,
        warmth=1e-3 * rng.normal(size=mean.shape) * size,
        modes=0.05 * rng.normal(size=(modes, *mean.shape)) * size,
        grip=give,
        grip_modes=0.01 * rng.normal(size=(modes, *give.shape)) * np.abs(give).max(),
        curvature=curvature + curvature.swapaxes(1, 2),
        misfit=root[0] @ root[0].T,
        pair_misfit=root[1] @ root[1].T,
    )


def with_coupling(table, seed=0):
    """The table with what columns under load add to pairs, about a fifth of their signals."""
    rng, size = np.random.default_rng([seed, 3]), (3 * table.basis.vertices, table.count)
    coupling = 3e-4 * rng.normal(size=(size[0], *size))
    both = coupling + coupling.swapaxes(0, 1)
    return replace(table, coupling=both.reshape(-1, 3, size[0] // 3, 3, size[1]))


def random_touches(count, seed=0, drag=0.3):
    """Places and forces all over that skin."""
    rng = np.random.default_rng([seed, 1])
    force = rng.uniform(-drag, drag, (count, 3))
    force[:, 2] = -rng.uniform(0.1, 1.1, count)
    return rng.uniform(0, BASIS.extent, (count, 2)), force
