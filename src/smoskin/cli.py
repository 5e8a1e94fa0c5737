"""The command line: one thin group of commands over `smoskin.apps` and the package.

Exit codes: 0 done, 1 the asked-for thing failed or was missed, 2 wrong use. An error is one line
on standard error, without a traceback.
"""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from smoskin import __version__
from smoskin.errors import MissingExtraError, SmoskinError

try:
    import typer
except ImportError:
    sys.exit(f"error: {MissingExtraError('the command line', 'cli')}")

if TYPE_CHECKING:
    from rich.table import Table

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Design, simulate, calibrate, train, run and see a sandwich Miura-ori tactile skin.",
)
bench = typer.Typer(no_args_is_help=True, help="Measure estimators on data.")
app.add_typer(bench, name="bench")

Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Design = Annotated[str, typer.Argument(help="A shipped design or the path of a TOML document.")]
Seconds = Annotated[float | None, typer.Option(min=0.0, help="Stop after so many seconds.")]
Record = Annotated[
    Path | None, typer.Option(help="Write everything to this new MCAP file.", dir_okay=False)
]


def main() -> None:
    """Run the command line; the console script's entry."""
    try:
        app()
    except SmoskinError as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"smoskin {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options before any command."""


@app.command()
def demo(
    design: Design = "planar",
    seconds: Seconds = None,
    headless: Annotated[bool, typer.Option("--headless", help="Without the live page.")] = False,
    as_json: Json = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page; 0: a free one.")] = 0,
    rate: Annotated[float, typer.Option(help="Readings a second, Hz.")] = 100.0,
    seed: Annotated[
        int, typer.Option(min=0, help="Of the skin, of all noise and of the hand.")
    ] = 0,
    record: Record = None,
) -> None:
    """Touch a simulated skin and see what its chips feel, live in a browser.

    The skin is made and calibrated first, which takes some seconds. A scripted hand presses it all
    over; in the page the mouse presses it too. At the end every touch of the hand is listed beside
    its estimate; the exit code is 1 if one was missed.
    """
    from smoskin.apps.demo import run_demo
    from smoskin.feasibility import load_design

    if headless and seconds is None:
        seconds = 10.0

    def announce(url: str | None) -> None:
        where = f"The skin is live at {url}" if url else "The hand is touching the skin"
        until = f"for {seconds:g} s" if seconds is not None else "until Ctrl-C"
        typer.echo(f"{where} {until}.", err=True)

    result = run_demo(
        load_design(design),
        seconds=seconds,
        page=not headless,
        port=port,
        rate=rate,
        seed=seed,
        record=record,
        on_start=announce,
        say=lambda sentence: typer.echo(sentence, err=True),
    )
    if as_json:
        typer.echo(json.dumps(result.as_json()))
    else:
        _print_demo(result)
    if result.summary.found < result.summary.touches:
        raise typer.Exit(1)


@app.command()
def info(design: Design = "planar", as_json: Json = False) -> None:
    """Print a design: what is built, where each value comes from, and what follows from it."""
    from smoskin.apps.info import describe
    from smoskin.feasibility import load_design

    sheet = describe(load_design(design))
    if as_json:
        typer.echo(json.dumps(sheet.as_json()))
        return
    for table in sheet.tables():
        _show(table)


@app.command()
def run(
    source: Annotated[str, typer.Argument(help="twin://planar or replay:FILE, with ?options.")],
    design: Annotated[str, typer.Option(help="Of the skin that the source reads.")] = "planar",
    calibration: Annotated[
        Path | None, typer.Option(help="Of this skin, as `smoskin calibrate` writes it.")
    ] = None,
    seconds: Seconds = None,
    record: Record = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print each estimate as a line of JSON.")
    ] = False,
) -> None:
    """Estimate touches from a source of readings and print them as they come."""
    from smoskin.apps.watch import estimate_line, watch
    from smoskin.feasibility import load_design

    skin = load_design(design)
    for estimate in watch(skin, source, calibration=calibration, seconds=seconds, record=record):
        typer.echo(estimate_line(estimate, as_json=as_json))


