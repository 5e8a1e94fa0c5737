"""Trains a network on a response table, and writes it with its learning curve.

Decides which files stand beside a model while and after it is trained: the curve (JSON lines), and
a checkpoint that is removed once training has ended of itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.sensing.network.lessons import NetworkEffort
from smoskin.sensing.network.model import NetworkModel, load_network
from smoskin.sensing.network.samples import TouchSpread
from smoskin.sensing.response.table import ResponseTable

if TYPE_CHECKING:
    from rich.table import Table

    from smoskin.sensing.network.training import Epoch

Progress = Callable[[str, float], None]
"""Is told what is being done, and the share of the whole work that is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainedNetwork:
    """A training that has ended, and its files."""

    model: NetworkModel
    curve: "tuple[Epoch, ...]"
    ended: str
    """Why, in words."""
    files: tuple[Path, ...]
    """The model, its curve, and the ONNX file where one was asked for."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        last = self.curve[-1]
        return {
            "design_hash": self.model.design_hash,
            "data_sha256": self.model.data_sha256,
            "chips": list(self.model.chips),
            "drag_N": self.model.drag,
            "epochs": last.epoch,
            "seconds": last.seconds,
            "ended": self.ended,
            "held_out_nats": min(point.held_out for point in self.curve),
            "metrics": [metric._asdict() for metric in self.model.metrics],
            "files": [str(file) for file in self.files],
        }

    def table(self) -> "Table":
        """The figures, for people."""
        from rich.table import Table

        table = Table(title="Touches of 0.3 N and more, on skins held out from training")
        for name in ("figure", "value", "unit"):
            table.add_column(name, justify="left" if name == "figure" else "right")
        for name, value, unit in self.model.metrics:
            scale, shown = {"m": (1e3, "mm"), "1": (100.0, "%")}.get(unit, (1.0, unit))
            table.add_row(name, f"{value * scale:.3g}", shown)
        return table


def train_on_table(
    design: SkinDesign,
    table: ResponseTable,
    out: Path,
    *,
    chips: Sequence[int] | None = None,
    drag: float = 0.0,
    effort: NetworkEffort | None = None,
    start: Path | None = None,
    resume: bool = False,
    onnx: Path | None = None,
    progress: Progress | None = None,
) -> TrainedNetwork:
    """Train a network and write it to `out`, its curve to `out` with `.curve.jsonl` for an ending.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of the design, for any skin; or of one skin that was calibrated.
    out : Path
    chips : sequence of int, optional
        That the network reads; all of the table by default.
    drag : float
        N: largest drag that it shall tell; 0: touches are straight.
    effort : NetworkEffort, optional
    start : Path, optional
        A network to go on from.
    resume : bool
        Go on where a training of the same kind was stopped.
    onnx : Path, optional
        Write the network there as an ONNX file too.
    progress : callable, optional

    Raises
    ------
    ArgumentError
        If a training was stopped here and it is not to be resumed, or the other way round.
    MissingExtraError
        If the extra `train`, or `onnx` where it is needed, is not installed.
    """
    from smoskin.sensing.network.training import train_network

    checkpoint = out.with_name(out.name + ".checkpoint")
    if checkpoint.exists() is not resume:
        raise ArgumentError(
            f"resume must be asked for where a training was stopped, or remove {checkpoint}"
            if checkpoint.exists()
            else f"resume must be asked for where a training was stopped; got no {checkpoint}"
        )
    curve = out.with_name(out.name + ".curve.jsonl")
    trained = train_network(
        design,
        table if chips is None else table.of_chips(chips),
        spread=TouchSpread(drag=drag),
        creep=elastomer_prony(design.columns.material),
        effort=effort,
        start=None if start is None else load_network(start),
        checkpoint=checkpoint,
        curve=curve,
        progress=progress,
    )
    trained.model.save(out)
    files = [out, curve]
    if onnx is not None:
        from smoskin.sensing.network.export import export_onnx

        export_onnx(trained.model, onnx)
        files.append(onnx)
    checkpoint.unlink()
    return TrainedNetwork(
        model=trained.model, curve=trained.curve, ended=trained.ended, files=tuple(files)
    )


def parse_chips(text: str) -> tuple[int, ...]:
    """Chips from ``1,2``.

    Raises
    ------
    ArgumentError
        If the text is no such list.

    Examples
    --------
    >>> parse_chips("1,2")
    (1, 2)
    """
    try:
        return tuple(int(one) for one in text.split(","))
    except ValueError as error:
        raise ArgumentError(f"chips must be numbers such as 1,2; got {text!r}") from error


def effort_of(
    *, members: int | None = None, minutes: float | None = None, seed: int = 0
) -> NetworkEffort:
    """An effort with these numbers, where they are given."""
    effort = NetworkEffort(seed=seed)
    if members is not None:
        effort = replace(effort, members=members)
    return effort if minutes is None else replace(effort, seconds=60 * minutes)
