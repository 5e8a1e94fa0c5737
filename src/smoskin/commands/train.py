"""Trains a network on a response table: `smo.train`, and the files of `smoskin train`.

Decides which files stand beside a model while and after it is trained.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from smoskin.arguments import Seed, typed
from smoskin.design.document import shipped_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.roles import Progress, stopwatch, unheard
from smoskin.sensing.learned.gaussian_process import Metric
from smoskin.sensing.network.model import NetworkModel, load_network
from smoskin.sensing.network.samples import TouchSpread, TrainingEffort
from smoskin.sensing.response.table import ResponseTable, load_response_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

    from smoskin.sensing.network.training import Trained

_DRAWN: Final = 300
"""Held-out touches that a figure shows."""


@typed
def train(
    table: ResponseTable | Path | str,
    *,
    minutes: float | None = None,
    seed: Seed = 0,
    design: SkinDesign | str | None = None,
    chips: Sequence[int] | None = None,
    drag: float = 0.0,
    arm: bool = False,
    members: int | None = None,
    effort: TrainingEffort | None = None,
    start: NetworkModel | Path | str | None = None,
    checkpoint: Path | None = None,
    curve: Path | None = None,
    progress: Progress = unheard,
    clock: Callable[[], float] | None = None,
) -> "Trained":
    """A network that tells place and force, each with its uncertainty, from a reading.

    Parameters
    ----------
    table : ResponseTable or path
        Table of a design, for any skin made of it; or of one skin that was calibrated.
    minutes, members : optional
        Longest time, and networks of the ensemble; those of the effort by default.
    seed : int
        Seed of the first weights and of all touches that are drawn.
    design : SkinDesign or str, optional
        Design of the table, or its name; by default the shipped one that it was made of.
    chips : sequence of int, optional
        Chips that the network reads; all of the table by default.
    drag : float
        Largest drag that it shall tell, N; 0: touches are straight.
    arm : bool
        Whether an arm turns the skin, so that its zero is known less well.
    effort : TrainingEffort, optional
        Sizes and lengths.
    start : NetworkModel or path, optional
        A network to go on from, such as the design's for one skin of it; its sizes are kept.
    checkpoint : Path, optional
        File that is written after every epoch; where it exists, training goes on from there.
    curve : Path, optional
        File of the learning curve, a line of JSON for each epoch.
    progress : Progress
        Listener.
    clock : callable, optional
        Seconds since the work began; since the call by default.

    Raises
    ------
    ArgumentError
        If a number is out of its range.
    DesignError
        If no design is given and the table is of none that is shipped.
    ModelError
        If table, start or checkpoint belong to another design or training.
    MissingExtraError
        If the extra `train` is not installed.
    """
    from smoskin.sensing.network.training import train_network

    whole = table if isinstance(table, ResponseTable) else load_response_table(table)
    skin = load_design(design) if isinstance(design, str) else design
    skin = skin or shipped_design(whole.design_hash)
    asked = {"members": members, "seconds": None if minutes is None else 60 * minutes}
    given: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
    work = replace(effort or TrainingEffort(), seed=seed, **given)
    return train_network(
        skin,
        whole if chips is None else whole.of_chips(chips),
        spread=TouchSpread(drag=drag, arm=arm),
        creep=elastomer_prony(skin.columns.material),
        effort=work,
        start=load_network(start) if isinstance(start, (str, Path)) else start,
        checkpoint=checkpoint,
        curve=curve,
        progress=progress,
        clock=clock or stopwatch(),
    )


def residual_figure(trained: "Trained", design: SkinDesign | None = None) -> "Figure":
    """Draw where held-out touches are located, and what is missed over what was stated.

    The design is the shipped one that the network was made for, by default.
    """
    from smoskin.plots import draw_judgement

    held_out, design = trained.held_out, design or shipped_design(trained.model.design_hash)
    names = ("x", "y", "Fx", "Fy", "normal force")
    missed = {names[row]: held_out.scaled[:, row] for row in trained.model.rows}
    places, off = held_out.position[:_DRAWN], held_out.errors[:_DRAWN, :2]
    return draw_judgement(design, places, off, missed, "located on skins held out")


def figure_rows(trained: "Trained") -> "Table":
    """The figures of a network, for people."""
    from rich.table import Table

    table = Table(title="Touches of 0.3 N and more, on skins held out from training")
    for name in ("figure", "value", "unit"):
        table.add_column(name, justify="left" if name == "figure" else "right")
    least = "least mean distance that noise and the spread of skins leave"
    for metric in (*trained.model.metrics, Metric(least, trained.attainable, "m")):
        table.add_row(metric.name, *metric.shown)
    return table


def checkpoint_of(out: Path, *, resume: bool) -> Path:
    """The checkpoint's file beside a model's, asked for whether training shall go on from it.

    It raises an `ArgumentError` if a training was stopped here and is not to be resumed, or the
    other way round.
    """
    checkpoint = out.with_name(out.name + ".checkpoint")
    if checkpoint.exists() is not resume:
        hint = f"; got no {checkpoint}" if resume else f", or remove {checkpoint}"
        raise ArgumentError(f"resume must be asked for where a training was stopped{hint}")
    return checkpoint


def kept_of(checkpoint: Path) -> str:
    """What a stopped training leaves, and how to go on."""
    if not checkpoint.exists():
        return "nothing is kept, as no epoch was over"
    return f"{checkpoint} keeps every epoch that was over, and --resume goes on from there"


def write_network(trained: "Trained", out: Path, onnx: Path | None = None) -> list[Path]:
    """Write a network to `out`, and to `onnx` as an ONNX file; the files written.

    It raises a `MissingExtraError` without `safetensors`, or `onnx` where that is needed.
    """
    trained.save(out)
    if onnx is None:
        return [out]
    from smoskin.sensing.network.export import export_onnx

    export_onnx(trained.model, onnx)
    return [out, onnx]


def parse_chips(text: str) -> tuple[int, ...]:
    """Chips of a text such as ``1,2``; any other raises an `ArgumentError`."""
    try:
        return tuple(int(chip) for chip in text.split(","))
    except ValueError as error:
        raise ArgumentError(f"chips must be numbers such as 1,2; got {text!r}") from error
