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
from smoskin.magnetics.nonlinearity import cross_signals
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.origami.layout import middles_of_fields
from smoskin.sensing.response.basis import TouchBasis
from smoskin.sensing.response.pairs import mutual_drags
from smoskin.sensing.response.table import ResponseTable

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
_BENT_AT: Final = (6, 7)
"""Where the curvature of a table is taken."""
_BENT_BY: Final = np.array(
    [
        *((0.0, 0.0, -0.2), (0.0, 0.0, -0.5)),
        *((0.35, 0.0, -0.2), (-0.35, 0.0, -0.3), (0.0, 0.35, -0.3), (0.0, -0.35, -0.2)),
        *((0.25, 0.25, -0.4), (0.25, -0.25, -0.4)),
    ]
)
"""N: forces between whose answers it is taken."""
_TABLE_BLUR: Final = 3e-3
"""By which answers may be off, of a chip's largest."""
_PAIR_BLUR: Final = 0.1
"""By which signals of pairs may be off, of each chip's, where their products are fitted."""
_MADE_GRIP: Final = 0.03
"""By which what the touches of a pair pull at each other differs on made skins, relative."""
_MADE_CURVATURE: Final = 0.03
"""Likewise what is missing in the sum of their signals."""


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
        grip=np.zeros((vertices, 2, vertices, 3)),
        grip_modes=np.zeros((0, vertices, 2, vertices, 3)),
        curvature=np.zeros((chips, 3, 3, 3)),
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
    grips: ArrayLike | None = None,
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
    grips : array_like, shape (L, H, 2, H, 3), optional
        m/N: how they give way where touches grip them; by default as the table's skin.
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
        shapes, _ = _principal(ways[:-held] - ways[:-held].mean(axis=0), least)
        seen = np.arange(len(where)) % _SEEN == 0
        missed = _missed(ways[-held:] - ways[:-held].mean(axis=0), shapes, seen) / strength[~seen]
        flat = missed.reshape(-1, table.count)
        misfit = misfit + flat.T @ flat / len(flat)
    middle = ways.mean(axis=0)
    shapes, scores = _principal(ways - middle, least)
    sizes = table.grip.shape
    held_by = np.broadcast_to(table.grip, (len(ways), *sizes)) if grips is None else grips
    gives = floats("grips", held_by, sizes[1:])
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
        grip=gives.mean(axis=0),
        grip_modes=np.tensordot(scores.T, gives - gives.mean(axis=0), 1),
        misfit=misfit + np.einsum("bkc,bkd->cd", apart, apart) / len(where),
    )


def _principal(apart: Floats, least: float) -> tuple[Floats, Floats]:
    """Principal ways of skins (L, B, C) that change signals by `least` or more.

    Returns
    -------
    ways : Floats, shape (K, B, C)
        Each by one standard deviation.
    scores : Floats, shape (L, K)
        By which a skin's other properties are to be added up to go with each way.
    """
    flat = apart.reshape(len(apart), -1)
    # The skins are few and presses many: the skins' own products give both.
    power, mixes = np.linalg.eigh(flat @ flat.T)
    kept = power > (len(flat) - 1) * flat.shape[1] * least**2
    scores = mixes[:, kept][:, ::-1] / np.sqrt(len(flat) - 1)
    return np.asarray((scores.T @ flat).reshape(-1, *apart.shape[1:])), np.asarray(scores)


def _missed(apart: Floats, shapes: Floats, seen: Bools) -> Floats:
    """What weights found from the presses seen miss of skins in the others, (L, B', C)."""
    rows = shapes[:, seen].reshape(len(shapes), -1)
    gram = rows @ rows.T / _NOISE**2 + np.eye(len(shapes))
    weights = np.linalg.solve(gram, rows @ apart[:, seen].reshape(len(apart), -1).T / _NOISE**2)
    missed = apart - np.einsum("kl,kbc->lbc", weights, shapes)
    return np.asarray(missed[:, ~seen])


