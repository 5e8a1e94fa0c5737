"""``python -m paper --out DIR``: the paper beside what the package computes."""

from pathlib import Path
from typing import Annotated

import typer

from paper.build import build_report
from smoskin.cli.frame import Design, progress_bar
from smoskin.errors import SmoskinError
from smoskin.feasibility import load_design
from smoskin.sensing.response.table import load_response_table


def main(
    out: Annotated[Path, typer.Option(help="The folder to write to.", file_okay=False)],
    design: Design = "planar",
    table: Annotated[
        Path | None,
        typer.Option(help="A response table of the design; a small one is made by default."),
    ] = None,
) -> None:
    """Write the paper's figures, tables and numbers beside what the package computes.

    The folder gets report.html, report.pdf, report.json and every figure as SVG.
    """
    known = None if table is None else load_response_table(table)
    with progress_bar() as progress:
        written = build_report(load_design(design), out, table=known, progress=progress)
    typer.echo(written.summary)


if __name__ == "__main__":
    try:
        typer.run(main)
    except SmoskinError as error:
        raise SystemExit(f"error: {error}") from error
