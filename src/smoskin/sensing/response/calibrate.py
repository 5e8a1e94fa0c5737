"""Calibration of one skin from a few labelled touches, and where to touch it next.

A labelled touch measures a mix of the modes in which skins of a design differ: linear regression.
The calibrated table is the likeliest one, its modes what is still open. Decides which touches are
proposed and what is made of them; equations: "Calibration by a few touches" and "The next touch"
in `docs/derivations.md`.
"""

from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, assign, floats, freeze
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.origami.geometry import places_to_the_rim
from smoskin.sensing.response.fit import table_curvature
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.loops import Loops

_ROUNDS: Final = 4
"""Rounds in which weights and misfit are found from each other."""
_LINEAR: Final = 4
"""Times that signals are made linear in the modes' weights, by which places warp."""
_WARPED: Final = (0.25, 0.5, 1.0)
"""Factors on how far laws of contact may be off, of which the likeliest is taken."""
_LEAST: Final = 0.25
"""Smallest factor on the misfit's variance in a round."""
_PLACES: Final = (17, 23)
"""Places where a touch may be proposed, from rim to rim."""
_LIGHT: Final = 0.4
"""Force of the lighter presses that may be proposed, over the largest."""
_ON_BOARD: Final = 0.01
"""Share of the largest coupling below which a chip reads none: it watches the board."""
_NEAR: Final = 2e-3
"""Distance within which a place is not touched again while there are others, m."""
_SAME: Final = 1e-6
"""Distance, m, or force, N, within which two touches are one."""
_LARGE: Final = 0.6
"""Share of a signal's largest value from which it may have ended a chip's range."""
_FINE: Final = 1e-9
"""Difference within which two signals are one, T."""
_JUDGED: Final = (11, 14)
"""Places whose touches shall be estimated well."""
_TYPICAL: Final = 0.5
"""Press of those touches, N."""
_WEIGHT: Final = 0.05
"""Distance for which an error of the whole force counts, m: half a millimetre for 1 %."""


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
    temperature: Floats = field(default_factory=lambda: np.array(REFERENCE_TEMPERATURE))
    """Rubber temperature, (N,) or one for all, degC."""
    place_spread: float = 0.0
    """Standard deviation of the labels' places along each axis, m."""
    force_spread: float = 0.0
    """Standard deviation of the labels' forces along each axis, N."""
    left: float = 0.0
    """Root mean square of what a touch leaves in each signal once it is gone, T; 0: unknown."""
    loops: Loops | None = None
    """Loops of the signals that were undone; None: none were."""

    def __post_init__(self) -> None:
        freeze(self, position=(None, 2))
        count = len(self.position)
        degrees = floats("temperature", self.temperature)
        if not degrees.ndim:
            assign(self, temperature=np.full(count, degrees))
        freeze(self, force=(count, 3), signals=(count, None, 3), temperature=(count,))
        for name in ("position", "force", "signals", "temperature"):
            if not np.isfinite(getattr(self, name)).all():
                raise ArgumentError(f"{name} must be finite; got NaN or infinity")
        if not (self.force[:, 2] < 0).all():
            raise ArgumentError("force must press, with z < 0 N, in every labelled touch")
        if not all(0 <= spread < np.inf for spread in (self.place_spread, self.force_spread)):
            raise ArgumentError(
                f"place_spread and force_spread must be finite and >= 0; got {self.place_spread} m "
                f"and {self.force_spread} N"
            )
        if not 0 <= self.left < np.inf:
            raise ArgumentError(f"left must be finite and >= 0; got {self.left} T")

    def __len__(self) -> int:
        return len(self.position)


class Target(NamedTuple):
    """A touch to make."""

    position: Floats
    """(2,), m."""
    force: Floats
    """(3,), N."""
    error: float
    """Expected distance of a located touch from its true place once this one is made, m; root mean
    square over the skin, of straight touches of 0.5 N."""


