"""The command that varies a design so that its chips tell most about a touch."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from smoskin.cli.frame import Design, Force, Json, app, clock_of, examples, progress_bar, show
from smoskin.errors import require
from smoskin.outputs import check_output


@app.command(epilog=examples("optimise planar --out better.toml --minutes 10"))
def optimise(
    context: typer.Context,
    out: Annotated[
        Path, typer.Option(help="The new design (TOML); the comparison beside it.", dir_okay=False)
    ],
    design: Design = "planar",
    minutes: Annotated[
        float | None, typer.Option(min=0.1, help="Time for search and comparison.")
    ] = None,
    force: Annotated[
        float, typer.Option("--force-N", min=0.05, max=1.0, help="Force of the touches.")
    ] = 0.5,
    rate: Annotated[float, typer.Option(min=1.0, help="Least readings a second.")] = 100.0,
    seed: Annotated[int, typer.Option(min=0, help="Of what is drawn.")] = 0,
    overwrite: Force = False,
    as_json: Json = False,
) -> None:
    """Vary magnets, chips, columns and frame so that touches are located best.

    The mean and the worst Cramer-Rao bound of location are made small within what can be made and
    what the skin must stand; made skins are checked too. The exit code is 1 if the design found
    does not keep every limit.
    """
    from smoskin.commands.optimise import Limits, Objective, SearchEffort
    from smoskin.commands.optimise import optimise as vary
    from smoskin.feasibility import load_design

    for file in (out, out.with_suffix(".json")):
        check_output(file, force=overwrite)
    require("writing a design", "cli", "tomli_w")
    seconds = math.inf if minutes is None else 60 * minutes
    with progress_bar() as progress:
        optimised = vary(
            load_design(design),
            name=out.stem,
            objective=Objective(force=force),
            limits=Limits(rate=rate),
            effort=SearchEffort(seed=seed, seconds=seconds),
            progress=progress,
            clock=clock_of(context),
        )
    document, beside = optimised.write(out)
    if as_json:
        typer.echo(json.dumps(optimised.as_json()))
    else:
        for table in optimised.tables():
            show(table)
        typer.echo(f"{document} and {beside}")
    if optimised.warning:
        typer.echo(f"warning: {optimised.warning}", err=True)
    typer.echo(optimised.verdict(), err=True)
    if not optimised.kept:
        raise typer.Exit(1)
