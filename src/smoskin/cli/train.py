"""Commands that press a twin for a response table, and that train networks on one."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from typer import Argument, Option

from smoskin.arrays import Floats
from smoskin.cli.ending import if_stopped
from smoskin.cli.frame import (
    Carried,
    Design,
    File,
    Force,
    Json,
    Number,
    Text,
    Whole,
    app,
    clock_of,
    examples,
    progress_bar,
    show,
)
from smoskin.errors import ArgumentError, require
from smoskin.feasibility import load_design
from smoskin.outputs import check_output
from smoskin.sensing.learned.gaussian_process import LearnedModel, Metric
from smoskin.sensing.response.table import ResponseTable


@app.command(
    "table", epilog=examples("table own.toml --out own.table", "table own.toml --folder presses")
)
def make_table(
    design: Design = "planar",
    out: Annotated[
        File, Option(help="The file to write; by default DESIGN.table, here.", dir_okay=False)
    ] = None,
    presses: Annotated[
        Whole, Option(min=1, max=1_000_000, help="Presses of the skin as designed, one touch each.")
    ] = None,
    pairs: Annotated[
        Whole,
        Option(min=0, max=1_000_000, help="Presses of the skin as designed, two touches each."),
    ] = None,
    skins: Annotated[
        Whole, Option(min=1, max=10_000, help="Made sheets, which show how skins differ.")
    ] = None,
    seed: Annotated[int, Option(min=0, help="Seed of the presses and made skins.")] = 0,
    folder: Annotated[
        File, Option(help="Keep the presses here and go on where they stop.", file_okay=False)
    ] = None,
    workers: Annotated[Whole, Option(min=1, help="Processes; one a core.")] = None,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Press a design's twin all over and write what its chips read as a response table.

    It takes a minute or two; with --folder a killed run goes on. Calibration by a few touches,
    networks and the Bayesian estimator all start from this file. The table of the planar design
    comes with the package.
    """
    from smoskin.commands import table as making
    from smoskin.datasets.workers import Engine

    usual = making.Effort(seed=seed)
    effort = replace(
        usual,
        presses=presses or usual.presses,
        pairs=usual.pairs if pairs is None else pairs,
        skins=skins or usual.skins,
    )
    file = check_output(out or Path(f"{Path(design).stem}.table"), force=overwrite)
    ResponseTable.check_writer()
    with if_stopped(lambda: _pressed(folder)), progress_bar() as progress:
        table = making.make_table(
            load_design(design), effort, folder=folder, engine=Engine(workers), progress=progress
        )
    table.save(file)
    if as_json:
        typer.echo(json.dumps({"file": str(file), **making.table_facts(table)}))
        return
    show(making.table_rows(table, str(file)))


def _pressed(folder: Path | None) -> str:
    """What a stopped table leaves, and how to go on."""
    if folder is None:
        return "nothing is kept; with --folder F a table goes on where it was stopped"
    return f"{folder} keeps what has been pressed, and the same command goes on from there"


