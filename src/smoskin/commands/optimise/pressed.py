"""Signals about touches of one force, straight from the twin, and their bound without a table.

A sheet on its columns is pressed once; whatever magnets then hang on it, over whatever chips, are
read from the same presses. Decides which presses it takes, how slopes follow from them, as
differences of presses so near to each other that the field is straight between them, and what of
a signal counts as unknown besides the chips' noise.
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
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.records import Motion
from smoskin.sensing.response.bound import BoundMap, bound_of_slopes, information
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import Deviations, made_mechanics
from smoskin.twin.readout import Readout

Places = tuple[int, int]
"""Numbers of places along x and y, from rim to rim."""
_STEP: Final = 0.25e-3
"""Step to either side of a place, m: a sixteenth of a fingertip, over which shares bend."""
_PUSH: Final = 10e-3
"""Step of a force, N: two hundredths of the usual touch."""
_TOLERANCE: Final = 1e-7
"""Tolerance of equilibria: a ten-thousandth of the smallest difference that is taken."""
_RATED: Final = (5, 7)
"""Places of the rated presses: rims, corners and the middle are among them."""
_GAP: Final = 5.5e-3
"""Gap of the reference design, m, for which the unknown share of signals is given."""


class PressedSheet:
    """A sheet under touches without drag at some places, N, and under the rated ones at others.

    The design's magnets and chips play no part here; a made skin deviates from it. It raises an
    `ArgumentError` if the force is not positive or there are fewer than two places along an axis,
    and a `MissingExtraError` if the extra ``twin`` is not installed.
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
        extent = geometry(design).extent
        self.x, self.y = (np.linspace(0.0, end, n) for end, n in zip(extent, places, strict=True))
        where, push, self._spans = _near(extent, places_to_the_rim(extent, places), force)
        hard_where, hard_push = rated_touches(places_to_the_rim(extent, rated_places))
        touches = Touches(
            position=np.concatenate([where, hard_where])[:, None],
            force=np.concatenate([push, hard_push])[:, None],
        )
        self._near = len(where)
        lattice, board = None, None
        if deviations is not None:
            lattice, board = made_mechanics(design, deviations, REFERENCE_TEMPERATURE)
        solver = BarHinge(design, lattice=lattice, board=board)
        pressed = solver.press(touches, tolerance=_TOLERANCE)
        self._displacements, self._board = pressed.displacements, pressed.board
        self._valid: Bools = pressed.converged & ~pressed.pulled
        near = pressed.displacements[self._near :]
        sunk = solver.lattice.sunk(near)
        self.sunk = float(np.max(sunk))
        """Farthest that a column is pressed down by a rated touch, m; NaN where one has no
        equilibrium."""
        self.pull = float(np.max(-sunk * solver.lattice.supports.axial))
        """Largest pull at a column's foot likewise, N."""
        self.bond = solver.lattice.bond_limit
        """Pull at which it leaves its base, N."""
        self.margin = float(pressed.buckling_margin[self._near :].min())
        """Least buckling load of a column over its load likewise."""
        stops = solver.lattice.stops
        moved = near[:, stops.nodes]
        self.sway = float(np.max((moved * stops.normal).sum(axis=-1), initial=0.0))
        """Farthest that a rim column sways outward over the board likewise, m."""
        self.free_sway = float(np.min(stops.free, initial=np.inf))
        """Sway at which it meets the frame, m."""

    def stands(self) -> bool:
        """Whether every touch has an equilibrium with all columns on their bases."""
        return bool(self._valid.all())

    def rated(self, design: SkinDesign) -> Motion:
        """Motion of this design's magnets under the rated touches."""
        return self._motion(design, slice(self._near, None))

    def slopes(self, design: SkinDesign) -> tuple[Floats, Floats]:
        """Signals of the chips of a design with this sheet, and their slopes, at every place.

        Signals less those of the untouched skin, (L, W, C), T; slopes (L, W, C, 5), T/m and T/N, as
        `smoskin.sensing.response.bound.bound_of_slopes` takes them.
        """
        motion = self._motion(design, slice(0, self._near))
        readout = Readout(design, self.deviations)
        signals = readout.risen(motion).reshape(8, *self.shape, -1)
        rises = [signals[0] - signals[1], signals[2] - signals[3], *(signals[5:] - signals[4])]
        spans = self._spans.reshape(5, *self.shape, 1)
        return signals[4], np.stack([r / s for r, s in zip(rises, spans, strict=True)], axis=-1)

    def _motion(self, design: SkinDesign, rows: slice) -> Motion:
        """Motion of this design's magnets in some of the states."""
        holders = holder_matrix(design)
        moved, valid = self._displacements[rows], self._valid[rows]
        flat = moved.reshape(len(moved), -1) @ holders.reshape(-1, moved[0].size).T
        motion = Motion(magnets=flat.reshape(len(moved), -1, 6), board=self._board[rows])
        return motion.where(valid)


