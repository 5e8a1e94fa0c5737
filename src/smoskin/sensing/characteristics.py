"""Figures by which tactile skins are compared, each a function of measured arrays.

Decides how each figure is defined and how sure it is. Signals may be in any unit; what is relative
has none. What numbers do not determine is NaN.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints, floats, frozen, wholes
from smoskin.errors import ArgumentError


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A figure with its standard deviation, in one unit."""

    value: float
    """NaN where the data do not determine it."""
    deviation: float
    """NaN where nothing tells it."""
    count: int
    """How many samples, touches or loops it is of."""


def mean_of(values: ArrayLike) -> Measured:
    """Mean of single figures, shape (N,), with its standard error; those that are NaN are left out.

    m = sum x / N, and s_m = sqrt(sum (x - m)^2 / (N (N - 1))), NaN of fewer than two.
    """
    known = frozen("values", values, (None,))
    known = known[np.isfinite(known)]
    if not len(known):
        return Measured(value=np.nan, deviation=np.nan, count=0)
    spread = float(known.std(ddof=1)) / len(known) ** 0.5 if len(known) > 1 else np.nan
    return Measured(value=float(known.mean()), deviation=spread, count=len(known))


def noise(readings: ArrayLike) -> Measured:
    """Noise of one reading of one axis at rest, in the unit of the readings, (N, K).

    sigma^2 = sum (b_{i+1} - b_i)^2 / (2 (N - 1)), its mean over the K axes: slow drift leaves it
    alone.

    Raises
    ------
    ArgumentError
        If there are fewer than three readings, or one is not finite.

    Notes
    -----
    The estimate's variance is (3 N - 4) / (N - 1)^2 sigma^4 (von Neumann, Kent, Bellinson and Hart,
    1941), of K axes a Kth of it.
    """
    values = frozen("readings", readings, (None, None))
    count, axes = values.shape
    if count < 3 or not np.isfinite(values).all():
        raise ArgumentError(f"readings must be finite and at least 3; got {count}")
    variance = float((np.diff(values, axis=0) ** 2).mean() / 2.0)
    relative = 0.5 * ((3 * count - 4) / (axes * (count - 1) ** 2)) ** 0.5
    sigma = variance**0.5
    return Measured(value=sigma, deviation=relative * sigma, count=count)


def slope(x: ArrayLike, y: ArrayLike) -> Measured:
    """Slope of the straight line through points, (N,) and (N,): sensitivity, or stiffness.

    y = a + b x by least squares; s_b^2 = sum r^2 / ((N - 2) sum (x - mean x)^2), NaN of two points.

    Raises
    ------
    ArgumentError
        If lengths differ, there are fewer than two points, or x does not vary.
    """
    along = frozen("x", x, (None,))
    across = frozen("y", y, along.shape)
    away = along - along.mean() if len(along) else along
    square = float(away @ away)
    if len(along) < 2 or not square > 0.0:
        raise ArgumentError("a line needs two points or more that differ in x")
    value = float(away @ across) / square
    left = across - across.mean() - value * away
    freedom = len(along) - 2
    spread = (float(left @ left) / (freedom * square)) ** 0.5 if freedom else np.nan
    return Measured(value=value, deviation=spread, count=len(along))


def loop_share(drive: ArrayLike, response: ArrayLike, turn: int) -> float:
    """Hysteresis: area of the loop of loading and unloading over that under the loading.

    h = |closed integral of r dx| / |integral of r dx up to the turn|, by trapezia, of the response
    r, (N,), which is zero without load, over the drive x, (N,), from hardly any load and back; the
    loop is closed by a straight line. `turn` is the index of the last sample of the loading. It is
    NaN where the loading has no area.

    Raises
    ------
    ArgumentError
        If lengths differ or the turn is not within.
    """
    x = frozen("drive", drive, (None,))
    r = frozen("response", response, x.shape)
    if not 0 < turn < len(x) - 1:
        raise ArgumentError(f"turn must lie within the {len(x)} samples; got {turn}")
    loop = abs(_area(np.append(x, x[0]), np.append(r, r[0])))
    under = abs(_area(x[: turn + 1], r[: turn + 1]))
    return loop / under if under > 0.0 else np.nan


def _area(x: Floats, y: Floats) -> float:
    """Integral of y dx by trapezia."""
    return float((0.5 * (y[1:] + y[:-1])) @ np.diff(x))


def repeatability(values: ArrayLike) -> Measured:
    """Relative standard deviation of N answers to one and the same touch, (N,).

    c = s / |m| with s^2 = sum (x - m)^2 / (N - 1); its own deviation is c sqrt(1 / (2 (N - 1)) +
    c^2 / N), of normal answers.

    Raises
    ------
    ArgumentError
        If there are fewer than two.
    """
    answers = frozen("values", values, (None,))
    count = len(answers)
    if count < 2:
        raise ArgumentError(f"values must be at least 2; got {count}")
    mean = abs(float(answers.mean()))
    share = float(answers.std(ddof=1)) / mean if mean > 0.0 else np.nan
    spread = share * (0.5 / (count - 1) + share**2 / count) ** 0.5
    return Measured(value=share, deviation=spread, count=count)