def add_coupling(
    table: ResponseTable, grip: Floats, position: ArrayLike, force: ArrayLike, signals: ArrayLike
) -> ResponseTable:
    """The table with what two touches at once do beyond adding up.

    Parameters
    ----------
    table : ResponseTable
        Of the same skin.
    grip : Floats, shape (H, 2, H, 3)
        m/N, as `smoskin.mechanics.sheet.compliance.grip_compliance` has it.
    position, force : array_like, shapes (B, 2, 2) and (B, 2, 3)
        m and N: pairs of touches.
    signals : array_like, shape (B, S, 3)
        T, under both.

    Raises
    ------
    ModelError
        If the grip does not fit the table's vertices.
    """
    where, push = floats("position", position, (2, 2)), floats("force", force, (2, 3))
    said = floats("signals", signals, (None, 3)).reshape(len(where), table.count)
    table = replace(table, grip=grip, curvature=table_curvature(table))
    drags = mutual_drags(grip, table.vertex_shares(where), -push[..., 2])
    pulled = np.concatenate([push[..., :2] + drags, push[..., 2:]], axis=-1)
    one, other = (table.signals(where[:, k], pulled[:, k]) for k in (0, 1))
    missing = said - one - other
    held = np.arange(len(where)) % _HELD_OUT == 0
    curvature = _fit_curvature(
        one[~held], other[~held], missing[~held], table.curvature, _PAIR_BLUR
    )
    made = replace(table, curvature=curvature)
    missed = missing - cross_signals(curvature, one, other)
    # A calibration of single touches does not find how a made skin holds and bends otherwise.
    single = [table.signals(where[:, k], push[:, k]) for k in (0, 1)]
    unsure = [
        missed[held],
        _MADE_GRIP * (one + other - single[0] - single[1])[held],
        _MADE_CURVATURE * missing[held],
    ]
    strength = np.linalg.norm(push[held, :, 2], axis=1)[:, None]
    scaled = np.concatenate([part / strength for part in unsure])
    return replace(made, pair_misfit=scaled.T @ scaled / held.sum())


def table_curvature(table: ResponseTable) -> Floats:
    """The curvature that a table of single touches shows, (S, 3, 3, 3), 1/T."""
    grid = middles_of_fields(table.basis.extent, _BENT_AT)
    one, other = np.triu_indices(len(_BENT_BY))

    def answers(forces: Floats) -> Floats:
        where = np.repeat(grid, len(forces), axis=0)
        said = table.signals(where, np.tile(forces, (len(grid), 1)))
        return said.reshape(len(grid), len(forces), -1)

    alone, both = answers(_BENT_BY), answers(_BENT_BY[one] + _BENT_BY[other])
    first, second = (alone[:, index].reshape(-1, table.count) for index in (one, other))
    missing = both.reshape(first.shape) - first - second
    none = np.zeros((len(table.chips), 3, 3, 3))
    return _fit_curvature(first, second, missing, none, _TABLE_BLUR)


def _fit_curvature(
    one: Floats, other: Floats, missing: Floats, known: Floats, blur: float
) -> Floats:
    """Products of signals (B, C) that make what is missing in their sums, (S, 3, 3, 3).

    Parameters
    ----------
    one, other : Floats, shape (B, C)
        T: of each touch.
    missing : Floats, shape (B, C)
        T.
    known : Floats, shape (S, 3, 3, 3)
        From which they differ little.
    blur : float
        By which the signals may be off, of each chip's root mean square.
    """
    found = np.array(known)
    left = missing - cross_signals(known, one, other)
    pairs = [(i, j) for i in range(3) for j in range(i + 1)]
    for chip in range(len(known)):
        part = slice(3 * chip, 3 * chip + 3)
        a, b = one[:, part], other[:, part]
        rows = np.stack([a[:, i] * b[:, j] + a[:, j] * b[:, i] for i, j in pairs], axis=1)
        size = (a**2).mean(axis=0) + (b**2).mean(axis=0)
        if not size.any():
            continue
        # Signals that are off blur their products: faint ones say little of theirs.
        ridge = len(a) * blur**2 * size.mean() * np.array([size[i] + size[j] for i, j in pairs])
        gram = rows.T @ rows + np.diag(ridge)
        parts = np.linalg.solve(gram, rows.T @ left[:, part])
        for (i, j), row in zip(pairs, parts, strict=True):
            found[chip, i, j] += row
            found[chip, j, i] += row
    return found


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
