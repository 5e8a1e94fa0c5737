"""Commands of a rig: campaigns are planned and pressed, and their recordings tell of a skin."""

from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Argument, Option

from smoskin.cli.calibration import Rig, touches
from smoskin.cli.frame import (
    Design,
    File,
    Force,
    Json,
    Text,
    app,
    examples,
    progress_bar,
    tell,
)
from smoskin.errors import ArgumentError, require
from smoskin.feasibility import load_design
from smoskin.measurement import read_touches, write_touches
from smoskin.outputs import check_output
from smoskin.roles import Rig as AnyRig
from smoskin.twin.rig import open_rig


@touches.command(
    "campaign",
    epilog=examples(
        "touches campaign --width-mm 120 --height-mm 160",
        "touches campaign --kind shear --columns 5 --rows 7",
    ),
)
def plan_campaign(
    kind: Annotated[
        Literal["grid", "random", "shear", "cycles", "recovery"], Option(help="What is asked.")
    ] = "grid",
    width: Annotated[float, Option("--width-mm", help="Width of the skin along x, mm.")] = 120.0,
    height: Annotated[float, Option("--height-mm", help="Height of the skin along y, mm.")] = 160.0,
    out: Annotated[Path, Option(help="Sheet (CSV) to write.", dir_okay=False)] = Path("plan.csv"),
    columns: Annotated[int, Option(min=1, max=1000, help="Places along x.")] = 25,
    rows: Annotated[int, Option(min=1, max=1000, help="Places along y.")] = 33,
    forces: Annotated[str, Option("--forces-N", help="How hard each is pressed.")] = "0.3,0.6,0.9",
    drag: Annotated[float, Option(help="Sideways force of shear, as a share of the press.")] = 0.2,
    angles: Annotated[int, Option(min=1, max=360, help="Directions of shear.")] = 8,
    repeats: Annotated[int, Option(min=1, max=1000, help="Cycles, or touches, a place.")] = 5,
    reference_every: Annotated[
        int, Option(min=0, help="Make one touch again after every so many; 0: never.")
    ] = 25,
    seed: Annotated[int, Option(min=0, help="Seed of the order.")] = 0,
    overwrite: Force = False,
) -> None:
    """Write the touches of a rig's campaign, in random order, for touches press.

    A grid, random places, shear at angles, load cycles or recoveries. For temperature press the
    same plan cold and warm; smoskin touches plan chooses the touches that tell most.
    """
    from smoskin.hardware.rig.plans import campaign_plan

    check_output(out, force=overwrite)
    try:
        pushes = [float(part) for part in forces.split(",")]
    except ValueError as error:
        raise ArgumentError(f"--forces-N must be numbers with commas; got {forces!r}") from error
    plan = campaign_plan(
        kind,
        1e-3 * width,
        1e-3 * height,
        columns=columns,
        rows=rows,
        forces=pushes,
        drag=drag,
        angles=angles,
        repeats=repeats,
        reference_every=reference_every,
        seed=seed,
    )
    write_touches(out, plan)
    typer.echo(f"{len(plan.contacts)} touches")
    typer.echo(f"Now: smoskin touches press --plan {out} --out campaign.mcap", err=True)


