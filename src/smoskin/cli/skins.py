"""Commands about a design: what it is, how its twin answers, and the paper beside the program."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from smoskin.cli.frame import Design, Json, app, progress_bar, show


@app.command()
def info(design: Design = "planar", as_json: Json = False) -> None:
    """Print a design: what is built, where each value comes from, and what follows from it."""
    from smoskin.commands.info import describe
    from smoskin.feasibility import load_design

    sheet = describe(load_design(design))
    if as_json:
        typer.echo(json.dumps(sheet.as_json()))
        return
    for table in sheet.tables():
        show(table)


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
    from smoskin.commands import simulate as simulation
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
                show(table)
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
    with progress_bar() as progress:
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
