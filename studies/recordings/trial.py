"""Training and judging, the same for every question: three models, one split, no leaks."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from sklearn.linear_model import Ridge
from sklearn.neighbors import KNeighborsRegressor

from smoskin.arrays import Bools, Floats, Ints
from smoskin.errors import RecordingError
from smoskin.roles import Progress
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.memory import choose_encoding
from smoskin.sensing.learned.training import Examples, FittingEffort, train_model

_QUICK: Final = FittingEffort(rows=2400, evidence_rows=250, iterations=15)
_MOST_SUBSETS: Final = 60
_NEIGHBOURS: Final = 5


class Trial:
    """What all questions share: seed, effort, progress and notes."""

    def __init__(self, seed: int, effort: FittingEffort, progress: Progress) -> None:
        self.seed = seed
        self.effort = effort
        self.progress = progress
        self.notes: list[str] = []
        """Sets and tests left out, and what was chosen."""
        self.share = (0.0, 1.0)
        """Share of the whole at which the present question begins, and how much of it it is."""

    def report(self, what: str, done: float) -> None:
        """Pass on the progress of the present question."""
        start, width = self.share
        self.progress(what, start + width * done)

    def folds(self, group: Ints, count: int) -> Ints:
        """A fold for every row, whole groups together, drawn with the seed."""
        groups, member = np.unique(group, return_inverse=True)
        fold = np.empty(len(groups), dtype=np.int64)
        fold[np.random.default_rng(self.seed).permutation(len(groups))] = (
            np.arange(len(groups)) % count
        )
        return fold[member.reshape(-1)]

    def answers(self, examples: Examples, judged: Bools, encoding: Encoding) -> dict[str, Floats]:
        """Predictions of each model, trained on the rows with a target that are not judged."""
        training = examples.where(~judged)
        model = train_model(training, encoding, seed=self.seed, effort=self.effort)
        ours = model.predict(examples.encode(encoding)[judged]).values
        plain = examples.field[:, list(encoding.chips)].reshape(len(judged), -1)
        rows = training.known
        x, y, group = plain[rows], examples.targets[rows], examples.group[rows]
        spread = np.maximum(x.std(axis=0), 1e-12)
        x, asked = x / spread, plain[judged] / spread
        return {
            "smoskin": ours,
            "ridge": _ridge(x, y, group, asked, self.seed),
            "5-nearest": KNeighborsRegressor(_NEIGHBOURS).fit(x, y).predict(asked),
        }

    def encoding(self, training: Examples, encodings: Sequence[Encoding]) -> Encoding:
        """The encoding that does best on stretches held out within the training part."""
        return choose_encoding(training, encodings, seed=self.seed, effort=self.quick)

    def best_chips(self, training: Examples, encoding: Encoding, count: int) -> tuple[int, ...]:
        """The chips that do best on groups held out within the training part."""
        present = training.field.shape[1]
        if count == present:
            return tuple(range(present))
        subsets = list(itertools.combinations(range(present), count))
        if len(subsets) > _MOST_SUBSETS:
            drawn = np.random.default_rng(self.seed).permutation(len(subsets))[:_MOST_SUBSETS]
            subsets = [subsets[k] for k in drawn]
        errors = []
        for used in subsets:
            given = replace(encoding, chips=used)
            model = train_model(training, given, seed=self.seed, effort=self.quick)
            errors.append(next(m.value for m in model.metrics if m.name == "mean_error"))
        return subsets[int(np.argmin(errors))]

    @property
    def quick(self) -> FittingEffort:
        """Effort of trainings that only compare."""
        return FittingEffort(
            rows=min(self.effort.rows, _QUICK.rows),
            evidence_rows=min(self.effort.evidence_rows, _QUICK.evidence_rows),
            iterations=min(self.effort.iterations, _QUICK.iterations),
        )


def _ridge(x: Floats, y: Floats, group: Ints, asked: Floats, seed: int) -> Floats:
    """Ridge regression, its strength chosen on groups held out within the training part."""
    groups = np.unique(group)
    drawn = np.random.default_rng(seed).permutation(groups)
    inner = np.isin(group, drawn[: max(1, len(groups) // 5)])

    def fit(rows: Bools, strength: float, at: Floats) -> Floats:
        model = Ridge(alpha=strength * rows.sum(), solver="cholesky").fit(x[rows], y[rows])
        # One target comes back without its axis.
        return np.reshape(model.predict(at), (len(at), -1))

    strengths = 10.0 ** np.arange(-8.0, 1.0)
    errors = [((fit(~inner, strength, x[inner]) - y[inner]) ** 2).mean() for strength in strengths]
    return fit(np.ones(len(x), dtype=bool), float(strengths[int(np.argmin(errors))]), asked)


def joined(fields: Sequence[Floats], names: Sequence[str]) -> tuple[Floats, Ints]:
    """Fields (T, S, 3) of several runs one after the other, and each row's run.

    Raises
    ------
    RecordingError
        If the runs were not made with the same chips.
    """
    chips = [field.shape[1] for field in fields]
    if len(set(chips)) > 1:
        counts = ", ".join(f"{name}: {count}" for name, count in zip(names, chips, strict=True))
        raise RecordingError(f"runs must have the same chips; got {counts}")
    return np.concatenate(fields), np.repeat(
        np.arange(len(fields)), [len(field) for field in fields]
    )
