"""Memory of the elastomer: creep and recovery of the columns and scales.

The elastomer is a generalised Maxwell solid, and the skin's motion is its elastic response put
through the creep that follows from it (quasi-linear viscoelasticity). Moduli of a design are
long-term: under a load that stays, the motion ends at the static response.
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
    compliance J(t) = J_inf (1 - sum c_k exp(-t / lambda_k)). It raises an `ArgumentError` if a
    share or a time is not positive, the shares leave nothing for the long term, or the times do not
    rise.

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
    """The solid of an elastomer, by its name in `smoskin.design.materials.ELASTOMERS`.

    An unknown material raises an `ArgumentError`.

    Examples
    --------
    >>> round(float(elastomer_prony("Ecoflex 00-30").compliance(0.0)), 2)
    0.91
    """
    elastomer = _elastomer(material)
    return Prony(moduli=elastomer.relaxing_shares, times=elastomer.relaxation_times)


def modulus_factor(material: str, temperature: ArrayLike) -> Floats:
    """Modulus of an elastomer over its value at 25 degC, at any array of temperatures, degC.

    It raises an `ArgumentError` if the material is unknown.

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

    It begins with the elastic response, of any shape, under which the elastomer has rested long
    enough to forget all before: zeros for an untouched skin.

    Notes
    -----
    With r(t) the static response to the load at t, the motion is ``(1 - sum c_k) r + sum c_k y_k``
    with ``dy_k/dt = (r - y_k) / lambda_k``, exact for r that changes evenly within a step.
    The whole response creeps alike, which holds while the elastomer carries the load; film and
    frame, which do not creep, make it creep less.

    Examples
    --------
    >>> memory = Memory(Prony(moduli=[0.2], times=[1.0]), settled=0.0)
    >>> float(memory.step(0.0, 1.0)), round(float(memory.step(100.0, 1.0)), 6)
    (0.8, 1.0)
    """

    def __init__(self, prony: Prony, settled: ArrayLike) -> None:
        self._prony = prony
        self._duration = math.nan
        self._weights: Floats = np.empty((0, 0))
        self.reset(settled)

    def reset(self, settled: ArrayLike) -> None:
        """Forget all but that the skin has rested under this response, which must be finite."""
        rest = floats("settled", settled)
        if not np.isfinite(rest).all():
            raise ArgumentError(f"settled must be finite; got {rest}")
        # Rows: the late parts y_k, the response at the last step, the response now.
        self._rows = np.repeat(rest.reshape(1, -1), len(self._prony.times) + 2, axis=0)
        self._shape = rest.shape

    def step(self, duration: float, response: ArrayLike) -> Floats:
        """The creeping response after the elastic one has changed evenly to a new one of its shape.

        `duration` is in s since the last step, 0 for a jump. Where the response is not a number the
        answer is none either, and the memory goes on from the last that was. It raises an
        `ArgumentError` if time runs backwards or the shape differs.
        """
        if duration != self._duration:
            self._weights = self._step_weights(duration)
            self._duration = duration
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
        moved: Floats = self._weights @ rows
        rows[:-1] = moved[:-1]
        crept = moved[-1]
        if missing is not None:
            crept[missing] = np.nan
        return np.asarray(crept.reshape(self._shape))

    def _step_weights(self, duration: float) -> Floats:
        """Matrix from `_rows` to the new late parts, the last response and what has crept."""
        if not 0 <= duration < math.inf:
            raise ArgumentError(f"duration must be finite and >= 0 s; got {duration}")
        shares, terms = self._prony.retardation_shares, len(self._prony.times)
        part = duration / self._prony.retardation_times
        lost = -np.expm1(-part)
        mean = np.divide(lost, part, out=np.ones_like(part), where=part > 0)
        weights = np.zeros((terms + 2, terms + 2))
        weights[:terms] = np.column_stack([np.diag(1 - lost), mean - 1 + lost, 1 - mean])
        weights[terms, -1] = 1.0
        weights[-1] = shares @ weights[:terms]
        weights[-1, -1] += 1 - shares.sum()
        return weights


def creep(prony: Prony, times: ArrayLike, response: ArrayLike) -> Floats:
    """The creeping response over a whole history, (T, ...): what `Memory` answers step by step.

    The elastic response, (T, ...), changes evenly between the times, (T,), s, which never fall; a
    time that occurs twice is a jump. The skin has rested under the first response. It raises an
    `ArgumentError` if times fall or are not finite, or the lengths differ or are 0.
    """
    instants, history = floats("times", times, (None,)), floats("response", response)
    if not len(instants) or history.shape[:1] != instants.shape:
        raise ArgumentError(
            f"times and response must have the same length, at least 1; got "
            f"{instants.shape} and {history.shape}"
        )
    if not (np.isfinite(instants).all() and (np.diff(instants) >= 0).all()):
        raise ArgumentError("times must be finite and never fall")
    memory, durations = Memory(prony, history[0]), np.diff(instants, prepend=instants[0])
    return np.stack([memory.step(*step) for step in zip(durations, history, strict=True)])
