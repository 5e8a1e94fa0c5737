"""``python -m studies.recordings DIR``: learned estimators judged on real recordings."""

import json
from pathlib import Path
from typing import Annotated

import typer

from smoskin.cli.frame import Json, progress_bar, show
from smoskin.errors import SmoskinError
from studies.recordings import bench_recordings


def main(
    directory: Annotated[
        Path, typer.Argument(help="A folder of eFlesh or EFlashTeam7 recordings.")
    ],
    chips: Annotated[
        int | None, typer.Option(min=1, help="Judge this many chips, best on training data.")
    ] = None,
    as_json: Json = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of splits and training.")] = 0,
) -> None:
    """Train on real recordings and judge on places and runs that training never saw."""
    with progress_bar() as progress:
        result = bench_recordings(directory, chips=chips, seed=seed, progress=progress)
    for note in result.notes:
        typer.echo(note, err=True)
    if as_json:
        typer.echo(json.dumps(result.as_json()))
    else:
        show(result.table())


if __name__ == "__main__":
    try:
        typer.run(main)
    except SmoskinError as error:
        raise SystemExit(f"error: {error}") from error
