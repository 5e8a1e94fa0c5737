"""The whole folded sheet under touches: nonlinear statics of bars and hinges on columns.

Decides what a touch is to the sheet (a patch of loaded vertices that is held in the plane, slides
or is free), what carries the sheet (columns on a board that moves and turns on its pillars), and
which answers count.
"""

from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError

try:
    from smoskin.mechanics.sheet.equilibrium import Equilibrium, Loads, Relaxed
except ModuleNotFoundError as error:
    raise MissingExtraError("the nonlinear model of the whole sheet", "twin") from error

from smoskin.mechanics.board import Board, board_of
from smoskin.mechanics.sheet.contact import ContactLaw, contact_of, probe_law, shares_by, slopes_by
from smoskin.mechanics.sheet.continuation import Press, constrained_solve
from smoskin.mechanics.sheet.lattice import Lattice, Springs, build_lattice
from smoskin.mechanics.sheet.tangent import Place
from smoskin.mechanics.sheet.touches import (
    Covered,
    Frictionless,
    Grip,
    Sliding,
    Sticking,
    Touches,
    check_on_skin,
)

STIFFNESSES: Final = tuple(part.name for part in fields(Springs))
"""Kinds of springs that `Sensitivity` knows, in its order."""
_DEEPEST: Final = 0.5
"""Share of a column's height by which its top may sink in an answer that counts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pressed:
    """Answers of the sheet to touches, one in each row."""

    displacements: Floats
    """(B, V, 3), m: motion of the vertices over the board, from rest; NaN where not converged."""
    board: Floats
    """(B, 6): motion of the board over its base along x, y and z, m, and its turns about them,
    rad; from rest."""
    reaction: Floats
    """(B, K, 2), N: sideways force of each touch on the sheet beyond the drag asked for; under
    cover panels, that of the guide."""
    residual: Floats
    """(B,): unbalanced force over the load, or over 10 mN where the load is less."""
    iterations: Ints
    """(B,): steps of the solver."""
    converged: Bools
    """(B,): an equilibrium was found, with every column shorter by less than half its height."""
    pulled: Bools
    """(B,): some column is pulled harder than its bond to the base holds."""
    buckling_margin: Floats
    """(B,): least of the columns' buckling loads over their loads; below 1 some column buckles
    between its ends, which no answer counts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """Exact derivatives of the sheet's and the board's motion, one case in each row."""

    displacements: Floats
    """(B, K, 5, V, 3): derivatives by x and y, m/m, and by Fx, Fy and Fz, m/N, of each touch."""
    board: Floats
    """(B, K, 5, 6): the same derivatives of the board's motion."""
    displacements_by_stiffness: Floats
    """(B, 6, V, 3), m: derivatives by the relative change of each kind of spring, `STIFFNESSES`."""
    board_by_stiffness: Floats
    """(B, 6, 6): the same derivatives of the board's motion."""


class _Answer(NamedTuple):
    """Equilibria of a case before and after the drags."""

    straight: Relaxed
    """Presses alone, patches held where the touches grip."""
    sideways: Floats
    """(B, K, 2), N: force in the plane that each touch then exerts on the sheet."""
    final: Relaxed
    """Equilibrium with them."""


class Rest(NamedTuple):
    """The unloaded sheet, whose creases may have opened or closed it from its fold."""

    displacements: Floats
    """(V, 3), m: from the sheet as folded, over the board."""
    outward: Floats
    """(S,), m: sway of each rim column's top out of the sheet, at the frame's S stops."""
    stop_force: Floats
    """(S,), N: what each stop takes."""
    compression: Floats
    """(C,), N: load of each column."""


class _Change(NamedTuple):
    """Derivatives of one case's touches by the P parameters of `Sensitivity`, one after another."""

    share: Floats
    """(K, T, P)."""
    carried: Floats
    """(K, 3, 6, P): of the patches' motions with the board."""
    force: Floats
    """(K, 3, P)."""


