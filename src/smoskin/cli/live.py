"""Commands that run a skin: the demonstration, and any source of readings."""

import json
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from smoskin.cli.frame import (
    Carried,
    Design,
    File,
    Force,
    Json,
    Number,
    Text,
    Whole,
    app,
    examples,
    tell,
)
from smoskin.feasibility import load_design
from smoskin.hardware.wire.packet import Format
from smoskin.sensing.response.table import load_response_table
from smoskin.service.apart.realtime import undisturbed

Seconds = Annotated[Number, Option(min=0.0, help="Stop after so many seconds.")]
Record = Annotated[File, Option(help="Write everything to this new MCAP file.", dir_okay=False)]
Port = Annotated[int, Option(min=0, max=65535, help="TCP port of the page; 0 takes a free one.")]
Recorded = Annotated[
    File,
    Option(help="Write everything to this new MCAP file; with --view a folder for the page's."),
]
JsonLines = Annotated[
    bool, Option("--json", help="Print estimates, and the summary, as lines of JSON.")
]
Others = Annotated[
    list[Path] | None,
    Option(help="File of another estimator to choose on the page, such as a network."),
]
OthersNamed = Annotated[
    list[str] | None,
    Option("--estimator", metavar="[NAME=]FILE", help="To choose on the page too."),
]
Zeroed = Annotated[
    bool,
    Option("--zero/--no-zero", help="Take the first 20 readings as those of the untouched skin."),
]
Paged = Annotated[
    bool,
    Option(
        "--view",
        help="Serve the live page: press a virtual skin there, or pause and seek in a recording, "
        "which then stays until Ctrl-C.",
    ),
]
Changes = Annotated[
    bool, Option("--changes", help="Print where the status or number of touches changes.")
]
Realtime = Annotated[
    bool, Option("--realtime", help="Run before other programs, where the system lets this user.")
]


@app.command(
    epilog=examples("demo", "demo --seconds 30 --seed 7", "demo --headless --seconds 30 --json")
)
def demo(
    design: Design = "planar",
    seconds: Seconds = None,
    headless: Annotated[bool, Option("--headless", help="Without the live page.")] = False,
    as_json: Json = False,
    port: Port = 0,
    rate: Annotated[float, Option(help="Readings a second, Hz.")] = 100.0,
    seed: Annotated[int, Option(min=0, help="Seed of the skin, the noise and the hand.")] = 0,
    touches: Annotated[
        int, Option(min=1, max=1000, help="Touches of the rig that calibrates.")
    ] = 15,
    table: Annotated[
        File, Option(help="Response table of the design; by default the shipped one.")
    ] = None,
    estimator: Others = None,
    record: Record = None,
) -> None:
    """Touch a simulated skin and see what its chips feel, live in a browser.

    A workshop makes the skin and a rig calibrates it by a few touches, which takes some seconds. A
    scripted hand then touches it anywhere; on the page the mouse presses it too. At the end every
    touch of the hand is listed beside its estimate; the exit code is 1 if one was missed, or none
    was read.
    """
    from smoskin.commands.demo import run_demo

    seconds = 15.0 if headless and seconds is None else seconds

    def announce(url: str | None) -> None:
        where = f"The skin is live at {url}" if url else "A hand touches the skin"
        until = f"for {seconds:g} s" if seconds is not None else "until Ctrl-C"
        typer.echo(f"{where} {until}.", err=True)

    result = run_demo(
        load_design(design),
        seconds=seconds,
        page=not headless,
        port=port,
        rate=rate,
        seed=seed,
        calibration_touches=touches,
        table=None if table is None else load_response_table(table),
        others=estimator or (),
        record=record,
        on_start=announce,
        say=lambda sentence: typer.echo(sentence, err=True),
    )
    tell(result, as_json)
    if not as_json:
        for name, value in asdict(result.summary).items():
            typer.echo(f"{name}: {value}")
    summary = result.summary
    if summary.found < summary.touches or (summary.unread and not summary.touches):
        raise typer.Exit(1)


