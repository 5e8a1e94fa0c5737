"""The whole folded sheet under touches: nonlinear statics of bars and hinges on columns.

Decides what a touch is to the sheet (a patch of loaded vertices that is held in the plane, slides
or is free), what carries the sheet (columns on a board that moves and turns on its pillars), and
which answers count.
"""

from dataclasses import dataclass, fields
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError

try:
    from smoskin.mechanics.sheet.equilibrium import Equilibrium, Loads, Relaxed
except ModuleNotFoundError as error:
    raise MissingExtraError("the nonlinear model of the whole sheet", "twin") from error

from smoskin.mechanics.reduced.stiffness import board_stiffness, yaw_stiffness
from smoskin.mechanics.sheet.contact import (
    ContactLaw,
    contact_of,
    probe_law,
    shares_by,
    slopes_by,
)
from smoskin.mechanics.sheet.continuation import constrained_solve
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
from smoskin.origami.geometry import geometry

STIFFNESSES: Final = tuple(part.name for part in fields(Springs))
"""Kinds of springs that `Sensitivity` knows, in its order."""
_DEEPEST: Final = 0.5
"""Share of the columns' height by which a foot may sink in an answer that counts."""
_PAD: Final = 1e-12
"""m/N: compliance of any touch by itself, so that two on one place share what they hold."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pressed:
    """Answers of the sheet to touches, one in each row."""

    displacements: Floats
    """(B, V, 3), m: motion of the vertices relative to the board; NaN where not converged."""
    board: Floats
    """(B, 3): motion of the board over its base along x and y, m, and its yaw, rad."""
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """Exact derivatives of the sheet's and the board's motion, one case in each row."""

    displacements: Floats
    """(B, K, 5, V, 3): derivatives by x and y, m/m, and by Fx, Fy and Fz, m/N, of each touch."""
    board: Floats
    """(B, K, 5, 3): the same derivatives of the board's x, y and yaw."""
    displacements_by_stiffness: Floats
    """(B, 6, V, 3), m: derivatives by the relative change of each kind of spring, `STIFFNESSES`."""
    board_by_stiffness: Floats
    """(B, 6, 3): the same derivatives of the board's motion."""


class _Answer(NamedTuple):
    """Equilibria of a case before and after the drags."""

    straight: Relaxed
    """Presses alone, patches held where the touches grip."""
    sideways: Floats
    """(B, K, 2), N: force in the plane that each touch then exerts on the sheet."""
    final: Relaxed
    """Equilibrium with them."""


class _Change(NamedTuple):
    """Derivatives of one case's touches by the P parameters of `Sensitivity`, one after another."""

    share: Floats
    """(K, T, P)."""
    arm: Floats
    """(K, 2, P)."""
    drag: Floats
    """(K, 2, P)."""
    normal: Floats
    """(K, P)."""