@touches.command(
    "press",
    epilog=examples("touches press planar --rig 'virtual?seed=3' --plan plan.csv"),
)
def press_touches(
    design: Design = "planar",
    rig: Rig = "virtual",
    plan: Annotated[Path, Option(help="Sheet of touches to make, of grid or plan.")] = Path(
        "plan.csv"
    ),
    out: Annotated[
        Path,
        Option(
            help="Sheet (.csv) or recording (.mcap) to write, or to go on with.", dir_okay=False
        ),
    ] = Path("touches.csv"),
    source: Annotated[Text, Option(help="Readings of a real skin, as of smoskin run.")] = None,
    stage: Annotated[Text, Option(help="Stage (GRBL): serial:///dev/ttyUSB0.")] = None,
    gauge: Annotated[Text, Option(help="Force gauge: serial:///dev/ttyUSB1.")] = None,
    origin: Annotated[
        Text, Option("--origin-mm", help="Stage's X,Y,Z with the probe over the skin's origin, mm.")
    ] = None,
    limit: Annotated[float, Option("--limit-N", help="Force that breaks a touch off.")] = 1.5,
    stiffness: Annotated[
        float, Option("--stiffness-N-per-mm", help="Stiffness of the skin's stiffest place.")
    ] = 2.0,
    reach: Annotated[
        float, Option("--reach-mm", help="How far below the origin the probe may go.")
    ] = 10.0,
    recovery: Annotated[
        float, Option("--recovery-s", min=0.0, help="How long a real skin is read after each.")
    ] = 0.0,
    turn: Annotated[
        bool, Option("--turn", help="The stage's y axis turns a limb, a degree a millimetre.")
    ] = False,
    held_out: Annotated[
        float, Option(min=0.0, max=0.9, help="Share of the places that learn does not learn by.")
    ] = 0.0,
    picture: Annotated[
        File, Option(help="Draw how far it is to this file (SVG), anew every five seconds.")
    ] = None,
) -> None:
    """Let a rig make the touches of a plan, each once.

    What has been made is in the file, at most five seconds late; the same command goes on with it,
    whatever has interrupted it. A recording (MCAP) has all that chips, gauge and stage said, each
    touch as soon as it is made, and which places are held out, before the first press. With
    --source, --stage, --gauge and --origin-mm the rig is a real one, which presses straight.
    """
    from smoskin.commands import press as campaigns

    parts = (source, stage, gauge, origin)
    if any(part is not None for part in parts) and (None in parts or rig != "virtual"):
        raise ArgumentError(
            "--source, --stage, --gauge and --origin-mm must come together, and without --rig"
        )
    if None in parts and (turn or recovery):
        raise ArgumentError(
            "--turn and --recovery-s are of a rig with --stage; give recovery in --rig"
        )
    skin = load_design(design)
    read_touches(plan)  # a wrong one is told before a rig moves
    for file in (out, picture):
        if file is not None and not file.exists():
            check_output(file)
    opened: AnyRig
    if source is not None and stage is not None and gauge is not None and origin is not None:
        sizes = {"limit": limit, "stiffness": 1e3 * stiffness, "reach": 1e-3 * reach}
        sizes["recovery"] = recovery
        if turn:
            if skin.limb is None:
                raise ArgumentError(f"--turn needs a skin round a limb; {skin.name} is none")
            sizes["radius"] = 1.0 / skin.curvature
        opened = campaigns.real_rig(source, stage, gauge, origin=_place(origin), **sizes)
        known = {"source": source, "stage": stage, "gauge": gauge, "origin_mm": origin, **sizes}
    else:
        opened, known = open_rig(rig, skin), {"rig": rig}
    with opened as presser, progress_bar() as bar:
        done = campaigns.press(
            presser, skin, plan, out, known, share=held_out, picture=picture, progress=bar
        )
    typer.echo(f"{done} touches in {out}")
    typer.echo(f"Now: smoskin learn {out} --out own.model", err=True)


def _place(text: str) -> list[float]:
    """The place that three numbers with commas name in mm, m."""
    try:
        x, y, z = (1e-3 * float(part) for part in text.split(","))
    except ValueError as error:
        raise ArgumentError(
            f"--origin-mm must be three numbers such as -120,-80,-5; got {text!r}"
        ) from error
    return [x, y, z]


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
    block: Annotated[
        File, Option(help="Recording (MCAP) of a rigid block pressed by the same rig.")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Characterise a skin: what the recordings of a rig's touches tell of it, and how surely.

    Noise, sensitivity, stiffness, hysteresis, repeatability, cross-talk of chips, recovery and
    temperature coefficients, and the rig's own compliance and lag, each with its definition and its
    uncertainty, or why the recordings do not give it. report.html, report.json and report.svg are
    written.
    """
    from smoskin.commands.report import characterise, write_report

    require("a picture", "plots", "matplotlib")
    done = characterise(recordings, block=block)
    files = write_report(done, out, force=force)
    tell(done, as_json, files=[str(file) for file in files])
    if not as_json:
        for file in files:
            typer.echo(str(file))
