"""Calibration of one skin from a few labelled touches, and where to touch it next.

Skins of a design differ in the modes of its response table, each with a weight that is normal
before anything is known. A labelled touch measures a mix of them, so that the weights' posterior
is linear regression; the calibrated table is the likeliest one, its modes what is still open. The
next touch is the one after which straight touches all over the skin are located and weighed best.
"""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats, frozen
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.origami.layout import places_to_the_rim
from smoskin.sensing.response.fit import table_curvature
from smoskin.sensing.response.table import ResponseTable

DEFAULT_COUNT: Final = 60
"""Touches of a calibration."""
_ROUNDS: Final = 4
"""In which weights and misfit are found from each other."""
_LEAST: Final = 0.25
"""By which the misfit may shrink in one of them."""
_PLACES: Final = (13, 17)
"""Where a touch may be proposed, from rim to rim."""
_LIGHT: Final = 0.4
"""Of the largest force, that of the lighter presses which may be proposed."""
_NEAR: Final = 2e-3
"""m within which a place is not touched again while there are others."""
_SAME: Final = 1e-6
"""m or N within which two touches are one."""
_LARGE: Final = 0.6
"""Of the largest that a signal may become, from which it is suspected to have ended a range."""
_FINE: Final = 1e-9
"""T within which two signals are one."""
_JUDGED: Final = (9, 11)
"""Places whose touches shall be told well."""
_TYPICAL: Final = 0.5
"""N, of those touches."""
_WEIGHT: Final = 0.05
"""m for which an error of the whole force counts: half a millimetre for one per cent."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelledTouches:
    """N touches of known place and force with what the chips read.

    Raises
    ------
    ArgumentError
        If shapes disagree, a number is not finite, or a touch does not press.
    """

    position: Floats
    """(N, 2), m."""
    force: Floats
    """(N, 3), N, on the skin."""
    signals: Floats
    """(N, S, 3), T, as `ResponseTable` defines them; of the table's chips."""
    temperature: Floats
    """(N,), degC, of the rubber."""
    place_spread: float
    """m: standard deviation of the labels' places along each axis."""
    force_spread: float
    """N: standard deviation of the labels' forces along each axis."""

    def __init__(
        self,
        *,
        position: ArrayLike,
        force: ArrayLike,
        signals: ArrayLike,
        temperature: ArrayLike = REFERENCE_TEMPERATURE,
        place_spread: float = 0.0,
        force_spread: float = 0.0,
    ) -> None:
        where = frozen("position", position, (None, 2))
        push = frozen("force", force, (len(where), 3))
        said = floats("signals", signals, (None, 3))
        said = frozen("signals", said, (len(where), None, 3))
        degrees = np.broadcast_to(floats("temperature", temperature), len(where))
        for name, values in (("position", where), ("force", push), ("signals", said)):
            if not np.isfinite(values).all():
                raise ArgumentError(f"{name} must be finite; got NaN or infinity")
        if not (push[:, 2] < 0).all():
            raise ArgumentError("force must press, with z < 0 N, in every labelled touch")
        if not (0 <= place_spread < np.inf and 0 <= force_spread < np.inf):
            raise ArgumentError(
                f"place_spread and force_spread must be finite and >= 0; got {place_spread} m and "
                f"{force_spread} N"
            )
        object.__setattr__(self, "place_spread", float(place_spread))
        object.__setattr__(self, "force_spread", float(force_spread))
        object.__setattr__(self, "position", where)
        object.__setattr__(self, "force", push)
        object.__setattr__(self, "signals", said)
        object.__setattr__(self, "temperature", frozen("temperature", degrees, (len(where),)))

    def __len__(self) -> int:
        return len(self.position)


class Target(NamedTuple):
    """A touch to make."""

    position: Floats
    """(2,), m."""
    force: Floats
    """(3,), N."""
    error: float
    """m: expected distance of a located touch from its true place once this one is made; root mean
    square over the skin, of straight touches of 0.5 N."""