@app.command(
    epilog=examples(
        "run 'twin://planar?manufactured=yes&seed=3' --calibration skin.table --seconds 5",
        "run 'twin://planar?manufactured=yes&seed=3' --calibration skin.table --view --quiet",
        "run replay:touch.mcap --every 0.5 --strict",
    )
)
def run(
    source: Annotated[
        str, Argument(help="serial:PORT, i2c:DEVICE, replay:FILE or twin:DESIGN, with ?options.")
    ] = "twin://planar",
    design: Annotated[Text, Option(help="Design of the skin; by default the source's own.")] = None,
    calibration: Annotated[
        File, Option(help="File of this skin: a calibration, a response table or a network.")
    ] = None,
    arm: Carried = False,
    zero: Zeroed = True,
    seconds: Seconds = None,
    view: Paged = False,
    port: Port = 0,
    record: Recorded = None,
    force: Force = False,
    estimator: Others = None,
    every: Annotated[Number, Option(min=0.0, help="Print one estimate in so many seconds.")] = None,
    changes: Changes = False,
    quiet: Annotated[bool, Option("--quiet", help="Print no estimates.")] = False,
    strict: Annotated[bool, Option("--strict", help="Fail if a recording is not whole.")] = False,
    realtime: Realtime = False,
    as_json: JsonLines = False,
) -> None:
    """Estimate touches from a source of readings and print them as they come.

    At the end a summary is told on standard error. The exit code is 1 if readings could not be
    recorded or, with --strict, are missing from a recording.
    """
    from smoskin.commands.run import Watch, lines

    say = partial(typer.echo, err=True)
    watch = Watch(
        source,
        None if design is None else load_design(design),
        calibration=calibration,
        arm=arm,
        zero=zero,
        seconds=seconds,
        record=record,
        force=force,
        estimators=estimator or (),
        view=view,
        port=port,
        say=say,
    )
    with watch, undisturbed(realtime=realtime):
        try:
            for estimate, worth in lines.thinned(iter(watch), every=every, changes=changes):
                if worth and not quiet:
                    typer.echo(lines.estimate_line(estimate, as_json=as_json))
        finally:
            watch.close()
            say(json.dumps({"summary": watch.summary.as_json()}) if as_json else watch.summary)
    if watch.summary.failure or (strict and watch.summary.damage):
        raise typer.Exit(1)


@app.command(
    epilog=examples(
        "serve twin://planar --feed 8770",
        "serve left=serial:///dev/ttyACM0 right=serial:///dev/ttyACM1 "
        "--calibration left=left.table --calibration right=right.table",
    )
)
def serve(
    sources: Annotated[list[str], Argument(metavar="[NAME=]SOURCE...", help="As of smoskin run.")],
    calibration: Annotated[
        list[str] | None, Option(metavar="[NAME=]FILE", help="Of a skin, as of smoskin run.")
    ] = None,
    estimator: OthersNamed = None,
    arm: Carried = False,
    zero: Zeroed = True,
    seconds: Seconds = None,
    host: Annotated[str, Option(help="Address to listen at; others need the token.")] = "127.0.0.1",
    feed: Annotated[int, Option(min=0, max=65535, help="TCP port of the JSON feed.")] = 8770,
    foxglove: Annotated[
        Whole, Option(min=0, max=65535, help="TCP port for Foxglove on this machine, often 8765.")
    ] = None,
    view: Annotated[bool, Option("--view", help="Serve each skin's live page.")] = False,
    record: Annotated[File, Option(help="Folder in which each skin is recorded.")] = None,
    force: Force = False,
    every: Annotated[float, Option(min=0.1, help="Tell counters each so many seconds.")] = 10.0,
    log: Annotated[File, Option(help="Append the log here, as lines of JSON.")] = None,
    realtime: Realtime = False,
    as_json: Json = False,
) -> None:
    """Read any number of skins and hand their touches to other programs, until Ctrl-C.

    Programs get them as JSON over a WebSocket (docs/feed.md), Foxglove by its own protocol. A skin
    that fails leaves the others alone; the exit code is 1 if one did.
    """
    from smoskin.commands.serve.log import logged_to
    from smoskin.commands.serve.skins import Service, counters_line, wanted_skins
    from smoskin.service.bridges.feed import Feed
    from smoskin.service.bridges.foxglove import Foxglove

    say = partial(typer.echo, err=True)
    wanted = wanted_skins(sources, calibration or (), record, estimator or ())
    if record is not None:
        record.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        if log is not None:
            stack.enter_context(logged_to(log))
        bridges: list[Feed | Foxglove] = [stack.enter_context(Feed(host=host, port=feed))]
        if foxglove is not None:
            bridges.append(stack.enter_context(Foxglove(port=foxglove)))
        options = {"arm": arm, "zero": zero, "view": view, "force": force}
        service = stack.enter_context(Service(wanted, bridges, **options, say=say))
        places = " and ".join(bridge.url for bridge in bridges)
        stack.enter_context(undisturbed(realtime=realtime))
        say(f"Touches of {', '.join(service.skins)} at {places}")
        for counters in service.run(seconds, every):
            typer.echo(json.dumps(counters) if as_json else counters_line(counters))
        if as_json:
            typer.echo(json.dumps(service.counters()))
    for name, failure in service.failures.items():
        say(f"error: {name}: {failure}")
    if service.failures:
        raise typer.Exit(1)


