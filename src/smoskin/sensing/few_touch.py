"""Calibration of one skin from a few labelled touches, and where to touch it next.

Skins of a design differ in the modes of its response table, each with a weight that is normal
before anything is known. A labelled touch measures a mix of them, so that the weights' posterior
is linear regression; the calibrated table is the likeliest one, its modes what is still open. The
next touch is the one that tells most: whose signals' logarithm of variance over noise is largest.
"""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats, frozen
from smoskin.errors import ArgumentError
from smoskin.magnetics.material import REFERENCE_TEMPERATURE
from smoskin.sensing.response import ResponseTable

DEFAULT_COUNT: Final = 60
"""Touches of a calibration."""
_ROUNDS: Final = 4
"""In which weights and misfit are found from each other."""
_LEAST: Final = 0.25
"""By which the misfit may shrink in one of them."""
_FAINT: Final = 0.1
"""Of the strongest signal's squared answers, those that say little."""
_PLACES: Final = (13, 17)
"""Where a touch may be proposed, from rim to rim."""


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
    gain: float
    """Nats that it is expected to tell about the skin."""


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
    slopes = table.slopes(touches.position, touches.force)
    off = np.array([touches.place_spread] * 2 + [touches.force_spread] * 3) ** 2
    noise = noise + np.einsum("nck,k,ndk->ncd", slopes, off, slopes)
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
    mean = table.mean + np.tensordot(weights, table.modes, 1)
    return replace(
        table,
        mean=mean,
        coupling=table.coupling * _growth(table, mean)[:, None, None],
        modes=np.tensordot(root.T, table.modes, 1),
        misfit=stretch[:, None] * table.misfit * stretch,
    )


def _growth(table: ResponseTable, mean: Floats) -> Floats:
    """By which each signal's coupling of two touches grows with its single answers, (2, C).

    What one touch adds because another holds the sheet is a drag; what their product adds comes
    from the field's curvature, as the square of one force does.
    """
    order = table.basis.exponents
    drags = order[:, :2].sum(axis=1) * (order.sum(axis=1) == 1) > 0
    squares = (order == (0, 0, 2)).all(axis=1)
    growth = np.ones((2, table.count))
    for row, kind in enumerate((drags, squares)):
        old, new = (one[:, :, kind].reshape(-1, table.count) for one in (table.mean, mean))
        size = (old**2).sum(axis=0)
        # A signal that hardly answers so cannot say by how much: it keeps the design's.
        least = _FAINT * size.max()
        growth[row] = ((old * new).sum(axis=0) + least) / (size + least) if least else 1.0
    return growth


def next_touch(
    table: ResponseTable, noise: Floats, *, force: float = 0.8, drag: float = 0.3
) -> Target:
    """The touch that tells most about what a table leaves open.

    Parameters
    ----------
    table : ResponseTable
        Whose modes are what is open: the design's, or one calibrated with the touches so far.
    noise : Floats, shape (C, C)
        T^2: covariance of the signals' noise.
    force, drag : float
        N: largest normal and sideways force that the rig may use.

    Raises
    ------
    ArgumentError
        If the force is not positive or the drag negative.
    """
    return plan_touches(table, 1, noise, force=force, drag=drag)[0]


def plan_touches(
    table: ResponseTable,
    count: int,
    noise: Floats,
    *,
    force: float = 0.8,
    drag: float = 0.3,
) -> list[Target]:
    """As many touches, each the one that tells most after those before it.

    What a touch tells does not depend on what it reads, so that all can be planned beforehand.

    Raises
    ------
    ArgumentError
        If count or force are not positive or the drag is negative.
    """
    if count < 1 or not force > 0 or not drag >= 0:
        raise ArgumentError(
            f"count and force must be positive and drag >= 0; got {count}, {force}, {drag}"
        )
    lines = [np.linspace(0, end, n) for end, n in zip(table.basis.extent, _PLACES, strict=True)]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    pushes = [(0.0, 0.0, -force), (0.0, 0.0, -force / 2.5)]
    if drag:
        pushes += [(drag, 0.0, -force), (-drag, 0.0, -force), (0.0, drag, -force),
                   (0.0, -drag, -force)]  # fmt: skip
    places = np.tile(grid, (len(pushes), 1))
    forces = np.repeat(np.array(pushes), len(grid), axis=0)
    ways = table.mode_signals(places, forces)
    squared = (forces**2).sum(axis=1)[:, None, None]
    white = np.linalg.inv(np.linalg.cholesky(noise + squared * table.misfit))
    ways = ways @ np.swapaxes(white, 1, 2)
    spread = np.eye(len(table.modes))
    targets = []
    for _ in range(count):
        inner = np.einsum("bkc,kl,bld->bcd", ways, spread, ways, optimize=True)
        gains = 0.5 * np.linalg.slogdet(np.eye(table.count) + inner)[1]
        best = int(gains.argmax())
        targets.append(Target(places[best], forces[best], float(gains[best])))
        way = ways[best]
        along = spread @ way
        spread = spread - along @ np.linalg.solve(np.eye(table.count) + way.T @ along, along.T)
    return targets