def calibrate_touches(
    table: ResponseTable, touches: LabelledTouches, noise: Floats
) -> ResponseTable:
    """The table of the skin that was touched.

    Parameters
    ----------
    table : ResponseTable
        Of the design, with modes; or one that has been calibrated and shall be so further.
    touches : LabelledTouches
    noise : Floats, shape (C, C)
        T^2: covariance of the signals' noise.

    Returns
    -------
    ResponseTable
        Its modes are what the touches left open.

    Raises
    ------
    ArgumentError
        If the touches have another number of chips, or there are none.
    """
    if not len(touches) or touches.signals.shape[1] != len(table.chips):
        raise ArgumentError(
            f"touches must be at least one, with {len(table.chips)} chips; got {len(touches)} "
            f"with {touches.signals.shape[1]}"
        )
    said = touches.signals.reshape(len(touches), -1)
    left = said - table.signals(touches.position, touches.force, touches.temperature)
    ways = table.mode_signals(touches.position, touches.force)
    squared = (touches.force**2).sum(axis=1)
    # Labels that are off shift the signals along their slopes.
    off = np.array([touches.place_spread] * 2 + [touches.force_spread] * 3) ** 2
    noise = noise + _label_noise(table, touches.position, touches.force, off)
    stretch = np.ones(table.count)
    for _ in range(_ROUNDS):
        misfit = stretch[:, None] * table.misfit * stretch
        sure = np.linalg.inv(noise + squared[:, None, None] * misfit)
        spread = np.linalg.inv(
            np.eye(len(table.modes)) + np.einsum("nkc,ncd,nld->kl", ways, sure, ways, optimize=True)
        )
        weights = spread @ np.einsum("nkc,ncd,nd->k", ways, sure, left, optimize=True)
        missed = left - np.einsum("k,nkc->nc", weights, ways)
        # What the fit leaves, and what it would leave of touches that it has not seen.
        open_still = np.einsum("nkc,kl,nlc->nc", ways, spread, ways, optimize=True)
        expected = np.einsum("ncc->nc", noise) + squared[:, None] * np.diag(misfit)
        short = ((missed**2 + open_still) / expected).mean(axis=0)
        stretch *= np.sqrt(np.maximum(short, _LEAST))
        stretch = np.maximum(stretch, 1.0)
    # The root of the covariance mixes the old modes into new ones of one deviation each.
    power, mixes = np.linalg.eigh(spread)
    root = mixes * np.sqrt(np.maximum(power, 0.0))
    found = replace(
        table,
        mean=table.mean + np.tensordot(weights, table.modes, 1),
        grip=table.grip + np.tensordot(weights, table.grip_modes, 1),
    )
    # How a chip's field bends shows in single touches as well.
    bent = table_curvature(found) - table_curvature(table)
    return replace(
        found,
        curvature=table.curvature + bent,
        modes=np.tensordot(root.T, table.modes, 1),
        grip_modes=np.tensordot(root.T, table.grip_modes, 1),
        misfit=stretch[:, None] * table.misfit * stretch,
    )


