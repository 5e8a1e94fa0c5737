"""Commands about files: what one is, and a design to start from."""

import json
import math
import time
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Argument, Option

from smoskin.cli.frame import File, Force, Json, Text, app, examples
from smoskin.cli.live import Port, Seconds
from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.outputs import check_output, write_output


@app.command(
    epilog=examples(
        "view touch.mcap", "view planar", "view skin.table", "view sheet.fold", "view parts.stl"
    )
)
def view(
    file: Annotated[
        Path, Argument(help="A file, a folder of tessellate or fabricate, or a shipped design.")
    ],
    design: Annotated[
        Text, Option(help="Design that a table, network or calibration is of.")
    ] = None,
    seconds: Seconds = None,
    port: Port = 0,
) -> None:
    """Look at a file in a browser.

    A recording is played, paused and sought in; a design, and a table, network or calibration, is a
    virtual skin that the mouse presses; a sheet (FOLD) folds by a slider, coloured by strain; a
    mesh (STL, OBJ, PLY) and the folders of tessellate and fabricate are shown in space. The page
    stays until Ctrl-C.
    """
    from smoskin.commands.view import Shown

    end = math.inf if seconds is None else time.monotonic() + seconds
    with Shown(file, design=design, port=port, say=partial(typer.echo, err=True)) as page:
        for _ in page:
            if time.monotonic() >= end:
                return
        while page.watch is None and time.monotonic() < end:
            time.sleep(0.1)


@app.command(
    epilog=examples(
        "check touch.mcap", "check *.table --json", "check pattern.fold --plot pattern.svg"
    )
)
def check(
    paths: Annotated[list[Path], Argument(metavar="FILE...", help="Files, or folders of data.")],
    plot: Annotated[
        File, Option(help="Draw the crease pattern and the vertices that break a rule.")
    ] = None,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Tell what files are, whether they are whole and what reads them.

    Designs, recordings, response tables, networks, learned models, calibrations, sheets of touches,
    data sets and crease patterns (FOLD) are known; of a pattern, which vertices keep it from
    folding flat. The exit code is 1 if a file is damaged or of another kind.
    """
    from smoskin.commands.check import check_file

    if plot is not None:
        _draw_pattern(paths, plot, force=overwrite)
    reports = [check_file(path) for path in paths]
    if as_json:
        typer.echo(json.dumps([report.as_json() for report in reports]))
    else:
        typer.echo("\n".join(line for report in reports for line in report.lines()))
    if any(report.problem for report in reports):
        raise typer.Exit(1)


def _draw_pattern(paths: list[Path], plot: Path, *, force: bool) -> None:
    """Draw the one crease pattern."""
    from smoskin.origami.pattern import broken_rules, read_pattern
    from smoskin.plots import check_figure, draw_pattern, save_figure

    if len(paths) != 1:
        raise ArgumentError(f"--plot needs one crease pattern; got {len(paths)} files")
    check_figure(plot, force=force)
    pattern = read_pattern(paths[0])
    save_figure(draw_pattern(pattern, broken_rules(pattern), paths[0].name), plot)


@app.command(
    epilog=examples(
        "new-design mine --out mine.toml --cells 6x8",
        "new-design mine --out mine.toml --remanence 0.6",
    )
)
def new_design(
    name: Annotated[str, Argument(help="Name of the new design.")],
    out: Annotated[Path, Option(help="The design (TOML) to write.", dir_okay=False)],
    cells: Annotated[Text, Option(help="Cells along x and y, such as 6x8.")] = None,
    base: Annotated[str, Option("--from", help="Design to start from.")] = "planar",
    remanence: Annotated[
        float | None,
        Option(help="Remanence of your magnets, T: gaps and gain follow.", show_default=False),
    ] = None,
    force: Force = False,
) -> None:
    """Write a design to start from, each part with what it means.

    It is a copy of another one, which can be built and read; magnets move with the cells. Measure
    one magnet over one chip first: the process sheet of smoskin fabricate says what it then has.
    """
    from smoskin.commands.new_design import new_design as make

    check_output(out, force=force)
    write_output(out, make(name, base, cells, remanence).encode())
    typer.echo(f"Now: edit {out}, then smoskin info {out}", err=True)


@app.command(
    epilog=examples(
        "convert touch.mcap touch.csv",
        "convert touch.mcap touch.h5",
        "convert mine.csv mine.mcap --design planar",
        "convert touch.mcap touch-set --to lerobot --rate 30 --window 4",
    )
)
def convert(
    source: Annotated[Path, Argument(help="Recording (MCAP), or readings as a table (CSV).")],
    out: Annotated[Path, Argument(help="File to write: .csv, .h5 or .mcap; else a folder.")],
    design: Annotated[
        str, Option(help="Design of the skin whose readings a table holds.")
    ] = "planar",
    to: Annotated[
        Literal["lerobot"] | None, Option(help="A folder for robot learning: LeRobot v3.0.")
    ] = None,
    rate: Annotated[int, Option(help="Frames a second of a LeRobot data set.")] = 30,
    window: Annotated[int, Option(help="Latest readings in each of its frames.")] = 4,
    task: Annotated[str, Option(help="What was done, in words, for its frames.")] = "touch",
    force: Force = False,
) -> None:
    """Turn a recording into a table for any program, or a table of readings into a recording.

    Tables have SI units: time_s, chip0_x_T and so on for each chip, status, contact0_x_m and so on.
    With --to lerobot the recording becomes one episode of observation.tactile.* in a folder.
    """
    from smoskin.service.exchange import export_lerobot, export_recording, import_readings

    if to == "lerobot":
        frames = export_lerobot(source, out, rate=rate, window=window, task=task, force=force)
        typer.echo(f"{frames} frames in {out}")
        return
    if (rate, window, task) != (30, 4, "touch"):
        raise ArgumentError("rate, window and task must go with --to lerobot; got no --to")
    if out.suffix == ".mcap":
        count = import_readings(source, load_design(design), out, force=force)
    else:
        count = export_recording(source, out, force=force)
    typer.echo(f"{count} readings in {out}")
