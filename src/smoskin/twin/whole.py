"""The digital twin of a skin: any touch becomes what the chips read, by the whole folded sheet.

Decides how the parts join: contacts to the sheet's nonlinear equilibrium
(`smoskin.mechanics.sheet.model`), vertices to magnets on their holders, motion to readings; and
what
of a made skin's deviations goes into which part. Hides the solver and what it remembers between
live touches. `smoskin.twin.reduced` answers the same by the SI's closed forms.
"""

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.mlx90393 import HallSample
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, check_temperature
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.touches import Grip, Sticking, Touches, patch_shares, touches_of
from smoskin.origami.sheet import build_sheet
from smoskin.records import Contact, Reading
from smoskin.twin.manufacture import Tolerances, as_designed, draw, made_mechanics
from smoskin.twin.readout import Motion, Readout
from smoskin.twin.surroundings import Surroundings

if TYPE_CHECKING:
    from smoskin.mechanics.sheet.model import BarHinge, Pressed

_LIVE_TOLERANCE = 1e-6
"""Relative residual of a live touch: a nanometre, far below what a chip can see."""
_SLOTS = 2
"""Live touches for which the solver is compiled at once."""
_REMEMBERED = 8
"""Live states: what is shown runs a few readings behind what is read."""


class _State(NamedTuple):
    """Of one state."""

    displacements: Floats
    """(V, 3), m, over the board."""
    board: Floats
    """(3,), as in `Motion`."""
    valid: Bools
    """()."""