def calibrate_touches(
    table: ResponseTable, touches: LabelledTouches, noise: Floats
) -> ResponseTable:
    """The likeliest table of the skin that was touched; its modes are what the touches left open.

    Parameters
    ----------
    table : ResponseTable
        Table of the design, with modes; or one that was calibrated and shall be so further.
    touches : LabelledTouches
    noise : Floats, shape (C, C)
        Covariance of the signals' noise, T^2.

    Raises
    ------
    ArgumentError
        If the touches have another number of chips, or there are none.

    Notes
    -----
    After the touches the modes' weights are ``N(w, P)``: ``P = (1 + sum_n M_n R_n^-1 M_n^T)^-1``
    and ``w = P sum_n M_n R_n^-1 (y_n - s_n)``, with ``R_n = N + J_n L J_n^T + |F_n|^2 D E D``. The
    diagonal D >= 1 makes the mean square of what each signal misses, and of what is open of it,
    what R says, where a mean is taken over N - 2: that of the variances that N touches may be of.
    Laws of contact are off by as much of their prior deviation, a quarter, a half or all of it, as
    makes the touches likeliest. The table is ``mean + sum_k w_k modes_k``, with modes
    ``sqrt(P) modes``; the coupling grows as the squares of single touches' signals do, and the
    curvature of the field of a chip that has none moves as far as that of single touches does.
    """
    if not len(touches) or touches.signals.shape[1] != len(table.chips):
        raise ArgumentError(
            f"touches must be at least one, with {len(table.chips)} chips; got {len(touches)} "
            f"with {touches.signals.shape[1]}"
        )
    priors = [table]
    if table.warp is None and table.warp_modes is not None:
        priors = [replace(table, warp_modes=factor * table.warp_modes) for factor in _WARPED]
    posteriors = [_posterior_weights(prior, touches, noise) for prior in priors]
    table, (weights, covariance, misfit, _) = max(
        zip(priors, posteriors, strict=True), key=lambda candidate: candidate[1].evidence
    )
    # The root of the covariance mixes the old modes into new ones of one deviation each.
    power, mixes = np.linalg.eigh(covariance)
    root = mixes * np.sqrt(np.maximum(power, 0.0))
    moved = table.moved(weights)
    moved = replace(
        moved,
        modes=np.tensordot(root.T, table.modes, 1),
        grip_modes=np.tensordot(root.T, table.grip_modes, 1),
        warp_modes=None if table.warp_modes is None else root.T @ table.warp_modes,
        misfit=misfit,
        residue=_residue(table, touches.left, noise),
        loops=touches.loops or table.loops,
    )
    # How a chip's field bends shows in single touches as well.
    bent = table_curvature(moved) - table_curvature(table)
    if table.coupling is not None:
        # A skin that yields so much more to one touch does so to both: a product of their motions.
        softer = moved.newton.diagonal() / table.newton.diagonal()
        moved = replace(moved, coupling=table.coupling * softer)
        # Of a chip over the sheet, single touches show what columns under load add likewise.
        size = np.abs(table.coupling).max(axis=(0, 1, 2, 3)).reshape(-1, 3).max(axis=1)
        bent[size > _ON_BOARD * size.max()] = 0.0
    return replace(moved, curvature=table.curvature + bent)


def _residue(table: ResponseTable, left: float, noise: Floats) -> float:
    """Share h of a newton's signals that touches leave, as far as no reading's noise hides it.

    The table's own where that is unknown, 0 T.
    """
    if not left:
        return table.residue
    variance = max(left**2 - float(np.trace(noise)) / table.count, 0.0)
    return float(np.sqrt(variance * table.count / np.trace(table.newton)))


class _Posterior(NamedTuple):
    """What touches tell of the modes' weights."""

    weights: Floats
    """w, (K,)."""
    covariance: Floats
    """P, (K, K)."""
    misfit: Floats
    """D E D, (C, C)."""
    evidence: float
    """Logarithm of the likelihood of all signals, but for a constant."""


def _posterior_weights(table: ResponseTable, touches: LabelledTouches, noise: Floats) -> _Posterior:
    """The posterior, by signals that are linear in the weights near those found before."""
    posterior = _linear_posterior(table, touches, noise, np.zeros(len(table.modes)))
    for _ in range(0 if table.warp_modes is None else _LINEAR - 1):
        posterior = _linear_posterior(table, touches, noise, posterior.weights)
    return posterior


def _linear_posterior(
    table: ResponseTable, touches: LabelledTouches, noise: Floats, near: Floats
) -> _Posterior:
    """The same where signals are linear in the weights near these, (K,)."""
    y = touches.signals.reshape(len(touches), -1)
    here = table.moved(near)
    residual = y - here.signals(touches.position, touches.force, touches.temperature)
    modes = here.mode_signals(touches.position, touches.force)
    residual = residual + np.einsum("k,nkc->nc", near, modes)
    squared = (touches.force**2).sum(axis=1)
    spreads = touches.place_spread, touches.force_spread
    noise = noise + label_noise(table, touches.position, touches.force, spreads)
    stretch = np.ones(table.count)
    for _ in range(_ROUNDS):
        misfit = stretch[:, None] * table.misfit * stretch
        precision = np.linalg.inv(noise + squared[:, None, None] * misfit)
        weighed = modes @ precision
        seen = np.tensordot(weighed, modes, ([0, 2], [0, 2]))
        covariance = np.asarray(np.linalg.inv(np.eye(len(seen)) + seen), dtype=np.float64)
        weights = covariance @ np.einsum("nkc,nc->k", weighed, residual)
        missed = residual - np.einsum("k,nkc->nc", weights, modes)
        # What the fit leaves, and what it would leave of touches that it has not seen.
        still_open = np.einsum("nkc,kl,nlc->nc", modes, covariance, modes, optimize=True)
        expected = np.einsum("ncc->nc", noise) + squared[:, None] * np.diag(misfit)
        ratio = ((missed**2 + still_open) / expected).sum(axis=0) / max(len(y) - 2, 1)
        stretch = np.maximum(stretch * np.sqrt(np.maximum(ratio, _LEAST)), 1.0)
    volume = np.linalg.slogdet(precision)[1].sum() + np.linalg.slogdet(covariance)[1]
    away = np.einsum("nc,ncd,nd->", residual, precision, residual)
    away -= weights @ np.einsum("nkc,nc->k", weighed, residual)
    misfit = stretch[:, None] * table.misfit * stretch
    return _Posterior(weights, covariance, misfit, float(volume - away) / 2)


