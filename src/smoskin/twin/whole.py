"""The digital twin of a skin: any touch becomes what the chips read, by the whole folded sheet.

Decides how contacts, the sheet's nonlinear equilibrium (`smoskin.mechanics.sheet.model`) and
magnets on their holders join. Hides the solvers, one a temperature, and what they remember between
live touches. `smoskin.twin.reduced` answers the same by the SI's closed forms.
"""

import functools
import logging
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, check_temperature
from smoskin.mechanics.sheet.contact import ContactLaw, contact_of, shares_by
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.touches import Grip, Sticking, Touches, check_on_skin, touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Motion
from smoskin.twin.manufacture import Deviations, Tolerances, as_designed, drawn_skin, made_mechanics
from smoskin.twin.readout import MagneticSkin, Readout
from smoskin.twin.surroundings import Surroundings

if TYPE_CHECKING:
    from smoskin.mechanics.sheet.model import BarHinge, Pressed

_LOG = logging.getLogger(__name__)
_LIVE_TOLERANCE = 1e-6
"""Relative residual of a live touch: a nanometre, far below what a chip can see."""
_SLOTS = 2
"""Live touches for which the solver is compiled at once; more are filled to a power of two."""
_NO_TOUCH = Contact(position=(0.0, 0.0), force=(0.0, 0.0, 0.0))
_REMEMBERED = 8
"""Live states: what is shown runs a few readings behind what is read."""
_SOLVERS = 4
"""Temperatures at which the solver is kept."""


class _State(NamedTuple):
    """One equilibrium of the sheet."""

    displacements: Floats
    """(V, 3), m: how far each vertex has moved over the board from rest."""
    motion: Motion
    """The magnets and the board in it."""


