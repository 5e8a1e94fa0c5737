"""The command that characterises a skin from recordings of a rig's touches."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from smoskin.cli.frame import Force, Json, app, examples, tell
from smoskin.errors import require


@app.command(
    epilog=examples(
        "report campaign.mcap --out report", "report cold.mcap warm.mcap slow.mcap --out report"
    )
)
def report(
    recordings: Annotated[
        list[Path], Argument(help="Recordings (MCAP) of one skin, of touches press.")
    ],
    out: Annotated[Path, Option(help="Folder of the files.", file_okay=False)] = Path("report"),
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Characterise a skin: what the recordings of a rig's touches tell of it, and how surely.

    Noise, sensitivity, stiffness, hysteresis, repeatability, cross-talk of chips, recovery and
    temperature coefficients, each with its definition and its uncertainty, or why the recordings do
    not give it. report.html, report.json and report.svg are written.
    """
    from smoskin.commands.report import characterise, write_report

    require("a picture", "plots", "matplotlib")
    done = characterise(recordings)
    files = write_report(done, out, force=force)
    tell(done, as_json, files=[str(file) for file in files])
    if not as_json:
        for file in files:
            typer.echo(str(file))