def design_information(design: SkinDesign, sheet: PressedSheet, unmodelled: float) -> Floats:
    """Information of a design's signals at every place, (L, W, 5, 5)."""
    signals, slopes = sheet.slopes(design)
    noise = signal_noise(design) + unknown_of(design, signals, unmodelled)
    return information(slopes, noise)


def unknown_of(design: SkinDesign, signals: Floats, unmodelled: float) -> Floats:
    """Covariance of what is not known of signals (..., C), shape (..., C, C), T^2."""
    gaps = np.array([site.gap for site in design.halls])
    share = unmodelled * np.repeat((_GAP / gaps) ** 2, 3)
    return np.asarray((share * signals)[..., None] ** 2 * np.eye(len(share)))


def design_bound(
    design: SkinDesign,
    made: Deviations | None = None,
    *,
    force: float = 0.5,
    drags: bool = True,
    places: Places = (13, 17),
) -> BoundMap:
    """The bound of a design, or of one made skin of it, that has no response table.

    Touches have this normal force, N, and no drag; `drags` says whether drags are unknown too. It
    raises an `ArgumentError` if force or places are not positive, or a touch has no equilibrium.
    """
    sheet = PressedSheet(design, made, force=force, places=places, rated_places=(2, 2))
    slopes = sheet.slopes(design)[1]
    if not np.isfinite(slopes).all():
        raise ArgumentError(f"force must leave the skin an equilibrium everywhere; got {force} N")
    return bound_of_slopes(sheet.x, sheet.y, slopes, signal_noise(design), drags=drags)


def rated_touches(where: Floats) -> tuple[Floats, Floats]:
    """Places (5 B, 2) and forces (5 B, 3) of the rated press, alone and with the rated drag."""
    s = RATED_SHEAR
    drags = np.array([[0.0, 0.0], [s, 0.0], [-s, 0.0], [0.0, s], [0.0, -s]])
    push = np.concatenate([drags, np.full((len(drags), 1), -RATED_PRESS)], axis=1)
    return np.tile(where, (len(push), 1)), np.repeat(push, len(where), axis=0)


def _near(extent: Floats, at: Floats, force: float) -> tuple[Floats, Floats, Floats]:
    """Eight touches for each place, (8 B, ...), and what five differences of them span, (5, B).

    To either side in x and in y, the place itself, then with a little more of each force.
    """
    where, push = np.tile(at, (8, 1, 1)), np.tile([0.0, 0.0, -force], (8, len(at), 1))
    spans = np.tile([[0.0], [0.0], [_PUSH], [_PUSH], [-_PUSH]], len(at))
    for axis in range(2):
        ahead, behind = where[2 * axis, :, axis], where[2 * axis + 1, :, axis]
        ahead[:] = np.minimum(ahead + _STEP, extent[axis])
        behind[:] = np.maximum(behind - _STEP, 0.0)
        spans[axis] = ahead - behind
    for axis in range(3):
        push[5 + axis, :, axis] += spans[2 + axis]
    return where.reshape(-1, 2), push.reshape(-1, 3), spans