class Twin:
    """A virtual skin, as designed or as manufactured.

    Parameters
    ----------
    design : SkinDesign
    seed : int or None
        Of the made skin and, apart from it, of the chips' noise: the same seed gives the same
        skin and the same readings. None gives ideal chips: no noise, no quantisation, no limits.
    manufactured : bool
        Whether to draw one skin from the tolerances; by default it is as designed.
    tolerances : Tolerances, optional
        What a manufactured skin is drawn from; `Tolerances()` by default.
    grip : Grip, optional
        How touches hold on to the skin; by default they stick.
    surroundings : Surroundings, optional
        By default none.

    Raises
    ------
    ArgumentError
        If a skin is to be drawn without a seed.
    MissingExtraError
        If the extra ``twin`` is not installed.

    Examples
    --------
    >>> from smoskin.feasibility import load_design
    >>> twin = Twin(load_design("planar"), seed=0, manufactured=True)
    >>> reading = twin.read([Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5))])
    >>> reading.field.shape
    (3, 3)
    """

    def __init__(
        self,
        design: SkinDesign,
        *,
        seed: int | None = 0,
        manufactured: bool = False,
        tolerances: Tolerances | None = None,
        grip: Grip | None = None,
        surroundings: Surroundings | None = None,
    ) -> None:
        if manufactured and seed is None:
            raise ArgumentError("seed must be a whole number to draw a manufactured skin; got None")
        of_skin, of_noise = np.random.SeedSequence(seed).spawn(2)
        self.design = design
        self.deviations = (
            draw(design, np.random.default_rng(of_skin), tolerances)
            if manufactured
            else as_designed(design)
        )
        self._noise = None if seed is None else np.random.default_rng(of_noise)
        self._readout = Readout(design, self.deviations, surroundings)
        holders = holder_matrix(design)
        self._holders = holders.reshape(-1, holders.shape[2] * 3).T.copy()
        self._sheet = build_sheet(design.cell, design.cells)
        self._grip: Grip = grip or Sticking()
        self._solved_at = REFERENCE_TEMPERATURE
        self._solver = self._build_solver(REFERENCE_TEMPERATURE)
        self._held: deque[tuple[object, _State]] = deque(maxlen=_REMEMBERED)

    def check(self, contacts: Sequence[Contact]) -> None:
        """Raise unless the skin can be touched so.

        Raises
        ------
        ArgumentError
            If a contact lies off the skin, pulls at it, or is not finite.
        """
        patch_shares(self.design, touches_of([contacts]))

    def prepare(self) -> None:
        """Compile what one or two live touches need: some seconds, once in a process.

        Without it the first straight touch and the first drag take that long.
        """
        place = self._sheet.vertices[self._sheet.loaded[0, 0], :2]
        for drag in (0.0, 1e-3):
            self.motion([Contact(position=place, force=(drag, 0.0, -1e-3))])

    def motion(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Motion:
        """Where these contacts hold magnets and board.

        Contacts that are held cost nothing; from others the solution starts where the last ended.

        Parameters
        ----------
        contacts : sequence of Contact
            All that touches the skin now; none by default.
        temperature : float
            Of the rubber, degC.

        Returns
        -------
        Motion
            Of one state, without a batch axis. Invalid where no equilibrium was found.

        Raises
        ------
        ArgumentError
            If a contact lies off the skin or pulls at it, or the skin does not stand the
            temperature.
        """
        state = self._state(contacts, temperature)
        return self._motion_of(state.displacements, state.board, state.valid)

    def motions(self, touches: Touches, *, temperature: float = REFERENCE_TEMPERATURE) -> Motion:
        """Where each of many states of touch holds magnets and board; a batch (B,)."""
        pressed = self._at(temperature).press(touches)
        return self._motion_of(pressed.displacements, pressed.board, _is_valid(pressed))

    def field(self, motion: Motion, temperature: ArrayLike = REFERENCE_TEMPERATURE) -> Floats:
        """Of all magnets and the surroundings at all chips.

        Parameters
        ----------
        motion : Motion
            Of any batch of states.
        temperature : array_like, shape (...), optional
            Of the magnets, degC.

        Returns
        -------
        Floats, shape (..., S, 3)
            T, in the skin's frame; NaN in invalid states.
        """
        return self._readout.field(motion, temperature)

    def sample(
        self,
        motion: Motion,
        rng: np.random.Generator,
        *,
        temperature: ArrayLike = REFERENCE_TEMPERATURE,
    ) -> HallSample:
        """One conversion of every chip in each of many states, with this generator's noise."""
        return self._readout.sample(motion, rng, temperature)

    def sense(
        self,
        motion: Motion,
        *,
        time: float = 0.0,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Reading:
        """What the chips read in one state; of an invalid one, `ChipFlag.INVALID`.

        Parameters
        ----------
        motion : Motion
        time : float
            The reading's time, s.
        temperature : float
            Of magnets and chips, degC.
        """
        return self._readout.read(motion, self._noise, time=time, temperature=temperature)

    def read(
        self,
        contacts: Sequence[Contact] = (),
        *,
        time: float = 0.0,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Reading:
        """What the chips read under these contacts, once the skin has come to rest.

        Raises
        ------
        ArgumentError
            As `motion`.
        """
        held = self.motion(contacts, temperature=temperature)
        return self.sense(held, time=time, temperature=temperature)

    def sheet_vertices(self, contacts: Sequence[Contact] = ()) -> Floats:
        """Vertices of the deformed sheet over the board, shape (V, 3), m."""
        return self._sheet.vertices + self._state(contacts, self._solved_at).displacements

    def patch_depths(self, contacts: Sequence[Contact]) -> Floats:
        """How far the skin under each contact has sunk, shape (K,), m; positive is down."""
        state = self._state(contacts, self._solved_at)
        shares = patch_shares(self.design, touches_of([contacts]))[0]
        sunk = -state.displacements[self._sheet.loaded, 2]
        return np.asarray(np.einsum("knm,nm->k", shares, sunk))

    def _state(self, contacts: Sequence[Contact], temperature: float) -> "_State":
        """Equilibrium under live contacts; those held or just held are not solved again."""
        solver = self._at(temperature)
        key = (temperature, *((*c.position.tolist(), *c.force.tolist()) for c in contacts))
        held = tuple(self._held)  # at one stroke: others may be reading the skin too
        for known, state in held:
            if known == key:
                return state
        live = touches_of([[*contacts, *_fillers(len(contacts))]])
        start = held[-1][1].displacements[None] if held else None
        if live.pressed.any():
            pressed = solver.press(live, tolerance=_LIVE_TOLERANCE, start=start)
            state = _State(
                pressed.displacements[0], pressed.board[0], np.asarray(_is_valid(pressed)[0])
            )
        else:
            patch_shares(self.design, live)
            still = np.zeros_like(self._sheet.vertices)
            state = _State(still, np.zeros(3), np.array(True))
        self._held.append((key, state))
        return state

    def _motion_of(self, displacements: Floats, board: Floats, valid: Bools) -> Motion:
        """Magnets on their holders, from the vertices of any batch."""
        flat = displacements.reshape(*board.shape[:-1], -1)
        magnets = (flat @ self._holders).reshape(*board.shape[:-1], -1, 6)
        return Motion(
            magnets=np.where(valid[..., None, None], magnets, np.nan),
            board=np.where(valid[..., None], board, np.nan),
            valid=np.asarray(valid),
        )

    def _at(self, temperature: float) -> "BarHinge":
        """The solver with the rubber at this temperature."""
        if temperature != self._solved_at:
            self._solver = self._build_solver(temperature)
            self._solved_at = temperature
        return self._solver

    def _build_solver(self, temperature: float) -> "BarHinge":
        from smoskin.mechanics.sheet.model import BarHinge

        degrees = float(check_temperature(temperature))
        made, lattice = made_mechanics(self.design, self.deviations, degrees)
        return BarHinge(made, lattice=lattice, grip=self._grip)


def _is_valid(pressed: "Pressed") -> Bools:
    """Where there is an equilibrium in which every column still stands on its base."""
    return pressed.converged & ~pressed.pulled


def _fillers(count: int) -> list[Contact]:
    """Touches of no force that make `count` a power of two, so that few shapes compile."""
    slots = max(_SLOTS, 1 << (count - 1).bit_length())
    return [Contact(position=(0.0, 0.0), force=(0.0, 0.0, 0.0))] * (slots - count)