class BarHinge:
    """The nonlinear sheet of one design.

    A touch first presses straight: where it grips, the mean motion in the plane of its patch over
    the ground is zero, and what that takes is its reaction, counting what the board gives way.
    Its drag then comes on top of that reaction, as a load that follows no motion. With friction,
    the sum of both is cut to friction times normal force. Touches stick by default; lattice and
    board are as designed unless others with their own stiffness are given. The contact law says
    which vertices take a touch: `CoverPanels` under cover panels, else `Bilinear`, unless one is
    given. It raises a `DesignError` if the sheet can move without resistance or cannot rest, a
    `ContractError` if the law breaks its role; its module a `MissingExtraError` without JAX.

    Notes
    -----
    Source: SI Figure S6 and Eq. (S16), its energies taken at any displacement; columns that bend
    (`smoskin.mechanics.beam`) and a frame that stops them, in place of (S21); (S26) for the board,
    which tilts too. It solves f_inner(u, b) = P'(F + r) with P (u + b) = 0 for patches P that hold,
    b the board's motion; see docs/derivations_sheet.md.
    Valid for columns pressed by less than half their height and short of buckling between their
    clamped ends, `Pressed.buckling_margin`; they do not touch.
    """

    def __init__(
        self,
        design: SkinDesign,
        *,
        grip: Grip | None = None,
        lattice: Lattice | None = None,
        board: Board | None = None,
        contact: ContactLaw | None = None,
    ) -> None:
        self.design = design
        self.grip: Grip = grip or Sticking()
        self.contact = contact_of(self.grip) if contact is None else contact
        probe_law(self.contact, design)
        self.lattice = lattice or build_lattice(design)
        self.board = board or board_of(design)
        self._equilibrium = Equilibrium(self.lattice, self.board)
        arms = self.board.carries(self.lattice.nodes[self.lattice.loaded.ravel()])
        self._carried = np.swapaxes(self.lattice.loaded_axes, 1, 2) @ arms

    @property
    def rest(self) -> Rest:
        """The sheet that nothing touches; displacements of presses are from there."""
        lattice, rest = self.lattice, self._equilibrium.rest
        place = self._equilibrium.tangent.blocks(rest.motion, rest.board)
        sway = (rest.motion[lattice.stops.nodes] * lattice.stops.normal).sum(axis=1)
        return Rest(rest.motion, sway, place.stopped, place.compression)

    def press(
        self, touches: Touches, *, tolerance: float = 1e-8, start: Floats | None = None
    ) -> Pressed:
        """Equilibria under touches; an answer counts up to a relative residual of `tolerance`.

        `start`, (B, V, 3), m, are displacements near the answers, such as those of a moment ago. It
        raises an `ArgumentError` if a touch lies off the skin.
        """
        if not 0.0 < tolerance < 1.0:
            raise ArgumentError(f"tolerance must lie in (0, 1); got {tolerance}")
        loads = self._loads(touches)
        _, sideways, final = self._solve(loads, tolerance, start)
        converged, rest = self._counts(final, tolerance), self._equilibrium.rest
        drag = 0.0 if isinstance(self.grip, Covered) else touches.force[..., :2]
        counts = converged[:, None]
        part = (final.compression / self.lattice.supports.buckling_load).max(axis=1)
        margin = np.divide(1.0, part, out=np.full_like(part, np.inf), where=part > 0)
        return Pressed(
            displacements=np.where(counts[..., None], final.displacements - rest.motion, np.nan),
            board=np.where(counts, (final.board - rest.board) @ self.board.modes.T, np.nan),
            reaction=np.where(counts[..., None], sideways - drag, np.nan),
            residual=final.residual,
            iterations=final.iterations,
            converged=converged,
            pulled=(-final.compression > self.lattice.bond_limit).any(axis=1) & converged,
            buckling_margin=np.where(converged, margin, np.nan),
        )

    def sensitivity(self, touches: Touches, *, tolerance: float = 1e-10) -> Sensitivity:
        """Derivatives of the answers to touches, by the implicit function theorem.

        They are taken at equilibria of at most this residual, NaN where there is none. Between the
        vertices a patch's shares have a slope of their own at each point; the derivative by the
        position is that of the shares as they are computed. It raises an `ArgumentError` if a touch
        lies off the skin.
        """
        loads = self._loads(touches)
        answer = self._solve(loads, tolerance, None)
        rows, places, tops = loads.shares.shape
        by_place, by_force = slopes_by(self.contact, self.design, touches)
        slopes = np.concatenate([by_place, by_force], axis=2).reshape(rows, places, 5, tops)
        count, nodes = 5 * places + len(STIFFNESSES), len(self.lattice.nodes)
        motion, board = np.full((rows, count, nodes, 3), np.nan), np.full((rows, count, 6), np.nan)
        for row in map(int, np.flatnonzero(self._counts(answer.final, tolerance))):
            moved, carry = self._derive(loads, answer, slopes[row], row)
            motion[row], board[row] = np.moveaxis(moved, -1, 0), carry.T @ self.board.modes.T
        by_touch = 5 * places
        return Sensitivity(
            displacements=motion[:, :by_touch].reshape(rows, places, 5, nodes, 3),
            board=board[:, :by_touch].reshape(rows, places, 5, 6),
            displacements_by_stiffness=motion[:, by_touch:],
            board_by_stiffness=board[:, by_touch:],
        )

    def _derive(
        self, loads: Loads, answer: _Answer, slopes: Floats, row: int
    ) -> tuple[Floats, Floats]:
        """Derivatives of one case's motion, (V, 3, P), and of the board's, (6, P)."""
        force, straight = loads.force[row], answer.straight
        own = self._own_change(slopes)
        covered = isinstance(self.grip, Covered)
        upright = own._replace(force=own.force * [[0.0], [0.0], [1.0]])
        moved, carry, change = self._stage(
            loads, row, straight, straight.reaction[row], upright, own if covered else upright
        )
        if not covered:
            asked = straight.reaction[row] + force[:, :2]
            if isinstance(self.grip, Frictionless):
                change = np.zeros_like(change)
            change = self._cut_change(
                asked, force[:, 2], change + own.force[:, :2], own.force[:, 2]
            )
            freed = loads._replace(held=np.zeros_like(loads.held))
            dead = own._replace(force=np.concatenate([change, own.force[:, 2:]], axis=1))
            moved, carry, _ = self._stage(
                freed, row, answer.final, answer.sideways[row], dead, dead
            )
        at_rest, board_at_rest = self._rest_change
        moved[..., -len(STIFFNESSES) :] -= at_rest
        carry[..., -len(STIFFNESSES) :] -= board_at_rest
        return moved, carry

    @cached_property
    def _rest_change(self) -> tuple[Floats, Floats]:
        """Change of the rest with each stiffness, (V, 3, 6), and the board's, (6, 6)."""
        equilibrium, rest, count = self._equilibrium, self._equilibrium.rest, len(STIFFNESSES)
        place = equilibrium.tangent.at(rest.motion, rest.board)
        nothing = Press(
            dead=np.zeros_like(rest.motion),
            on_board=np.zeros(6),
            pulls=np.zeros((*rest.motion.shape, 0)),
            reach=np.zeros((0, 6)),
            place=np.zeros(0),
            link=np.zeros((0, 0)),
        )
        right, on_board = _by_stiffness(self.lattice, place, count)
        moved, carry, _ = constrained_solve(
            equilibrium.tangent, place, nothing, -right, -on_board, np.zeros((0, count))
        )
        return moved, carry

    def _own_change(self, slopes: Floats) -> _Change:
        """Change of the touches themselves with each parameter, from `slopes_by`, (K, 5, T)."""
        places, _, tops = slopes.shape
        count = 5 * places + len(STIFFNESSES)
        share, force = np.zeros((places, tops, count)), np.zeros((places, 3, count))
        for k in range(places):
            share[k, :, 5 * k : 5 * k + 5] = slopes[k].T
            force[k, :, 5 * k + 2 : 5 * k + 5] = np.eye(3)
        carry = np.einsum("ktp,tds->kdsp", share, self._carried)
        return _Change(share=share, carried=carry, force=force)

    def _stage(
        self,
        loads: Loads,
        row: int,
        relaxed: Relaxed,
        sideways: Floats,
        own: _Change,
        on_board: _Change,
    ) -> tuple[Floats, Floats, Floats]:
        """Change of an equilibrium's motion, (V, 3, P), the board's, (6, P), and the reactions'.

        Touches push by `sideways`, (K, 2), and their own force down; forces that follow no motion
        change on the sheet by `own`, on the board by `on_board`.
        """
        first, board, held = relaxed.displacements[row], relaxed.board[row], loads.held[row]
        rest, (at_rest, board_at_rest) = self._equilibrium.rest, self._rest_change
        press = self._equilibrium.one_press(loads, row)
        place = self._equilibrium.tangent.at(first, board)
        top = self.lattice.loaded.ravel()
        covered = isinstance(self.grip, Covered)
        arms = np.tensordot(loads.shares[row], self._carried, axes=1)
        pushed = np.concatenate([sideways, loads.force[row, :, 2:]], axis=1)
        right, turn = _by_stiffness(self.lattice, place, own.force.shape[-1])
        right, turn = -right, -turn
        axes = self.lattice.loaded_axes
        right[top] += np.einsum("tid,ktp,kd->tip", axes, own.share, pushed)
        right[top] += np.einsum("tid,kt,kdp->tip", axes, loads.shares[row], own.force)
        turn += np.einsum("kdb,kdp->bp", arms, on_board.force)
        turn += np.einsum("kdbp,kd->bp", own.carried, pushed)
        there = self.lattice.at_tops(first - rest.motion)[:, :2]
        gap = -np.einsum("ktp,td->kdp", own.share, there)
        if not covered:
            gap -= np.einsum("kdbp,b->kdp", own.carried[:, :2], board - rest.board)
        by_spring = gap[..., -len(STIFFNESSES) :]
        local = self.lattice.at_tops(at_rest)[:, :2]
        by_spring += np.einsum("kt,tdp->kdp", loads.shares[row], local)
        if not covered:
            by_spring += np.einsum("kdb,bp->kdp", arms[:, :2], board_at_rest)
        moved, carry, reactions = constrained_solve(
            self._equilibrium.tangent,
            place,
            press,
            right,
            turn,
            gap[held].reshape(-1, gap.shape[-1]),
        )
        change = np.zeros_like(gap)
        change[held] = reactions.reshape(-1, *change.shape[1:])
        return moved, carry, change

    def _cut_change(
        self, asked: Floats, normal: Floats, change: Floats, pressing: Floats
    ) -> Floats:
        """Change of `_cut`, (K, 2, P), with its first, (K, 2, P), and second, (K, P), argument."""
        if not isinstance(self.grip, Sliding):
            return change
        most, amount = -self.grip.friction * normal, np.hypot(asked[:, 0], asked[:, 1])
        slides = amount > most
        along = (asked[slides] / amount[slides, None])[:, :, None]
        across = change[slides] - along * (along * change[slides]).sum(axis=1, keepdims=True)
        cut = change.copy()
        cut[slides] = across * (most[slides] / amount[slides])[:, None, None]
        cut[slides] -= self.grip.friction * along * pressing[slides, None]
        return cut

    def _loads(self, touches: Touches) -> Loads:
        """Patches of the touches, and compliance of what they hold on to."""
        rows, places = touches.force.shape[:2]
        check_on_skin(self.design, touches)
        covered = isinstance(self.grip, Covered)
        shares = shares_by(self.contact, self.design, touches).reshape(rows, places, -1)
        arms = np.tensordot(shares, self._carried, axes=1)
        reach = np.zeros((rows, 2 * places, 6))
        if not covered:
            reach = arms[:, :, :2].reshape(reach.shape)
        held = (touches.force[..., 2] < 0) & (not isinstance(self.grip, Frictionless))
        on_board = np.einsum("bkds,bkd->bs", arms, touches.force)
        return Loads(shares=shares, force=touches.force, held=held, on_board=on_board, reach=reach)

    def _solve(self, loads: Loads, tolerance: float, start: Floats | None) -> _Answer:
        """Equilibrium of the straight press, then with the drags."""
        relax = partial(self._equilibrium.relax, tolerance=tolerance)
        drag, normal = loads.force[..., :2], loads.force[..., 2:]
        if start is not None:
            start = start + self._equilibrium.rest.motion
        if isinstance(self.grip, Frictionless):
            free = relax(loads, start=start)
            return _Answer(free, drag, free)
        upright = loads._replace(force=loads.force * [0.0, 0.0, 1.0])
        if isinstance(self.grip, Covered):
            straight = relax(upright, start=start)
            return _Answer(straight, straight.reaction, straight)
        arms = np.tensordot(loads.shares, self._carried, axes=1)
        upright = upright._replace(on_board=np.einsum("bkds,bkd->bs", arms, upright.force))
        straight = relax(upright, start=start)
        sideways = self._cut(straight.reaction + drag, normal[..., 0])
        again = (sideways != straight.reaction).any(axis=(1, 2))
        again &= straight.residual <= tolerance
        if not again.any():
            return _Answer(straight, sideways, straight)
        dead = np.concatenate([sideways, normal], axis=-1)
        pushed = np.einsum("bkds,bkd->bs", arms, dead)
        freed = loads._replace(force=dead, held=np.zeros_like(loads.held), on_board=pushed)
        dragged = relax(
            Loads._make(part[again] for part in freed), start=straight.displacements[again]
        )
        final = Relaxed._make(part.copy() for part in straight)
        for part, moved in zip(final, dragged, strict=True):
            part[again] = moved
        final.iterations[again] += straight.iterations[again]
        return _Answer(straight, sideways, final)

    def _counts(self, final: Relaxed, tolerance: float) -> Bools:
        """Whether answers are equilibria within what the columns can do, (B,)."""
        sunk = self.lattice.sunk(final.displacements)
        unbroken = (sunk < _DEEPEST * self.lattice.supports.height).all(axis=1)
        return np.asarray((final.residual <= tolerance) & unbroken)

    def _cut(self, sideways: Floats, normal: Floats) -> Floats:
        """Sideways forces, (..., 2), cut to what friction holds under `normal`, (...), N."""
        if not isinstance(self.grip, Sliding):
            return sideways
        most, amount = -self.grip.friction * normal, np.hypot(sideways[..., 0], sideways[..., 1])
        share = np.divide(most, amount, out=np.ones_like(amount), where=amount > most)
        return np.asarray(sideways * share[..., None])


def _by_stiffness(lattice: Lattice, place: Place, count: int) -> tuple[Floats, Floats]:
    """Change of the inner forces with each kind of spring, relative, last of P, (V, 3, P), N.

    The second answer is that of the forces on the board, (6, P).
    """
    bars, panels, creases, _, stops = place.blocks.pushes
    kinds = (*place.blocks.by_column, stops, creases, panels, bars)
    by_kind = np.zeros((*lattice.nodes.shape, count))
    by_kind[..., -len(kinds) :] = np.stack(kinds, axis=-1)
    on_board = np.zeros((6, count))
    on_board[:, -len(kinds) + STIFFNESSES.index("stop")] = place.blocks.board_push
    return by_kind, on_board
