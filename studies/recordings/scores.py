"""Figures of the benchmark, and how they are told to machines and to people."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One figure of one model in one test."""

    set: str
    """Name of the recording's set."""
    test: str
    """What was asked."""
    split: str
    """What was trained on and what was judged."""
    chips: int
    """Chips that the model saw."""
    model: str
    """`smoskin`, `ridge` or `5-nearest`."""
    metric: str
    """`mean_error` of a place in the plane, `rmse` of a force, `right` share of rows, or `ratio`
    to the same model's error under the recording's own zero."""
    value: float
    unit: str
    """Empty where the value is a plain number."""
    target: float | None = None
    """What smoskin is to reach on the published recordings; None where nothing was set."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """All figures, and what has to be said about them."""

    scores: tuple[Score, ...]
    notes: tuple[str, ...]
    """Sets and tests left out, and what was chosen inside the training parts."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines: ``{"results": [...]}``."""
        return {"results": [asdict(score) for score in self.scores]}

    def table(self) -> "Table":
        """A table for people: a row a test, a column a model."""
        from rich.table import Table

        models = list(dict.fromkeys(score.model for score in self.scores))
        table = Table(title="Recordings: judged on what was never trained on", show_lines=True)
        for name in ("set", "test", "split", "metric"):
            table.add_column(name, overflow="fold")
        for name in ("chips", "target", *models):
            table.add_column(name, justify="right", no_wrap=True)
        rows: dict[tuple[str, str, str, str, int, str], dict[str, str]] = {}
        for score in self.scores:
            target = "" if score.target is None else _shown(score.target, score.unit)
            head = (score.set, score.test, score.split, score.metric, score.chips, target)
            rows.setdefault(head, {})[score.model] = _shown(score.value, score.unit)
        for (*words, chips, target), values in rows.items():
            cells = [values.get(model, "") for model in models]
            table.add_row(*map(str, words), str(chips), target, *cells)
        return table


def _shown(value: float, unit: str) -> str:
    """A number with its unit."""
    return f"{value:.3f} {unit}".rstrip()
