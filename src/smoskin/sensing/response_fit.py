"""Response tables from presses: least squares with what is already known as the prior.

The first fit, of the likeliest skin, knows nothing and needs many presses. From it comes how large
each kind of coefficient is, and with that as prior every further answer (how made skins differ,
what warmth changes) needs few. Decides how tables come from presses and what is kept of the ways
in which skins differ; what misses the presses held out becomes the table's misfit.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.material import REFERENCE_TEMPERATURE
from smoskin.mechanics.contact import FINGERTIP
from smoskin.mechanics.relaxation import modulus_factor
from smoskin.sensing.response import ResponseTable
from smoskin.sensing.touch_basis import TouchBasis

_HELD_OUT: Final = 10
"""Of so many presses one is held out to find the misfit."""
_HELD_OUT_SKINS: Final = 8
"""Of so many made skins one is held out, likewise."""
_SEEN: Final = 10
"""Of so many presses one calibrates a skin that is held out."""
_JITTER: Final = 1e-9
"""Ridge of the first fit, relative to each function's own square."""
_DEVIATION: Final = 0.2
"""Prior of how skins differ, relative to the coefficients of the likeliest."""
_NOISE: Final = 0.5e-6
"""T: of the presses that a table is made of; the scatter of signals below which none is fitted."""
_SMOOTH: Final = 2.0
"""Cells over which coefficients of pairs go together."""
_MADE_COUPLING: Final = 0.25
"""By which the coupling of made skins differs from the designed one, relative."""
_PAIR_NOISE: Final = 0.01
"""Of what pairs do beyond adding up, relative, left unfitted."""


def fit_response_table(
    design: SkinDesign,
    position: ArrayLike,
    force: ArrayLike,
    signals: ArrayLike,
    *,
    radius: float = FINGERTIP,
) -> ResponseTable:
    """The table of one skin from B presses all over it.

    Parameters
    ----------
    design : SkinDesign
        Of the skin, with S chips.
    position : array_like, shape (B, 2)
        m.
    force : array_like, shape (B, 3)
        N, on the skin; with drags, where the table shall know them.
    signals : array_like, shape (B, S, 3)
        T, as `ResponseTable` defines them.
    radius : float
        m, of what presses.

    Raises
    ------
    ArgumentError
        If shapes disagree, a number is not finite, or there are fewer presses than twice the
        functions that the table is made of.
    """
    chips = len(design.halls)
    values = floats("signals", signals, (chips, 3)).reshape(-1, 3 * chips)
    where, push = floats("position", position, (None, 2)), floats("force", force, (None, 3))
    basis = TouchBasis.of(design, radius)
    functions = int(np.prod(basis.shape))
    if not len(where) == len(push) == len(values) or len(where) < 2 * functions:
        raise ArgumentError(
            f"position, force and signals must hold the same presses, at least {2 * functions}; "
            f"got {len(where)}, {len(push)} and {len(values)}"
        )
    if not (np.isfinite(values).all() and (push[:, 2] < 0).all()):
        raise ArgumentError("signals must be finite and every touch must press, Fz < 0 N")
    held = np.arange(len(where)) % _HELD_OUT == 0
    rows = basis.rows(where, push)
    gram = rows[~held].T @ rows[~held]
    size = np.diag(gram)
    gram[np.diag_indices_from(gram)] += _JITTER * (size + size.max() * _JITTER)
    coefficients = np.linalg.solve(gram, rows[~held].T @ values[~held])
    missed = (values[held] - rows[held] @ coefficients) / np.linalg.norm(push[held], axis=1)[
        :, None
    ]
    shape = (*basis.shape, 3 * chips)
    vertices = len(basis.lines_x) * len(basis.lines_y)
    return ResponseTable(
        design_hash=design.content_hash,
        basis=basis,
        chips=tuple(range(chips)),
        forces=(float(-push[:, 2].max()), float(-push[:, 2].min())),
        mean=coefficients.reshape(shape),
        softening=modulus_factor(design.columns.material, REFERENCE_TEMPERATURE + 1.0).item() - 1.0,
        warmth=np.zeros(shape),
        modes=np.zeros((0, *shape)),
        coupling=np.zeros((2, vertices, vertices, 3 * chips)),
        misfit=missed.T @ missed / len(missed),
        pair_misfit=np.zeros((3 * chips, 3 * chips)),
    )


