"""Response tables from presses: least squares with what is already known as the prior.

The first fit, of the likeliest skin, needs many presses; the size of its coefficients is the prior
with which every further answer needs few. Decides how tables come from presses and what is kept of
the modes in which skins differ; what misses the presses held out becomes the table's misfit. The
equations are those of "Fit", "Modes" and "Pairs" in `docs/derivations.md`.
"""

from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.nonlinearity import cross_signals
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.origami.geometry import middles_of_fields
from smoskin.sensing.response.basis import TouchBasis, touch_arrays
from smoskin.sensing.response.table import ResponseTable

_HELD_OUT: Final = 10
"""Presses of which one is held out to find the misfit."""
_HELD_OUT_SKINS: Final = 8
"""Made skins of which one is held out to find what the modes miss."""
_SEEN: Final = 10
"""Presses of which one calibrates a skin that is held out."""
_JITTER: Final = 1e-9
"""Ridge of the first fit, relative to each function's own square."""
_DEVIATION: Final = 0.2
"""Size of skins' deviations before they are known, relative to the likeliest coefficients."""
_NOISE: Final = 0.5e-6
"""Scatter of the signals that a table is made of, T."""
_BENT_AT: Final = (6, 7)
"""Places where the curvature of a table is taken."""
_BENT_BY: Final = np.array(
    [
        *((0.0, 0.0, -0.2), (0.0, 0.0, -0.5)),
        *((0.35, 0.0, -0.2), (-0.35, 0.0, -0.3), (0.0, 0.35, -0.3), (0.0, -0.35, -0.2)),
        *((0.25, 0.25, -0.4), (0.25, -0.25, -0.4)),
    ]
)
"""Forces between whose signals it is taken, N."""
_TABLE_BLUR: Final = 3e-3
"""Error of a table's signals, relative to each chip's root mean square."""
_PAIR_BLUR: Final = 0.1
"""Error of the signals of pairs likewise, where their products are fitted."""
_MADE_GRIP: Final = 0.015
"""Relative scatter over made skins of what the drags of a pair do to signals."""
_MADE_CURVATURE: Final = 0.03
"""Relative scatter over made skins of what is missing in the sum of a pair's signals."""
_MADE_COUPLING: Final = 0.2
"""Relative scatter over made skins, as soft as each may be, of what columns under load add."""


def fit_response_table(
    design: SkinDesign,
    position: ArrayLike,
    force: ArrayLike,
    signals: ArrayLike,
    *,
    radius: float = FINGERTIP,
) -> ResponseTable:
    """The table of one skin with S chips from B presses all over it.

    Positions (B, 2), m, forces (B, 3), N, and signals (B, S, 3), T, are as `ResponseTable` has
    them, with drags where it shall know them; `radius`, m, is that of what presses. It raises an
    `ArgumentError` if shapes disagree, a number is not finite, or there are fewer presses than
    twice the functions that the table is made of.

    Notes
    -----
    With rows X of functions and Y of signals: ``A = (X^T X + ridge)^-1 X^T Y``; the misfit is the
    mean of ``r r^T / |F|^2`` over what it leaves of presses held out, r.
    """
    chips = len(design.halls)
    values = floats("signals", signals, (chips, 3)).reshape(-1, 3 * chips)
    place, push = touch_arrays(position, force)
    basis = TouchBasis.of(design, radius)
    least = least_presses(design, radius)
    if len(place) != len(values) or len(place) < least:
        raise ArgumentError(
            f"position, force and signals must hold the same presses, at least {least}; "
            f"got {len(place)}, {len(push)} and {len(values)}"
        )
    if not (np.isfinite(values).all() and (push[:, 2] < 0).all()):
        raise ArgumentError("signals must be finite and every touch must press, Fz < 0 N")
    mean, misfit = _first_fit(basis.rows(place, push), values, np.linalg.norm(push, axis=1))
    shape, vertices = (*basis.shape, 3 * chips), basis.vertices
    return ResponseTable(
        design_hash=design.content_hash,
        basis=basis,
        chips=tuple(range(chips)),
        forces=(float(-push[:, 2].max()), float(-push[:, 2].min())),
        mean=mean.reshape(shape),
        softening=modulus_factor(design.columns.material, REFERENCE_TEMPERATURE + 1.0).item() - 1.0,
        warmth=np.zeros(shape),
        modes=np.zeros((0, *shape)),
        grip=np.zeros((vertices, 2, vertices, 3)),
        grip_modes=np.zeros((0, vertices, 2, vertices, 3)),
        curvature=np.zeros((chips, 3, 3, 3)),
        misfit=misfit,
        pair_misfit=np.zeros((3 * chips, 3 * chips)),
    )


def least_presses(design: SkinDesign, radius: float = FINGERTIP) -> int:
    """Presses that a table needs: two for each function that it is made of."""
    return 2 * int(np.prod(TouchBasis.of(design, radius).shape))


