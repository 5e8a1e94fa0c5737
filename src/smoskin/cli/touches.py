"""Commands by which a skin gets a response table of its own from a few touches."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smoskin.cli.frame import Json, app, progress_bar, show

if TYPE_CHECKING:
    from smoskin.commands.touches import TouchCalibration

touches = typer.Typer(
    no_args_is_help=True,
    help="Calibrate a skin by a few touches: on a rig, or by hand with a sheet.",
)
app.add_typer(touches, name="touches")

Response = Annotated[Path, typer.Argument(help="The design's response table.", dir_okay=False)]
Out = Annotated[Path, typer.Option(help="The skin's own response table to write.")]
OfDesign = Annotated[str, typer.Option("--design", help="That the response table is of.")]
Count = Annotated[int, typer.Option(min=1, help="Touches to make.")]
UntilMm = Annotated[
    float, typer.Option(min=0.0, help="Stop where a touch is expected to be located this well.")
]
Force = Annotated[float, typer.Option(help="Largest normal force, N.")]
PlaceMm = Annotated[
    float, typer.Option(min=0.0, help="How far off places are, one standard deviation.")
]
ForceMn = Annotated[
    float, typer.Option("--force-mN", min=0.0, help="How far off forces are, likewise.")
]


@touches.command("plan")
def plan_touches(
    response: Response,
    sheet: Annotated[Path, typer.Argument(help="The sheet (CSV) to write.")],
    design: OfDesign = "planar",
    count: Count = 60,
    until_mm: UntilMm = 0.0,
    force: Force = 0.8,
    drag: Annotated[float, typer.Option(help="Largest sideways force, N.")] = 0.0,
    place_mm: PlaceMm = 0.5,
    force_mn: ForceMn = 10.0,
    after: Annotated[
        Path | None, typer.Option(help="A filled sheet of touches that have been made.")
    ] = None,
) -> None:
    """Write where and how hard to touch a skin, as a sheet to fill in.

    Each touch is the one that tells most after those before it. Fill in what the chips read once a
    touch has settled, or from when until when it was held while a recording ran.
    """
    from smoskin.commands.touch_sheet import read_contacts, write_plan
    from smoskin.commands.touches import TouchOrder, plan_of
    from smoskin.feasibility import load_design
    from smoskin.sensing.response.table import load_response_table

    skin = load_design(design)
    order = TouchOrder(count=count, until=until_mm * 1e-3, force=force, drag=drag)
    made = () if after is None else read_contacts(after, skin)
    targets = plan_of(
        skin,
        load_response_table(response),
        order,
        made,
        place_spread=place_mm * 1e-3,
        force_spread=force_mn * 1e-3,
    )
    write_plan(sheet, skin, targets)
    if targets:
        typer.echo(
            f"{len(targets)} touches; a touch is then expected to be located to "
            f"{1e3 * targets[-1].error:.2f} mm",
            err=True,
        )
    typer.echo(f"Now: smoskin touches fit {response} {sheet} --out skin.table", err=True)


@touches.command("fit")
def fit_touches(
    response: Response,
    sheet: Annotated[Path, typer.Argument(help="The filled sheet (CSV).")],
    out: Out,
    design: OfDesign = "planar",
    recording: Annotated[
        Path | None,
        typer.Option(help="MCAP with the readings, where the sheet says when touches were held."),
    ] = None,
    place_mm: PlaceMm = 0.5,
    force_mn: ForceMn = 10.0,
    as_json: Json = False,
) -> None:
    """Calibrate a skin from a sheet of touches made by hand."""
    from smoskin.commands.touches import calibrate_with_sheet
    from smoskin.feasibility import load_design
    from smoskin.sensing.response.table import load_response_table

    done = calibrate_with_sheet(
        load_design(design),
        load_response_table(response),
        sheet,
        recording=recording,
        place_spread=place_mm * 1e-3,
        force_spread=force_mn * 1e-3,
    )
    _finish(done, out, as_json=as_json)


@touches.command("rig")
def rig_touches(
    response: Response,
    out: Out,
    design: OfDesign = "planar",
    seed: Annotated[int, typer.Option(min=0, help="Of the skin on the virtual rig.")] = 0,
    count: Count = 60,
    until_mm: UntilMm = 0.0,
    force: Force = 0.8,
    drag: Annotated[float, typer.Option(help="Largest sideways force, N.")] = 0.3,
    temperature: Annotated[float, typer.Option(help="Of the skin, degC.")] = 25.0,
    as_json: Json = False,
) -> None:
    """Calibrate a virtual skin on a virtual rig, touch by touch.

    The skin is the one that `twin://DESIGN?manufactured=yes&seed=SEED` reads.
    """
    touch_on_rig(
        response, out, design=design, seed=seed, count=count, until_mm=until_mm, force=force,
        drag=drag, temperature=temperature, as_json=as_json,
    )  # fmt: skip


def touch_on_rig(
    response: Path,
    out: Path,
    *,
    design: str,
    seed: int,
    count: int,
    until_mm: float = 0.0,
    force: float = 0.8,
    drag: float = 0.3,
    temperature: float = 25.0,
    as_json: bool,
) -> None:
    """Calibrate on the virtual rig, with a bar, and say what came of it."""
    from smoskin.commands.touches import TouchOrder, calibrate_with_rig, virtual_rig
    from smoskin.feasibility import load_design
    from smoskin.sensing.response.table import load_response_table

    skin, table = load_design(design), load_response_table(response)
    order = TouchOrder(count=count, until=until_mm * 1e-3, force=force, drag=drag)
    with progress_bar() as bar, virtual_rig(skin, seed, temperature=temperature) as rig:
        done = calibrate_with_rig(
            skin, table, rig, order, progress=lambda one: bar(one.sentence, one.number / one.asked)
        )
    _finish(done, out, as_json=as_json)


def _finish(done: "TouchCalibration", out: Path, *, as_json: bool) -> None:
    """Write the table and say what it is worth."""
    done.table.save(out)
    if as_json:
        typer.echo(json.dumps(done.as_json()))
        return
    for one in done.tables():
        show(one)
    typer.echo(f"Now: smoskin run SOURCE --calibration {out}", err=True)
