"""Commands for robots: an arm that follows touches, and a node of ROS 2."""

import queue
import sys
import threading
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from smoskin.cli.frame import Carried, File, Force, Json, Number, Text, app, examples, tell
from smoskin.cli.live import Realtime
from smoskin.design.skin import SkinDesign
from smoskin.feasibility import load_design


@app.command(
    epilog=examples(
        "follow --headless --json",
        "follow --headless --film follow.gif --record follow.mcap",
        "follow serial:///dev/ttyACM0 --calibration skin.table",
    )
)
def follow(
    source: Annotated[
        str, Argument(help="Source of a live skin, as of smoskin run.")
    ] = "twin://planar",
    design: Annotated[Text, Option(help="Design of the skin; by default the source's own.")] = None,
    calibration: Annotated[File, Option(help="File of this skin, as of smoskin run.")] = None,
    headless: Annotated[
        bool, Option("--headless", help="Play the scripted demonstration on a made skin.")
    ] = False,
    as_json: Json = False,
    rate: Annotated[
        float, Option(min=50.0, max=500.0, help="Readings a second of the demonstration.")
    ] = 100.0,
    seed: Annotated[int, Option(min=0, help="Seed of its skin and its noise.")] = 0,
    film: Annotated[File, Option(help="Write a GIF of the demonstration.")] = None,
    record: Annotated[File, Option(help="Write everything to this new MCAP file.")] = None,
    force: Force = False,
    model: Annotated[File, Option(help="MuJoCo model of another arm.")] = None,
    site: Annotated[str, Option(help="Its site at the skin's middle, z outward.")] = "skin",
    robot: Annotated[Text, Option(help="A real arm, as the model: ur:HOST or xarm:HOST.")] = None,
    view: Annotated[bool, Option("--view", help="Serve the operator's page.")] = False,
    port: Annotated[int, Option(min=0, max=65535, help="Its port; 0 takes a free one.")] = 0,
    seconds: Annotated[Number, Option(min=0.0, help="Stop after so many seconds.")] = None,
    realtime: Realtime = False,
) -> None:
    """Let an arm, simulated unless --robot is given, yield to touches of the skin on its forearm.

    It is disarmed at first: type arm, disarm, reset, zero or quit. A real arm moves only while
    Enter or the button of the page is held. This is not a safety function: it
    stops by category 2 only, and the wired emergency stop stays in force. With --headless a script
    presses through 0.5 N; the exit code is 1 if the arm broke a promise, or this machine is too
    slow for the rate. It is 1 too if a recording is not whole.
    """
    from smoskin.commands.follow.live import follow_source
    from smoskin.robot.simulated import OWN_MODEL

    say = partial(typer.echo, err=True)
    path = model or OWN_MODEL
    if headless:
        shown = load_design(design or "curved")
        _demonstrate(shown, path, site, seed, rate, film, record, force, as_json)
        return
    counters = follow_source(
        source,
        None if design is None else load_design(design),
        calibration=calibration,
        model=path,
        site=site,
        robot=robot,
        port=port if view else None,
        seconds=seconds,
        realtime=realtime,
        record=record,
        force=force,
        words=_heard(),
        say=say,
    )
    say(f"{counters.readings} readings at {counters.rate:.0f} Hz.")


@app.command(
    epilog=examples(
        "ros serial:///dev/ttyACM0 --calibration skin.table",
        "ros twin://planar -- --ros-args -r __ns:=/left -p prefix:=left_",
    )
)
def ros(
    source: Annotated[str, Argument(help="Source of the skin, as of smoskin run.")],
    arguments: Annotated[
        list[str] | None, Argument(metavar="[-- --ros-args ...]", help="Arguments of ROS.")
    ] = None,
    design: Annotated[Text, Option(help="Design of the skin; by default the source's own.")] = None,
    calibration: Annotated[File, Option(help="File of this skin, as of smoskin run.")] = None,
    arm: Carried = False,
    seconds: Annotated[Number, Option(min=0.0, help="Stop after so many seconds.")] = None,
    record: Annotated[File, Option(help="Write everything to this new MCAP file.")] = None,
    force: Force = False,
) -> None:
    """Be a ROS 2 node that publishes what a skin reads and feels (docs/ros.md).

    The first 20 readings are the zero; the service skin/zero takes a new one.
    """
    from smoskin.commands.run import Watch
    from smoskin.errors import ArgumentError
    from smoskin.service.bridges.ros import RosNode

    def say(sentence: object) -> None:
        typer.echo(str(sentence), err=True)

    def node_of(watch: Watch) -> list[RosNode]:
        if watch.design is None:
            raise ArgumentError(f"design must be given: {source!r} does not name it")
        node = RosNode(watch.design, zero=watch.ask_zero, arguments=arguments or ())
        say(f"The node {node.name} publishes.")
        return [node]

    with Watch(
        source,
        None if design is None else load_design(design),
        calibration=calibration,
        arm=arm,
        seconds=seconds,
        record=record,
        force=force,
        say=say,
        bridges=node_of,
    ) as watch:
        for _ in watch:
            pass
        say(watch.summary)


def _heard() -> "queue.Queue[str]":
    """What people type, line by line."""
    words: queue.Queue[str] = queue.Queue()

    def hear() -> None:
        for line in sys.stdin:
            words.put(line)

    threading.Thread(target=hear, daemon=True).start()
    return words


def _demonstrate(
    design: SkinDesign,
    model: Path,
    site: str,
    seed: int,
    rate: float,
    film: Path | None,
    record: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Play the demonstration, and tell of it."""
    from smoskin.commands.follow.demonstration import demonstrate
    from smoskin.commands.follow.film import Film
    from smoskin.commands.follow.live import WARNING
    from smoskin.robot.simulated import SimulatedArm

    typer.echo(WARNING, err=True)
    pictures = None if film is None else Film(film, force=force)
    result = demonstrate(
        design,
        seed=seed,
        rate=rate,
        record=record,
        force=force,
        arm=lambda skin, clock: SimulatedArm(skin, clock, model=model, site=site),
        say=partial(typer.echo, err=True),
        watch=(lambda stage, moment: None) if pictures is None else pictures.watch,
    )
    if pictures is not None:
        pictures.save()
    tell(result, as_json)
    if not as_json:
        for name, value in result.as_json()["summary"].items():
            typer.echo(f"{name}: {value}")
    for sentence in result.broken:
        typer.echo(sentence, err=True)
    if not result.kept:
        raise typer.Exit(1)
