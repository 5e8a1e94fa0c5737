"""Memory of the elastomer: creep and recovery of the columns and scales.

Decides how the skin's response lags behind its load. The elastomer is a generalised Maxwell
solid, and the skin's motion is its elastic response put through the creep that follows from
it (quasi-linear viscoelasticity): with r(t) the static response to the load at t, the motion
is ``(1 - sum c_k) r + sum c_k y_k`` with ``dy_k/dt = (r - y_k) / lambda_k``. Moduli of a design
are long-term: under a load that stays, the motion ends at the static response, and calibrations
from held touches need no correction. It hides the conversion of relaxation into creep, which is
exact, and the time step, which is exact for a response that changes evenly within it.
"""

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, assign, floats, freeze, frozen
from smoskin.design.materials import ELASTOMERS, Elastomer
from smoskin.errors import ArgumentError

REFERENCE_TEMPERATURE: Final = 25.0
"""degC: temperature of the design's moduli."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prony:
    """Generalised Maxwell solid; without terms it is elastic.

    G(t) = G_inf (1 + sum g_k exp(-t / tau_k) / (1 - sum g_k)); its inverse in Laplace space is the
    compliance J(t) = J_inf (1 - sum c_k exp(-t / lambda_k)).

    Raises
    ------
    ArgumentError
        If a share or a time is not positive, the shares leave nothing for the long term, or the
        times do not rise.

    Examples
    --------
    >>> solid = Prony(moduli=[0.2], times=[1.0])
    >>> float(solid.relaxation(0.0)), float(solid.compliance(0.0))
    (1.25, 0.8)
    """

    moduli: Floats
    """(K,): g_k, shares of the instantaneous modulus that relax; their sum is below 1."""
    times: Floats
    """(K,), s: tau_k, relaxation time of each, rising."""
    retardation_shares: Floats = field(init=False)
    """(K,): c_k, shares of the long-term compliance that come late; their sum is that of g_k."""
    retardation_times: Floats = field(init=False)
    """(K,), s: lambda_k, retardation times, each a little after its relaxation time."""

    def __init__(self, *, moduli: ArrayLike, times: ArrayLike) -> None:
        shares = frozen("moduli", moduli, (None,))
        instants = frozen("times", times, shares.shape)
        if not (np.isfinite(shares).all() and (shares > 0).all() and shares.sum() < 1):
            raise ArgumentError(f"moduli must be positive with a sum below 1; got {shares}")
        if not (np.isfinite(instants).all() and (np.diff(instants, prepend=0.0) > 0).all()):
            raise ArgumentError(f"times must be positive and rise; got {instants} s")
        # One spring beside K Maxwell arms: their states obey a symmetric system, whose
        # eigenvalues are the rates of creep.
        drive = np.sqrt(shares / instants)
        rates, modes = np.linalg.eigh(np.diag(1 / instants) - np.outer(drive, drive))
        late = (1 - shares.sum()) * (drive @ modes) ** 2 / rates
        assign(self, moduli=shares, times=instants)
        assign(self, retardation_shares=late[::-1], retardation_times=1 / rates[::-1])
        freeze(self, retardation_shares=(None,), retardation_times=(None,))

    @classmethod
    def from_creep(cls, shares: ArrayLike, times: ArrayLike) -> "Prony":
        """The solid that creeps with these `retardation_shares` and `retardation_times`.

        Raises
        ------
        ArgumentError
            As for the solid itself.
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
        return cls(moduli=((drive @ modes) ** 2 / rates)[::-1], times=1 / rates[::-1])

    def relaxation(self, time: ArrayLike) -> Floats:
        """G(t) over its long-term value, after a step of strain `time` seconds ago."""
        fading = np.exp(-np.divide.outer(floats("time", time), self.times))
        return np.asarray(1 + fading @ (self.moduli / (1 - self.moduli.sum())))

    def compliance(self, time: ArrayLike) -> Floats:
        """J(t) over its long-term value, after a step of load `time` seconds ago."""
        fading = np.exp(-np.divide.outer(floats("time", time), self.retardation_times))
        return np.asarray(1 - fading @ self.retardation_shares)


ELASTIC: Final = Prony(moduli=(), times=())
"""The solid that does not creep."""


def elastomer_prony(material: str) -> Prony:
    """The solid of an elastomer that designs name.

    Raises
    ------
    ArgumentError
        If the material is not in `smoskin.design.materials.ELASTOMERS`.

    Examples
    --------
    >>> round(float(elastomer_prony("Ecoflex 00-30").compliance(0.0)), 2)
    0.91
    """
    elastomer = _elastomer(material)
    return Prony(moduli=elastomer.relaxing_shares, times=elastomer.relaxation_times)


def modulus_factor(material: str, temperature: ArrayLike) -> Floats:
    """Modulus of an elastomer over its value at 25 degC.

    Parameters
    ----------
    material : str
        A name in `smoskin.design.materials.ELASTOMERS`.
    temperature : array_like, any shape
        degC.

    Returns
    -------
    Floats
        The factor on every stiffness that the elastomer gives.

    Raises
    ------
    ArgumentError
        If the material is unknown.

    Notes
    -----
    Valid in the rubbery state, -40 to 100 degC for a silicone. A warmer rubber is stiffer: its
    chains pull by entropy, and the modulus rises with the absolute temperature.

    Examples
    --------
    >>> round(float(modulus_factor("Ecoflex 00-30", 55.0)), 3)
    1.101
    """
    warmer = floats("temperature", temperature) - REFERENCE_TEMPERATURE
    return np.asarray(1 + _elastomer(material).temperature_coefficient * warmer)