def crosstalk(signals: ArrayLike, nearest: ArrayLike) -> Floats:
    """Share of a chip's signal that touches nearest to other chips give it, (S,).

    x_c = mean |s_tc| over touches t nearest to another chip, over the mean of those nearest to c.
    The signals, (T, S), are sizes per newton; `nearest`, (T,), names each touch's chip. A chip
    without touches of either kind has NaN.

    Raises
    ------
    ArgumentError
        If lengths differ, or a chip is not there.
    """
    sizes = np.abs(frozen("signals", signals, (None, None)))
    own = wholes("nearest", nearest, (len(sizes),))
    if len(own) and not 0 <= own.min() <= own.max() < sizes.shape[1]:
        raise ArgumentError(f"nearest must be chips from 0 to {sizes.shape[1] - 1}; got {own}")
    return np.array([_other_share(sizes[:, chip], own, chip) for chip in range(sizes.shape[1])])


def _other_share(sizes: Floats, nearest: Ints, chip: int) -> float:
    near, far = sizes[nearest == chip], sizes[nearest != chip]
    if not (len(near) and len(far) and near.mean() > 0.0):
        return np.nan
    return float(far.mean() / near.mean())


def relative_slope(temperature: ArrayLike, values: ArrayLike, reference: float = 25.0) -> Measured:
    """Temperature coefficient: relative change per kelvin of values, (N,), at temperatures, (N,).

    alpha = b / (a + b T_0) of the straight line a + b T by least squares, at the reference
    temperature T_0, degC. It raises as `slope`.

    Notes
    -----
    Source: SI Text S11 and Figure S15: the field falls almost linearly by 5 % per 10 degC.
    """
    degrees = frozen("temperature", temperature, (None,))
    levels = frozen("values", values, degrees.shape)
    line = slope(degrees, levels)
    level = float(levels.mean() + line.value * (reference - degrees.mean()))
    if level == 0.0:
        return Measured(value=np.nan, deviation=np.nan, count=line.count)
    return Measured(
        value=line.value / level, deviation=line.deviation / abs(level), count=line.count
    )


def recovery_time(
    times: ArrayLike,
    signal: ArrayLike,
    released: float,
    *,
    within: float = 0.05,
    rest: ArrayLike | None = None,
) -> Floats:
    """How long a signal takes to come back once the load is taken away.

    Parameters
    ----------
    times : array_like, shape (T,)
        s, never falling.
    signal : array_like, shape (T, ...)
        Any readings or motions.
    released : float
        s: when the load was taken away, within `times`.
    within : float
        The part of the loaded signal that may be left.
    rest : array_like, shape (...), optional
        The signal's rest; by default its last value.

    Returns
    -------
    Floats, shape (...)
        s from the release until the signal stays that near to its rest, between samples on a
        straight line; NaN where the signal is at rest all along, or not there by the end.

    Raises
    ------
    ArgumentError
        If an argument is out of bounds.

    Notes
    -----
    Source: SI Text S6, "Recovery Time", and Figure S9: a load of 1 N taken from a cell. Noise
    larger than what may be left never settles; smooth such a signal first.

    Examples
    --------
    >>> times = np.linspace(0, 5, 5001)
    >>> round(float(recovery_time(times, np.exp(-times), 0.0)), 2)  # ln 20, less a little
    2.88
    """
    instants, values = checked_history(times, signal)
    if not 0 < within < 1:
        raise ArgumentError(f"within must lie in (0, 1); got {within}")
    if not instants[0] <= released <= instants[-1]:
        raise ArgumentError(
            f"released must lie in {instants[0]:g}..{instants[-1]:g} s; got {released}"
        )
    start = int(np.searchsorted(instants, released, side="right")) - 1
    start = int(np.searchsorted(instants, instants[start], side="left"))
    level = values[-1] if rest is None else floats("rest", rest)
    off = np.abs(values - level)[start:].reshape(len(values) - start, -1)
    allowed = within * off[0]
    outside = off > allowed
    last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)
    after = np.minimum(last + 1, len(off) - 1)
    column = np.arange(off.shape[1])
    fall = off[last, column] - off[after, column]
    part = np.divide(off[last, column] - allowed, fall, out=np.zeros_like(fall), where=fall > 0)
    clock = instants[start:]
    settled = clock[last] + part * (clock[after] - clock[last]) - released
    settled = np.where((off[0] > 0) & ~outside[-1], np.maximum(settled, 0.0), np.nan)
    return np.asarray(settled.reshape(values.shape[1:]))


def checked_history(times: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
    """Times and the values at them as arrays of one length.

    Raises
    ------
    ArgumentError
        If times fall or are not finite, or the lengths differ or are below 2.
    """
    instants = frozen("times", times, (None,))
    history = floats("history", values)
    if history.ndim == 0 or len(history) != len(instants) or len(instants) < 2:
        raise ArgumentError(
            f"times and the history must have the same length, at least 2; got "
            f"{instants.shape} and {history.shape}"
        )
    if not (np.isfinite(instants).all() and (np.diff(instants) >= 0).all()):
        raise ArgumentError("times must be finite and never fall")
    return instants, history