def add_warmth(
    table: ResponseTable, position: ArrayLike, force: ArrayLike, per_degree: ArrayLike
) -> ResponseTable:
    """The table with what a degree of the rubber changes in B presses, (B, S, 3), T/K."""
    where, push = floats("position", position, (None, 2)), floats("force", force, (None, 3))
    known = replace(table, warmth=np.zeros_like(table.warmth))
    said = [known.signals(where, push, REFERENCE_TEMPERATURE + degree) for degree in (-1.0, 1.0)]
    change = floats("per_degree", per_degree, (None, 3)).reshape(-1, table.count)
    fitted = _deviation_fit(table, where, push, change - (said[1] - said[0]) / 2)
    return replace(table, warmth=fitted.reshape(table.mean.shape))


def add_modes(
    table: ResponseTable,
    position: ArrayLike,
    force: ArrayLike,
    deviations: ArrayLike,
    *,
    least: float = 0.5e-6,
) -> ResponseTable:
    """The table with the ways in which made skins differ from it.

    Parameters
    ----------
    table : ResponseTable
    position, force : array_like, shapes (B, 2) and (B, 3)
        m and N: presses, the same on every skin.
    deviations : array_like, shape (L, B, S, 3)
        T: signals of L made skins less the table's skin's.
    least : float
        T: modes that change signals by less, root mean square over presses, go into the misfit.

    Returns
    -------
    ResponseTable
        Its mean that of the skins, its misfit with what the modes leave over.

    Raises
    ------
    ArgumentError
        If there are fewer than two skins.
    """
    where, push = floats("position", position, (None, 2)), floats("force", force, (None, 3))
    ways = floats("deviations", deviations, (len(table.chips), 3))
    ways = ways.reshape(len(ways), len(where), table.count)
    if len(ways) < 2:
        raise ArgumentError(f"deviations must be of at least two skins; got {len(ways)}")
    strength = np.linalg.norm(push, axis=1)[:, None]
    held = len(ways) // _HELD_OUT_SKINS
    misfit = table.misfit
    if held:
        shapes = _principal(ways[:-held] - ways[:-held].mean(axis=0), least)
        seen = np.arange(len(where)) % _SEEN == 0
        missed = _missed(ways[-held:] - ways[:-held].mean(axis=0), shapes, seen) / strength[~seen]
        flat = missed.reshape(-1, table.count)
        misfit = misfit + flat.T @ flat / len(flat)
    middle = ways.mean(axis=0)
    shapes = _principal(ways - middle, least)
    columns = np.concatenate([middle[None], shapes]).transpose(1, 0, 2)
    fitted = _deviation_fit(table, where, push, columns.reshape(len(where), -1))
    blocks = fitted.reshape(*table.basis.shape, -1, table.count)
    blocks = np.moveaxis(blocks, -2, 0)
    said = (table.basis.rows(where, push) @ fitted).reshape(len(where), -1, table.count)
    apart = (columns - said) / strength[:, :, None]
    return replace(
        table,
        mean=table.mean + blocks[0],
        modes=blocks[1:],
        misfit=misfit + np.einsum("bkc,bkd->cd", apart, apart) / len(where),
    )


def _principal(apart: Floats, least: float) -> Floats:
    """Principal ways of skins (L, B, C) that change signals by `least` or more, (K, B, C)."""
    flat = apart.reshape(len(apart), -1)
    # The skins are few and presses many: the skins' own products give both.
    power, mixes = np.linalg.eigh(flat @ flat.T)
    kept = power > (len(flat) - 1) * flat.shape[1] * least**2
    ways = mixes[:, kept][:, ::-1].T @ flat / np.sqrt(len(flat) - 1)
    return np.asarray(ways.reshape(-1, *apart.shape[1:]))


