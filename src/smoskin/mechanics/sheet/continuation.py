"""Equilibrium of one press that the tangent at rest does not find: load steps, tangents renewed.

Decides how large load steps are and when a press is given up. Bars and panels keep forces of their
own here too: the tangent takes those that the last step foresaw, so that stiff panels do not force
short steps.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.mechanics.sheet.tangent import Place, Tangent

_NEWTON_STEPS: Final = 16
"""Newton steps of one load step."""
_SHORTEST: Final = 1 / 64
"""Smallest load step, as a share of the load."""
_ALL_STEPS: Final = 200
"""Newton steps of one press after which it is given up."""
_CRUSHED: Final = 4.0
"""Columns' heights by which a foot may sink on the way; no answer lies beyond."""
LOST: Final = 1e9
"""Relative residual from which a press does not come back."""
LIGHTEST: Final = 0.01
"""N: residuals are relative to the load or to this, as rounding alone leaves some 1e-11 N."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Press:
    """Load of one case, on all nodes."""

    dead: Floats
    """(V, 3), N: forces that follow no motion."""
    pulls: Floats
    """(V, 3, R): W, shares of the nodes in the motion of the held patches, x and y in turn."""
    link: Floats
    """(R, R), m/N: G, how much the held patches give way under their reactions."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Standing:
    """An equilibrium."""

    motion: Floats
    """(V, 3), m: u."""
    reaction: Floats
    """(R,), N: r."""
    force: Floats
    """(E + P,): q, forces of bars, N, and moments of panels' hinges, N m."""
    residual: float
    """Unbalanced force over the load, or over `LIGHTEST`."""
    steps: int
    """Newton steps, all together."""


def follow(tangent: Tangent, press: Press, tolerance: float) -> Standing | None:
    """The equilibrium that grows from rest with the load, or None where it cannot be followed.

    Notes
    -----
    f_inner(u) = t f + W r and W' u + G r = 0 for shares t of the load that rise to 1, each solved
    by Newton's method from the one before; a share that fails is halved.
    """
    state = Standing(
        motion=np.zeros_like(press.dead),
        reaction=np.zeros(press.link.shape[0]),
        force=np.zeros(len(tangent.elements.stiffness)),
        residual=0.0,
        steps=0,
    )
    rest = tangent.at(state.motion)
    linear, _ = constrained_solve(tangent, rest, press, press.dead, state.reaction)
    if _crushed(tangent, linear):
        return None
    reached, step = 0.0, 1.0
    while reached < 1.0 and step >= _SHORTEST and state.steps < _ALL_STEPS:
        target = min(reached + step, 1.0)
        tried = _newton(tangent, press, target, tolerance, state)
        if tried.residual <= tolerance:
            state, reached, step = tried, target, 2 * step
        else:
            state, step = replace(state, steps=tried.steps), step / 2
    return state if reached >= 1.0 else None


def constrained_solve(
    tangent: Tangent, place: Place, press: Press, right: Floats, closing: Floats
) -> tuple[Floats, Floats]:
    """Small motions (V, 3, ...) and reactions (R, ...) with held patches.

    They balance the forces `right`, (V, 3, ...), and close the gaps `closing`, (R, ...), m:
    K u = right + W r and W' u + G r = closing.
    """
    free = tangent.solve(place, right)
    if not press.link.size:
        return free, np.zeros((0, *right.shape[2:]))
    yielding = tangent.solve(place, press.pulls)
    give = np.einsum("vdr,vds->rs", press.pulls, yielding) + press.link
    gap = closing - np.tensordot(press.pulls, free, axes=((0, 1), (0, 1)))
    # Two touches on one patch share what holds it: the least of all reactions that would do.
    reaction = np.linalg.lstsq(give, gap.reshape(len(gap), -1), rcond=None)[0].reshape(gap.shape)
    return free + np.tensordot(yielding, reaction, axes=1), reaction


def _newton(
    tangent: Tangent, press: Press, load: float, tolerance: float, state: Standing
) -> Standing:
    """Newton's method at a share of the load; the residual says whether it converged."""
    stiffness = np.asarray(tangent.elements.stiffness)[:, 0]
    motion, reaction, force = state.motion, state.reaction, state.force
    scale = max(load * float(np.linalg.norm(press.dead)), LIGHTEST)
    residual, steps = np.inf, state.steps
    for step in range(_NEWTON_STEPS):
        try:
            place = tangent.at(motion, force)
        except (np.linalg.LinAlgError, ValueError):  # no stable place, or no finite one
            residual = np.inf
            break
        outer = load * press.dead + press.pulls @ reaction
        right = outer - place.inner.sum(axis=0)
        residual = float(np.linalg.norm(right)) / scale
        if (residual <= tolerance and step > 0) or not residual < LOST:
            break
        gap = -np.tensordot(press.pulls, motion, axes=((0, 1), (0, 1))) - press.link @ reaction
        move, change = constrained_solve(tangent, place, press, right, gap)
        growth = tangent.strain_change(place, move)
        motion, reaction = motion + move, reaction + change
        force = stiffness * (place.blocks.strain + growth)
        steps += 1
        if _crushed(tangent, motion):
            residual = np.inf
            break
    return Standing(motion=motion, reaction=reaction, force=force, residual=residual, steps=steps)


def _crushed(tangent: Tangent, motion: Floats) -> bool:
    """Whether a foot has sunk so far past the columns' height that no answer lies that way."""
    lattice = tangent.lattice
    return bool(motion[lattice.feet, 2].min() < -_CRUSHED * lattice.stroke)
