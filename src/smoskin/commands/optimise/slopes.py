"""What a skin's signals do about touches of one force, straight from the twin: values and slopes.

A sheet on its columns is pressed once; whatever magnets then hang on it, over whatever chips, are
read from the same presses. So a bound can be had of any design without a response table. Decides
which presses it takes and how slopes follow from them. Slopes are differences of presses so near
to each other that the field is straight between them; `exact_slopes` takes the solver's own
derivatives instead, which is slower.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.feasibility import RATED_PRESS, RATED_SHEAR
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.sensing.response.bound import BoundMap, bound_of_slopes
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import Deviations, made_mechanics
from smoskin.twin.readout import Readout

Places = tuple[int, int]
"""Along x and y, from rim to rim."""
_STEP: Final = 0.25e-3
"""m to either side of a place: a sixteenth of a fingertip's radius, over which shares bend."""
_PUSH: Final = 10e-3
"""N, more: two hundredths of the usual touch."""
_TOLERANCE: Final = 1e-7
"""Of equilibria: a ten-thousandth of the smallest difference that is taken."""
_TILT: Final = 0.05
"""Share of a derivative's motion over which `exact_slopes` takes the field's."""
_RATED: Final = (5, 7)
"""Where the rated presses are, by default: rims, corners and the middle are among them."""


class PressedSheet:
    """A sheet under the touches of a bound and under the rated ones.

    Parameters
    ----------
    design : SkinDesign
        Its magnets and chips play no part here.
    deviations : Deviations, optional
        Of a made skin; by default it is as designed.
    force : float
        N, normal, of the touches whose slopes are asked for; they have no drag.
    places : tuple of int
        Of those touches.
    rated_places : tuple of int
        Of the rated touches: the rated press alone, and with the rated drag in four directions.

    Raises
    ------
    ArgumentError
        If the force is not positive or there are fewer than two places along an axis.
    MissingExtraError
        If the extra ``twin`` is not installed.
    """

    def __init__(
        self,
        design: SkinDesign,
        deviations: Deviations | None = None,
        *,
        force: float = 0.5,
        places: Places = (13, 17),
        rated_places: Places = _RATED,
    ) -> None:
        if not force > 0 or min(*places, *rated_places) < 2:
            raise ArgumentError(
                f"force and places must be positive, with two places or more along each axis; got "
                f"{force} N, {places} and {rated_places}"
            )
        self.deviations, self.shape = deviations, places
        self.x, self.y = _lines(design, places)
        where, push, self._spans = _near(design, grid(design, places), force)
        hard_where, hard_push = rated_touches(grid(design, rated_places))
        self._near = len(where)
        if deviations is None:
            solver = BarHinge(design)
        else:
            made, lattice = made_mechanics(design, deviations, REFERENCE_TEMPERATURE)
            solver = BarHinge(made, lattice=lattice)
        pressed = solver.press(
            Touches(
                position=np.concatenate([where, hard_where])[:, None],
                force=np.concatenate([push, hard_push])[:, None],
            ),
            tolerance=_TOLERANCE,
        )
        feet = solver.lattice.feet
        self._displacements, self._board = pressed.displacements, pressed.board
        self._valid: Bools = pressed.converged & ~pressed.pulled
        sunk = -pressed.displacements[self._near :, feet, 2]
        self.sunk = float(np.max(sunk))
        """m: farthest that a column is pressed down by a rated touch; NaN where one has no
        equilibrium."""
        self.pull = float(np.max(-sunk * solver.lattice.ground[feet, 2]))
        """N: largest pull at a column's foot likewise."""
        self.bond = solver.lattice.bond_limit
        """N: pull at which it leaves its base."""

    def stands(self) -> bool:
        """Whether every touch has an equilibrium with all columns on their bases."""
        return bool(self._valid.all())

    def rated(self, design: SkinDesign) -> Motion:
        """Of this design's magnets under the rated touches."""
        return self._motion(design, slice(self._near, None))

    def slopes(self, design: SkinDesign) -> tuple[Floats, Floats]:
        """Signals of this design's chips, and their slopes, at every place.

        Parameters
        ----------
        design : SkinDesign
            With the same sheet, columns and frame.

        Returns
        -------
        signals : Floats, shape (L, W, C)
            T, less those of the untouched skin.
        slopes : Floats, shape (L, W, C, 5)
            T/m and T/N, as `smoskin.sensing.response.bound.bound_of_slopes` takes them.
        """
        motion = self._motion(design, slice(0, self._near))
        readout = Readout(design, self.deviations)
        said = readout.risen(motion).reshape(8, *self.shape, -1)
        rises = [said[0] - said[1], said[2] - said[3], *(said[5:] - said[4])]
        spans = self._spans.reshape(5, *self.shape, 1)
        return said[4], np.stack([r / s for r, s in zip(rises, spans, strict=True)], axis=-1)

    def _motion(self, design: SkinDesign, rows: slice) -> Motion:
        """Of this design's magnets in some of the states."""
        holders = holder_matrix(design)
        moved, valid = self._displacements[rows], self._valid[rows]
        flat = moved.reshape(len(moved), -1) @ holders.reshape(-1, moved[0].size).T
        motion = Motion(magnets=flat.reshape(len(moved), -1, 6), board=self._board[rows])
        return motion.where(valid)