def _elastomer(material: str) -> Elastomer:
    """The elastomer of this name."""
    if material not in ELASTOMERS:
        raise ArgumentError(f"material must be one of {', '.join(ELASTOMERS)}; got {material!r}")
    return ELASTOMERS[material]


class Memory:
    """Creep of a response, one step after the other.

    Parameters
    ----------
    prony : Prony
        Of the elastomer.
    settled : array_like, any shape
        The elastic response under which it has rested long enough to forget all before; zeros
        for an untouched skin. Its shape is that of every later response.

    Notes
    -----
    The whole response creeps alike, which holds while the elastomer carries the load; film and
    frame, which do not creep, make it creep less.

    Examples
    --------
    >>> memory = Memory(Prony(moduli=[0.2], times=[1.0]), settled=0.0)
    >>> float(memory.step(0.0, 1.0)), round(float(memory.step(100.0, 1.0)), 6)
    (0.8, 1.0)
    """

    def __init__(self, prony: Prony, settled: ArrayLike) -> None:
        self.prony = prony
        self._rates = 1 / prony.retardation_times
        self._prompt = 1 - prony.retardation_shares.sum()
        terms = len(self._rates)
        # Late parts, last and present response, to late parts, last response and what has crept.
        self._steps = np.zeros((terms + 2, terms + 2))
        self._steps[terms, -1] = 1.0
        # Views of what changes with the duration: weights of late part, last, present response.
        self._kept = np.einsum("ii->i", self._steps[:terms, :terms])
        self._before, self._after = self._steps[:terms, -2], self._steps[:terms, -1]
        self._duration = np.nan
        self.reset(settled)

    def reset(self, settled: ArrayLike) -> None:
        """Forget everything but that the skin has rested under this response.

        Raises
        ------
        ArgumentError
            If the response is not finite.
        """
        rest = floats("settled", settled)
        if not np.isfinite(rest).all():
            raise ArgumentError(f"settled must be finite; got {rest}")
        # Rows: the late parts, the response at the last step, the response now.
        self._rows = np.repeat(rest.reshape(1, -1), len(self.prony.times) + 2, axis=0)
        self._shape = rest.shape

    def step(self, duration: float, response: ArrayLike) -> Floats:
        """The creeping response after the elastic one has changed evenly to a new value.

        Parameters
        ----------
        duration : float
            s since the last step; 0 for a jump.
        response : array_like
            Elastic, of the shape of `settled`. Where it is not a number the answer is none
            either, and the memory goes on from the last that was.

        Returns
        -------
        Floats
            Of the same shape; exact for an elastic response that changed evenly in between.

        Raises
        ------
        ArgumentError
            If time runs backwards or the shape differs.
        """
        if duration != self._duration:
            self._prepare(duration)
        new = np.asarray(response, dtype=np.float64)
        if new.shape != self._shape:
            raise ArgumentError(f"response must have shape {self._shape}; got {new.shape}")
        rows = self._rows
        present = rows[-1]
        present[:] = new.ravel()
        missing = None
        if not math.isfinite(np.add.reduce(present)):
            missing = ~np.isfinite(present)
            present[missing] = rows[-2][missing]
        moved: Floats = self._steps @ rows
        rows[:-1] = moved[:-1]
        crept = moved[-1]
        if missing is not None:
            crept[missing] = np.nan
        return np.asarray(crept.reshape(self._shape))

    def _prepare(self, duration: float) -> None:
        """Set the step's weights: those of `late_parts`, at a live pace."""
        if not 0 <= duration < math.inf:
            raise ArgumentError(f"duration must be finite and >= 0 s; got {duration}")
        self._duration = duration
        if duration == 0:
            self._kept[:], self._before[:], self._after[:] = 1.0, 0.0, 0.0
        else:
            part = self._rates * duration
            lost = np.expm1(-part)
            mean = lost / -part
            np.add(lost, 1.0, out=self._kept)
            np.subtract(mean, self._kept, out=self._before)
            np.subtract(1.0, mean, out=self._after)
        terms, shares = len(self._rates), self.prony.retardation_shares
        self._steps[-1] = shares @ self._steps[:terms]
        self._steps[-1, -1] += self._prompt


def creep(prony: Prony, times: ArrayLike, response: ArrayLike) -> Floats:
    """The creeping response over a whole history.

    Parameters
    ----------
    prony : Prony
        Of the elastomer.
    times : array_like, shape (T,)
        s, never falling; a time that occurs twice is a jump.
    response : array_like, shape (T, ...)
        Elastic response, changing evenly in between; the skin has rested under the first.

    Returns
    -------
    Floats, shape (T, ...)
        What `Memory` would answer, all at once; what is not a number stays so to the end.

    Raises
    ------
    ArgumentError
        If times fall or are not finite, or the lengths differ.
    """
    late = late_parts(prony.retardation_times, times, response)
    prompt = float(1 - prony.retardation_shares.sum())
    return np.asarray(
        prompt * floats("response", response) + np.tensordot(prony.retardation_shares, late, 1)
    )


def late_parts(retardation_times: ArrayLike, times: ArrayLike, response: ArrayLike) -> Floats:
    """Late parts of creep over a whole history: y_k of dy_k/dt = (r - y_k) / lambda_k.

    Parameters
    ----------
    retardation_times : array_like, shape (K,)
        s, lambda_k.
    times, response : array_like
        The arguments of `creep`.

    Returns
    -------
    Floats, shape (K, T, ...)
        In the response's unit.

    Raises
    ------
    ArgumentError
        If times fall or are not finite, or the lengths differ.
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
