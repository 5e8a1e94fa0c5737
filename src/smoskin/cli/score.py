"""The command that judges an estimator's file on made skins that no training has seen."""

import json
from pathlib import Path
from typing import Annotated

import typer

from smoskin.cli.frame import Force, Json, app, examples, progress_bar, show
from smoskin.errors import require
from smoskin.outputs import check_output


@app.command(
    epilog=examples("score planar --skins 2 --out judged", "score network.safetensors --json")
)
def score(
    file: Annotated[
        Path,
        typer.Argument(
            help="A response table (planar, curved: those shipped), a network, or another file."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for score.json and the figures.", file_okay=False)
    ] = None,
    design: Annotated[str, typer.Option(help="Design of the skins that are pressed.")] = "planar",
    skins: Annotated[int, typer.Option(min=1, max=1000, help="Number of made skins.")] = 2,
    touches: Annotated[
        int,
        typer.Option(min=0, max=1000, help="Labelled touches that calibrate a table to each skin."),
    ] = 60,
    places: Annotated[
        str | None,
        typer.Option(help="All places of such a grid; by default 200 of 25x33 for each force."),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="Only so many of the places, drawn for each force."),
    ] = None,
    drag: Annotated[
        float, typer.Option(min=0.0, help="A second round with drags up to this, N.")
    ] = 0.0,
    pairs: Annotated[
        int,
        typer.Option(min=0, max=10_000, help="Pairs of touches on each skin, at once and in turn."),
    ] = 40,
    pairs_after: Annotated[
        float,
        typer.Option(min=0.02, max=10.0, help="Seconds from touch to touch of pairs in turn."),
    ] = 0.3,
    chips: Annotated[
        str | None, typer.Option(help="Read only these chips, such as 1,2; from 0.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first made skin.")] = 1,
    world: Annotated[
        str,
        typer.Option(
            help="World of the skins: hard; limb, with motor and steel inside the limb; or plain: "
            "what the twin assumes holds."
        ),
    ] = "hard",
    effect: Annotated[
        str | None, typer.Option(help="A world of this effect alone, such as hysteresis.")
    ] = None,
    posed: Annotated[
        bool, typer.Option("--posed", help="The arm tells how it holds the skin.")
    ] = False,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Judge an estimator on made skins that it has never seen, pressed all over.

    Skins are at 15 to 35 degC, creep, drift and are read by noisy chips; a response table is
    calibrated to each first. The folder gets score.json and the figures: errors over the skin,
    their distributions, stated against observed confidence. A missed touch counts as one in the
    middle of the skin. The exit code is 1 if a target is missed.
    """
    from smoskin.commands.score import DATA
    from smoskin.commands.score import score as judge
    from smoskin.commands.score.evaluate import parse_places
    from smoskin.commands.train import parse_chips
    from smoskin.feasibility import load_design

    if out is not None:
        if out.is_dir():
            check_output(out / DATA, force=overwrite)
        require("drawing", "plots", "matplotlib")
    skin = load_design(design)
    grid = None if places is None else parse_places(places)
    read = None if chips is None else parse_chips(chips)
    with progress_bar() as progress:
        sheet = judge(
            file,
            skin,
            skins=range(seed, seed + skins),
            touches=touches,
            count=count,
            places=grid,
            chips=read,
            drag=drag,
            pairs=pairs,
            pairs_after=pairs_after,
            world=world,
            effect=effect,
            posed=posed,
            out=out,
            progress=progress,
        )
    if as_json:
        typer.echo(json.dumps(sheet.as_json()))
    else:
        for table in sheet.tables():
            show(table)
        if out is not None:
            typer.echo(str(out / DATA))
    typer.echo(sheet.verdict(), err=True)
    if not sheet.met:
        raise typer.Exit(1)