@app.command(epilog=examples("board --virtual planar", "board --virtual planar --format anyskin"))
def board(
    virtual: Annotated[
        str, Option(help="Design of the simulated skin: a shipped name or a document.")
    ] = "planar",
    wire: Annotated[
        Format, Option("--format", help="What the board sends; smoskin is docs/wire.md.")
    ] = "smoskin",
    rate: Annotated[float, Option(help="Readings a second, Hz.")] = 100.0,
    seed: Annotated[int, Option(min=0, help="Seed of the skin, the noise and the hand.")] = 0,
    hand: Annotated[
        bool, Option("--hand/--no-hand", help="Let a scripted hand touch the skin.")
    ] = True,
    seconds: Seconds = None,
) -> None:
    """Be a board without hardware: print the name of a port and send a virtual skin's readings.

    Programs read it as they would a serial port: smoskin run serial:///dev/pts/N, with the
    format if it is another one.
    """
    from smoskin.service.board import run_board

    def announce(port: str) -> None:
        ask = "" if wire == "smoskin" else f"?format={wire}&design={virtual}"
        typer.echo(port)
        typer.echo(f"Read it by: smoskin run 'serial://{port}{ask}'", err=True)

    sent = run_board(
        load_design(virtual),
        format=wire,
        rate=rate,
        seed=seed,
        hand=hand,
        seconds=seconds,
        on_start=announce,
    )
    typer.echo(f"{sent.sent} frames sent, {sent.dropped} that nobody read", err=True)


@app.command(
    epilog=examples(
        "doctor", "doctor serial:///dev/ttyACM0 --seconds 10", "doctor i2c:///dev/i2c-1"
    )
)
def doctor(
    source: Annotated[
        Text, Argument(help="Source to look at, as of smoskin run; by default every port and bus.")
    ] = None,
    design: Annotated[Text, Option(help="Design of the skin; by default the source's own.")] = None,
    seconds: Annotated[float, Option(min=1.0, help="Seconds of readings.")] = 5.0,
    moving: Annotated[
        float, Option(min=0.0, help="Seconds in which you then move the robot.")
    ] = 0.0,
    as_json: Json = False,
) -> None:
    """Look at a board and say what is wrong with it, each with what to do.

    The skin must not be touched meanwhile. The exit code is 1 if anything is wrong.
    """
    from smoskin.service.doctor import examine_source, look_around

    if source is None:
        diagnosis = look_around()
    else:
        diagnosis = examine_source(
            source,
            design=None if design is None else load_design(design),
            seconds=seconds,
            moving=moving,
            say=lambda sentence: typer.echo(sentence, err=True),
        )
    typer.echo(json.dumps(diagnosis.as_json()) if as_json else diagnosis)
    if diagnosis.findings:
        raise typer.Exit(1)