def _missed(apart: Floats, shapes: Floats, seen: Bools) -> Floats:
    """What weights found from the presses seen miss of skins in the others, (L, B', C)."""
    rows = shapes[:, seen].reshape(len(shapes), -1)
    gram = rows @ rows.T / _NOISE**2 + np.eye(len(shapes))
    weights = np.linalg.solve(gram, rows @ apart[:, seen].reshape(len(apart), -1).T / _NOISE**2)
    missed = apart - np.einsum("kl,kbc->lbc", weights, shapes)
    return np.asarray(missed[:, ~seen])


def add_coupling(
    table: ResponseTable, position: ArrayLike, force: ArrayLike, signals: ArrayLike
) -> ResponseTable:
    """The table with what two touches at once do beyond adding up.

    Parameters
    ----------
    table : ResponseTable
        Of the same skin.
    position, force : array_like, shapes (B, 2, 2) and (B, 2, 3)
        m and N: pairs of straight touches.
    signals : array_like, shape (B, S, 3)
        T, under both.
    """
    where, push = floats("position", position, (2, 2)), floats("force", force, (2, 3))
    extra = floats("signals", signals, (None, 3)).reshape(len(where), table.count)
    extra = extra - sum(table.signals(where[:, k], push[:, k]) for k in (0, 1))
    hats = [table.vertex_shares(where[:, k]) for k in (0, 1)]
    pairs = [
        (hats[one][:, :, None] * hats[1 - one][:, None, :]).reshape(len(where), -1)
        for one in (0, 1)
    ]
    press = -push[..., 2]
    # A function of two places is as smooth as the sheet: neighbours' coefficients go together.
    n, m = len(table.basis.lines_x), len(table.basis.lines_y)
    near = np.exp(-0.5 * _squared_distances(n, m) / _SMOOTH**2)
    kernel = np.kron(near, near)
    pulls, gram = [], np.zeros((len(where), len(where)))
    for rows in (
        press[:, :1] * pairs[0] + press[:, 1:] * pairs[1],
        press[:, :1] * press[:, 1:] * (pairs[0] + pairs[1]),
    ):
        spread = rows @ kernel
        size = float(np.mean(extra**2) / np.mean((spread * rows).sum(axis=1)))
        pulls.append(size * spread)
        gram += pulls[-1] @ rows.T
    gram[np.diag_indices_from(gram)] += _PAIR_NOISE**2 * float(np.mean(extra**2))
    held = np.arange(len(where)) % _HELD_OUT == 0
    answers = np.linalg.solve(gram[np.ix_(~held, ~held)], extra[~held])
    coupling = np.stack([pull[~held].T @ answers for pull in pulls])
    missed = extra[held] - gram[np.ix_(held, ~held)] @ answers
    # A calibration of single touches does not find how a made skin couples two.
    missed = np.concatenate([missed, _MADE_COUPLING * extra[held]])
    missed /= np.sqrt(np.tile(press[held].prod(axis=1), 2))[:, None]
    return replace(
        table,
        coupling=coupling.reshape(2, n * m, n * m, table.count),
        pair_misfit=2 * missed.T @ missed / len(missed),
    )


def _squared_distances(n: int, m: int) -> Floats:
    """Between vertices, in cells, (N M, N M)."""
    at = np.indices((n, m)).reshape(2, -1).T
    return np.asarray(((at[:, None] - at[None]) ** 2).sum(axis=-1), dtype=np.float64)


def _deviation_fit(table: ResponseTable, where: Floats, push: Floats, values: Floats) -> Floats:
    """Coefficients (P Q D, V) of small changes (B, V), of a size like the likeliest skin's own."""
    p, q, _ = table.basis.shape
    sizes = np.empty(table.mean.shape[:3])
    x_kinds, y_kinds = ((slice(0, k // 2 + 1), slice(k // 2 + 1, k)) for k in (p, q))
    for along in x_kinds:
        for across in y_kinds:
            block = table.mean[along, across]
            sizes[along, across] = np.sqrt((block**2).mean(axis=(0, 1, 3))) if block.size else 0.0
    scale = _DEVIATION * sizes.reshape(-1)
    rows = table.basis.rows(where, push) * scale
    gram = rows @ rows.T
    gram[np.diag_indices_from(gram)] += _NOISE**2
    return np.asarray(scale[:, None] * (rows.T @ np.linalg.solve(gram, values)))
