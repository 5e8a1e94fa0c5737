"""Equilibrium of one press that the tangent at rest does not find: load steps, tangents renewed.

The rest itself is found so, its creases' angles in place of the load. Decides how large load steps
are and when a press is given up. Bars and panels keep forces of their own here too: the tangent
takes those that the last step foresaw, so that stiff panels do not force short steps.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import DesignError
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
    """Load of one case, on all nodes and on the board."""

    dead: Floats
    """(V, 3), N: forces that follow no motion."""
    on_board: Floats
    """(6,), N and N m: forces on the board, and moments."""
    pulls: Floats
    """(V, 3, R): W, shares of the nodes in the motion of the held patches, x and y in turn."""
    reach: Floats
    """(R, 6): motion of the held patches with the board."""
    place: Floats
    """(R,), m: motion of the held patches from the sheet as folded to rest, where they are held."""
    link: Floats
    """(R, R), m/N: how much held patches give way by themselves."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Standing:
    """An equilibrium."""

    motion: Floats
    """(V, 3), m: u, over the board."""
    board: Floats
    """(6,), m and rad: motion of the board."""
    reaction: Floats
    """(R,), N: r."""
    force: Floats
    """(E + P,): q, forces of bars, N, and moments of panels' hinges, N m."""
    residual: float
    """Unbalanced force over the load, or over `LIGHTEST`."""
    steps: int
    """Newton steps, all together."""


def settle(tangent: Tangent, tolerance: float = 1e-8) -> Standing:
    """The sheet at rest, its creases turned from their angles as folded to those without moment.

    It raises a `DesignError` where the columns cannot hold it.
    """
    shape = tangent.lattice.nodes.shape
    nothing = np.zeros(len(tangent.elements.stiffness))
    folded = Standing(
        motion=np.zeros(shape),
        board=np.zeros(6),
        reaction=np.zeros(0),
        force=nothing,
        residual=0.0,
        steps=0,
    )
    if (tangent.lattice.crease_set == 1.0).all():
        return folded
    press = Press(
        dead=np.zeros(shape),
        on_board=np.zeros(6),
        pulls=np.zeros((*shape, 0)),
        reach=np.zeros((0, 6)),
        place=np.zeros(0),
        link=np.zeros((0, 0)),
    )
    rest = _grow(tangent, press, tolerance, folded, settling=True)
    if rest is None:
        raise DesignError(
            "creases.set_fraction must let the columns hold the sheet near its fold; got "
            f"{tangent.lattice.crease_set.min():g}, with which it opens"
        )
    return rest


def follow(tangent: Tangent, press: Press, tolerance: float, rest: Standing) -> Standing | None:
    """The equilibrium that grows from rest with the load, or None where it cannot be followed.

    Notes
    -----
    f_inner(u, b) = t f + W r on sheet and board and W' u + S b + G r as at rest, for shares t of
    the load that rise to 1, each solved by Newton's method from the one before; a share that fails
    is halved.
    """
    state = replace(rest, reaction=np.zeros(press.link.shape[0]), residual=0.0, steps=0)
    place = tangent.at(state.motion, state.board, state.force)
    linear, _, _ = constrained_solve(
        tangent, place, press, press.dead, press.on_board, state.reaction
    )
    if _crushed(tangent, linear):
        return None
    return _grow(tangent, press, tolerance, state)


def _grow(
    tangent: Tangent, press: Press, tolerance: float, state: Standing, *, settling: bool = False
) -> Standing | None:
    """The equilibrium at the end of steps of the load, or of the creases' angles."""
    reached, step = 0.0, 1.0
    while reached < 1.0 and step >= _SHORTEST and state.steps < _ALL_STEPS:
        target = min(reached + step, 1.0)
        tried = _newton(tangent, press, target, tolerance, state, settling)
        if tried.residual <= tolerance:
            state, reached, step = tried, target, 2 * step
        else:
            state, step = replace(state, steps=tried.steps), step / 2
    return state if reached >= 1.0 else None


