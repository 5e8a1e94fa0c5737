"""``python -m paper --out DIR``: the paper beside what the package computes.

Runs every script of the paper and writes report.json, a figure each as SVG, and a plain index.
"""

import json
from collections.abc import Callable
from dataclasses import asdict
from html import escape
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from smoskin.cli.frame import Design, progress_bar
from smoskin.errors import ArgumentError, MissingExtraError, SmoskinError
from smoskin.feasibility import load_design
from smoskin.sensing.response.table import load_response_table

if TYPE_CHECKING:
    from paper.shared.rows import Row
    from paper.shared.setting import Setting

SCRIPTS: Final = (
    "figure_s1",
    "figure_s5",
    "figure_s6",
    "figure_s7",
    "figure_s9",
    "figure_s10",
    "figure_s11",
    "figure_s12",
    "figure_s15",
    "figure_s16",
    "beyond.displacement_field",
    "beyond.attenuation_fit",
    "beyond.device_search",
    "beyond.touch_bound",
    "beyond.touch_pairs",
    "beyond.calibration_touches",
    "beyond.curved_sheets",
)
"""Modules with a figure each, in the order of the paper."""
_EXTRAS: Final = ("matplotlib", "jax", "felupe")


def write_report(
    setting: "Setting", out: Path, progress: Callable[[str, float], None] = lambda what, share: None
) -> "list[Row]":
    """Run every script and write rows and figures to a folder.

    Files of an earlier report there are replaced; the same design gives the same bytes.

    Parameters
    ----------
    setting : Setting
    out : Path
        The folder; made if missing.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Raises
    ------
    ArgumentError
        If the folder cannot be written.
    """
    from matplotlib import pyplot as plt

    from paper import errata, text_numbers
    from paper.shared.rows import summary

    _check_writable(out)
    rows, figures = text_numbers.rows(setting), []
    for k, name in enumerate(SCRIPTS):
        progress(name, k / len(SCRIPTS))
        plate = import_module(f"paper.{name}").plate(setting)
        rows += plate.rows
        path = plate.write(out)
        plt.close(plate.figure)
        text = f'<h2>{escape(plate.title)}</h2><p><img src="{path.name}"></p>'
        figures.append(f"{text}<p>{escape(plate.caption)}</p>")
    rows += errata.errata_rows(setting.design)
    plain = json.dumps({"rows": [asdict(row) for row in rows]}, indent=1, ensure_ascii=False)
    (out / "report.json").write_text(plain + "\n", encoding="utf-8")
    head = f"<h1>The paper, printed and computed</h1><p>{summary(rows)}</p>"
    page = '<!DOCTYPE html>\n<html lang="en"><meta charset="utf-8"><title>smoskin report</title>\n'
    (out / "index.html").write_text(page + "\n".join([head, *figures]) + "\n", encoding="utf-8")
    progress("done", 1.0)
    return rows


def _check_writable(folder: Path) -> None:
    """Make the folder if it is missing, and try that it takes a file."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "report.json").open("a", encoding="utf-8"):
            pass
    except OSError as error:
        raise ArgumentError(
            f"out must be a folder that can be written; got {str(folder)!r}: {error.strerror}"
        ) from error


def main(
    out: Annotated[Path, typer.Option(help="The folder to write to.", file_okay=False)],
    design: Design = "planar",
    table: Annotated[
        Path | None,
        typer.Option(help="A response table of the design; a small one is made by default."),
    ] = None,
) -> None:
    """Write the paper's figures and numbers beside what the package computes.

    The folder gets report.json, every figure as SVG, and an index of them.
    """
    if not all(find_spec(module) for module in _EXTRAS):
        raise MissingExtraError("the report", "paper")
    from paper.shared.rows import summary
    from paper.shared.setting import Setting

    given = None if table is None else load_response_table(table)
    setting = Setting(load_design(design), given)
    with progress_bar() as progress:
        rows = write_report(setting, out, progress)
    typer.echo(summary(rows))


if __name__ == "__main__":
    try:
        typer.run(main)
    except SmoskinError as error:
        raise SystemExit(f"error: {error}") from error