def _first_fit(rows: Floats, values: Floats, strength: Floats) -> tuple[Floats, Floats]:
    """Coefficients A (P Q D, C) of presses, and the misfit E (C, C) of those held out."""
    held_out = np.arange(len(rows)) % _HELD_OUT == 0
    gram = rows[~held_out].T @ rows[~held_out]
    size = np.diag(gram)
    gram[np.diag_indices_from(gram)] += _JITTER * (size + size.max() * _JITTER)
    coefficients = np.linalg.solve(gram, rows[~held_out].T @ values[~held_out])
    missed = values[held_out] - rows[held_out] @ coefficients
    return coefficients, _scatter(missed / strength[held_out, None])


def add_warmth(
    table: ResponseTable, position: ArrayLike, force: ArrayLike, per_degree: ArrayLike
) -> ResponseTable:
    """The table with what a degree of the rubber changes in B presses, (B, S, 3), T/K."""
    place, push = touch_arrays(position, force)
    softened = replace(table, warmth=np.zeros_like(table.warmth))
    warmer = softened.signals(place, push, REFERENCE_TEMPERATURE + 1.0)
    colder = softened.signals(place, push, REFERENCE_TEMPERATURE - 1.0)
    change = floats("per_degree", per_degree, (None, 3)).reshape(-1, table.count)
    fitted = _deviation_fit(table, place, push, change - (warmer - colder) / 2)
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
    """The table with the modes in which L made skins differ from it, and the skins' mean.

    B presses, the same on every skin, have positions (B, 2), m, and forces (B, 3), N; deviations,
    (L, B, S, 3), T, are signals less those of the table's skin; grips, (L, H, 2, H, 3), m/N, by
    default are that of the table's skin. Modes of a root mean square over presses below `least`, T,
    go into the misfit. It raises an `ArgumentError` if there are fewer than two skins.
    """
    place, push = touch_arrays(position, force)
    skins = floats("deviations", deviations, (len(table.chips), 3))
    skins = skins.reshape(len(skins), len(place), table.count)
    if len(skins) < 2:
        raise ArgumentError(f"deviations must be of at least two skins; got {len(skins)}")
    strength = np.linalg.norm(push, axis=1)[:, None]
    misfit = table.misfit
    if held_out := len(skins) // _HELD_OUT_SKINS:
        misfit = misfit + _missed(skins[:-held_out], skins[-held_out:], strength, least)
    middle = skins.mean(axis=0)
    modes, scores = _principal(skins - middle, least)
    columns = np.concatenate([middle[None], modes]).transpose(1, 0, 2)
    fitted = _deviation_fit(table, place, push, columns.reshape(len(place), -1))
    blocks = np.moveaxis(fitted.reshape(*table.basis.shape, -1, table.count), -2, 0)
    left = columns - table.basis.sums(fitted, place, push).reshape(columns.shape)
    apart = left / strength[:, :, None]
    grip = table.grip[None] if grips is None else floats("grips", grips, table.grip.shape)
    grip = np.broadcast_to(grip, (len(skins), *table.grip.shape))
    return replace(
        table,
        mean=table.mean + blocks[0],
        modes=blocks[1:],
        grip=grip.mean(axis=0),
        grip_modes=np.tensordot(scores.T, grip - grip.mean(axis=0), 1),
        misfit=misfit + np.einsum("bkc,bkd->cd", apart, apart) / len(place),
    )


def _principal(deviations: Floats, least: float) -> tuple[Floats, Floats]:
    """Principal modes (K, B, C) of skins (L, B, C), by one deviation, and their mix (L, K)."""
    flat = deviations.reshape(len(deviations), -1)
    # The skins are few and presses many: the skins' own products give both.
    power, mixes = np.linalg.eigh(flat @ flat.T)
    kept = power > (len(flat) - 1) * flat.shape[1] * least**2
    scores = mixes[:, kept][:, ::-1] / np.sqrt(len(flat) - 1)
    return np.asarray((scores.T @ flat).reshape(-1, *deviations.shape[1:])), np.asarray(scores)


def _missed(skins: Floats, others: Floats, strength: Floats, least: float) -> Floats:
    """What modes of skins (L, B, C) miss of others known by a few presses, (C, C), T^2/N^2."""
    seen = np.arange(len(strength)) % _SEEN == 0
    modes, _ = _principal(skins - skins.mean(axis=0), least)
    deviations = others - skins.mean(axis=0)
    rows = modes[:, seen].reshape(len(modes), -1)
    gram = rows @ rows.T / _NOISE**2 + np.eye(len(modes))
    right = rows @ deviations[:, seen].reshape(len(deviations), -1).T
    weights = np.linalg.solve(gram, right / _NOISE**2)
    missed = (deviations - np.einsum("kl,kbc->lbc", weights, modes))[:, ~seen] / strength[~seen]
    return _scatter(missed.reshape(-1, missed.shape[-1]))