class TouchPlanner:
    """Where a skin is to be touched next so that touches on it are told well.

    Parameters
    ----------
    table : ResponseTable
        Whose modes are what is open: the design's, or one calibrated with earlier touches.
    noise : Floats, shape (C, C)
        T^2: covariance of the signals' noise.
    force, drag : float
        N: largest normal and sideways force that the rig may use.
    place_spread, force_spread : float
        m and N: standard deviations of the rig's places and forces along each axis; by default
        those of a good stage and gauge.

    Raises
    ------
    ArgumentError
        If the table has no modes, the force is not positive, or another number is negative.

    Notes
    -----
    The weights of the modes shift an estimate by a linear map: least squares of the signals on
    place and force, weighed by noise and misfit. The next touch is the one that takes most off the
    mean square of those shifts. It does not depend on what touches read.
    """

    def __init__(
        self,
        table: ResponseTable,
        noise: Floats,
        *,
        force: float = 0.8,
        drag: float = 0.3,
        place_spread: float = 20e-6,
        force_spread: float = 2e-3,
    ) -> None:
        if not force > 0 or not min(drag, place_spread, force_spread) >= 0:
            raise ArgumentError(
                f"force must be positive, drag and spreads >= 0; got {force}, {drag}, "
                f"{place_spread} and {force_spread}"
            )
        if not len(table.modes):
            raise ArgumentError("table must have modes, in which made skins differ; got none")
        self._table = table
        self._noise = noise
        self._off = np.array([place_spread] * 2 + [force_spread] * 3) ** 2
        grid = places_to_the_rim(table.basis.extent, _PLACES)
        pushes = [(0.0, 0.0, -force), (0.0, 0.0, -_LIGHT * force)]
        if drag:
            pushes += [(drag, 0.0, -force), (-drag, 0.0, -force),
                       (0.0, drag, -force), (0.0, -drag, -force)]  # fmt: skip
        self._places = np.tile(grid, (len(pushes), 1))
        self._forces = np.repeat(np.array(pushes), len(grid), axis=0)
        self._allowed = np.ones(len(self._places), dtype=bool)
        self._harder, self._new = ~self._allowed, self._allowed.copy()
        said = table.signals(self._places, self._forces)
        self._moved = np.concatenate([said, -said], axis=1)
        self._failed: list[Floats] = []
        self._reached = np.full(2 * table.count, -np.inf)
        self._ways = self._whitened(self._places, self._forces)
        self._spread = np.eye(len(table.modes))
        shifts, self._floor = _shifts(table, noise)
        # Only the shifts' squares count: as many columns as modes hold them.
        power, axes = np.linalg.eigh(np.tensordot(shifts, shifts, ([0, 2], [0, 2])))
        self._aim = axes * np.sqrt(np.maximum(power, 0.0))
        at = np.tensordot(shifts[:, :, :2], shifts[:, :, :2], ([0, 2], [0, 2])) / len(shifts)
        self._open_place = at
        # Of each candidate: what is open of its signals, and how that goes with the aim.
        across = np.swapaxes(self._ways, 1, 2)
        self._inner = across @ self._ways
        self._cross = across @ self._aim

    @property
    def error(self) -> float:
        """Expected distance of a located touch from its true place, m; as `Target.error`."""
        return self._error(self._spread)

    @property
    def exhausted(self) -> bool:
        """Whether every touch has been barred."""
        return not self._allowed.any()

    def next(self) -> Target:
        """The touch to make next.

        Raises
        ------
        ArgumentError
            If all have been barred.
        """
        if self.exhausted:
            raise ArgumentError("no touch is left that is not barred")
        told = np.eye(self._table.count) + self._inner
        gains = np.einsum("bce,bce->b", self._cross, np.linalg.solve(told, self._cross))
        # What the table misses at a place it misses there again: a new place tells more.
        new = self._allowed & self._new
        best = int(np.where(new if new.any() else self._allowed, gains, -np.inf).argmax())
        left = self._spread - self._taken(self._ways[best])
        return Target(self._places[best], self._forces[best], self._error(left))

    def made(self, position: ArrayLike, force: ArrayLike) -> None:
        """A touch was made, (2,) m and (3,) N, and its signals are known."""
        where, push = floats("position", position, (2,))[None], floats("force", force, (3,))[None]
        way = self._whitened(where, push)[0]
        told = np.linalg.cholesky(np.eye(self._table.count) + way.T @ self._spread @ way)
        taken = np.linalg.solve(told, way.T @ self._spread).T
        self._spread = self._spread - taken @ taken.T
        across = np.swapaxes(self._ways, 1, 2) @ taken
        self._inner -= across @ np.swapaxes(across, 1, 2)
        self._cross -= across @ (taken.T @ self._aim)
        self._new &= np.hypot(*(self._places - where).T) > _NEAR
        said = self._table.signals(where, push)[0]
        self._reached = np.maximum(self._reached, np.concatenate([said, -said]))
        if self._failed:
            self._allow()

    def bar(self, target: Target) -> None:
        """Propose neither this touch again nor one that may fail as it did: a chip cannot read it.

        A harder touch at its place will fail as well; and so may any that moves one of its large
        signals further the same way, unless a touch that was made has moved that signal as far.
        """
        here = np.hypot(*(self._places - target.position).T) < _SAME
        harder = np.linalg.norm(self._forces, axis=1) >= np.linalg.norm(target.force) - _SAME
        self._harder |= here & harder
        said = self._table.signals(target.position[None], target.force[None])[0]
        self._failed.append(np.concatenate([said, -said]))
        self._allow()

    def _allow(self) -> None:
        """Find again which touches may be proposed."""
        self._allowed = ~self._harder
        for failed in self._failed:
            suspect = failed > np.maximum(self._reached, _LARGE * self._moved.max(axis=0))
            self._allowed &= ~(self._moved[:, suspect] >= failed[suspect] - _FINE).any(axis=1)

    def _whitened(self, places: Floats, forces: Floats) -> Floats:
        """Modes' signals of touches over what spoils them, (B, K, C)."""
        table = self._table
        squared = (forces**2).sum(axis=1)[:, None, None]
        spoilt = (
            self._noise + squared * table.misfit + _label_noise(table, places, forces, self._off)
        )
        white = np.linalg.inv(np.linalg.cholesky(spoilt))
        return np.asarray(table.mode_signals(places, forces) @ np.swapaxes(white, 1, 2))

    def _taken(self, way: Floats) -> Floats:
        """What a touch takes off the weights' covariance."""
        along = self._spread @ way
        told = np.eye(self._table.count) + way.T @ along
        return np.asarray(along @ np.linalg.solve(told, along.T))

    def _error(self, spread: Floats) -> float:
        return float(np.sqrt(self._floor + np.sum(self._open_place * spread)))


