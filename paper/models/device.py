"""The device that the paper built, as an inverse problem: which unprinted numbers explain it.

Decides which numbers are free and between which ends, and how designs are compared: by how many
observations they meet, and by how little they miss the others. Hides the search.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from paper.models.observations import misses
from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError


class Unknown(NamedTuple):
    """A number of the device that the SI does not print."""

    name: str
    low: float
    high: float
    """Ends of what is tried, evenly in the logarithm."""
    unit: str = ""
    """Unit in which it is shown; lengths are in m inside."""


UNKNOWNS: Final = (
    Unknown("column radius", 1e-3, 4e-3, "mm"),
    Unknown("column height", 5e-3, 20e-3, "mm"),
    Unknown("film thickness", 12.7e-6, 125e-6, "mm"),
    Unknown("film gap", 0.5e-3, 3e-3, "mm"),
    Unknown("panel thickness", 0.3e-3, 2e-3, "mm"),
    Unknown("panel bonding", 0.25, 1.0),
    Unknown("strip shift", 1e-3, 1.0),
    Unknown("frame clearance", 1e-6, 3e-3, "mm"),
    Unknown("frame height share", 0.2, 0.9),
)
"""Free numbers. The rubber's stiffness is not among them: a light sheet on columns twice as stiff
moves as one of panels and creases half as stiff."""


def device(design: SkinDesign, values: Sequence[float] | Floats) -> SkinDesign:
    """A design with these values of `UNKNOWNS`."""
    radius, height, film, gap, plate, bonding, shift, clearance, share = map(float, values)
    return replace(
        design,
        columns=replace(design.columns, radius=radius, height=height),
        creases=replace(design.creases, thickness=film, gap=gap, strip_shift=shift),
        panels=replace(design.panels, thickness=plate, bonding=bonding),
        frame=replace(design.frame, clearance=clearance, held_height=share * height),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trials:
    """Designs that were tried, and what each misses."""

    values: Floats
    """(T, U): of `UNKNOWNS`."""
    misses: Floats
    """(T, O), in tolerances: of `OBSERVATIONS`."""
    random: int
    """The first so many were drawn, the others sought."""

    @property
    def met(self) -> Bools:
        """(T, O): which observations each design meets."""
        return self.misses <= 1.0

    @property
    def cost(self) -> Floats:
        """(T,): between 0, all met with room to spare, and the number of observations."""
        return np.asarray(cost(self.misses))

    @property
    def best(self) -> int:
        """Design of least cost."""
        return int(np.argmin(self.cost))

    @property
    def together(self) -> Floats:
        """(O, O): designs that meet both observations; on the diagonal, that meet the one."""
        met = self.met.astype(np.float64)
        return np.asarray(met.T @ met)

    def spread(self, within: float) -> Floats:
        """Ends of each unknown among designs that cost little more than the best, (U, 2)."""
        near = self.values[self.cost <= self.cost.min() + within]
        return np.stack([near.min(axis=0), near.max(axis=0)], axis=-1)


def cost(missed: Floats) -> Floats:
    """Sum of m^2 / (1 + m^2) over the observations (..., O): each counts for at most one."""
    square = np.square(missed)
    return np.asarray((square / (1.0 + square)).sum(axis=-1))


def seek(
    design: SkinDesign,
    *,
    drawn: int = 128,
    population: int = 24,
    rounds: int = 20,
    seed: int = 0,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> Trials:
    """Draw designs, then let the best of them evolve towards the least cost.

    Parameters
    ----------
    design : SkinDesign
        Cell, magnets and materials, which stay.
    drawn : int
        Designs that are drawn evenly.
    population, rounds : int
        Designs that evolve, and for how many rounds.

    Raises
    ------
    ArgumentError
        If fewer are drawn than evolve.
    """
    if not 5 <= population <= drawn:
        raise ArgumentError(f"population must be 5 to drawn = {drawn}; got {population}")
    low, high = (np.log([getattr(u, end) for u in UNKNOWNS]) for end in ("low", "high"))
    values: list[Floats] = []
    missed: list[tuple[float, ...]] = []
    whole = drawn + population * rounds

    def judge(share: Floats) -> float:
        """Cost of a point of the unit cube; kept."""
        values.append(np.exp(low + share * (high - low)))
        missed.append(misses(device(design, values[-1])))
        progress("designs of the paper's device", len(values) / whole)
        return float(cost(np.array(missed[-1])))

    points = qmc.Sobol(len(UNKNOWNS), rng=np.random.default_rng(seed)).random(drawn)
    costs = [judge(point) for point in points]
    begin = points[np.argsort(costs)[:population]]
    differential_evolution(
        judge,
        Bounds(np.zeros(len(UNKNOWNS)), np.ones(len(UNKNOWNS))),
        init=begin,
        maxiter=rounds - 1,
        mutation=(0.4, 0.9),
        polish=False,
        tol=0.0,
        rng=np.random.default_rng(seed),
    )
    return Trials(values=np.array(values), misses=np.array(missed), random=drawn)