def add_coupling(
    table: ResponseTable,
    grip: Floats,
    position: ArrayLike,
    force: ArrayLike,
    signals: ArrayLike,
    *,
    coupling: Floats | None = None,
    curvature: Floats | None = None,
) -> ResponseTable:
    """The table with what two touches at once do beyond adding up on the same skin.

    The grip, (H, 2, H, 3), m/N, is that of `smoskin.mechanics.sheet.compliance.grip_compliance`;
    pairs of touches have positions (B, 2, 2), m, forces (B, 2, 3), N, and signals (B, S, 3), T. The
    coupling is that of `ResponseTable`, beside which the fields' own curvature (S, 3, 3, 3), 1/T,
    is corrected; by default there is none, and the curvature is what the table shows. It raises a
    `ModelError` if grip or coupling do not fit the table's vertices.
    """
    place, push = floats("position", position, (2, 2)), floats("force", force, (2, 3))
    both = floats("signals", signals, (None, 3)).reshape(len(place), table.count)
    curvature = table_curvature(table) if curvature is None else curvature
    table = replace(table, grip=grip, curvature=curvature, coupling=coupling)
    first, second = table.dragged(place, push)
    softer = table.coupled(place, push)
    missing = both - first - second - softer
    seen = np.arange(len(place)) % _HELD_OUT != 0
    curvature = _fit_curvature(
        first[seen], second[seen], missing[seen], table.curvature, _PAIR_BLUR
    )
    # A calibration of single touches does not find how a made skin holds and bends otherwise.
    added = sum(table.signals(place[:, k], push[:, k]) for k in (0, 1))
    unsure = [
        missing - cross_signals(curvature, first, second),
        _MADE_GRIP * (first + second - added),
        _MADE_CURVATURE * missing,
        _MADE_COUPLING * softer,
    ]
    strength = np.linalg.norm(push[~seen, :, 2], axis=1)[:, None]
    pair_misfit = np.sum([_scatter(part[~seen] / strength) for part in unsure], axis=0)
    return replace(table, curvature=curvature, pair_misfit=pair_misfit)


def table_curvature(table: ResponseTable) -> Floats:
    """The curvature (S, 3, 3, 3), 1/T, that a table shows: two forces at a place are their sum."""
    grid = middles_of_fields(table.basis.extent, _BENT_AT)
    i, j = np.triu_indices(len(_BENT_BY))

    def at_all(forces: Floats) -> Floats:
        place = np.repeat(grid, len(forces), axis=0)
        values = table.signals(place, np.tile(forces, (len(grid), 1)))
        return values.reshape(len(grid), len(forces), -1)

    alone, both = at_all(_BENT_BY), at_all(_BENT_BY[i] + _BENT_BY[j])
    first, second = (alone[:, index].reshape(-1, table.count) for index in (i, j))
    missing = both.reshape(first.shape) - first - second
    none = np.zeros((len(table.chips), 3, 3, 3))
    return _fit_curvature(first, second, missing, none, _TABLE_BLUR)


def _fit_curvature(
    first: Floats, second: Floats, missing: Floats, prior: Floats, blur: float
) -> Floats:
    """Curvature near a prior whose products of signals (B, C) make what their sums miss."""
    curvature = np.array(prior)
    left = missing - cross_signals(prior, first, second)
    for chip in range(len(prior)):
        part = slice(3 * chip, 3 * chip + 3)
        a, b = first[:, part], second[:, part]
        size = (a**2).mean(axis=0) + (b**2).mean(axis=0)
        if not size.any():
            continue
        products = a[:, :, None] * b[:, None, :]
        rows = (products + products.swapaxes(1, 2)).reshape(-1, 9) / 2
        # Signals that are off blur their products: faint ones say little of theirs.
        ridge = len(a) * blur**2 * size.mean() * np.add.outer(size, size) / (2 + 2 * np.eye(3))
        gram = rows.T @ rows + np.diag(ridge.ravel())
        curvature[chip] += np.linalg.solve(gram, rows.T @ left[:, part]).reshape(3, 3, 3)
    return curvature


def _deviation_fit(table: ResponseTable, place: Floats, push: Floats, values: Floats) -> Floats:
    """Coefficients ``S^2 X^T (X S^2 X^T + noise^2)^-1 values`` (P Q D, V) of changes (B, V)."""
    # S are sizes like those of the likeliest skin's coefficients, by kind of function.
    p, q, _ = table.basis.shape
    sizes = np.zeros(table.mean.shape[:3])
    x_kinds, y_kinds = ((slice(0, k // 2 + 1), slice(k // 2 + 1, k)) for k in (p, q))
    for kind in product(x_kinds, y_kinds):
        if (block := table.mean[kind]).size:
            sizes[kind] = np.sqrt((block**2).mean(axis=(0, 1, 3)))
    scale = _DEVIATION * sizes.reshape(-1)
    rows = table.basis.rows(place, push) * scale
    gram = rows @ rows.T
    gram[np.diag_indices_from(gram)] += _NOISE**2
    return np.asarray(scale[:, None] * (rows.T @ np.linalg.solve(gram, values)))


def _scatter(rows: Floats) -> Floats:
    """Mean product of rows (B, C) with themselves, (C, C)."""
    return np.asarray(rows.T @ rows / len(rows))
