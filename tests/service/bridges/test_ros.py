"""The ROS 2 node: geometry and stamps, and all of it against plain rclpy in another process."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from smoskin.errors import SmoskinError
from smoskin.feasibility import load_design
from smoskin.magnetics.mlx90393 import rotations
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.service.bridges.ros import RosNode, Stamps, in_space, static_frames

TESTS = Path(__file__).parents[2]
PLANAR, CURVED = load_design("planar"), load_design("curved")


@pytest.fixture
def ros() -> str:
    """A Python that has rclpy and this package's core."""
    named = os.environ.get("SMOSKIN_ROS_PYTHON")
    if named is None and importlib.util.find_spec("rclpy") is None:
        pytest.skip("no rclpy here, and SMOSKIN_ROS_PYTHON names no Python that has it")
    return named or sys.executable


@pytest.fixture
def start(ros):
    """Start a process of ROS in a domain of its own; all are ended at the end."""
    begun = []
    domain = 1 + os.getpid() % 100
    path = os.pathsep.join([str(TESTS.parent / "src"), os.environ.get("PYTHONPATH", "")])
    more = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}

    def begin(*arguments: str) -> subprocess.Popen[str]:
        begun.append(
            subprocess.Popen(
                [ros, *arguments],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env=os.environ | {"PYTHONPATH": path} | more,
            )
        )
        return begun[-1]

    yield begin
    for process in begun:
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.communicate()


def listening(start, **asked) -> subprocess.Popen[str]:
    return start(str(TESTS / "ros_listener.py"), json.dumps(asked))


def result(process: subprocess.Popen[str], timeout: float):
    out, errors = process.communicate(timeout=timeout)
    assert process.returncode == 0, errors
    return json.loads(out.splitlines()[-1])


def test_chips_stand_in_the_tree_where_they_stand_in_the_skin():
    for design in (PLANAR, CURVED):
        places, turns = static_frames(design)
        skin = geometry(design)
        assert places == pytest.approx(skin.chips, abs=1e-12)
        own = np.random.default_rng(1).normal(size=(len(design.halls), 3))
        # Vectors of chips' own axes, first to the axes along the limb there, then to the skin's.
        local = np.einsum("sij,sj->si", rotations(design.halls), own)
        expected = np.einsum("sij,sj->si", skin.chip_axes, local)
        assert Rotation.from_quat(turns).apply(own) == pytest.approx(expected, abs=1e-12)


def test_a_press_round_a_limb_points_at_its_axis():
    radius = 1.0 / CURVED.curvature
    middle = geometry(CURVED).roll.middle
    for y in (middle, 0.3 * middle, 1.9 * middle):
        place, force = in_space(CURVED, Contact(position=(0.03, y), force=(0.0, 0.0, -2.0)))
        axis = np.array([0.03, middle, -radius])
        assert np.linalg.norm(place - axis) == pytest.approx(radius)
        assert force == pytest.approx(2.0 * (axis - place) / radius)
    place, force = in_space(PLANAR, Contact(position=(0.03, 0.04), force=(0.1, 0.2, -0.3)))
    assert (place.tolist(), force.tolist()) == ([0.03, 0.04, 0.0], [0.1, 0.2, -0.3])


def test_stamps_are_those_of_acquisition_however_late_readings_come():
    rng = np.random.default_rng(0)
    times = 1000.0 + np.arange(2000) / 200
    delays = 1e-3 + rng.exponential(2e-3, 2000)
    now = [0]
    stamps = Stamps(lambda: now[0])
    got = []
    for time, delay in zip(times, delays, strict=True):
        now[0] = round((1.7e9 + time + delay) * 1e9)
        got.append(stamps(time))
        assert got[-1] <= now[0]
    assert (np.diff(got) > 0).all()
    late = np.array(got[200:]) * 1e-9 - (1.7e9 + times[200:])
    # The least delay stays in all stamps, the others' scatter goes.
    assert late.min() >= 0.9e-3
    assert late.max() < 1.5e-3


def test_stamps_begin_anew_after_a_pause_and_when_time_goes_back():
    now = [0]
    stamps = Stamps(lambda: now[0])
    for wall, time, expected in (
        (100.0, 5.0, 100.0),
        (100.1, 5.1, 100.1),
        (130.0, 5.2, 130.0),
        (130.1, 5.3, 130.1),
        (131.0, 0.0, 131.0),
        (120.0, 0.1, 120.0),  # the clock of the wall was set back
    ):
        now[0] = round(wall * 1e9)
        assert stamps(time) == pytest.approx(expected * 1e9, abs=1e3)


def test_without_rclpy_it_is_told_what_to_do():
    if importlib.util.find_spec("rclpy") is not None:
        pytest.skip("rclpy is installed here")
    with pytest.raises(SmoskinError, match="ROS 2 node needs rclpy"):
        RosNode(PLANAR, zero=lambda: None)


def test_the_launch_file_runs_the_command_with_its_arguments(launched):
    words = launched
    assert words[:2] == ["smoskin", "ros"]
    assert words[2:5] == ["serial:///dev/ttyACM0", "--calibration", "skin.table"]
    assert words[5:] == ["--", "--ros-args", "-r", "__ns:=/", "-p", "prefix:=''"]


