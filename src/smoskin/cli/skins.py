"""Commands about a design: what it is, how its twin answers, and the paper beside the program."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Option

from smoskin.cli.ending import if_stopped
from smoskin.cli.frame import (
    Design,
    File,
    Force,
    Json,
    Text,
    Whole,
    app,
    examples,
    progress_bar,
    tell,
)
from smoskin.errors import DesignError
from smoskin.feasibility import load_design
from smoskin.outputs import check_output


@app.command(epilog=examples("info planar", "info own.toml --json"))
def info(design: Design = "planar", as_json: Json = False) -> None:
    """Print a design: what is built, where each value comes from, and what follows from it."""
    from smoskin.commands.check import check_file
    from smoskin.commands.info import describe

    try:
        skin = load_design(design)
    except DesignError as error:
        kind = check_file(Path(design)).kind if Path(design).is_file() else ""
        if kind in ("", "a file", "a design", "a file of another kind"):
            raise
        raise DesignError(
            f"{design} is {kind}, not a design; smoskin check {design} tells of it"
        ) from error
    tell(describe(skin), as_json)


Mechanics = Annotated[
    Literal["whole", "reduced"], Option(help="whole: the folded sheet; reduced: the paper's model.")
]
Grip = Annotated[
    Text, Option(help="How touches hold: sticking, frictionless, covered or sliding:FRICTION.")
]


@app.command(
    epilog=examples(
        "simulate planar --at 45,80 --force 0,0,-0.5", "simulate --at 30,40 --at 90,120 --json"
    )
)
def simulate(
    design: Design = "planar",
    at: Annotated[
        list[str] | None, Option(help="x,y of a touch, mm; once for each. The middle.")
    ] = None,
    force: Annotated[
        list[str] | None,
        Option(help="Fx,Fy,Fz on the skin, N; z < 0 presses; one for all. 0,0,-0.5."),
    ] = None,
    temperature: Annotated[float, Option(help="Temperature of the skin, degC.")] = 25.0,
    manufactured: Annotated[
        bool, Option("--manufactured", help="Press a manufactured skin, of this seed.")
    ] = False,
    mechanics: Mechanics = "whole",
    grip: Grip = None,
    seed: Annotated[int, Option(min=0, help="Seed of made skin and noise.")] = 0,
    as_json: Json = False,
) -> None:
    """Press a simulated skin once: what sinks, what moves, what the chips read.

    The exit code is 1 if the skin finds no equilibrium.
    """
    from smoskin.commands.simulate import simulate_press

    press = simulate_press(
        load_design(design),
        at or (),
        force or (),
        temperature=temperature,
        mechanics=mechanics,
        grip=grip,
        manufactured=manufactured,
        seed=seed,
    )
    tell(press, as_json)
    if not press.valid:
        typer.echo("The skin has no equilibrium under these touches.", err=True)
        raise typer.Exit(1)


@app.command(
    epilog=examples(
        "sweep planar --kind grid --forces 0.1:1:4 --places 25x33 --out pressed",
        "sweep --summary pressed",
    )
)
def sweep(
    design: Design = "planar",
    kind: Annotated[
        Literal["grid", "shear", "pairs", "random"],
        Option(help="Presses at every place of a grid; with drags; two at once; random."),
    ] = "grid",
    out: Annotated[
        File, Option(help="Folder of the data set; DESIGN-KIND by default.", file_okay=False)
    ] = None,
    summary: Annotated[
        File, Option(help="Only tell what this data set holds.", file_okay=False)
    ] = None,
    export: Annotated[File, Option(help="Also write this one HDF5 file.")] = None,
    forces: Annotated[
        Text, Option(help="Forces, N: 0.1,0.5 or from:to:count; random: from:to.")
    ] = None,
    drags: Annotated[Text, Option(help="Forces sideways, N, likewise.")] = None,
    directions: Annotated[Text, Option(help="Directions of a shear's drags.")] = None,
    places: Annotated[Text, Option(help="Places of the grid, such as 25x33.")] = None,
    count: Annotated[Text, Option(help="Number of random presses.")] = None,
    touches: Annotated[Text, Option(help="Touches at once: 2, or from:to.")] = None,
    radius: Annotated[Text, Option(help="Radius of touches, mm; or from:to.")] = None,
    margin: Annotated[Text, Option(help="Random presses' way to the rim, mm.")] = None,
    temperature: Annotated[str, Option(help="Temperatures, degC, written as forces.")] = "25",
    skins: Annotated[int, Option(min=0, max=10_000, help="Number of manufactured skins.")] = 0,
    mechanics: Mechanics = "whole",
    grip: Grip = None,
    seed: Annotated[int, Option(min=0, help="Seed of noise and random presses.")] = 0,
    chunk: Annotated[Whole, Option(min=1, help="Presses a file.")] = None,
    workers: Annotated[Whole, Option(min=1, help="Processes; one a core.")] = None,
    scheduler: Annotated[
        Text, Option(help="A dask cluster, tcp://host:8786; or local to start one.")
    ] = None,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Press a simulated skin in many ways into a data set; one that was stopped goes on.

    Presses without an equilibrium are counted and flagged in the files. With --summary the exit
    code is 1 if rows are missing or damaged.
    """
    from smoskin.commands import sweep as sweeps
    from smoskin.datasets.workers import Engine

    if export is not None:
        check_output(export, force=overwrite)
    if summary is not None:
        report = sweeps.summarise(summary)
    else:
        skin = load_design(design)
        words = {"forces": forces, "drags": drags, "directions": directions, "places": places}
        words |= {"count": count, "touches": touches, "radius": radius, "margin": margin}
        plan = sweeps.plan_sweep(
            kind,
            words,
            temperatures=temperature,
            skins=skins,
            mechanics=mechanics,
            grip=grip,
            seed=seed,
            presses_per_chunk=chunk,
        )
        folder = out or Path(f"{skin.name}-{kind}")
        kept = f"{folder} keeps what has been pressed, and the same command goes on from there"
        with if_stopped(lambda: kept), progress_bar() as bar:
            report = sweeps.run_sweep(
                skin,
                plan,
                folder,
                engine=Engine(workers, scheduler),
                export=export,
                force=overwrite,
                progress=bar,
            )
    typer.echo(json.dumps(report.as_json()) if as_json else "\n".join(report.lines()))
    if not report.sound:
        raise typer.Exit(1)
