"""The command that lays a folded sheet on a surface."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from smoskin.cli.frame import Force, Json, app, examples, progress_bar, tell
from smoskin.feasibility import load_design


@app.command(
    epilog=examples(
        "tessellate cylinder:100 --cells 6 6 --out skin",
        "tessellate cone:60,80,150 --cells 6 6 --out forearm",
        "tessellate link.stl --at 0,40,120 --along 0,0,1 --cells 6 6 --out link",
    )
)
def tessellate(
    surface: Annotated[
        str,
        Argument(
            help="plane, cylinder:R, cone:R1,R2,H, sphere:R, saddle:R, bump:HEIGHT,WIDTH, lengths "
            "in mm; or a mesh (STL, OBJ, PLY) in mm."
        ),
    ],
    cells: Annotated[tuple[int, int], Option(help="Cells along the axis and round it.")],
    out: Annotated[Path, Option(help="Folder of the files.", file_okay=False)],
    design: Annotated[
        str, Option(help="Design whose cell and columns are used, and panels no thicker than its.")
    ] = "planar",
    scale: Annotated[float, Option(help="Factor on the cell's edges.")] = 1.0,
    at: Annotated[str, Option(help="x,y,z of a mesh under the sheet's middle, mm.")] = "0,0,0",
    along: Annotated[str, Option(help="Direction of the sheet's x: a limb's axis.")] = "1,0,0",
    own_columns: Annotated[
        bool,
        Option(
            "--own-columns",
            help="Let each column have its own height, within 10 %, so that sheets fold on "
            "surfaces bent two ways too.",
        ),
    ] = False,
    time_limit: Annotated[float, Option(help="Longest search, s.")] = 60.0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Lay a folded sheet on a surface and write its flat pattern.

    report.html tells every gate's value, and fold.html shows the sheet from flat to folded to
    attached. On a plane, cylinder or cone, whose radii are those of the bottom vertices,
    design.toml is the skin for table, score, demo and fabricate. On surfaces bent two ways film and
    circuit cannot lie: there is geometry alone. No pattern is written of a sheet that fails a gate;
    validity.json tells which, and what would fit. The exit code is then 1, as for a surface that is
    refused, of which there is no other file.
    """
    from smoskin.commands.tessellate import numbers, tessellate_surface

    with progress_bar() as bar:
        report = tessellate_surface(
            surface,
            load_design(design),
            cells,
            out,
            scale=scale,
            at=numbers("at", at),
            along=numbers("along", along),
            own_columns=own_columns,
            time_limit=time_limit,
            force=force,
            progress=bar,
        )
    tell(report, as_json)
    if not report.made.holds:
        typer.echo(f"This sheet must not be cut: {report.made.advice}.", err=True)
        raise typer.Exit(1)
