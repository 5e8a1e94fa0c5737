"""The device that the paper built, as an inverse problem: which unprinted numbers explain it.

Decides which numbers are free and between which ends, and how designs are compared: by how many
observations they meet, and by how little they miss the others. Hides the search, which takes over
an hour: ``python -m paper.models.device`` runs it and writes what the figure draws.
"""

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from paper.models.observations import misses
from smoskin import __version__
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


NEAR: Final = 0.25
"""Cost over the best, in observations, up to which designs count as nearly as good."""
STUDY: Final = Path(__file__).with_name("device.json")
"""File of the study that the figure draws."""


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
        return cost(self.misses)

    @property
    def best(self) -> int:
        """Design of least cost."""
        return int(np.argmin(self.cost))

    @property
    def nearest(self) -> Floats:
        """(O, O), in tolerances: how near any design comes to two observations at once.

        The larger of the two misses, at the design where it is least; on the diagonal, the one
        observation's least miss. Two that are each met but not together exclude each other.
        """
        return np.asarray(self._larger_misses().min(axis=0))

    def spread(self, within: float) -> Floats:
        """Ends of each unknown among designs that cost little more than the best, (U, 2)."""
        near = self.values[self.cost <= self.cost.min() + within]
        return np.stack([near.min(axis=0), near.max(axis=0)], axis=-1)

    def telling(self) -> Floats:
        """Numbers of the designs that the best, `spread` and `nearest` are read off."""
        near = np.flatnonzero(self.cost <= self.cost.min() + NEAR)
        return np.unique([*near, *self._larger_misses().argmin(axis=0).ravel()])

    def _larger_misses(self) -> Floats:
        """Larger of two misses, (T, O, O)."""
        return np.maximum(self.misses[:, :, None], self.misses[:, None, :])


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A search, as it is kept: how it was run, its counts, and the designs that tell its result."""

    command: str
    version: str
    """Version of the package that ran it."""
    seed: int
    drawn: int
    """Designs that were drawn evenly."""
    tried: int
    """All designs."""
    population: int
    rounds: int
    met_by_drawn: tuple[float, ...]
    """Share of the drawn designs that meet each observation."""
    most_met: int
    """Observations that the design which meets most meets."""
    values: tuple[tuple[float, ...], ...]
    """Numbers of the telling designs, rounded."""
    misses: tuple[tuple[float, ...], ...]

    @property
    def trials(self) -> Trials:
        """Designs that tell the result; none of them counts as drawn."""
        return Trials(values=np.array(self.values), misses=np.array(self.misses), random=0)

    def write(self, path: Path) -> None:
        """Write the study, a design a line."""
        text = json.dumps(asdict(self), indent=1)
        rows = re.sub(r"\[\s+([^][]+?)\s+\]", lambda list_: f"[{' '.join(list_[1].split())}]", text)
        path.write_text(rows + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path = STUDY) -> "Study":
        """Read a study that was written."""
        plain = json.loads(path.read_text(encoding="utf-8"))
        for name in ("values", "misses"):
            plain[name] = tuple(tuple(row) for row in plain[name])
        return cls(**plain | {"met_by_drawn": tuple(plain["met_by_drawn"])})


def cost(missed: Floats) -> Floats:
    """Sum of m^2 / (1 + m^2) over the observations (..., O): each counts for at most one."""
    square = np.square(missed)
    return np.asarray((square / (1.0 + square)).sum(axis=-1))


class _Trying:
    """Tries designs once each, and keeps what they miss."""

    def __init__(self, design: SkinDesign, progress: Callable[[str, float], None], whole: int):
        self._design, self._progress, self._whole = design, progress, whole
        low, high = (np.log([getattr(u, end) for u in UNKNOWNS]) for end in ("low", "high"))
        self._low, self._span = low, high - low
        self.missed: dict[bytes, tuple[float, ...]] = {}
        self.shares: list[Floats] = []

    def cost(self, share: Floats) -> float:
        """Cost of a point of the unit cube."""
        key = _key(share)
        if key not in self.missed:
            self.missed[key] = misses(device(self._design, self._values(share)))
            self.shares.append(share.copy())
            self._progress("designs of the paper's device", len(self.shares) / self._whole)
        return float(cost(np.array(self.missed[key])))

    def trials(self, random: int) -> Trials:
        """All that was tried."""
        return Trials(
            values=np.array([self._values(share) for share in self.shares]),
            misses=np.array([self.missed[_key(share)] for share in self.shares]),
            random=random,
        )

    def _values(self, share: Floats) -> Floats:
        return np.asarray(np.exp(self._low + share * self._span))


def seek(
    design: SkinDesign,
    *,
    drawn: int = 512,
    population: int = 40,
    rounds: int = 45,
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
        Designs that evolve, and for how many rounds, the first of which is of designs drawn.

    Raises
    ------
    ArgumentError
        If fewer are drawn than evolve.
    """
    if not 5 <= population <= drawn:
        raise ArgumentError(f"population must be 5 to drawn = {drawn}; got {population}")
    trying = _Trying(design, progress, drawn + population * (rounds - 1))
    points = qmc.Sobol(len(UNKNOWNS), rng=np.random.default_rng(seed)).random(drawn)
    costs = [trying.cost(point) for point in points]
    differential_evolution(
        trying.cost,
        Bounds(np.zeros(len(UNKNOWNS)), np.ones(len(UNKNOWNS))),
        init=points[np.argsort(costs)[:population]],
        maxiter=rounds - 1,
        mutation=(0.4, 0.9),
        polish=False,
        tol=0.0,
        rng=np.random.default_rng(seed),
    )
    return trying.trials(drawn)


def study(trials: Trials, *, population: int, rounds: int, seed: int) -> Study:
    """What a search found, to be kept."""
    telling = trials.telling()
    return Study(
        command="python -m paper.models.device",
        version=__version__,
        seed=seed,
        drawn=trials.random,
        tried=len(trials.values),
        population=population,
        rounds=rounds,
        met_by_drawn=tuple(trials.met[: trials.random].mean(axis=0).round(4).tolist()),
        most_met=int(trials.met.sum(axis=1).max()),
        values=_rounded(trials.values[telling], 6),
        misses=_rounded(trials.misses[telling], 4),
    )


def _rounded(values: Floats, digits: int) -> tuple[tuple[float, ...], ...]:
    """Rows of values to so many digits."""
    return tuple(tuple(float(f"{value:.{digits}g}") for value in row) for row in values.tolist())


def _key(share: Floats) -> bytes:
    """A point, up to the rounding with which the search hands it back."""
    return np.asarray(share.round(12)).tobytes()


if __name__ == "__main__":
    from smoskin.feasibility import load_design

    trials = seek(
        load_design("planar"),
        progress=lambda what, share: print(f"\r{what}: {share:.1%}", end="", flush=True),
    )
    study(trials, population=40, rounds=45, seed=0).write(STUDY)