@final
class Twin(MagneticSkin):
    """A virtual skin of the whole folded sheet, as designed or as manufactured.

    Parameters
    ----------
    seed : int or None
        Seed of the made skin and, apart from it, of the chips' noise: the same seed gives the
        same skin and the same readings. None gives ideal chips: no noise, no quantisation, no
        limits.
    manufactured : bool
        Whether to draw one skin from the tolerances, `Tolerances()` by default.
    deviations : Deviations, optional
        A skin that is drawn already, which goes before both.
    grip : Grip, optional
        How touches hold on to the skin; by default they stick.
    contact : ContactLaw, optional
        Which vertices take a touch; by default that of the made skin, or else as
        `smoskin.mechanics.sheet.model.BarHinge` has it.

    Raises
    ------
    ArgumentError
        If a skin is to be drawn without a seed.
    ContractError
        If the contact law breaks its role, here or at a later touch.
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

    @typed
    def __init__(
        self,
        design: SkinDesign,
        *,
        seed: Seed | None = 0,
        manufactured: bool = False,
        tolerances: Tolerances | None = None,
        grip: Grip | None = None,
        contact: ContactLaw | None = None,
        surroundings: Surroundings | None = None,
        deviations: Deviations | None = None,
    ) -> None:
        if manufactured and seed is None:
            raise ArgumentError("seed must be a whole number to draw a manufactured skin; got None")
        _, of_noise = np.random.SeedSequence(seed).spawn(2)
        self.design = design
        if deviations is not None:
            self.deviations = deviations
        elif manufactured and seed is not None:
            self.deviations = drawn_skin(design, seed, tolerances)
        else:
            self.deviations = as_designed(design)
        _LOG.info("%s skin of %r, seed %s", "made" if manufactured else "ideal", design.name, seed)
        self.noise = None if seed is None else np.random.default_rng(of_noise)
        holders = holder_matrix(design)
        self._holders = holders.reshape(-1, holders.shape[2] * 3).T.copy()
        self._sheet = geometry(design).sheet
        self._grip: Grip = grip or Sticking()
        own = contact_of(self._grip) if self.deviations.contact is None else self.deviations.contact
        self.contact = own if contact is None else contact
        """Which vertices take a touch."""
        self._solver = functools.lru_cache(maxsize=_SOLVERS)(self._build_solver)
        self._rest = self._solver(REFERENCE_TEMPERATURE).rest.displacements
        hung = (self._rest.ravel() @ self._holders).reshape(-1, 6)
        self.readout = Readout(design, self.deviations, surroundings, rest=hung)
        self._states: deque[tuple[object, _State]] = deque(maxlen=_REMEMBERED)

    def check(self, contacts: Sequence[Contact]) -> None:
        """As `VirtualSkin.check`."""
        check_on_skin(self.design, touches_of([contacts]))

    def prepare(self) -> None:
        """Compile what one or two live touches need: some seconds, once in a process.

        Without it the first straight touch and the first drag take that long.
        """
        place = geometry(self.design).tops[0, 0]
        for drag in (0.0, 1e-3):
            self.motion([Contact(position=place, force=(drag, 0.0, -1e-3))])

    def forget(self) -> None:
        """As `MagneticSkin.forget`: solutions start from rest again."""
        self._states.clear()

    @typed
    def motion(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Motion:
        """As `VirtualSkin.motion`; invalid where no equilibrium was found.

        Contacts that are held cost nothing; from others the solution starts where the last ended.
        """
        return self._state(contacts, temperature).motion

    @typed
    def motions(self, touches: Touches, *, temperature: float = REFERENCE_TEMPERATURE) -> Motion:
        """As `VirtualSkin.motions`; invalid where no equilibrium was found."""
        return self._motion_of(self._solver(temperature).press(touches))

    def sheet_vertices(
        self, contacts: Sequence[Contact] = (), *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Floats:
        """As `VirtualSkin.sheet_vertices`."""
        moved = self._state(contacts, temperature).displacements
        return self._sheet.vertices + self._rest + moved

    def depths(
        self, contacts: Sequence[Contact], *, temperature: float = REFERENCE_TEMPERATURE
    ) -> Floats:
        """As `VirtualSkin.depths`: the mean over each contact's patch."""
        moved = self._state(contacts, temperature).displacements[self._sheet.loaded]
        sunk = -(moved * geometry(self.design).axes[self._sheet.loaded][..., 2]).sum(axis=-1)
        shares = shares_by(self.contact, self.design, touches_of([contacts]))[0]
        return np.asarray(np.einsum("knm,nm->k", shares, sunk))

    def _state(self, contacts: Sequence[Contact], temperature: float) -> _State:
        """Equilibrium under live contacts; those held or just held are not solved again."""
        solver = self._solver(temperature)
        key = (temperature, *((*c.position.tolist(), *c.force.tolist()) for c in contacts))
        remembered = tuple(self._states)  # at one stroke: others may be reading the skin too
        for solved, state in remembered:
            if solved == key:
                return state
        slots = max(_SLOTS, 1 << (len(contacts) - 1).bit_length())
        live = touches_of([[*contacts, *[_NO_TOUCH] * (slots - len(contacts))]])
        if live.pressed.any():
            start = remembered[-1][1].displacements[None] if remembered else None
            pressed = solver.press(live, tolerance=_LIVE_TOLERANCE, start=start)
            state = _State(pressed.displacements[0], self._motion_of(pressed)[0])
        else:
            still = Motion.rest(len(self.design.magnets))
            state = _State(np.zeros_like(self._sheet.vertices), still)
        self._states.append((key, state))
        return state

    def _motion_of(self, pressed: "Pressed") -> Motion:
        """Magnets on their holders; valid at rest with every column unbent on its base."""
        moved = pressed.displacements.reshape(len(pressed.board), -1) @ self._holders
        motion = Motion(magnets=moved.reshape(len(moved), -1, 6), board=pressed.board)
        stands = ~pressed.pulled & (pressed.buckling_margin >= 1.0)
        return motion.where(pressed.converged & stands)

    def _build_solver(self, temperature: float) -> "BarHinge":
        """The solver with the rubber at this temperature."""
        from smoskin.mechanics.sheet.model import BarHinge

        degrees = float(check_temperature(temperature))
        lattice, board = made_mechanics(self.design, self.deviations, degrees)
        return BarHinge(
            self.design, lattice=lattice, board=board, grip=self._grip, contact=self.contact
        )
