"""Commands by which one skin becomes known: from touches on a rig, by hand, or as in the paper."""

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer import Argument, Option

from smoskin.cli.ending import if_stopped
from smoskin.cli.frame import (
    Design,
    File,
    Force,
    Json,
    Number,
    Text,
    Whole,
    app,
    examples,
    progress_bar,
    tell,
)
from smoskin.errors import ArgumentError, CalibrationError, SourceError, require
from smoskin.feasibility import load_design
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.outputs import check_output
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.twin.rig import open_rig

touches = typer.Typer(no_args_is_help=True, help="Plan the touches of a calibration by hand.")
app.add_typer(touches, name="touches")

Table = Annotated[
    Text, Option("--table", help="Response table to start from; by default the design's shipped.")
]
UntilMm = Annotated[
    Number, Option(min=0.0, help="Stop where a touch is expected to be located this well, mm.")
]
PlaceMm = Option(min=0.0, help="Standard deviation of the places that are reported, mm.")
ForceMn = Option("--force-mN", min=0.0, help="Standard deviation of the forces, mN.")
Rig = Annotated[
    str, Option(help="Rig that touches the skin: virtual, virtual?seed=3&temperature=30.")
]
Sheet = Annotated[
    File, Option(help="Touches that have been made, instead of a rig: a CSV, or a rig's MCAP.")
]
Recording = Annotated[
    File, Option(help="MCAP with the readings, where the CSV says when touches were held.")
]
Touches = Annotated[Whole, Option(min=1, max=1000, help="Touches that a rig makes; 15 by default.")]
RigForce = Annotated[
    Number, Option("--force-N", help="Largest normal force of a rig; 0.8 N by default.")
]
RigDrag = Annotated[
    Number, Option("--drag-N", "--drag", help="Largest sideways force of a rig; 0.3 N by default.")
]
BadFit = Annotated[
    bool, Option("--accept-bad-fit", help="Write the table though the touches fit no skin.")
]
Plot = Annotated[File, Option(help="Draw what each touch misses to this file.")]
OwnTable = Annotated[
    Path, Option(help="File of the skin's own response table to write.", dir_okay=False)
]


@app.command(
    epilog=examples(
        "calibrate planar --rig 'virtual?seed=3' --out skin.table",
        "calibrate planar --sheet touches.csv --out skin.table",
    )
)
def calibrate(
    design: Design = "planar",
    rig: Rig = "virtual",
    sheet: Sheet = None,
    recording: Recording = None,
    touches: Touches = None,
    until_mm: UntilMm = None,
    force: RigForce = None,
    drag: RigDrag = None,
    place_mm: Annotated[Number, PlaceMm] = None,
    force_mn: Annotated[Number, ForceMn] = None,
    table: Table = None,
    out: OwnTable = Path("skin.table"),
    overwrite: Force = False,
    plot: Plot = None,
    accept_bad_fit: BadFit = False,
    as_json: Json = False,
) -> None:
    """Calibrate a skin from a few touches and write its own response table.

    A rig touches the skin where it tells most; its touches are kept where no table comes of them.
    Without one, `smoskin touches plan` writes a sheet of touches to make by hand, and --sheet reads
    it once it is filled in. Touches that fit no skin of the design are refused, and a wrong unit,
    sign, order or origin is named.
    """
    from smoskin.commands import calibrate as work

    check_output(out, force=overwrite)
    ResponseTable.check_writer()
    if plot is not None:
        from smoskin.plots import check_figure, save_figure

        check_figure(plot, force=overwrite)
    until = None if until_mm is None else 1e-3 * until_mm
    orders = {"count": touches, "until": until, "force": force, "drag": drag}
    options: dict[str, Any] = {key: value for key, value in orders.items() if value is not None}
    if sheet is not None and (options or rig != "virtual"):
        raise ArgumentError(
            "--sheet must come without --rig, --touches, --until-mm, --force-N and --drag-N: "
            "its touches have been made"
        )
    if sheet is None and recording is not None:
        raise ArgumentError("--recording must come with --sheet: a rig reads the chips itself")
    skin = load_design(design)
    options |= {"design": skin, "accept_bad_fit": accept_bad_fit}
    for name, milli in (("place_spread", place_mm), ("force_spread", force_mn)):
        options[name] = None if milli is None else 1e-3 * milli
    start = load_response_table(table or design)
    if sheet is not None:
        done = work.calibrate(start, sheet, recording=recording, **options)
    else:
        from smoskin.service.kept import RememberingRig

        with progress_bar() as bar, open_rig(rig, skin) as presser:
            options["progress"] = lambda step: bar(step.sentence, step.number / step.asked)
            own = RememberingRig(presser, skin)
            try:
                with if_stopped(lambda: own.keep(out)):
                    done = work.calibrate(start, own, **options)
            except (CalibrationError, SourceError):
                typer.echo(own.keep(out), err=True)
                raise
    done.save(out)
    if plot is not None:
        save_figure(done.figure(skin), plot)
    tell(done, as_json, file=str(out))
    for warning in done.judgement.warnings:
        typer.echo(f"warning: {warning}", err=True)
    if not as_json:
        typer.echo(f"Now: smoskin run SOURCE --calibration {out}", err=True)