class TouchPlanner:
    """Chooses where a skin is to be touched next so that touches on it are estimated well.

    Parameters
    ----------
    table : ResponseTable
        Its modes are what is open: the design's, or one calibrated with earlier touches.
    noise : Floats, shape (C, C)
        Covariance of the signals' noise, T^2.
    force, drag : float
        Largest normal and sideways force that the rig may use, N.
    place_spread, force_spread : float
        Standard deviations of the rig's places, m, and forces, N, along each axis; by default
        those of a good stage and gauge.

    Raises
    ------
    ArgumentError
        If the table has no modes, the force is not positive, or another number is negative.

    Notes
    -----
    The weights w of the modes shift an estimate by a linear map H w: least squares of the signals
    on place and force, weighed by noise and misfit. The next touch is the one that takes most off
    the mean square of those shifts, ``tr(A^T P A)`` with ``A A^T = mean(H^T H)``; with W its
    modes' signals in standard deviations, ``tr(A^T P W (1 + W^T P W)^-1 W^T P A)``. It does not
    depend on what touches read.
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
        self._table, self._noise = table, noise
        self._spreads = place_spread, force_spread
        self._places, self._forces = _candidates(table.basis.extent, force, drag)
        self._harder = np.zeros(len(self._places), dtype=bool)
        self._allowed, self._new = ~self._harder, ~self._harder
        self._signals = self._signed(self._places, self._forces)
        self._failed: list[Floats] = []
        self._reached = np.full(2 * table.count, -np.inf)
        self._modes = self._whitened(self._places, self._forces)
        self._covariance = np.eye(len(table.modes))
        shifts, self._floor = _shifts(table, noise)
        # Only the shifts' squares count: as many columns as modes hold them.
        power, axes = np.linalg.eigh(np.tensordot(shifts, shifts, ([0, 2], [0, 2])))
        self._aim = axes * np.sqrt(np.maximum(power, 0.0))
        place = shifts[:, :, :2]
        self._place_aim = np.tensordot(place, place, ([0, 2], [0, 2])) / len(shifts)
        across = np.swapaxes(self._modes, 1, 2)  # W^T P W and W^T P A of each candidate
        self._inner = across @ self._modes
        self._cross = across @ self._aim

    @property
    def error(self) -> float:
        """Expected distance of a located touch from its true place, m; as `Target.error`."""
        return self._error(self._covariance)

    @property
    def exhausted(self) -> bool:
        """Whether every touch has been barred."""
        return not self._allowed.any()

    def next(self) -> Target:
        """The touch to make next; `ArgumentError` if all have been barred."""
        if self.exhausted:
            raise ArgumentError("no touch is left that is not barred")
        seen = np.eye(self._table.count) + self._inner
        gains = np.einsum("bce,bce->b", self._cross, np.linalg.solve(seen, self._cross))
        # What the table misses at a place it misses there again: a new place tells more.
        new = self._allowed & self._new
        best = int(np.where(new if new.any() else self._allowed, gains, -np.inf).argmax())
        taken = self._taken(self._modes[best])
        left = self._error(self._covariance - taken @ taken.T)
        return Target(self._places[best], self._forces[best], left)

    def plan(self, count: int, until: float = 0.0) -> list[Target]:
        """So many next touches, each taken for made; fewer if `error` falls to so many metres.

        What a touch tells does not depend on what it reads, so that all can be planned beforehand.
        """
        if count < 1:
            raise ArgumentError(f"count must be positive; got {count}")
        targets: list[Target] = []
        while len(targets) < count and self.error > until:
            targets.append(self.next())
            self.made(targets[-1].position, targets[-1].force)
        return targets

    def made(self, position: ArrayLike, force: ArrayLike) -> None:
        """A touch was made, (2,) m and (3,) N, and its signals are known."""
        place, push = floats("position", position, (2,))[None], floats("force", force, (3,))[None]
        taken = self._taken(self._whitened(place, push)[0])
        self._covariance = self._covariance - taken @ taken.T
        across = np.swapaxes(self._modes, 1, 2) @ taken
        self._inner -= across @ np.swapaxes(across, 1, 2)
        self._cross -= across @ (taken.T @ self._aim)
        self._new &= np.hypot(*(self._places - place).T) > _NEAR
        self._reached = np.maximum(self._reached, self._signed(place, push)[0])
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
        self._failed.append(self._signed(target.position[None], target.force[None])[0])
        self._allow()

    def _allow(self) -> None:
        """Find again which touches may be proposed."""
        self._allowed = ~self._harder
        for failed in self._failed:
            suspect = failed > np.maximum(self._reached, _LARGE * self._signals.max(axis=0))
            self._allowed &= ~(self._signals[:, suspect] >= failed[suspect] - _FINE).any(axis=1)

    def _signed(self, places: Floats, forces: Floats) -> Floats:
        """Signals of touches, and their opposites: how far each goes either way, (B, 2 C), T."""
        signals = self._table.signals(places, forces)
        return np.concatenate([signals, -signals], axis=1)

    def _whitened(self, places: Floats, forces: Floats) -> Floats:
        """W, modes' signals of touches in standard deviations of what spoils them, (B, K, C)."""
        table = self._table
        squared = (forces**2).sum(axis=1)[:, None, None]
        labels = label_noise(table, places, forces, self._spreads)
        white = np.linalg.inv(np.linalg.cholesky(self._noise + squared * table.misfit + labels))
        return np.asarray(table.mode_signals(places, forces) @ np.swapaxes(white, 1, 2))

    def _taken(self, modes: Floats) -> Floats:
        """T, (K, C), by which a touch with W = modes, (K, C), lowers the covariance by T T^T."""
        along = modes.T @ self._covariance
        root = np.linalg.cholesky(np.eye(self._table.count) + along @ modes)
        return np.asarray(np.linalg.solve(root, along).T)

    def _error(self, covariance: Floats) -> float:
        return float(np.sqrt(self._floor + np.sum(self._place_aim * covariance)))