def test_another_process_hears_all_of_a_live_skin(start):
    pytest.importorskip("typer")
    topics = [f"skin/chip{k}/field" for k in range(3)]
    topics += ["skin/wrench", "skin/contact0", "/diagnostics", "skin/frames", "/tf_static"]
    calls = [
        *[["zero"], ["get", "prefix", "fields", "least_force"]],
        *[["set", "prefix", "other_"], ["set", "least_force", -1.0], ["set", "least_force", 1e3]],
    ]
    inside = ["-r", "__ns:=/left"]
    listener = listening(
        start, topics=topics, until=["/diagnostics", 3], calls=calls, arguments=inside
    )
    tools = ["--", "--ros-args", *inside, "-p", "prefix:=left_"]
    # A hand that touches for 0.65 s of every 0.8 s.
    start("-m", "smoskin", "ros", "twin://planar?mechanics=reduced&rate=50&hand=yes", *tools)
    report = result(listener, 60)
    heard = {topic: messages for topic, messages in report["heard"].items() if messages}
    assert set(heard) >= {*topics[:4], "/diagnostics"}
    for chip in range(3):
        stamps, received, frames, fields = zip(*heard[f"skin/chip{chip}/field"], strict=True)
        assert set(frames) == {f"left_chip{chip}"}
        steps = np.diff(stamps) * 1e-9
        assert (steps > 0).all()
        assert np.median(steps) == pytest.approx(1 / 50, rel=0.1)
        assert (np.array(received) > stamps).all()
        assert 1e-6 < np.linalg.norm(fields, axis=1).max() < 0.05
    # All that was acquired at once has the same stamp.
    of_fields = {message[0] for message in heard["skin/chip0/field"]}
    wrenches = [message[0] for message in heard["skin/wrench"]]
    assert len(of_fields & set(wrenches)) > 0.9 * len(wrenches)
    assert {message[2] for message in heard["skin/wrench"]} == {"left_skin"}
    for stamp, _, frame, (x, y, z) in heard.get("skin/contact0", []):
        assert (frame, z) == ("left_skin", 0.0)
        assert 0.0 <= x <= 0.12
        assert 0.0 <= y <= 0.161
        assert stamp in wrenches
    places, turns = static_frames(PLANAR)
    frames = heard.get("skin/frames") or heard["/tf_static"]
    assert len(frames) == 3
    for chip, (_, _, frame, (child, place, turn)) in enumerate(frames):
        assert (frame, child) == ("left_skin", f"left_chip{chip}")
        assert place == pytest.approx(places[chip])
        assert turn == pytest.approx(turns[chip])
    level, name, words, design = heard["/diagnostics"][-1][3][0][0]
    assert level in (0, 1)
    assert (name, design) == ("/left/smoskin: skin", "planar")
    assert words
    values = heard["/diagnostics"][-1][3][1][0]
    assert values["chip0"] == "good"
    assert float(values["rate, Hz"]) > 20
    (zeroed, sentence), parameters, *settings = report["answers"]
    assert zeroed or sentence == "The skin is touched." or "as soon as the skin rests" in sentence
    assert parameters == ["left_", True, 0.0]
    assert settings == [False, False, True]


def test_the_zero_is_taken_when_asked_for(start):
    pytest.importorskip("typer")
    wrench, field = "skin/wrench", "skin/chip0/field"
    calls = [["zero"], ["set", "fields", False]]
    asked = {"topics": [wrench, field], "until": [wrench, 5], "calls": calls, "more": 30}
    listener = listening(start, **asked)
    start("-m", "smoskin", "ros", "twin://planar?mechanics=reduced&rate=50")
    report = result(listener, 60)
    assert report["answers"] == [[True, "The zero is taken."], True]
    # From then on there are wrenches, but no fields.
    later = {
        topic: len(report["heard"][topic]) - report["by_then"][topic] for topic in (wrench, field)
    }
    assert later[wrench] >= 30
    assert later[field] <= 5


@pytest.mark.slow
def test_none_of_12000_is_lost_and_a_paused_subscriber_slows_nothing(start, capsys):
    field, wrench = "skin/chip0/field", "skin/wrench"
    paused = listening(start, topics=[field], until=[field, 10**6], deadline=100.0)
    hasty = listening(start, topics=[field], until=[field, 5000], deadline=75.0, best_effort=True)
    # This one keeps more than the node: other work may hold it up for over half a second.
    listener = listening(
        start, topics=[field, wrench], until=[field, 12000], deadline=90.0, depth=1000
    )
    publisher = start(str(TESTS / "ros_publisher.py"), "200", "12600", "3")
    with pytest.raises(subprocess.TimeoutExpired):
        publisher.wait(8.0)
    paused.send_signal(signal.SIGSTOP)
    report, published = result(listener, 100), result(publisher, 30)
    assert published["dropped"] == 0
    numbers = [round(message[3][0] * 1e9) for message in report["heard"][field]]
    assert numbers == list(range(numbers[0], numbers[0] + 12000))
    assert len(report["heard"][wrench]) >= 11990
    latency = 1e-6 * np.array([message[1] - message[0] for message in report["heard"][field]])
    middle, most = np.percentile(latency, [50, 99])
    assert published["seconds"] == pytest.approx(63.0, abs=2.0)
    assert len(result(hasty, 30)["heard"][field]) == 5000
    with capsys.disabled():
        print(f"latency {middle:.2f} ms, 99 % {most:.2f} ms; write, ms: {published['write_ms']}")