@app.command()
def simulate(
    design: Design = "planar",
    at: Annotated[
        list[str] | None, typer.Option(help="x,y of a touch, mm; once for each touch.")
    ] = None,
    force: Annotated[
        list[str] | None, typer.Option(help="Fx,Fy,Fz of each touch on the skin, N; z < 0 presses.")
    ] = None,
    sweep: Annotated[
        Literal["grid", "shear", "pairs", "random"] | None,
        typer.Option(help="Instead of one press: every place of a grid; with drags; two at once."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The sweep's folder; repeat to resume.", file_okay=False)
    ] = None,
    export: Annotated[
        Path | None, typer.Option(help="Also write the sweep to this one HDF5 file.")
    ] = None,
    forces: Annotated[
        str | None, typer.Option(help="N: 0.1,0.5 or from:to:count; random: from:to.")
    ] = None,
    drags: Annotated[str | None, typer.Option(help="Sideways, N, likewise.")] = None,
    directions: Annotated[str | None, typer.Option(help="Of the drags of a shear sweep.")] = None,
    places: Annotated[str | None, typer.Option(help="Of the grid, such as 25x33.")] = None,
    count: Annotated[str | None, typer.Option(help="How many random presses.")] = None,
    touches: Annotated[str | None, typer.Option(help="At once: 2, or from:to.")] = None,
    radius: Annotated[str | None, typer.Option(help="Of touches, mm; random: from:to.")] = None,
    margin: Annotated[str | None, typer.Option(help="Of random presses to the rim, mm.")] = None,
    temperature: Annotated[
        str | None, typer.Option(help="degC; for sweeps one or more, as forces.")
    ] = None,
    skins: Annotated[int, typer.Option(min=0, help="Sweep over so many manufactured skins.")] = 0,
    manufactured: Annotated[
        bool, typer.Option("--manufactured", help="Press a manufactured skin, of this seed.")
    ] = False,
    mechanics: Annotated[
        Literal["whole", "reduced"],
        typer.Option(help="whole: the folded sheet; reduced: the paper's model."),
    ] = "whole",
    grip: Annotated[
        str | None, typer.Option(help="sticking, frictionless, covered or sliding:FRICTION.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of noise and of random presses.")] = 0,
    chunk: Annotated[int | None, typer.Option(min=1, help="Presses a file of the sweep.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one a core.")] = None,
    engine: Annotated[
        Literal["local", "dask"], typer.Option(help="Where a sweep is computed.")
    ] = "local",
    scheduler: Annotated[
        str | None, typer.Option(help="Of a running dask cluster, such as tcp://host:8786.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Press a simulated skin: once, to see what it does, or in a sweep that fills a data set.

    A sweep that was stopped goes on when the command is repeated. The exit code is 1 if a single
    press finds no equilibrium; a sweep counts such rows and flags them in its files.
    """
    from smoskin.apps import simulate as simulation
    from smoskin.errors import ArgumentError
    from smoskin.feasibility import load_design

    of_sweep = {"forces": forces, "drags": drags, "directions": directions, "places": places,
                "count": count, "touches": touches, "radius": radius, "margin": margin}  # fmt: skip
    if sweep is None:
        others = (*of_sweep.values(), out, export, chunk, workers, scheduler)
        degrees = simulation.parse_numbers("temperature", temperature or "25")
        if not at or skins or len(degrees) > 1 or any(value is not None for value in others):
            raise ArgumentError(
                "simulate must be given --at and --force for one press, at one temperature, or "
                "--sweep and --out"
            )
        press = simulation.simulate_press(
            load_design(design),
            at,
            force or [],
            temperature=degrees[0],
            mechanics=mechanics,
            grip=grip,
            manufactured=manufactured,
            seed=seed,
        )
        if as_json:
            typer.echo(json.dumps(press.as_json()))
        else:
            for table in press.tables():
                _show(table)
        if not press.valid:
            typer.echo("The skin has no equilibrium under these touches.", err=True)
            raise typer.Exit(1)
        return
    if at or force or manufactured or out is None:
        raise ArgumentError("a sweep must be given --out, and neither --at, --force nor "
                            "--manufactured (skins says how many)")  # fmt: skip
    planned = simulation.plan_sweep(
        sweep,
        of_sweep,
        temperatures=temperature,
        skins=skins,
        mechanics=mechanics,
        grip=grip,
        seed=seed,
        presses_per_chunk=chunk,
    )
    with _progress() as progress:
        done = simulation.run_sweep(
            load_design(design),
            planned,
            out,
            engine=simulation.parse_engine(engine, workers, scheduler),
            export=export,
            progress=lambda state: progress(
                f"{state.rows}/{state.rows_in_all} rows, {state.rate:.0f}/s",
                state.rows / state.rows_in_all,
            ),
        )
    if as_json:
        typer.echo(json.dumps(done.as_json()))
        return
    for line in done.lines():
        typer.echo(line)


@app.command()
def report(
    out: Annotated[Path, typer.Option(help="The folder to write to.", file_okay=False)],
    design: Design = "planar",
) -> None:
    """Write the paper's figures, tables and numbers beside what this package computes.

    The folder gets report.html, report.pdf, report.json and every figure as SVG.
    """
    from smoskin.apps.report.build import build_report
    from smoskin.feasibility import load_design

    with _progress() as progress:
        written = build_report(load_design(design), out, progress=progress)
    typer.echo(written.summary)
    typer.echo(str(written.page))


@app.command()
def calibrate(
    table: Annotated[Path, typer.Argument(help="CSV of touches measured on a bench.")],
    out: Annotated[Path, typer.Option(help="The calibration file (TOML) to write.")],
    design: Annotated[str, typer.Option(help="Of the skin that was measured.")] = "planar",
    recording: Annotated[
        Path | None,
        typer.Option(help="MCAP with the readings, where the table says when touches were held."),
    ] = None,
    date: Annotated[str | None, typer.Option(help="Of the measurement, ISO; today.")] = None,
    method: Annotated[
        Literal["auto", "table", "reduced"],
        typer.Option(
            help="table: a press on every cell; reduced: the paper's model; auto: the table, "
            "where the touches hold one."
        ),
    ] = "auto",
    separate: Annotated[
        bool, typer.Option("--separate", help="Reduced model: fit v_a in X and Y apart.")
    ] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw the residuals to this file.")] = None,
    as_json: Json = False,
) -> None:
    """Calibrate a skin from touches measured on a bench.

    With a press on every cell the calibration rests on the skin's own answers. Otherwise the
    paper's model is fitted, with uncertainties; a coefficient that the touches cannot determine
    is refused by name.
    """
    import datetime as dt

    from smoskin.apps import calibrate as bench_work
    from smoskin.feasibility import load_design

    result = bench_work.calibrate(
        load_design(design),
        table,
        out,
        recording=recording,
        date=date or dt.date.today().isoformat(),
        attenuation="separate" if separate else "equal",
        method=method,
    )
    if plot is not None:
        bench_work.residual_figure(result.fit).savefig(plot)
    if as_json:
        typer.echo(json.dumps(result.as_json()))
        return
    for one in result.tables():
        _show(one)


@app.command()
def virtual_bench(
    out: Annotated[Path, typer.Argument(help="The CSV of touches to write.")],
    design: Annotated[str, typer.Option(help="That the virtual skin scatters about.")] = "planar",
    seed: Annotated[int, typer.Option(min=0, help="Of the skin and of the bench's noise.")] = 0,
    sheet: Annotated[
        Literal["whole", "reduced"],
        typer.Option(help="whole: the folded sheet's twin; reduced: the paper's model."),
    ] = "whole",
) -> None:
    """Measure a virtual skin as a person would measure a real one for calibration."""
    from smoskin.apps.calibrate import write_virtual_bench
    from smoskin.feasibility import load_design

    write_virtual_bench(load_design(design), out, seed=seed, sheet=sheet)
    typer.echo(f"Now: smoskin calibrate {out} --out calibration.toml", err=True)


@bench.command()
def recordings(
    directory: Annotated[
        Path, typer.Argument(help="A folder of eFlesh or EFlashTeam7 recordings.")
    ],
    chips: Annotated[
        int | None, typer.Option(min=1, help="Judge this many chips, best on training data.")
    ] = None,
    as_json: Json = False,
    seed: Annotated[int, typer.Option(min=0, help="Of splits and training.")] = 0,
) -> None:
    """Train on real recordings and judge on places and runs that training never saw."""
    from smoskin.apps.recordings import bench_recordings

    with _progress() as progress:
        result = bench_recordings(directory, chips=chips, seed=seed, progress=progress)
    for note in result.notes:
        typer.echo(note, err=True)
    if as_json:
        typer.echo(json.dumps(result.as_json()))
    else:
        _show(result.table())


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error; called with what is being done and the share that is done."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(),
               TimeRemainingColumn())  # fmt: skip
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=1.0)

        def report(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)

        yield report


def _show(table: "Table") -> None:
    """Print a table, wide enough for its columns where nobody's terminal limits it."""
    from rich.console import Console

    console = Console()
    Console(width=max(console.width, 100)).print(table)


def _print_demo(result: "DemoResult") -> None:
    """Every touch beside its estimate, and the summary."""
    from rich.table import Table

    table = Table(title="Touches of the hand")
    for heading in ("true x, y (mm)", "estimated", "true Fx, Fy, Fz (N)", "estimated", "off"):
        table.add_column(heading, justify="right")
    for touch in result.touches:
        true, seen = touch.true, touch.estimated
        table.add_row(
            f"{true.x_mm:.1f}, {true.y_mm:.1f}",
            f"{seen.x_mm:.1f}, {seen.y_mm:.1f}" if seen else touch.status,
            f"{true.fx_N:.2f}, {true.fy_N:.2f}, {true.fz_N:.2f}",
            f"{seen.fx_N:.2f}, {seen.fy_N:.2f}, {seen.fz_N:.2f}" if seen else "",
            f"{touch.position_error_mm:.1f} mm, {touch.force_error_percent:.1f} %" if seen else "",
            style="" if touch.found else "red",
        )
    _show(table)
    for name, value in asdict(result.summary).items():
        typer.echo(f"{name}: {value}")


if TYPE_CHECKING:
    from smoskin.apps.demo import DemoResult
