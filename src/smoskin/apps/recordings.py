"""How well learned estimators do on recordings of real chips, told without leaks.

Decides the tests: where a probe pressed, on places never trained on; how hard, on a run never
trained on and on the last fifth of a run. Splits are by place and by run, never by row, and
whatever is chosen (chips, lengths, the ridge) is chosen inside the training part. Ridge
regression and nearest neighbours stand beside the package's own model.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.spatial import cKDTree

from smoskin.arrays import Bools, Floats, Ints
from smoskin.errors import ArgumentError, RecordingError
from smoskin.sensing.encoding import Encoding, Form
from smoskin.sensing.learned import Output
from smoskin.sensing.training import Effort, Examples, Progress, train
from smoskin.service.bridge import EFLESH_SETS, ProbeRun, read_eflesh

if TYPE_CHECKING:
    from rich.table import Table

_FOLDS: Final = 5
_LEAST_PLACES: Final = 10
_BLOCKS: Final = 10
"""Parts of a run that count as groups of the force sets, about a load cycle each."""
_MEMORY: Final = 3.0
"""s: the past that force models see; the best of none, 1, 3 and 10 s on early cycles held out
within each of the two normal-force runs, never on the other run."""
_PLACE_GRID: Final = 1e-4
"""m: positions that round to the same point are one place."""
_QUICK: Final = Effort(rows=2400, evidence_rows=250, iterations=15)
_MOST_SUBSETS: Final = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One figure of one model in one test."""

    set: str
    """Of the recording."""
    test: str
    """What was asked."""
    split: str
    """What was trained on and what was judged."""
    chips: int
    """How many the model saw."""
    model: str
    """`smoskin`, `ridge` or `5-nearest`."""
    metric: str
    """`mean_error` of the place in the plane, or `rmse` of the force."""
    value: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """All figures, and what has to be said about them."""

    scores: tuple[Score, ...]
    notes: tuple[str, ...]
    """Sets and tests left out, and which chips were chosen."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines: ``{"results": [...]}``."""
        return {"results": [asdict(score) for score in self.scores]}

    def table(self) -> "Table":
        """A table for people: a row a test, a column a model."""
        from rich.table import Table

        models = list(dict.fromkeys(score.model for score in self.scores))
        table = Table(title="Recordings: judged on what was never trained on", show_lines=True)
        for name in ("set", "test", "split"):
            table.add_column(name, overflow="fold")
        for name in ("chips", *models):
            table.add_column(name, justify="right", no_wrap=True)
        rows: dict[tuple[str, str, str, int], dict[str, str]] = {}
        for score in self.scores:
            row = rows.setdefault((score.set, score.test, score.split, score.chips), {})
            row[score.model] = f"{score.value:.3f} {score.unit}"
        for (*words, chips), values in rows.items():
            table.add_row(*words, str(chips), *(values.get(model, "") for model in models))
        return table


def bench_recordings(
    directory: Path | str,
    *,
    chips: int | None = None,
    seed: int = 0,
    effort: Effort | None = None,
    progress: Progress | None = None,
) -> Benchmark:
    """Train and judge on the recordings under a folder.

    Parameters
    ----------
    directory : Path or str
        As `smoskin.service.bridge.read_eflesh` takes it.
    chips : int, optional
        Location is judged with all chips and with the best this many; two by default.
    seed : int, optional
        Of folds and training.
    effort : Effort, optional
        Of each training.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Returns
    -------
    Benchmark

    Raises
    ------
    RecordingError
        If the recordings cannot be read.
    ArgumentError
        If there are not that many chips.
    """
    runs = read_eflesh(directory)
    bench = _Bench(seed, effort or Effort(), progress or (lambda what, share: None))
    scores: list[Score] = []
    for position, name in enumerate(EFLESH_SETS):
        bench.share = (position / len(EFLESH_SETS), 1 / len(EFLESH_SETS))
        members = [run for run in runs if run.set == name]
        if not members:
            bench.notes.append(f"{name}: not in {directory}; left out")
        elif name == "spatial_resolution":
            scores.extend(bench.location(members, chips))
        else:
            scores.extend(bench.force(members))
    bench.progress("done", 1.0)
    return Benchmark(scores=tuple(scores), notes=tuple(bench.notes))