def next_touch(
    table: ResponseTable, noise: Floats, *, force: float = 0.8, drag: float = 0.3
) -> Target:
    """The touch that tells most about what a table leaves open; see `TouchPlanner`.

    Raises
    ------
    ArgumentError
        As `TouchPlanner`.
    """
    return TouchPlanner(table, noise, force=force, drag=drag).next()


def plan_touches(
    table: ResponseTable,
    count: int,
    noise: Floats,
    *,
    force: float = 0.8,
    drag: float = 0.3,
    place_spread: float = 20e-6,
    force_spread: float = 2e-3,
) -> list[Target]:
    """As many touches, each the one that tells most after those before it.

    What a touch tells does not depend on what it reads, so that all can be planned beforehand.

    Raises
    ------
    ArgumentError
        If the count is not positive, and as `TouchPlanner`.
    """
    if count < 1:
        raise ArgumentError(f"count must be positive; got {count}")
    planner = TouchPlanner(
        table,
        noise,
        force=force,
        drag=drag,
        place_spread=place_spread,
        force_spread=force_spread,
    )
    targets = []
    for _ in range(count):
        targets.append(planner.next())
        planner.made(targets[-1].position, targets[-1].force)
    return targets


def _label_noise(table: ResponseTable, places: Floats, forces: Floats, off: Floats) -> Floats:
    """Covariance of signals from labels that are off by these variances (5,), (B, C, C)."""
    if not off.any():
        return np.zeros((len(places), table.count, table.count))
    slopes = table.slopes(places, forces)
    return np.asarray(np.einsum("nck,k,ndk->ncd", slopes, off, slopes))


def _shifts(table: ResponseTable, noise: Floats) -> tuple[Floats, float]:
    """How each mode shifts estimates all over the skin, and their error without any.

    Returns
    -------
    shifts : Floats, shape (E, K, 3)
        m, of x, of y, and of the normal force as `_WEIGHT` weighs it.
    floor : float
        m^2, mean square of the place's error.
    """
    places = places_to_the_rim(table.basis.extent, _JUDGED)
    force = np.array([0.0, 0.0, -_TYPICAL])
    unknown = [0, 1, 4]
    slopes = table.point_table().scan(places[:, 0], places[:, 1], force)[1][:, unknown]
    sure = np.linalg.inv(noise + _TYPICAL**2 * table.misfit)
    known = np.diag([*12 / table.basis.extent**2, 0.0])
    spread = np.linalg.inv(slopes @ sure @ np.swapaxes(slopes, 1, 2) + known)
    solves = spread @ slopes @ sure
    solves[:, 2] *= _WEIGHT / _TYPICAL
    ways = table.mode_signals(places, np.tile(force, (len(places), 1)))
    return ways @ np.swapaxes(solves, 1, 2), float(np.einsum("eii->e", spread[:, :2, :2]).mean())
