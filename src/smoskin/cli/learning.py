"""Commands by which one skin becomes known, and by which estimators are judged on data."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from smoskin.cli.frame import Json, app, show
from smoskin.cli.touches import touch_on_rig
from smoskin.errors import ArgumentError


@app.command()
def calibrate(
    table: Annotated[
        Path,
        typer.Argument(
            help="CSV of touches measured on a bench; with --touches the design's response table."
        ),
    ],
    out: Annotated[Path, typer.Option(help="The calibration file (TOML; or table) to write.")],
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
    touches: Annotated[
        int | None,
        typer.Option(min=1, help="Have a virtual rig make so many touches; see touches rig."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="With --touches: of the skin on the rig.")] = 0,
    as_json: Json = False,
) -> None:
    """Calibrate a skin from touches measured on a bench, or made by a virtual rig.

    With a press on every cell the calibration rests on the skin's own answers. Otherwise the
    paper's model is fitted, with uncertainties; a coefficient that the touches cannot determine
    is refused by name. With --touches the skin gets a response table of its own.
    """
    import datetime as dt

    if touches is not None:
        of_bench = {"--recording": recording, "--plot": plot, "--date": date}
        given = [name for name, value in of_bench.items() if value is not None]
        if given or separate or method != "auto":
            raise ArgumentError("--touches goes with --design, --seed, --out and --json alone")
        touch_on_rig(table, out, design=design, seed=seed, count=touches, as_json=as_json)
        return

    from smoskin.commands import calibrate as bench_work
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
        show(one)


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
    from smoskin.commands.calibrate import write_virtual_bench
    from smoskin.feasibility import load_design

    write_virtual_bench(load_design(design), out, seed=seed, sheet=sheet)
    typer.echo(f"Now: smoskin calibrate {out} --out calibration.toml", err=True)
