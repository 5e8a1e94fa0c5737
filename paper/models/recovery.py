"""The rubber that explains a recovery after a load is taken away.

Decides how a recorded recovery is turned into a solid (Figure S9): least squares over retardation
times tried in advance, with shares that are not negative. Hides the scaling and the way from the
fitted shares to their uncertainty.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats, frozen
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.sensing.characteristics import checked_history


def creeping_solid(shares: ArrayLike, times: ArrayLike) -> Prony:
    """The solid that creeps with these `retardation_shares` and `retardation_times`.

    Raises
    ------
    ArgumentError
        If a share or a time is not positive, the shares leave nothing at once, or the times do
        not rise.
    """
    late = frozen("shares", shares, (None,))
    instants = frozen("times", times, late.shape)
    if not ((late > 0).all() and late.sum() < 1):
        raise ArgumentError(f"shares must be positive with a sum below 1; got {late}")
    if not (np.isfinite(instants).all() and (np.diff(instants, prepend=0.0) > 0).all()):
        raise ArgumentError(f"times must be positive and rise; got {instants} s")
    prompt = 1 - late.sum()
    drive = np.sqrt(late / (instants * prompt))
    rates, modes = np.linalg.eigh(np.diag(1 / instants) + np.outer(drive, drive))
    return Prony(moduli=((drive @ modes) ** 2 / rates)[::-1], times=1 / rates[::-1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PronyFit:
    """A solid found from a recording, and how well it is known."""

    prony: Prony
    """Only the terms that the recording shows."""
    moduli_deviation: Floats
    """(K,), standard deviation of g_k."""
    times_deviation: Floats
    """(K,), s, standard deviation of tau_k, with the retardation times as they were tried."""
    rest: float
    """The signal without load, in its own unit."""
    scale: float
    """Settled signal per load, in their units; may be negative."""
    residual: float
    """Root mean square of what the model leaves, in the signal's unit."""


def fit_prony(
    times: ArrayLike,
    load: ArrayLike,
    signal: ArrayLike,
    retardation_times: ArrayLike | None = None,
) -> PronyFit:
    """The solid whose creep explains a recorded load and recovery.

    Parameters
    ----------
    times : array_like, shape (T,)
        s, never falling; a time that occurs twice is a jump.
    load : array_like, shape (T,)
        The load, or any elastic response in proportion to it; the skin has rested under the
        first. A release is enough: 1 until then and 0 after.
    signal : array_like, shape (T,)
        One reading or motion, in proportion to the creeping response.
    retardation_times : array_like, shape (K,), optional
        s, rising: what is tried. By default five a decade, from five samples to a third of the
        record; neighbours that both show are then taken as one between them.

    Returns
    -------
    PronyFit
        Least squares with shares of creep that are not negative; times without a share are
        left out. Deviations take the residuals as independent from sample to sample.

    Raises
    ------
    ArgumentError
        If lengths differ, numbers are not finite, nothing changes, or the signal does not
        follow the load.

    Notes
    -----
    Source: SI Figure S9, of such recordings: its values are not in the text.
    """
    instants, drive = checked_history(times, load)
    answer = floats("signal", signal)
    if answer.shape != instants.shape or drive.shape != instants.shape:
        raise ArgumentError(
            f"load and signal must have the shape {instants.shape} of times; "
            f"got {drive.shape} and {answer.shape}"
        )
    if not (np.isfinite(drive).all() and np.isfinite(answer).all()):
        raise ArgumentError("load and signal must be finite")
    reach, stroke = float(np.ptp(drive)), float(np.ptp(answer))
    if not (reach > 0 and stroke > 0):
        raise ArgumentError("load and signal must change; one of them does not")
    sign = 1.0 if np.dot(drive - drive.mean(), answer) >= 0 else -1.0
    drive, answer = drive / reach, answer * (sign / stroke)
    if retardation_times is None:
        tried = _tried_times(instants)
        _, weights = _nonnegative_fit(tried, instants, drive, answer)
        tried = _merged(tried, weights[2:])
    else:
        tried = frozen("retardation_times", retardation_times, (None,))
    columns, weights = _nonnegative_fit(tried, instants, drive, answer)
    if not weights[1] > 0:
        raise ArgumentError("signal must follow the load at once, at least in part; it does not")
    shown = np.flatnonzero(weights[2:] > 1e-12 * weights[1:].sum())
    kept = np.concatenate([[0, 1], shown + 2])
    left = answer - columns[:, kept] @ weights[kept]
    freedom = max(len(answer) - len(kept), 1)
    spread = np.linalg.pinv(columns[:, kept].T @ columns[:, kept]) * (left @ left) / freedom
    settled = weights[kept][1:]
    deviation = _deviation(settled, tried[shown], spread[1:, 1:])
    return PronyFit(
        prony=_solid(settled, tried[shown]),
        moduli_deviation=frozen("deviation", deviation[: len(shown)], (None,)),
        times_deviation=frozen("deviation", deviation[len(shown) :], (None,)),
        rest=float(sign * stroke * weights[0]),
        scale=float(sign * stroke / reach * settled.sum()),
        residual=float(stroke * np.sqrt(np.mean(left**2))),
    )