def _candidates(extent: Floats, force: float, drag: float) -> tuple[Floats, Floats]:
    """Places (B, 2) and forces (B, 3) of the touches that may be proposed."""
    pushes = [(0.0, 0.0, -force), (0.0, 0.0, -_LIGHT * force)]
    if drag:
        sideways = ((drag, 0.0), (-drag, 0.0), (0.0, drag), (0.0, -drag))
        pushes += [(x, y, -force) for x, y in sideways]
    grid = places_to_the_rim(extent, _PLACES)
    return np.tile(grid, (len(pushes), 1)), np.repeat(np.array(pushes), len(grid), axis=0)


def label_noise(
    table: ResponseTable, places: Floats, forces: Floats, spreads: tuple[float, float]
) -> Floats:
    """Covariance J L J^T of signals of labels whose places and forces spread so, (B, C, C)."""
    slopes = table.slopes(places, forces)
    variances = np.repeat(spreads, [2, 3]) ** 2
    return np.asarray((slopes * variances) @ np.swapaxes(slopes, 1, 2))


def expected_error(table: ResponseTable, noise: Floats, *, drag_spread: float = 0.3) -> float:
    """Expected distance of a located press of 0.5 N from its true place, m; root mean square.

    Its drags are taken as normal with this spread, N, as the estimator does; 0: known to be none.
    """
    shifts, floor = _shifts(table, noise, drag_spread)
    return float(np.sqrt(floor + (shifts[:, :, :2] ** 2).sum(axis=(1, 2)).mean()))


def _shifts(table: ResponseTable, noise: Floats, drag_spread: float = 0.0) -> tuple[Floats, float]:
    """Shifts H^T, m, of x, y and weighed force at E places, and the errors' floor, m^2.

    They have shape (E, K, 3), or (E, K, 5) with those of drags that may be any of this spread, N.
    """
    places = places_to_the_rim(table.basis.extent, _JUDGED)
    forces = np.tile([0.0, 0.0, -_TYPICAL], (len(places), 1))
    unknowns = [0, 1, 4, 2, 3] if drag_spread else [0, 1, 4]
    slopes = table.slopes(places, forces)[..., unknowns]
    weighed = np.swapaxes(slopes, 1, 2) @ np.linalg.inv(noise + _TYPICAL**2 * table.misfit)
    level = [*12 / table.basis.extent**2, 0.0]
    if drag_spread:
        level += [drag_spread**-2] * 2
    covariance = np.linalg.inv(weighed @ slopes + np.diag(level))
    estimates = covariance @ weighed
    estimates[:, 2] *= _WEIGHT / _TYPICAL
    shifts = table.mode_signals(places, forces) @ np.swapaxes(estimates, 1, 2)
    return shifts, float(np.einsum("eii->e", covariance[:, :2, :2]).mean())