def constrained_solve(
    tangent: Tangent, place: Place, press: Press, right: Floats, on_board: Floats, closing: Floats
) -> tuple[Floats, Floats, Floats]:
    """Small motions (V, 3, ...), the board's (6, ...), and reactions (R, ...) with held patches.

    They balance the forces `right`, (V, 3, ...), and `on_board`, (6, ...), and close the gaps
    `closing`, (R, ...), m: K u + C b = right + W r, C' u + B b = on_board + S' r and
    W' u + S b + G r = closing.
    """
    coupling, held = place.blocks.coupling, press.link.shape[0]
    coupled = coupling if tangent.lattice.stops.on_base else coupling[..., :0]
    many = coupled.shape[-1]
    free = tangent.solve(place, right)
    moved = np.zeros((*press.pulls.shape[:2], many + held))
    if many + held:
        moved = tangent.solve(place, np.concatenate([-coupled, press.pulls], axis=-1))
    by_board = np.zeros((*press.pulls.shape[:2], 6))
    by_board[..., :many], by_held = moved[..., :many], moved[..., many:]

    def along(shapes: Floats, motion: Floats) -> Floats:
        return np.asarray(np.tensordot(shapes, motion, axes=((0, 1), (0, 1))))

    # The board first, as stiff as pillars and frame make it, then what the held patches take.
    own = place.board + along(coupling, by_board)
    left = on_board - along(coupling, free)
    pushed = press.reach.T - along(coupling, by_held)
    board: Floats = np.asarray(np.linalg.solve(own, left), dtype=np.float64)
    board_by_held: Floats = np.asarray(np.linalg.solve(own, pushed), dtype=np.float64)
    if not held:
        return free + np.tensordot(by_board, board, axes=1), board, np.zeros_like(closing)
    reach = along(press.pulls, by_board) + press.reach
    give = along(press.pulls, by_held) + press.link + reach @ board_by_held
    gap = closing - along(press.pulls, free) - np.tensordot(reach, board, axes=1)
    # Two touches on one patch share what holds it: the least of all reactions that would do.
    least = np.linalg.lstsq(give, gap.reshape(held, -1), rcond=None)[0]
    reaction = np.reshape(np.asarray(least, dtype=np.float64), closing.shape)
    board = board + np.tensordot(board_by_held, reaction, axes=1)
    motion = free + np.tensordot(by_board, board, axes=1)
    return motion + np.tensordot(by_held, reaction, axes=1), board, reaction


def _newton(
    tangent: Tangent, press: Press, share: float, tolerance: float, state: Standing, settling: bool
) -> Standing:
    """Newton's method at a share of the load; the residual says whether it converged."""
    stiffness = np.asarray(tangent.elements.stiffness)[:, 0]
    motion, board, reaction, force = state.motion, state.board, state.reaction, state.force
    load, fold = (0.0, share) if settling else (share, 1.0)
    scale = max(load * float(np.linalg.norm(press.dead)), LIGHTEST)
    residual, steps = np.inf, state.steps
    for step in range(_NEWTON_STEPS):
        try:
            place = tangent.at(motion, board, force, fold=fold)
        except (np.linalg.LinAlgError, ValueError):  # no stable place, or no finite one
            residual = np.inf
            break
        right = load * press.dead + press.pulls @ reaction - place.blocks.pushes.sum(axis=0)
        on_board = load * press.on_board + press.reach.T @ reaction - place.board_push
        residual = math.hypot(np.linalg.norm(right), np.linalg.norm(on_board[:3])) / scale
        if (residual <= tolerance and step > 0) or not residual < LOST:
            break
        gap = press.place - np.tensordot(press.pulls, motion, axes=((0, 1), (0, 1)))
        gap -= press.reach @ board + press.link @ reaction
        move, shift, change = constrained_solve(tangent, place, press, right, on_board, gap)
        growth = tangent.strain_change(place, move)
        motion, board, reaction = motion + move, board + shift, reaction + change
        force = stiffness * (place.blocks.strain + growth)
        steps += 1
        if _crushed(tangent, motion):
            residual = np.inf
            break
    return Standing(
        motion=motion, board=board, reaction=reaction, force=force, residual=residual, steps=steps
    )


def _crushed(tangent: Tangent, motion: Floats) -> bool:
    """Whether a foot has sunk so far past the columns' height that no answer lies that way."""
    lattice = tangent.lattice
    return bool((lattice.sunk(motion) > _CRUSHED * lattice.supports.height).any())
