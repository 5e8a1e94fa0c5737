"""The command that writes the files from which a skin is built."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from typer import Option

from smoskin.cli.frame import Design, File, Force, Json, app, examples, progress_bar, tell
from smoskin.feasibility import load_design


@app.command(
    epilog=examples(
        "fabricate planar --out skin",
        "fabricate own.toml --workshop shop.toml --out skin",
        "fabricate curved --out skin --step",
    )
)
def fabricate(
    design: Design,
    out: Annotated[Path, Option(help="Folder of the files.", file_okay=False)],
    workshop: Annotated[
        File, Option(help="Workshop (TOML): what differs from the usual, such as kerf_mm = 0.2.")
    ] = None,
    covers: Annotated[
        bool, Option("--covers", help="Guided cover panels (SI Figure S16) in place of scales.")
    ] = False,
    step: Annotated[
        bool, Option("--step", help="Also write the assembled skin as a STEP file.")
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write every file from which a workshop builds a skin, with a manifest.

    Patterns for the laser and a bill of materials, all in millimetres at 1:1. A design that cannot
    be made so is refused with the measure and the limit.
    """
    from smoskin.commands.fabricate import fabricate as make
    from smoskin.fabrication.workshop import Workshop, read_workshop

    shop = Workshop() if workshop is None else read_workshop(workshop)
    shop = replace(shop, top="covers") if covers else shop
    skin = load_design(design)
    with progress_bar() as bar:
        report = make(skin, out, workshop=shop, step=step, force=force, progress=bar)
    tell(report, as_json)
    typer.echo(f"Now: cut {out}/pattern/coupon.dxf and measure it.", err=True)