@app.command(
    epilog=examples("train skin.table --minutes 5", "train skin.table --minutes 5 --resume")
)
def train(
    context: typer.Context,
    response: Annotated[
        Path, Argument(help="A response table, of a design or of a skin.", dir_okay=False)
    ],
    out: Annotated[Path, Option(help="The model file to write.", dir_okay=False)] = Path(
        "network.safetensors"
    ),
    design: Annotated[Text, Option(help="The table's design; by default the shipped one.")] = None,
    chips: Annotated[
        Text, Option(help="Chips that the network reads, such as 1,2; all by default.")
    ] = None,
    drag: Annotated[
        float, Option(min=0.0, help="Largest drag that it shall tell, N; 0: none.")
    ] = 0.0,
    arm: Carried = False,
    members: Annotated[Whole, Option(min=1, max=100, help="Networks of the ensemble.")] = None,
    minutes: Annotated[Number, Option(min=0.01, help="Longest time of the training.")] = None,
    start: Annotated[File, Option(help="A model to go on from.")] = None,
    resume: Annotated[bool, Option("--resume", help="Go on where training was stopped.")] = False,
    onnx: Annotated[File, Option(help="Write an ONNX file too.")] = None,
    plot: Annotated[File, Option(help="Draw what held-out touches miss to this file.")] = None,
    seed: Annotated[int, Option(min=0, help="Seed of weights and of touches.")] = 0,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Train a network that tells place and force, each with its uncertainty, from a reading.

    Touches are drawn anew from the table at every step, with noise, drift, warmth and creep, on
    skins as they differ. Trained on a design's table the network serves any skin made of it; on the
    table of one skin, calibrated by a few touches, that skin alone, and better. The learning curve
    stands beside the model, in a file that ends on .curve.jsonl.
    """
    from smoskin.commands import train as training

    check_output(out, force=overwrite)
    curve = check_output(out.with_name(out.name + ".curve.jsonl"), force=overwrite or resume)
    checkpoint = training.checkpoint_of(out, resume=resume)
    if onnx is not None:
        check_output(onnx, force=overwrite)
        require("writing ONNX files", "onnx", "onnx")
    if plot is not None:
        from smoskin.plots import check_figure, save_figure

        check_figure(plot, force=overwrite)
    skin = None if design is None else load_design(design)
    with if_stopped(lambda: training.kept_of(checkpoint)), progress_bar() as progress:
        trained = training.train(
            response,
            design=skin,
            chips=None if chips is None else training.parse_chips(chips),
            drag=drag,
            arm=arm,
            members=members,
            minutes=minutes,
            seed=seed,
            start=start,
            checkpoint=checkpoint,
            curve=curve,
            progress=progress,
            clock=clock_of(context),
        )
    model, *others = training.write_network(trained, out, onnx)
    files = [model, curve, *others]
    checkpoint.unlink()
    if plot is not None:
        drawn = training.residual_figure(trained, skin)
        save_figure(drawn, plot)
    if as_json:
        typer.echo(json.dumps(trained.as_json() | {"files": [str(file) for file in files]}))
        return
    show(training.figure_rows(trained))
    typer.echo(f"Training ended: {trained.ended}.")
    if trained.warning:
        typer.echo(f"warning: {trained.warning}", err=True)
    for file in files:
        typer.echo(str(file))


@app.command(
    epilog=examples(
        "learn touches.csv --out own.model",
        "learn monday.csv --test tuesday.csv",
        "learn campaign.mcap --past",
    )
)
def learn(
    sheets: Annotated[
        list[Path],
        Argument(help="Touches that have been made: sheets (CSV), or a rig's recordings (MCAP)."),
    ],
    out: Annotated[Path, Option(help="Model to write.", dir_okay=False)] = Path("own.model"),
    recording: Annotated[
        File, Option(help="MCAP with the readings, where one sheet says when touches were held.")
    ] = None,
    chips: Annotated[
        Text, Option(help="Chips that the model reads, such as 1,2; all by default.")
    ] = None,
    test: Annotated[
        list[Path] | None, Option(help="Sheet of touches to judge by and not to learn.")
    ] = None,
    past: Annotated[
        bool,
        Option(
            "--past",
            help="Learn every reading with its past, as rubber remembers: recordings with the "
            "force at each, of a rig (MCAP) or in a table (CSV) as convert writes it.",
        ),
    ] = False,
    plot: Annotated[File, Option(help="Draw what was missed of what is held out.")] = None,
    seed: Annotated[int, Option(min=0, help="Seed of what is held out.")] = 0,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Learn the touches of any board with any number of chips, and say how well.

    Places are held out whole, in five folds, to tell the error; the model is then trained on all
    touches but those at places that a rig's campaign has held out, which judge it too. --test
    judges it on sheets of another day or run, where a board's zero, rubber and placing differ.
    smoskin run SOURCE --calibration FILE runs it.
    """
    from smoskin.commands.train import parse_chips

    check_output(out, force=overwrite)
    require("a learned model", "learned", "safetensors")
    drawn = _Drawn(plot, force=overwrite)
    used = None if chips is None else parse_chips(chips)
    if past:
        if recording is not None:
            raise typer.BadParameter("--past reads recordings; --recording goes with one sheet")
        model, judged = _learned_with_past(sheets, test or (), used, seed, drawn.add)
    else:
        model, judged = _learned_touches(sheets, recording, test or (), used, seed, drawn.add)
    model.save(out)
    drawn.save(model)
    names = ", ".join(map(str, test)) if test else "places held out"
    _report(out, model, judged, names, as_json)


def _report(
    out: Path, model: LearnedModel, judged: tuple[Metric, ...], judges: str, as_json: bool
) -> None:
    """Print what a model reached, and by what was not learned."""
    figures, missed = _figures(model.metrics), _figures(judged)
    if as_json:
        document = {"file": str(out), "split": model.split, **figures}
        typer.echo(json.dumps(document | ({"test": missed} if judged else {})))
        return
    _tell(f"{out}, judged by {model.split}:", figures)
    if judged:
        _tell(f"{judges}, not learned:", missed)
    typer.echo(f"Now: smoskin run SOURCE --calibration {out}", err=True)


class _Drawn:
    """A picture of what was missed of what was held out; none without a file."""

    def __init__(self, file: Path | None, *, force: bool) -> None:
        if file is not None:
            from smoskin.plots import check_figure

            check_figure(file, force=force)
        self._file, self._missed = file, (np.zeros((0, 0)), np.zeros((0, 0)))

    def add(self, true: Floats, error: Floats) -> None:
        """Take what was true and what was missed, (N, O) each."""
        self._missed = true, error

    def save(self, model: LearnedModel) -> None:
        """Draw it."""
        if self._file is not None:
            from smoskin.commands.learn import missed_figure
            from smoskin.plots import save_figure

            save_figure(missed_figure(model.outputs, *self._missed), self._file)


def _learned_touches(
    sheets: Sequence[Path],
    recording: Path | None,
    test: Sequence[Path],
    chips: tuple[int, ...] | None,
    seed: int,
    on_judged: Callable[[Floats, Floats], None],
) -> tuple[LearnedModel, tuple[Metric, ...]]:
    """A model of touches that were held still, and its figures on others."""
    from smoskin.sensing.learned.touches import judge_touches, learn_touches
    from smoskin.service.kept import parted_sheet, read_sheet

    parted = [parted_sheet(sheet) for sheet in sheets]
    tables = [learned for learned, _ in parted]
    tests = [read_sheet(sheet)[0] for sheet in test]
    tests += [held for _, held in parted if held is not None]
    if recording is not None:
        from smoskin.service.recording import open_recording

        readings = list(open_recording(recording).readings())
        tables = [table.with_readings(readings) for table in tables]
        tests = [table.with_readings(readings) for table in tests]
    with progress_bar() as progress:
        model = learn_touches(
            tables, chips=chips, seed=seed, progress=progress, on_judged=on_judged
        )
    return model, judge_touches(model, tests) if tests else ()


def _learned_with_past(
    recordings: Sequence[Path],
    test: Sequence[Path],
    chips: tuple[int, ...] | None,
    seed: int,
    on_judged: Callable[[Floats, Floats], None],
) -> tuple[LearnedModel, tuple[Metric, ...]]:
    """A model of every reading with its past, and its figures on other recordings."""
    from smoskin.commands.learn import read_course
    from smoskin.sensing.learned.courses import judge_courses, learn_courses
    from smoskin.service.kept import held_out_of

    for path in recordings:
        if path.suffix == ".mcap" and held_out_of(path):
            raise ArgumentError(f"{path} holds places out, whose rises --past would learn")
    courses = [read_course(path) for path in recordings]
    tests = [read_course(path) for path in test]
    with progress_bar() as progress:
        model = learn_courses(
            courses, chips=chips, seed=seed, progress=progress, on_judged=on_judged
        )
    return model, judge_courses(model, tests) if tests else ()


def _figures(metrics: Iterable[Metric]) -> dict[str, float]:
    """Figures by their names with units."""
    return {f"{m.name}_{m.unit}".rstrip("_"): m.value for m in metrics}


def _tell(heading: str, figures: dict[str, float]) -> None:
    """Print figures under a heading."""
    typer.echo(heading)
    for name, value in _in_millimetres(figures).items():
        typer.echo(f"{name}: {value:.3g}")


def _in_millimetres(figures: dict[str, float]) -> dict[str, float]:
    """Figures in the units people read."""
    return {
        (f"{name[:-1]}mm" if name.endswith("_m") else name): (
            1e3 * value if name.endswith("_m") else value
        )
        for name, value in figures.items()
    }