@touches.command("plan", epilog=examples("touches plan planar --out touches.csv"))
def plan_touches(
    design: Design = "planar",
    out: Annotated[Path, Option(help="Sheet (CSV) to write.", dir_okay=False)] = Path(
        "touches.csv"
    ),
    count: Annotated[int, Option(min=1, max=1000, help="Touches to make.")] = 15,
    until_mm: UntilMm = None,
    force: Annotated[float, Option("--force-N", help="Largest normal force.")] = 0.8,
    drag: Annotated[float, Option("--drag-N", "--drag", help="Largest sideways force.")] = 0.0,
    place_mm: Annotated[float, PlaceMm] = 0.5,
    force_mn: Annotated[float, ForceMn] = 10.0,
    after: Annotated[File, Option(help="A filled sheet of touches that have been made.")] = None,
    table: Table = None,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Write where and how hard to touch a skin by hand, as a sheet to fill in.

    Each touch is the one that tells most after those before it. Fill in what the chips read once a
    touch has settled, or from when until when it was held while a recording ran.
    """
    from smoskin.commands.calibrate import plan_by_hand, write_plan

    check_output(out, force=overwrite)
    skin = load_design(design)
    filled = None if after is None else read_touches(after)[0]
    targets = plan_by_hand(
        skin,
        load_response_table(table or design),
        count=count,
        until=1e-3 * (until_mm or 0.0),
        force=force,
        drag=drag,
        made=() if filled is None else filled.rows(filled.made).contacts,
        place_spread=1e-3 * place_mm,
        force_spread=1e-3 * force_mn,
    )
    write_plan(out, skin, targets)
    errors = [round(1e3 * target.error, 4) for target in targets]
    if as_json:
        typer.echo(json.dumps({"file": str(out), "expected_error_mm": errors}))
        return
    if targets:
        typer.echo(
            f"{len(targets)} touches; a touch is then expected to be located to {errors[-1]:.2f} mm"
        )
    typer.echo(f"Now: smoskin calibrate {design} --sheet {out} --out skin.table", err=True)


@touches.command("grid", epilog=examples("touches grid --width-mm 30 --height-mm 30"))
def grid_touches(
    width: Annotated[float, Option("--width-mm", help="Width of the pad along x, mm.")] = 30.0,
    height: Annotated[float, Option("--height-mm", help="Height of the pad along y, mm.")] = 30.0,
    out: Annotated[Path, Option(help="Sheet (CSV) to write.", dir_okay=False)] = Path("plan.csv"),
    count: Annotated[int, Option(min=1, max=10_000, help="About so many touches.")] = 30,
    force: Annotated[float, Option("--force-N", help="How hard each is pressed.")] = 0.5,
    seed: Annotated[int, Option(min=0, help="Seed of their order.")] = 0,
    overwrite: Force = False,
) -> None:
    """Write a grid of touches of any pad, in random order, to make with touches record."""
    from smoskin.service.guided import grid_plan

    check_output(out, force=overwrite)
    plan = grid_plan(1e-3 * width, 1e-3 * height, count, force=force, seed=seed)
    write_touches(out, plan)
    typer.echo(f"{len(plan.contacts)} touches")
    typer.echo(f"Now: smoskin touches record SOURCE --plan {out} --out touches.csv", err=True)


@touches.command(
    "record",
    epilog=examples(
        "touches record 'serial:///dev/ttyACM0?format=anyskin' --plan plan.csv --out touches.csv"
    ),
)
def record_touches(
    source: Annotated[str, Argument(help="Source of readings, as of smoskin run.")],
    plan: Annotated[Path, Option(help="Sheet of touches to make, of grid or plan.")] = Path(
        "plan.csv"
    ),
    out: Annotated[Path, Option(help="Sheet (CSV) to write.", dir_okay=False)] = Path(
        "touches.csv"
    ),
    overwrite: Force = False,
) -> None:
    """Make the touches of a plan by hand; each is recorded once it is held still.

    The program says where to press and when to let go. What has been made is in the file after
    each touch.
    """
    from smoskin.service import guided
    from smoskin.service.source import open_source

    check_output(out, force=overwrite)
    wanted, _ = read_touches(plan)

    def keep(table: TouchTable) -> None:
        write_touches(out, table)

    with open_source(source) as opened:
        done = guided.record_touches(opened, wanted, say=typer.echo, keep=keep)
    typer.echo(f"{len(done.contacts)} touches in {out}")
    typer.echo(f"Now: smoskin learn {out} --out own.model", err=True)


@app.command("fit-paper", epilog=examples("fit-paper touches.csv --out calibration.toml"))
def fit_paper(
    table: Annotated[Path, Argument(help="CSV of touches on the cells' top vertices.")],
    out: Annotated[Path, Option(help="Calibration (TOML) to write.", dir_okay=False)] = Path(
        "calibration.toml"
    ),
    design: Annotated[str, Option(help="Design of the skin that was touched.")] = "planar",
    recording: Recording = None,
    date: Annotated[Text, Option(help="ISO date of the measurement; today by default.")] = None,
    separate: Annotated[bool, Option("--separate", help="Fit v_a in X and Y apart.")] = False,
    plot: Annotated[File, Option(help="Draw the residuals to this file.")] = None,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Fit the paper's own model to touches of a bench, with uncertainties.

    A coefficient that the touches cannot determine is refused by name, as is a wrong unit, sign,
    chip, axis or row that explains a sheet which fits badly. Folded sheets as this package models
    them are refused too: `virtual-bench --sheet reduced` measures one that the paper's model fits.
    The paper's estimator reads the file; `smoskin calibrate` locates touches better.
    """
    import datetime as dt

    from smoskin.commands import fit_paper as work

    check_output(out, force=overwrite)
    require("writing a calibration", "cli", "tomli_w")
    if plot is not None:
        from smoskin.plots import check_figure, save_figure

        check_figure(plot, force=overwrite)
    result = work.fit_paper(
        load_design(design),
        table,
        out,
        recording=recording,
        date=date or dt.date.today().isoformat(),
        attenuation="separate" if separate else "equal",
    )
    if plot is not None:
        save_figure(work.residual_figure(result.fit), plot)
    tell(result, as_json)
    for warning in result.warnings:
        typer.echo(f"warning: {warning}", err=True)


@app.command(epilog=examples("virtual-bench touches.csv --seed 2 --sheet reduced"))
def virtual_bench(
    out: Annotated[Path, Argument(help="CSV of touches to write.")] = Path("touches.csv"),
    design: Annotated[str, Option(help="Design that the virtual skin scatters about.")] = (
        "planar"
    ),
    seed: Annotated[int, Option(min=0, help="Seed of the skin and of the bench's noise.")] = 0,
    sheet: Annotated[
        Literal["whole", "reduced"],
        Option(help="whole: the folded sheet's twin; reduced: the paper's model."),
    ] = "whole",
    overwrite: Force = False,
) -> None:
    """Measure a virtual skin as a person would measure a real one for calibration."""
    from smoskin.commands.fit_paper import write_virtual_bench

    check_output(out, force=overwrite)
    with progress_bar() as progress:
        write_virtual_bench(load_design(design), out, seed=seed, sheet=sheet, progress=progress)
    if sheet == "whole":
        typer.echo(f"Now: smoskin calibrate {design} --sheet {out} --out skin.table", err=True)
    else:
        typer.echo(f"Now: smoskin fit-paper {out} --out calibration.toml", err=True)