class _Bench:
    """What all tests share: seed, effort, progress and notes."""

    def __init__(self, seed: int, effort: Effort, progress: Progress) -> None:
        self.seed = seed
        self.effort = effort
        self.progress = progress
        self.notes: list[str] = []
        self.share = (0.0, 1.0)

    def report(self, what: str, done: float) -> None:
        """Pass on the progress of the present set."""
        start, width = self.share
        self.progress(what, start + width * done)

    def location(self, runs: Sequence[ProbeRun], chips: int | None) -> Iterator[Score]:
        """Error of the place, with places held out in folds."""
        examples = _location_examples(runs)
        present = examples.field.shape[1]
        if chips is not None and not 1 <= chips <= present:
            raise ArgumentError(f"chips must be 1 to {present}, as recorded; got {chips}")
        fewer = min(2, present) if chips is None else chips
        places = np.unique(examples.group)
        if len(places) < _LEAST_PLACES:
            self.notes.append(
                f"spatial_resolution: {len(places)} places; location needs {_LEAST_PLACES}"
            )
            return
        fold_of_place = np.empty(len(places), dtype=np.int64)
        drawn = np.random.default_rng(self.seed).permutation(len(places))
        fold_of_place[drawn] = np.arange(len(places)) % _FOLDS
        fold = fold_of_place[np.searchsorted(places, examples.group)]
        split = f"{_FOLDS} folds of {len(places)} places, all passes of a place together"
        for count in dict.fromkeys((present, fewer)):
            errors: dict[str, list[Floats]] = {}
            chosen = []
            for k in range(_FOLDS):
                self.report(f"location, {count} chips, fold {k + 1}", _share(k, count == fewer))
                judged = fold == k
                used = self._choose(examples.where(~judged), count)
                chosen.append(used)
                encoding = Encoding(chips=used, form=Form.DIRECTION)
                for model, answer in self._answers(examples, judged, encoding).items():
                    miss = np.linalg.norm(answer - examples.targets[judged], axis=1)
                    errors.setdefault(model, []).append(miss)
            if count < present:
                listed = ", ".join(str(used) for used in chosen)
                self.notes.append(f"spatial_resolution: best {count} chips by fold: {listed}")
            for model, misses in errors.items():
                yield Score(
                    set="spatial_resolution",
                    test="held-out places",
                    split=split,
                    chips=count,
                    model=model,
                    metric="mean_error",
                    value=1e3 * float(np.concatenate(misses).mean()),
                    unit="mm",
                )

    def force(self, runs: Sequence[ProbeRun]) -> Iterator[Score]:
        """Error of the force, with whole runs and with the ends of runs held out."""
        examples = _force_examples(runs)
        name = runs[0].set
        known = examples.known
        everything = Encoding(
            chips=tuple(range(examples.field.shape[1])), time_constants=(_MEMORY,)
        )
        tests: list[tuple[str, str, Bools, Bools]] = []
        for k, run in enumerate(runs):
            this = examples.run == k
            if len(runs) > 1:
                others = ", ".join(one.name for one in runs if one is not run)
                words = f"trained on {others}, judged on {run.name}"
                tests.append(("other run", words, ~this, this))
        for k, run in enumerate(runs):
            this = examples.run == k
            late = this & (examples.group % _BLOCKS >= _BLOCKS - _BLOCKS // 5)
            words = f"trained on the first four fifths of {run.name}, judged on the last"
            tests.append(("last fifth", words, this & ~late, late))
        if len(runs) == 1:
            self.notes.append(f"{name}: one run; not judged on another")
        for k, (test, words, trained, judged) in enumerate(tests):
            self.report(f"{name}, {test}", k / len(tests))
            if min((known & trained).sum(), (known & judged).sum()) < 2 * _BLOCKS:
                self.notes.append(f"{name}: {words}: too few rows with a load; left out")
                continue
            rows = judged & known
            seen = examples.where(trained | judged)
            for model, answer in self._answers(seen, rows, everything).items():
                error = answer - examples.targets[rows]
                yield Score(
                    set=name,
                    test=test,
                    split=words,
                    chips=len(everything.chips),
                    model=model,
                    metric="rmse",
                    value=float(np.sqrt(np.mean(error**2))),
                    unit="N",
                )

    def _answers(self, examples: Examples, judged: Bools, encoding: Encoding) -> dict[str, Floats]:
        """What each model, trained on the known rows that are not judged, says of those."""
        training = examples.where(~judged)
        model = train(training, encoding, seed=self.seed, effort=self.effort)
        ours = model.predict(examples.encode(encoding)[judged]).values
        plain = examples.field[:, list(encoding.chips)].reshape(len(judged), -1)
        rows = training.known
        x, y, group = plain[rows], examples.targets[rows], examples.group[rows]
        spread = np.maximum(x.std(axis=0), 1e-12)
        x, asked = x / spread, plain[judged] / spread
        return {
            "smoskin": ours,
            "ridge": _ridge(x, y, group, asked, self.seed),
            "5-nearest": y[cKDTree(x).query(asked, k=5)[1]].mean(axis=1),
        }

    def _choose(self, training: Examples, count: int) -> tuple[int, ...]:
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
            encoding = Encoding(chips=used, form=Form.DIRECTION)
            model = train(training, encoding, seed=self.seed, effort=_QUICK)
            errors.append(next(m.value for m in model.metrics if m.name == "mean_error"))
        return subsets[int(np.argmin(errors))]


def _share(fold: int, second: bool) -> float:
    """Share of the location test that is done when a fold begins."""
    return (fold + _FOLDS * second) / (2 * _FOLDS)


def _ridge(x: Floats, y: Floats, group: Ints, asked: Floats, seed: int) -> Floats:
    """Ridge regression, its strength chosen on groups held out within the training part."""
    groups = np.unique(group)
    drawn = np.random.default_rng(seed).permutation(groups)
    inner = np.isin(group, drawn[: max(1, len(groups) // 5)])

    def fit(rows: Bools, strength: float, at: Floats) -> Floats:
        mean, level = x[rows].mean(axis=0), y[rows].mean(axis=0)
        moved = x[rows] - mean
        normal = moved.T @ moved + strength * rows.sum() * np.eye(x.shape[1])
        slope = np.linalg.solve(normal, moved.T @ (y[rows] - level))
        return np.asarray((at - mean) @ slope + level)

    strengths = 10.0 ** np.arange(-8.0, 1.0)
    errors = [((fit(~inner, one, x[inner]) - y[inner]) ** 2).mean() for one in strengths]
    return fit(np.ones(len(x), dtype=bool), float(strengths[np.argmin(errors)]), asked)


def _joined(runs: Sequence[ProbeRun]) -> tuple[Floats, Floats, Ints]:
    """Time, re-zeroed field and run of all rows of a set."""
    if len({run.field.shape[1] for run in runs}) > 1:
        counts = ", ".join(f"{run.name}: {run.field.shape[1]}" for run in runs)
        raise RecordingError(f"{runs[0].set}: runs must have the same chips; got {counts}")
    return (
        np.concatenate([run.time for run in runs]),
        np.concatenate([run.field_rezeroed for run in runs]),
        np.repeat(np.arange(len(runs)), [len(run.time) for run in runs]),
    )


def _location_examples(runs: Sequence[ProbeRun]) -> Examples:
    """Presses and where they were."""
    time, field, run = _joined(runs)
    position = np.concatenate([one.position[:, :2] for one in runs])
    _, place = np.unique(np.round(position / _PLACE_GRID), axis=0, return_inverse=True)
    return Examples(
        time=time,
        field=field,
        targets=position,
        outputs=(Output.X, Output.Y),
        group=place.reshape(-1),
        run=run,
    )


def _force_examples(runs: Sequence[ProbeRun]) -> Examples:
    """Loads over time: pressing is negative z; shear is along the skin's x by convention."""
    time, field, run = _joined(runs)
    load = np.concatenate([one.load for one in runs])[:, None]
    blocks = [np.arange(len(one.time)) * _BLOCKS // len(one.time) for one in runs]
    shear = runs[0].set == "shear_force"
    return Examples(
        time=time,
        field=field,
        targets=load if shear else -load,
        outputs=(Output.FX if shear else Output.FZ,),
        group=np.concatenate(blocks) + _BLOCKS * run,
        run=run,
    )