def design_bound(
    design: SkinDesign,
    deviations: Deviations | None = None,
    *,
    force: float = 0.5,
    drags: bool = True,
    places: Places = (13, 17),
) -> BoundMap:
    """The bound of a design, or of one made skin of it, that has no response table.

    Parameters
    ----------
    design : SkinDesign
    deviations : Deviations, optional
        Of a made skin; by default it is as designed.
    force : float
        N, normal, of the touch; without drag.
    drags : bool
        Whether the drags are unknown too.
    places : tuple of int
        Along x and y.

    Raises
    ------
    ArgumentError
        As `PressedSheet`; also if a touch has no equilibrium.
    """
    sheet = PressedSheet(design, deviations, force=force, places=places, rated_places=(2, 2))
    slopes = sheet.slopes(design)[1]
    if not np.isfinite(slopes).all():
        raise ArgumentError(f"force must leave the skin an equilibrium everywhere; got {force} N")
    return bound_of_slopes(sheet.x, sheet.y, slopes, signal_noise(design), drags=drags)


def exact_slopes(design: SkinDesign, position: Floats, force: float = 0.5) -> Floats:
    """Slopes of the signals as designed at B places, (B, 2) m; shape (B, C, 5), T/m and T/N.

    Mechanics by the implicit function theorem; the field along them by central differences.
    """
    push = np.tile([0.0, 0.0, -force], (len(position), 1))
    solver = BarHinge(design)
    touches = Touches(position=position[:, None], force=push[:, None])
    pressed, rates = solver.press(touches, tolerance=1e-10), solver.sensitivity(touches)
    holders = holder_matrix(design)
    flat = holders.reshape(-1, pressed.displacements[0].size).T

    def magnets(displacements: Floats) -> Floats:
        joined = displacements.reshape(*displacements.shape[:-2], -1)
        return np.asarray((joined @ flat).reshape(*joined.shape[:-1], -1, 6))

    at, along = magnets(pressed.displacements), magnets(rates.displacements[:, 0])
    readout, slopes = Readout(design), []
    for k, span in enumerate(_TILT * np.array([1e-3, 1e-3, 0.1, 0.1, 0.1])):
        said = [
            readout.risen(
                Motion(
                    magnets=at + side * span * along[:, k],
                    board=pressed.board + side * span * rates.board[:, 0, k],
                )
            ).reshape(len(at), -1)
            for side in (1.0, -1.0)
        ]
        slopes.append((said[0] - said[1]) / (2 * span))
    return np.stack(slopes, axis=-1)


def grid(design: SkinDesign, places: Places) -> Floats:
    """Places from rim to rim, shape (L W, 2), m."""
    return np.stack(np.meshgrid(*_lines(design, places), indexing="ij"), axis=-1).reshape(-1, 2)


def rated_touches(where: Floats) -> tuple[Floats, Floats]:
    """Places (5 B, 2) and forces (5 B, 3) of the rated press, alone and with the rated drag."""
    s = RATED_SHEAR
    drags = np.array([[0.0, 0.0], [s, 0.0], [-s, 0.0], [0.0, s], [0.0, -s]])
    push = np.concatenate([drags, np.full((len(drags), 1), -RATED_PRESS)], axis=1)
    return np.tile(where, (len(push), 1)), np.repeat(push, len(where), axis=0)


def _lines(design: SkinDesign, places: Places) -> tuple[Floats, Floats]:
    """Of places along x and y, m."""
    extent = geometry(design).extent
    return np.linspace(0.0, extent[0], places[0]), np.linspace(0.0, extent[1], places[1])


def _near(design: SkinDesign, at: Floats, force: float) -> tuple[Floats, Floats, Floats]:
    """Eight touches for each place, (8 B, ...), and what five differences of them span, (5, B).

    To either side in x and in y, the place itself, then with a little more of each force.
    """
    extent = geometry(design).extent
    where, push = np.tile(at, (8, 1, 1)), np.tile([0.0, 0.0, -force], (8, len(at), 1))
    for row, axis, side in ((0, 0, 1), (1, 0, -1), (2, 1, 1), (3, 1, -1)):
        where[row, :, axis] = np.clip(at[:, axis] + side * _STEP, 0.0, extent[axis])
    more = np.array([_PUSH, _PUSH, -_PUSH])
    for axis in range(3):
        push[5 + axis, :, axis] += more[axis]
    spans = np.stack(
        [
            where[0, :, 0] - where[1, :, 0],
            where[2, :, 1] - where[3, :, 1],
            *np.broadcast_to(more[:, None], (3, len(at))),
        ]
    )
    return where.reshape(-1, 2), push.reshape(-1, 3), spans