class BarHinge:
    """The nonlinear sheet of one design.

    A touch first presses straight: where it grips, the mean motion in the plane of its patch over
    the ground is zero, and what that takes is its reaction, counting what the board gives way.
    Its drag then comes on top of that reaction, as a load that follows no motion. With friction,
    the sum of both is cut to friction times normal force. Touches stick by default, and the lattice
    is `build_lattice(design)` unless one with its own springs is given. The contact law says which
    vertices take a touch: `CoverPanels` under cover panels, else `Bilinear`, unless one is given.
    It raises a `DesignError` if the sheet can move without resistance, a `ContractError` if the law
    breaks its role; its module a `MissingExtraError` without JAX.

    Notes
    -----
    Source: SI Figure S6 and Eqs. (S16), (S21) and (S25), their energies taken at any
    displacement; (S26) for the board, which stays level. It solves f_inner(u) = P'(F + r) with
    P u + G r = 0 for patches P that hold, G the board's compliance there; see
    docs/derivations_sheet.md.
    Valid for columns pressed by less than half their height; they neither buckle nor touch.
    """

    def __init__(
        self,
        design: SkinDesign,
        *,
        grip: Grip | None = None,
        lattice: Lattice | None = None,
        contact: ContactLaw | None = None,
    ) -> None:
        self.design = design
        self.grip: Grip = grip or Sticking()
        self.contact = contact_of(self.grip) if contact is None else contact
        probe_law(self.contact, design)
        self.lattice = lattice or build_lattice(design)
        self._equilibrium = Equilibrium(self.lattice)
        places = geometry(design)
        self._tops = places.tops.reshape(-1, 2) - places.extent / 2  # from the board's middle
        self._board = board_stiffness(design)
        self._yaw = yaw_stiffness(design)

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
        drag, feet = touches.force[..., :2], self.lattice.feet
        converged = self._counts(final, tolerance)
        pull = final.displacements[:, feet, 2] * self.lattice.ground[feet, 2]
        covered = isinstance(self.grip, Covered)
        on_board = drag if covered else sideways
        turn = (_turned(loads.shares @ self._tops) * on_board).sum(axis=(1, 2)) / self._yaw
        slide = on_board.sum(axis=1) / self._board
        excess = sideways - (0.0 if covered else drag)
        board = np.concatenate([slide, turn[:, None]], axis=-1)
        return Pressed(
            displacements=np.where(converged[:, None, None], final.displacements, np.nan),
            board=np.where(converged[:, None], board, np.nan),
            reaction=np.where(converged[:, None, None], excess, np.nan),
            residual=final.residual,
            iterations=final.iterations,
            converged=converged,
            pulled=(pull > self.lattice.bond_limit).any(axis=1) & converged,
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
        motion, board = np.full((rows, count, nodes, 3), np.nan), np.full((rows, count, 3), np.nan)
        for row in map(int, np.flatnonzero(self._counts(answer.final, tolerance))):
            moved, carried = self._derive(loads, answer, slopes[row], row)
            motion[row], board[row] = np.moveaxis(moved, -1, 0), carried.T
        by_touch = 5 * places
        return Sensitivity(
            displacements=motion[:, :by_touch].reshape(rows, places, 5, nodes, 3),
            board=board[:, :by_touch].reshape(rows, places, 5, 3),
            displacements_by_stiffness=motion[:, by_touch:],
            board_by_stiffness=board[:, by_touch:],
        )

    def _derive(
        self, loads: Loads, answer: _Answer, slopes: Floats, row: int
    ) -> tuple[Floats, Floats]:
        """Derivatives of one case's motion, (V, 3, P), and of the board's, (3, P)."""
        force, arms = loads.force[row], loads.shares[row] @ self._tops
        own = self._own_change(slopes)
        change = np.zeros_like(own.drag)
        if not isinstance(self.grip, Frictionless):
            moved, change = self._straight_change(loads, answer.straight, own, row)
        if isinstance(self.grip, Covered):
            sideways, change = force[:, :2], own.drag
        else:
            sideways, asked = answer.sideways[row], answer.straight.reaction[row] + force[:, :2]
            change = self._cut_change(asked, force[:, 2], change + own.drag, own.normal)
            place = self._equilibrium.tangent.at(answer.final.displacements[row])
            right = self._unbalance(loads, row, place, own, sideways, change)
            moved = self._equilibrium.tangent.solve(place, right)
        slide = change.sum(axis=0) / self._board
        turn = np.einsum("kd,kdp->p", _turned(arms), change)
        turn += np.einsum("kdp,kd->p", _turned(own.arm, axis=-2), sideways)
        return moved, np.concatenate([slide, turn[None] / self._yaw])

    def _own_change(self, slopes: Floats) -> _Change:
        """Change of the touches themselves with each parameter, from `slopes_by`, (K, 5, T)."""
        places, _, tops = slopes.shape
        count = 5 * places + len(STIFFNESSES)
        share = np.zeros((places, tops, count))
        drag, normal = np.zeros((places, 2, count)), np.zeros((places, count))
        for k in range(places):
            share[k, :, 5 * k : 5 * k + 5] = slopes[k].T
            drag[k, :, 5 * k + 2 : 5 * k + 4] = np.eye(2)
            normal[k, 5 * k + 4] = 1.0
        arm = np.einsum("ktp,td->kdp", share, self._tops)
        return _Change(share=share, arm=arm, drag=drag, normal=normal)

    def _straight_change(
        self, loads: Loads, straight: Relaxed, own: _Change, row: int
    ) -> tuple[Floats, Floats]:
        """Change of a straight press's motion, (V, 3, P), and of its reactions, (K, 2, P)."""
        first, reaction, held = straight.displacements[row], straight.reaction[row], loads.held[row]
        press = self._equilibrium.one_press(loads, row)
        place = self._equilibrium.tangent.at(first)
        gap = -np.einsum("ktp,td->kdp", own.share, first[self.lattice.loaded.ravel(), :2])
        if not isinstance(self.grip, Covered):
            turn, turned = _turned(own.arm, axis=-2), _turned(loads.shares[row] @ self._tops)
            gap -= np.einsum("kdp,le,le->kdp", turn, turned, reaction) / self._yaw
            gap -= np.einsum("kd,lep,le->kdp", turned, turn, reaction) / self._yaw
        change = np.zeros_like(gap)
        right = self._unbalance(loads, row, place, own, reaction, change)
        moved, reactions = constrained_solve(
            self._equilibrium.tangent, place, press, right, gap[held].reshape(-1, gap.shape[-1])
        )
        change[held] = reactions.reshape(-1, *change.shape[1:])
        return moved, change

    def _unbalance(
        self, loads: Loads, row: int, place: Place, own: _Change, sideways: Floats, change: Floats
    ) -> Floats:
        """Forces that unbalance the nodes when touches push by `sideways` and `change` more."""
        right = -_by_stiffness(self.lattice, place, change.shape[-1])
        pushed = np.concatenate([sideways, loads.force[row, :, 2:]], axis=1)
        more = np.concatenate([change, own.normal[:, None]], axis=1)
        top = self.lattice.loaded.ravel()
        right[top] += np.einsum("ktp,kd->tdp", own.share, pushed)
        right[top] += np.einsum("kt,kdp->tdp", loads.shares[row], more)
        return right

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
        link = np.broadcast_to(_PAD * np.eye(2 * places), (rows, 2 * places, 2 * places)).copy()
        if not covered:
            turned = _turned(shares @ self._tops).reshape(rows, 2 * places)
            link += np.kron(np.ones((places, places)), np.eye(2)) / self._board
            link += turned[:, :, None] * turned[:, None, :] / self._yaw
        held = (touches.force[..., 2] < 0) & (not isinstance(self.grip, Frictionless))
        return Loads(shares=shares, force=touches.force, held=held, link=link)

    def _solve(self, loads: Loads, tolerance: float, start: Floats | None) -> _Answer:
        """Equilibrium of the straight press, then with the drags."""
        relax = partial(self._equilibrium.relax, tolerance=tolerance)
        drag, normal = loads.force[..., :2], loads.force[..., 2:]
        if isinstance(self.grip, Frictionless):
            free = relax(loads, start=start)
            return _Answer(free, drag, free)
        straight = relax(loads._replace(force=loads.force * [0.0, 0.0, 1.0]), start=start)
        if isinstance(self.grip, Covered):
            return _Answer(straight, straight.reaction, straight)
        sideways = self._cut(straight.reaction + drag, normal[..., 0])
        again = (sideways != straight.reaction).any(axis=(1, 2))
        again &= straight.residual <= tolerance
        if not again.any():
            return _Answer(straight, sideways, straight)
        dead = np.concatenate([sideways, normal], axis=-1)
        freed = loads._replace(force=dead, held=np.zeros_like(loads.held))
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
        sunk = final.displacements[:, self.lattice.feet, 2]
        unbroken = (sunk > -_DEEPEST * self.lattice.stroke).all(axis=1)
        return np.asarray((final.residual <= tolerance) & unbroken)

    def _cut(self, sideways: Floats, normal: Floats) -> Floats:
        """Sideways forces, (..., 2), cut to what friction holds under `normal`, (...), N."""
        if not isinstance(self.grip, Sliding):
            return sideways
        most, amount = -self.grip.friction * normal, np.hypot(sideways[..., 0], sideways[..., 1])
        share = np.divide(most, amount, out=np.ones_like(amount), where=amount > most)
        return np.asarray(sideways * share[..., None])


def _by_stiffness(lattice: Lattice, place: Place, count: int) -> Floats:
    """Change of the inner forces with each kind of spring, relative, last of P, (V, 3, P), N."""
    bars, panels, creases, ground = place.inner
    frame = lattice.frame[:, None] * [1.0, 1.0, 0.0]
    part = np.divide(frame, lattice.ground, out=np.zeros_like(frame), where=lattice.ground > 0)
    of_frame = part * ground
    upright = ground * [0.0, 0.0, 1.0]
    kinds = (ground - upright - of_frame, upright, of_frame, creases, panels, bars)
    by_kind = np.zeros((*ground.shape, count))
    by_kind[..., -len(kinds) :] = np.stack(kinds, axis=-1)
    return by_kind


def _turned(arms: Floats, axis: int = -1) -> Floats:
    """Motion of points per angle of a turn about the middle; `axis` holds x and y."""
    x, y = np.moveaxis(arms, axis, 0)
    return np.stack([-y, x], axis=axis)
