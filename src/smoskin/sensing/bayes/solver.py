"""The touch, or the two touches, that best explain what chips read, and how sure that is.

Decides from where to search and when a search is over: from the touches of a moment ago, if they
still fit; else from coarse places, the likeliest first and others where these lead nowhere.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.origami.geometry import places_to_the_rim
from smoskin.sensing.bayes.posterior import Descent, TouchProblem, pair_answer, single_answer
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.bayes.starts import TYPICAL, Starts, pair_starts, single_starts
from smoskin.sensing.response.table import ResponseTable

_FITS: Final = 4.0
"""Squared residual a signal up to which what follows from the last reading is believed."""
_ALIKE: Final = 0.1
"""Change of noise, as a share of its variance, up to which it counts as the same."""
_NOISES: Final = 3
"""Noises whose problems are kept: a still skin's, a turning one's, and the one before."""
_STARTS: Final = {1: 3, 2: 6}
"""Coarse starts of a search for K touches."""
_STEPS: Final = {1: 15, 2: 10}
"""Steps of each descent at most; what is not settled then is followed at the next reading."""
_FOLLOWED: Final = 3
"""Starts that are followed at least."""
_GOOD: Final = 1.0
"""Squared residual a signal at which the others are not."""


class _Problems:
    """What is solved under one noise, for as many touches as was asked for."""

    def __init__(self, noise: Floats) -> None:
        self.noise = noise
        self.of: dict[int, TouchProblem] = {}
        variance = noise.diagonal()
        self._apart = _ALIKE * np.sqrt(np.outer(variance, variance))

    def alike(self, noise: Floats) -> bool:
        """Whether another noise counts as the same."""
        return bool((np.abs(noise - self.noise) <= self._apart).all())


class TouchSolver:
    """Solves single readings of one skin (`smoskin.sensing.bayes.posterior.TouchProblem`).

    Modes that the table still has count as misfit; the noise (C, C), T^2, is the covariance of
    signals of a skin at rest (`ArgumentError` if it is none).
    """

    def __init__(
        self, table: ResponseTable, noise: Floats, priors: TouchPriors | None = None
    ) -> None:
        self.table = table
        self.priors = priors or TouchPriors()
        self.misfit = table.misfit + _mode_energy(table)
        """Covariance M of what is not known of single touches' signals, T^2/N^2."""
        self._rest_noise = noise
        self._pair_starts: Starts | None = None
        self.warm_to(REFERENCE_TEMPERATURE)

    def warm_to(self, temperature: float) -> None:
        """Take the rubber to be this warm, degC."""
        self._point = point = self.table.point_table(temperature)
        self._answers = (
            single_answer(point, straight=self.priors.drag_spread == 0),
            pair_answer(point),
        )
        self._problems = _Problems(self._rest_noise)
        self._recent = [self._problems]
        self._single_starts = single_starts(
            self.table, point, self._problem(1), self.priors.drag_spread
        )

    def add_noise(self, more: Floats) -> None:
        """Take signals to be less sure by this covariance (C, C), T^2, from now on."""
        noise = self._rest_noise + more
        for known in self._recent:
            if known.alike(noise):
                self._problems = known
                return
        self._problems = _Problems(noise)
        self._recent = [self._problems, *self._recent][:_NOISES]

    def single(
        self, signals: Floats, guess: Floats | None = None, *, enough: float = 0.0
    ) -> TouchPosterior:
        """The single touch that explains signals (C,) best; from a guess (1, 5), where given.

        What follows from the guess is believed where it fits, or its misfit is at most `enough`.
        """
        problem = self._problem(1)
        return self._solve(1, problem, self._single_starts, signals, guess, None, enough)

    def pair(
        self,
        signals: Floats,
        guess: Floats | None = None,
        standing: Standing | None = None,
        *,
        enough: float = 0.0,
    ) -> TouchPosterior:
        """The two straight touches that explain signals (C,) best; from guesses, (..., 2, 5).

        What is known of one from when it was alone stands for the first of them.
        """
        problem, starts = self.ready_for_pair()
        return self._solve(2, problem, starts, signals, guess, standing, enough)

    def ready_for_pair(self) -> tuple[TouchProblem, Starts]:
        """What a search for two needs; the starts take longer than a search, the first time."""
        problem = self._problem(2)
        if self._pair_starts is None:
            self._pair_starts = pair_starts(self.table, problem)
        return problem, self._pair_starts

    def whitener(self, posterior: TouchPosterior) -> Floats:
        """W (C, C), 1/T, which turns signals into standard deviations for a single touch."""
        return self._problem(1).whitener(float((posterior.values[:, 2:] ** 2).sum()))

    def _problem(self, touches: int) -> TouchProblem:
        """What is solved for so many touches under the noise of now."""
        problem = self._problems.of.get(touches)
        if problem is None:
            misfit = self.misfit if touches == 1 else self.misfit + self.table.pair_misfit
            answer, noise = self._answers[touches - 1], self._problems.noise
            problem = TouchProblem(answer, touches, self.table, noise, misfit, self.priors)
            self._problems.of[touches] = problem
        return problem

    def _solve(
        self,
        touches: int,
        problem: TouchProblem,
        starts: Starts,
        signals: Floats,
        guess: Floats | None,
        standing: Standing | None,
        enough: float,
    ) -> TouchPosterior:
        """The likeliest of several descents."""
        fits, steps = _FITS * len(signals), _STEPS[touches]
        if guess is not None:
            guesses = np.array([*map(problem.unknowns, guess.reshape(-1, touches, 5))])
            led = problem.descend_all(signals, guesses, standing, steps)
            if 2 * led[0].cost < max(fits, enough):
                return problem.posteriors(led, standing)
        begun = [
            problem.unknowns(start) for start in starts.best(signals, _STARTS[touches], standing)
        ]
        tried: list[Descent] = []
        good = 0.5 * _GOOD * len(signals)
        for some in filter(None, (begun[:_FOLLOWED], begun[_FOLLOWED:])):
            if tried and tried[0].cost < good:
                break
            tried += problem.descend_all(signals, np.array(some), standing, steps, good)
            tried.sort(key=lambda end: end.cost)
        if touches == 2 and tried and tried[0].cost >= good:
            best = np.array([end.unknowns for end in tried[:_FOLLOWED]])
            tried = problem.descend_all(signals, best, standing)
            tried.sort(key=lambda end: end.cost)
        if tried and (standing is None or 2 * tried[0].cost < fits):
            return problem.posteriors(tried[: len(tried) if touches == 2 else 1], standing)
        if standing is not None:
            return self._solve(touches, problem, starts, signals, None, None, 0.0)
        # Nothing that presses explains them; an answer is given all the same.
        spread = (np.arange(touches) + 0.5) / touches
        middle = np.zeros((touches, 5))
        middle[:, :2] = spread[:, None] * self.table.basis.extent
        middle[:, 4] = -0.1
        return problem.posterior(problem.descend(signals, problem.unknowns(middle), None, steps))


def _mode_energy(table: ResponseTable) -> Floats:
    """What the modes leave open in a touch of a newton, mean over the skin, (C, C), T^2/N^2."""
    places = places_to_the_rim(table.basis.extent, (11, 14))
    force = np.tile([0.0, 0.0, -TYPICAL], (len(places), 1))
    modes = table.mode_signals(places, force) / TYPICAL
    return np.asarray(np.einsum("bkc,bkd->cd", modes, modes) / len(places))