def _solid(settled: Floats, retardation_times: Floats) -> Prony:
    """The solid that answers a load at once by the first part and late by the others."""
    return creeping_solid(settled[1:] / settled.sum(), retardation_times)


def _deviation(settled: Floats, retardation_times: Floats, spread: Floats) -> Floats:
    """Standard deviation of the moduli and times of `_solid`, from the covariance of its parts."""
    change = np.empty((2 * len(retardation_times), len(settled)))
    for index, value in enumerate(settled):
        # Half a part in a million keeps every share positive and the difference linear.
        step = np.zeros_like(settled)
        step[index] = 0.5e-6 * value
        more = _solid(settled + step, retardation_times)
        less = _solid(settled - step, retardation_times)
        change[:, index] = np.concatenate([more.moduli - less.moduli, more.times - less.times])
        change[:, index] /= 1e-6 * value
    return np.asarray(np.sqrt(np.einsum("ki,ij,kj->k", change, spread, change)))


def _tried_times(instants: Floats) -> Floats:
    """Five a decade over what the record can show."""
    steps = np.diff(instants)
    least, most = 5 * float(np.median(steps[steps > 0])), float(np.ptp(instants)) / 3
    count = max(int(np.ceil(5 * np.log10(max(most / least, 1.0)))) + 1, 1)
    return np.geomspace(least, most, count) if count > 1 else np.array([most])


def _nonnegative_fit(
    tried: Floats, instants: Floats, drive: Floats, answer: Floats
) -> tuple[Floats, Floats]:
    """Columns (rest, load, late parts) and their least-squares weights, none but rest's below 0."""
    from scipy.optimize import nnls

    late = late_parts(tried, instants, drive)
    columns = np.stack([np.ones_like(drive), drive, *late], axis=1)
    weights, _ = nnls(np.column_stack([columns, -columns[:, 0]]), answer)
    weights[0] -= weights[-1]
    return columns, np.asarray(weights[:-1])


def _merged(tried: Floats, weights: Floats) -> Floats:
    """One time for each run of times with weight, at their weighted mean of the logarithm."""
    shown = np.flatnonzero(weights > 1e-9 * weights.sum())
    runs = np.split(shown, np.flatnonzero(np.diff(shown) > 1) + 1) if len(shown) else []
    return np.array([np.exp(np.average(np.log(tried[run]), weights=weights[run])) for run in runs])


def late_parts(retardation_times: ArrayLike, times: ArrayLike, response: ArrayLike) -> Floats:
    """Late parts of creep over a whole history: y_k of dy_k/dt = (r - y_k) / lambda_k.

    Shape (K, T, ...); lambda_k, (K,), and times, (T,), in s, the response, (T, ...), in any unit.

    Raises
    ------
    ArgumentError
        If times fall or are not finite, or the lengths differ or are below 2.
    """
    delays = frozen("retardation_times", retardation_times, (None,))
    instants, history = checked_history(times, response)
    wide = (slice(None),) + (None,) * (history.ndim - 1)
    parts = np.empty((len(delays), *history.shape))
    for late, delay in zip(parts, delays, strict=True):
        part = np.diff(instants) / delay
        lost = -np.expm1(-part)
        mean = np.divide(lost, part, out=np.ones_like(part), where=part > 0)
        late[0] = history[0]
        late[1:] = (mean - 1 + lost)[wide] * history[:-1] + (1 - mean)[wide] * history[1:]
        weight = np.concatenate([[0.0], 1 - lost])
        # A recurrence of first order, all steps at once: spans double until they cover it.
        span = 1
        while span < len(late):
            late[span:] += weight[span:][wide] * late[:-span]
            weight[span:] *= weight[:-span].copy()
            span *= 2
    return parts
