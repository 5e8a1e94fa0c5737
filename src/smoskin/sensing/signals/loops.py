"""Hysteresis undone: from what a skin that remembers its touches reads to the elastic answer.

Decides how loops are learned from what touches leave behind, and how they are followed from
reading to reading. Hides the plays.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats, assign, floats, freeze
from smoskin.errors import ArgumentError

PLAYS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Plays that are learned, as shares of a signal's reach."""
_MOST: Final = 0.4
"""Sum of weights from which loops are too wide to be undone."""
_FIXED_POINTS: Final = 20
"""Steps of the fixed point, each of which leaves at most two thirds of an error."""
_ROUNDS: Final = 3
"""Rounds in which weights and elastic answers are found from each other."""
_STARTS: Final = (-0.8, -0.4, 0.0, 0.4, 0.8)
"""Starts of plays that are followed, as shares of their reach."""
_FINE: Final = 1e-7
"""Change, as a share of the reach, at which the fixed point ends."""
_CHANCE: Final = 1e-3
"""Chance to take noise for loops."""
_APART: Final = 0.02
"""Standard deviation of a chip's weights from those of all chips: creases and adhesive are alike,
and what a chip mixes of motions would else be taken for loops of its own."""
_FAINT: Final = 1e-3
"""Share of a motion's reach that counts as noise of what a touch leaves."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loops:
    """Hysteresis of C signals by K plays, the discrete Prandtl-Ishlinskii operator.

    What loses is motion: a chip's signals s show the magnet's as ``A s``. A motion reads
    ``y = (1 - sum_k w_k) x + sum_k w_k P_k[x]`` of the elastic x, with weights of its own or, as
    (K,), those of all, and with plays ``P_k(t) = max(x - r_k, min(x + r_k, P_k(t-)))`` and r_k a
    share of the motion's reach ("Loops" in `docs/derivations.md`).

    Raises
    ------
    ArgumentError
        If weights are negative or sum to 0.4 or more, or a reach is not positive.
    """

    weights: Floats
    """w_k of each motion, (K, C)."""
    plays: Floats
    """r_k as shares of the reach, (K,)."""
    reach: Floats
    """Largest motions, (C,), m; or T, where the signals themselves are taken for motions."""
    axes: Floats | None = None
    """A, motion of each chip's magnet by its signals, (S, 3, 3), m/T; None: signals are motions."""

    def __post_init__(self) -> None:
        freeze(self, reach=(None,))
        weights = np.asarray(self.weights)
        if weights.ndim == 1:
            assign(self, weights=np.repeat(weights[:, None], len(self.reach), axis=1))
        freeze(self, weights=(None, len(self.reach)))
        freeze(self, plays=(len(self.weights),))
        if self.axes is not None:
            freeze(self, axes=(len(self.reach) // 3, 3, 3))
        if not (self.weights >= 0).all() or not (self.weights.sum(axis=0) < _MOST).all():
            raise ArgumentError(
                f"weights must be >= 0 with a sum below {_MOST:g}; got {self.weights.tolist()}"
            )
        for name in ("plays", "reach"):
            if not (getattr(self, name) > 0).all():
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name).tolist()}")

    def as_json(self) -> dict[str, list[float]]:
        """Plain values, `reach` in m, `axes` in m/T."""
        names = ("weights", "plays", "reach", *(() if self.axes is None else ("axes",)))
        return {name: getattr(self, name).tolist() for name in names}

    @classmethod
    def from_json(cls, values: Mapping[str, Any] | None) -> "Loops | None":
        """The loops of plain values, None of none."""
        if values is None:
            return None
        return cls(**{name: values[name] for name in values})

    def of_signals(self, at: list[int]) -> "Loops":
        """The loops of these signals alone, of whole chips where motions are not the signals."""
        axes = None if self.axes is None else self.axes[np.array(at[::3]) // 3]
        return Loops(weights=self.weights[:, at], plays=self.plays, reach=self.reach[at], axes=axes)


def no_loops(signals: int) -> Loops:
    """A skin that remembers nothing, of so many signals."""
    return Loops(weights=np.zeros(0), plays=np.zeros(0), reach=np.ones(signals))


class Unlooping:
    """Undoes hysteresis, one reading after the other, from a skin whose past is unknown.

    A play may have begun anywhere: some that did are followed, until touches have moved them
    together.

    Examples
    --------
    >>> loops = Loops(weights=[0.1], plays=[0.2], reach=[1.0])
    >>> skin = Unlooping(loops)
    >>> [abs(round(float(skin.step(np.array([y]))[0]), 6)) for y in (0.98, 0.02)]
    [1.0, 0.0]
    """

    def __init__(self, loops: Loops) -> None:
        used = (loops.weights > 0).any(axis=1)
        self._weights = loops.weights[used]
        self._elastic = 1 - loops.weights.sum(axis=0)
        self._reach = loops.plays[used, None] * loops.reach
        self._fine = _FINE * loops.reach
        count = len(loops.reach)
        self._axes = np.eye(count) if loops.axes is None else _blocks(loops.axes)
        self._back = np.linalg.inv(self._axes)
        self.reset()

    def reset(self) -> None:
        """Forget all touches."""
        self._plays = np.multiply.outer(_STARTS, self._reach)
        self.zero()

    def zero(self) -> None:
        """Take signals against what the skin reads now, untouched, from here on."""
        self.offset = self._mean(np.clip(self._plays, -self._reach, self._reach))
        """What touches had left in the motions then, (C,), m."""
        self.rest()

    def rest(self) -> None:
        """Take what is unknown now for part of the zero."""
        self._rest = self._plays

    @property
    def covariance(self) -> Floats:
        """Covariance of elastic signals for what was unknown at the last rest, (C, C), T^2."""
        moved = self._plays - self._rest
        variance = (self._weights**2 * moved.var(axis=0)).sum(axis=0)
        return np.asarray((self._back * variance) @ self._back.T)

    def step(self, read: Floats) -> Floats:
        """Elastic signals (C,), T, behind those that are read."""
        read = self._axes @ read + self.offset
        elastic = read
        for _ in range(_FIXED_POINTS):
            mean = self._mean(self._moved(elastic))
            last, elastic = elastic, (read - mean) / self._elastic
            if (np.abs(elastic - last) < self._fine).all():
                break
        self._plays = self._moved(elastic)
        return np.asarray(self._back @ elastic)

    def _moved(self, elastic: Floats) -> Floats:
        """Plays that elastic motions (C,) take along."""
        return np.minimum(np.maximum(self._plays, elastic - self._reach), elastic + self._reach)

    def _mean(self, plays: Floats) -> Floats:
        """Mean of sum_k w_k P_k over all that may be, (C,)."""
        return np.asarray((self._weights * plays.mean(axis=0)).sum(axis=0))


def _blocks(axes: Floats) -> Floats:
    """Matrices of chips (S, 3, 3) as one of all signals, (C, C)."""
    whole = np.zeros((3 * len(axes), 3 * len(axes)))
    for chip, part in enumerate(axes):
        whole[3 * chip : 3 * chip + 3, 3 * chip : 3 * chip + 3] = part
    return whole


def learn_loops(rests: Floats, held: Floats, noise: Floats, axes: Floats | None = None) -> Loops:
    """The loops that explain what touches of one skin left behind.

    Parameters
    ----------
    rests, held : Floats, shape (N, C)
        Signals just before each touch and under it, T, touch after touch; freed of curvature and
        creep.
    noise : Floats, shape (C,)
        Standard deviation of the rests' noise, T.
    axes : Floats, shape (S, 3, 3), optional
        Motion of each chip's magnet by its signals, m/T; by default signals are motions.

    Notes
    -----
    At rest x = 0, so what is left is ``sum_k w_k P_k``, linear in the weights once the plays are
    known; these follow from the touches' x, which are found with the weights before. A chip's three
    signals have the same, near those that explain all chips. Weights that explain no more than
    noise might are none.
    """
    # Here, so that whoever only imports the package does not wait for it.
    from scipy.special import chdtri

    rests, held = floats("rests", rests, (None,)), floats("held", held, (None,))
    if axes is not None:
        whole = _blocks(axes)
        rests, held = rests @ whole.T, held @ whole.T
        noise = np.sqrt(whole**2 @ noise**2)
    plays, reach = np.array(PLAYS), np.abs(held).max(axis=0)
    rest_spread = np.hypot(noise, _FAINT * reach)
    widths = plays[:, None] * reach
    changes = np.diff(rests, axis=0) / rest_spread
    chips = np.arange(len(reach)).reshape(-1, 3)
    seen = [changes[:, chip].ravel() for chip in chips]
    weights, elastic = np.zeros(widths.shape), held
    for _ in range(_ROUNDS):
        state, left = np.zeros_like(widths), []
        for touch in elastic:
            state = np.clip(np.clip(state, touch - widths, touch + widths), -widths, widths)
            left.append(state)
        before = np.diff([np.zeros_like(widths), *left[:-1]], axis=0) / rest_spread
        moved = [np.swapaxes(before[..., chip], 1, 2).reshape(-1, len(plays)) for chip in chips]
        for chip, chip_weights, explained in zip(chips, *_pooled(moved, seen), strict=True):
            if explained < chdtri(len(plays), _CHANCE):
                chip_weights = np.zeros(len(plays))
            chip_weights = chip_weights * min(1.0, 0.99 * _MOST / max(chip_weights.sum(), 1e-12))
            weights[:, chip] = chip_weights[:, None]
        loops = Loops(weights=weights, plays=plays, reach=reach)
        elastic = elastic_signals(loops, rests, held)[1]
    return replace(loops, axes=axes)


def _pooled(moved: list[Floats], seen: list[Floats]) -> tuple[list[Floats], list[float]]:
    """Weights of each chip's plays, and by how much they explain more than noise, as chi-square.

    Chips' weights differ from those of all by `_APART`; a chip counts by how well plays explain it.
    """
    from scipy.optimize import nnls

    count = moved[0].shape[1]
    misfits = [nnls(plays, change)[1] for plays, change in zip(moved, seen, strict=True)]
    explained = [
        (float(change @ change) / max(misfit**2, 1e-300) - 1) * len(change)
        for change, misfit in zip(seen, misfits, strict=True)
    ]
    spreads = [
        max(misfit / len(change) ** 0.5, 1.0) for misfit, change in zip(misfits, seen, strict=True)
    ]
    rows = np.concatenate([plays / spread for plays, spread in zip(moved, spreads, strict=True)])
    whole = np.concatenate([change / spread for change, spread in zip(seen, spreads, strict=True)])
    of_all = nnls(rows, whole)[0]
    weights = []
    for plays, change, spread in zip(moved, seen, spreads, strict=True):
        tied = spread / _APART
        rows = np.concatenate([plays, tied * np.eye(count)])
        weights.append(nnls(rows, np.append(change, tied * of_all))[0])
    return weights, explained


def elastic_signals(loops: Loops, rests: Floats, held: Floats) -> tuple[Floats, Floats]:
    """Elastic signals (N, C), T, behind those at rest before each touch and under it."""
    skin = Unlooping(loops)
    elastic = [(skin.step(rest), skin.step(touch)) for rest, touch in zip(rests, held, strict=True)]
    return np.array([rest for rest, _ in elastic]), np.array([touch for _, touch in elastic])
