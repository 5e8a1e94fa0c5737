"""Steps mixed from those before: what the fixed tangent lacks, learned on the way.

Columns that lose stiffness under load, and stops that add it, make the plain step crawl or swing.
"""

from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

MEMORY: Final = 3
"""Earlier steps of which the next one is mixed."""
_ALIKE: Final = 1e-8
"""Share of a step's energy below which what is new in it is rounding."""


class Trial(NamedTuple):
    """A step's end, and the unbalanced forces that it answers."""

    motion: Array
    """(V, 3, B), m."""
    board: Array
    """(6, B)."""
    reaction: Array
    """(2K, B), N."""
    curved: Array
    """(E + P, B), N or N m."""
    step: Array
    """(V, 3, B), m."""
    right: Array
    """(V, 3, B), N: the unbalanced forces that it answers."""


def blank(nodes: int, strains: int, reactions: int, lanes: int) -> Trial:
    """No trial at all."""
    shape = (nodes, 3, lanes)
    return Trial(
        motion=jnp.zeros(shape),
        board=jnp.zeros((6, lanes)),
        reaction=jnp.zeros((reactions, lanes)),
        curved=jnp.zeros((strains, lanes)),
        step=jnp.zeros(shape),
        right=jnp.zeros(shape),
    )


def mix(last: Trial, past: Trial, trial: Trial, moved: Array, tick: Array) -> tuple[Trial, Trial]:
    """Differences of the last turns, and what they make of the plain trial.

    They count for the presses that have `moved`, (B,), since the trial before.

    Notes
    -----
    Source: Anderson's mixing of type II: the combination of the last trials whose step would be
    the least, in the energy of the tangent at rest.
    """
    change = jax.tree.map(lambda new, old: jnp.where(moved, new - old, 0.0), trial, last)
    slot = tick % MEMORY
    past = jax.tree.map(lambda all_, new: all_.at[slot].set(new), past, change)
    gram = [
        [(past.right[i] * past.step[j]).sum(axis=(0, 1)) for j in range(i + 1)]
        for i in range(MEMORY)
    ]
    left = [(past.right[i] * trial.step).sum(axis=(0, 1)) for i in range(MEMORY)]
    weight = _solve_small(gram, left)
    better = jax.tree.map(
        lambda new, all_: new - sum(w * part for w, part in zip(weight, all_, strict=True)),
        trial,
        past,
    )
    return past, better


def _solve_small(gram: list[list[Array]], left: list[Array]) -> list[Array]:
    """Solution of small symmetric systems, given below the diagonal, by Cholesky; 0 where empty."""
    size = len(left)
    factor: list[list[Array]] = []
    kept: list[Array] = []
    for i in range(size):
        row: list[Array] = []
        for j in range(i):
            rest = gram[i][j] - sum((row[k] * factor[j][k] for k in range(j)), jnp.zeros(()))
            row.append(rest * kept[j])
        rest = gram[i][i] - sum((part * part for part in row), jnp.zeros(()))
        kept.append(jnp.where(rest > _ALIKE * gram[i][i], 1 / jnp.sqrt(jnp.abs(rest)), 0.0))
        factor.append(row)
    down: list[Array] = []
    for i in range(size):
        rest = left[i] - sum((factor[i][k] * down[k] for k in range(i)), jnp.zeros(()))
        down.append(rest * kept[i])
    up: list[Array] = [jnp.zeros(())] * size
    for i in reversed(range(size)):
        rest = down[i] - sum((factor[k][i] * up[k] for k in range(i + 1, size)), jnp.zeros(()))
        up[i] = rest * kept[i]
    return up
