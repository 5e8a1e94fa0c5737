"""The command that judges an estimator's file on made skins that no training has seen."""

import json
from pathlib import Path
from typing import Annotated

import typer

from smoskin.cli.frame import Json, app, progress_bar, show


@app.command()
def score(
    file: Annotated[Path, typer.Argument(help="A response table, or a network.")],
    out: Annotated[Path, typer.Option(help="The folder to write to.", file_okay=False)],
    design: Annotated[str, typer.Option(help="Of the skins that are pressed.")] = "planar",
    skins: Annotated[int, typer.Option(min=1, help="Made skins.")] = 2,
    touches: Annotated[
        int, typer.Option(min=0, help="Labelled touches that calibrate each skin; 0: none.")
    ] = 60,
    places: Annotated[
        str | None,
        typer.Option(help="All places of such a grid; by default 200 of 25x33 for each force."),
    ] = None,
    count: Annotated[
        int | None, typer.Option(min=1, help="Only so many of the places, drawn for each force.")
    ] = None,
    drag: Annotated[
        float, typer.Option(min=0.0, help="A second round with drags up to this, N.")
    ] = 0.0,
    pairs: Annotated[int, typer.Option(min=0, help="Pairs of touches on each skin.")] = 40,
    chips: Annotated[
        str | None, typer.Option(help="Read only these chips, such as 1,2; from 0.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the first made skin.")] = 1,
    as_json: Json = False,
) -> None:
    """Judge an estimator on made skins that it has never seen, pressed all over.

    Skins are at 15 to 35 degC, creep, drift and are read by noisy chips; each is calibrated first.
    The folder gets score.json and the figures: errors over the skin, their distributions, stated
    against observed confidence. A missed touch counts as one in the middle of the skin.
    """
    from smoskin.commands.score import Exam, score_file
    from smoskin.commands.score.plan import parse_places
    from smoskin.commands.train import parse_chips
    from smoskin.feasibility import load_design

    exam = Exam(
        skins=skins,
        touches=touches,
        places=parse_places(places or "25x33"),
        count=count if count or places else 200,
        drag=drag,
        pairs=pairs,
        chips=None if chips is None else parse_chips(chips),
        seed=seed,
    )
    with progress_bar() as progress:
        written = score_file(load_design(design), file, out, exam, progress=progress)
    if as_json:
        typer.echo(json.dumps(written.sheet.as_json()))
        return
    for table in written.sheet.tables():
        show(table)
    typer.echo(str(written.data))
