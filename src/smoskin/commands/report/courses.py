"""A recorded touch as the courses of one signal, the force and the depth.

Decides what the signal of a touch is: the change of all chips' fields from the rest before it,
along the direction into which the held touch changes them, so that it is in T and linear in the
field.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.records import HeldTouch, Trace

_TOUCHED: Final = 0.05
"""Share of the largest force from which the probe is on the skin."""
_LET_GO: Final = 4
"""Samples between a tenth and nine tenths of the force that show how the skin is let go."""
_AT_ONCE: Final = 0.5
"""Seconds within which a load that is taken away is gone at once."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """Force, depth and signal at the gauge's times, from the first contact on."""

    force: Floats
    """(N,), N: how hard the probe presses."""
    depth: Floats
    """(N,), m: how far the probe has gone down."""
    signal: Floats
    """(N,), T."""
    loaded: int
    """Index of the last sample before the hold."""
    turn: int
    """Index of the last sample of the hold."""
    closed: bool
    """Whether the way back was felt too."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """One touch of S chips."""

    run: int
    """Number of its recording."""
    place: Floats
    """(2,), m."""
    force: float
    """N: how hard it pressed while it was held."""
    still: Floats
    """(R, 3 S), T: good readings at rest before it."""
    change: Floats
    """(S, 3), T: the hold's mean less the rest's."""
    temperature: float
    """degC: mean of the chips' while it was held; NaN where they do not tell."""
    times: Floats
    """(N,), s: of the good readings since its rest began."""
    signal: Floats
    """(N,), T: how far they lie from the rest along the change."""
    released: float | None
    """s: when the load was taken away at once; None where it was not, or nothing was read since."""
    lifting: float
    """s: how long that took; zero where it was not."""
    loop: Loop | None
    """What gauge and stage said; None where they said nothing."""

    @property
    def size(self) -> float:
        """Signal of the hold, T."""
        return float(np.linalg.norm(self.change))


def course_of(touch: HeldTouch, run: int = 0) -> Course | None:
    """The course of a touch; None where no good reading was made at rest or in the hold."""
    good = [r for r in touch.readings if not r.flags.any() and np.isfinite(r.field).all()]
    times = np.array([reading.time for reading in good])
    at_rest, in_hold = (
        (times >= begin) & (times <= end) for begin, end in (touch.rest, touch.held)
    )
    if not (at_rest.any() and in_hold.any()):
        return None
    fields = np.array([reading.field for reading in good])
    flat = fields.reshape(len(good), -1)
    rest = flat[at_rest].mean(axis=0)
    change = flat[in_hold].mean(axis=0) - rest
    size = float(np.linalg.norm(change))
    since = times >= touch.rest[0]
    signal = (flat[since] - rest) @ (change / size if size else change)
    lifted = _lifted(touch, times)
    degrees = np.array([reading.temperature for reading in good])[in_hold]
    return Course(
        run=run,
        place=touch.contact.position,
        force=touch.contact.normal_force,
        still=flat[at_rest],
        change=change.reshape(fields.shape[1:]),
        temperature=float(degrees[np.isfinite(degrees)].mean())
        if np.isfinite(degrees).any()
        else np.nan,
        times=times[since],
        signal=signal,
        released=None if lifted is None else lifted[0],
        lifting=0.0 if lifted is None else lifted[1] - lifted[0],
        loop=None if touch.trace is None else _loop(touch.trace, times[since], signal),
    )


def phase_of(trace: Trace, name: str) -> tuple[float, float] | None:
    """Begin and end of a phase of a touch, s; None where there was none of that name."""
    return next(((begin, end) for each, begin, end in trace.phases if each == name), None)


def _lifted(touch: HeldTouch, times: Floats) -> tuple[float, float] | None:
    """From when until when the load was taken away, at once and read on; None otherwise."""
    retract = None if touch.trace is None else phase_of(touch.trace, "retract")
    if retract is None or times[-1] <= retract[1]:
        return None
    return retract if retract[1] - retract[0] <= _AT_ONCE else None


def _loop(trace: Trace, times: Floats, signal: Floats) -> Loop | None:
    """Loading and unloading at the gauge's times; None where the press was not felt."""
    hold, retract = phase_of(trace, "hold"), phase_of(trace, "retract")
    if hold is None or not len(trace.stage) or not len(trace.gauge):
        return None
    begin = min(b for name, b, _ in trace.phases if name in ("descend", "press", "hold"))
    moments, force = trace.gauge[:, 0], -trace.gauge[:, 3]
    end = hold[1] if retract is None else retract[1]
    within = (moments >= begin) & (moments <= end)
    if not within.any():
        return None
    most = float(force[within].max())
    chosen = np.flatnonzero(within & (force > _TOUCHED * most))
    if most <= 0.0 or len(chosen) < 2:
        return None
    moments, force = moments[chosen], force[chosen]
    back = force[moments > hold[1]] / most
    return Loop(
        force=force,
        depth=-np.interp(moments, trace.stage[:, 0], trace.stage[:, 3]),
        signal=np.interp(moments, times, signal),
        loaded=int(np.searchsorted(moments, hold[0], side="right")) - 1,
        turn=int(np.searchsorted(moments, hold[1], side="right")) - 1,
        closed=bool(((back > 0.1) & (back < 0.9)).sum() >= _LET_GO),
    )
