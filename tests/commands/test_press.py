"""A campaign by a rig: what is held out before the first press, its picture, and going on."""

import json
import re
import subprocess
import sys
import time
from collections import Counter
from hashlib import sha256

import numpy as np
import pytest

pytest.importorskip("mcap")

from smoskin.commands.press import press
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.hardware.rig.plans import campaign_plan, held_out
from smoskin.measurement import read_touches, write_touches
from smoskin.records import Contact, HeldTouch, Reading
from smoskin.roles import Rig, unheard
from smoskin.service.exchange import export_lerobot, export_recording
from smoskin.service.kept import (
    held_out_of,
    parted_sheet,
    read_sheet,
    recorded_touches,
    rig_of,
)
from smoskin.service.recording import open_recording
from touch_recordings import decoded_by_others

DESIGN = read_design("planar")


class Arm(Rig):
    """Half a second a touch, 4 mN too hard and 30 um beside; it may end after so many."""

    place_spread, force_spread = 3e-5, 4e-3

    def __init__(self, ends: int = 1000) -> None:
        self.made, self.ends = 0, ends

    def press(self, contact: Contact, timeout: float = 30.0) -> HeldTouch:
        if self.made == self.ends:
            raise KeyboardInterrupt
        begin = 0.5 * self.made
        self.made += 1
        change = 1e-3 * contact.normal_force * (1.0 + 0.001 * self.made)
        fields = [0.0, 0.0, change, change]
        readings = [
            Reading(time=begin + 0.1 * k, field=np.full((3, 3), field))
            for k, field in enumerate(fields)
        ]
        off = np.array([3e-5, 0.0]), np.array([0.0, 0.0, -4e-3])
        reported = Contact(position=contact.position + off[0], force=contact.force + off[1])
        rest, held = (begin, begin + 0.1), (begin + 0.2, begin + 0.3)
        return HeldTouch(contact=reported, readings=tuple(readings), rest=rest, held=held)

    def close(self) -> None:
        pass


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "plan.csv"
    pushes = {"columns": 4, "rows": 5, "forces": (0.3, 0.6), "reference_every": 10}
    write_touches(path, campaign_plan("grid", 0.12, 0.16, **pushes))
    return path


def pressed(plan, out, rig, *, share=0.3):
    picture = plan.parent / "picture.svg"
    words = {"share": share, "picture": picture, "progress": unheard}
    return press(rig, DESIGN, plan, out, {"rig": "arm"}, **words)


def test_what_is_held_out_is_in_the_file_before_the_first_press(plan, tmp_path) -> None:
    out = tmp_path / "a.mcap"
    with pytest.raises(KeyboardInterrupt):
        pressed(plan, out, Arm(ends=0))
    expected = held_out(read_touches(plan)[0], 0.3)
    assert held_out_of(out) == expected
    assert rig_of(out)["plan_sha256"] == sha256(plan.read_bytes()).hexdigest()
    # It goes on, stops and goes on, each touch once.
    with pytest.raises(KeyboardInterrupt):
        pressed(plan, out, Arm(ends=7))
    whole = len(read_touches(plan)[0].contacts)
    rest = Arm()
    assert pressed(plan, out, rest) == whole
    assert rest.made == whole - 7
    learned, judged = parted_sheet(out)
    assert judged is not None
    assert len(learned.contacts) + len(judged.contacts) == whole
    targets = read_touches(plan)[0].position
    places = [contact.position - [3e-5, 0] for contact in judged.contacts]
    np.testing.assert_allclose(places, targets[list(expected)], atol=1e-9)
    assert read_sheet(out)[0].touched.sum() == whole


def test_the_picture_tells_how_far_it_is_and_how_far_off(plan, tmp_path) -> None:
    whole = len(read_touches(plan)[0].contacts)
    assert pressed(plan, tmp_path / "a.mcap", Arm()) == whole
    drawn = (tmp_path / "picture.svg").read_text()
    assert f"{whole} of {whole} touches; 0 min to go" in drawn
    assert "off what was asked: 4.0 mN (at most 4), 0.030 mm" in drawn
    # Five times the first touch, whose signal grew by 0.1 % a touch.
    assert re.search(r"the first touch, made 5 times: \+4\.4 % a newton", drawn)
    assert drawn.count("<circle") == 20
    rings = {tuple(read_touches(plan)[0].position[k]) for k in held_out_of(tmp_path / "a.mcap")}
    assert drawn.count('stroke="#2255cc"') == len(rings)


def test_a_sheet_holds_nothing_out(plan, tmp_path) -> None:
    with pytest.raises(ArgumentError, match="must be a recording"):
        pressed(plan, tmp_path / "a.csv", Arm())
    assert pressed(plan, tmp_path / "a.csv", Arm(), share=0.0) == 45
    assert parted_sheet(tmp_path / "a.csv")[1] is None


def test_a_campaign_is_planned_pressed_and_learned_by_commands(tmp_path, monkeypatch) -> None:
    pytest.importorskip("typer")
    pytest.importorskip("safetensors")
    from typer.testing import CliRunner

    from smoskin.cli import app

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("smoskin.cli.rig.open_rig", lambda name, design: Arm())

    def run(*words: str):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
        return done

    grid = ("--columns", "4", "--rows", "5", "--forces-N", "0.3,0.6")
    assert run("touches", "campaign", *grid).stdout == "43 touches\n"
    run("touches", "press", "--out", "a.mcap", "--held-out", "0.3", "--picture", "a.svg")
    answer = json.loads(run("learn", "a.mcap", "--json", "--plot", "missed.svg").stdout)
    assert "Fz, held out" in (tmp_path / "missed.svg").read_text()
    assert 0.0 <= answer["test"]["refused"] <= 1.0
    wrong = CliRunner().invoke(app, ("learn", "a.mcap", "--past", "--out", "b.model"))
    assert wrong.exit_code != 0
    bad = CliRunner().invoke(app, ("touches", "campaign", "--forces-N", "a", "--out", "b.csv"))
    assert bad.exit_code != 0


@pytest.mark.slow
@pytest.mark.timeout(200)
def test_a_virtual_campaign_that_is_killed_three_times_is_whole_for_others(tmp_path) -> None:
    """The command itself, ended by SIGKILL as it presses; read by four libraries of others."""
    for package in ("typer", "rosbags", "h5py", "pyarrow", "jax"):
        pytest.importorskip(package)
    out = tmp_path / "a.mcap"
    pushes = {"columns": 6, "rows": 8, "forces": (0.3, 0.6, 0.9), "reference_every": 0}
    wanted = campaign_plan("grid", 0.12, 0.16, **pushes)
    write_touches(tmp_path / "plan.csv", wanted)
    smoskin = [sys.executable, "-m", "smoskin"]
    words = ["touches", "press", "planar", "--rig", "virtual?seed=3", "--out", "a.mcap"]
    made = []
    for _ in range(3):
        with subprocess.Popen([*smoskin, *words], cwd=tmp_path, stderr=subprocess.DEVNULL) as going:
            # The file that is gone on with begins small, and what it takes over comes at once.
            grown = 100_000 * (1 + len(made))
            end = time.monotonic() + 40.0
            while not (out.exists() and out.stat().st_size > grown) and time.monotonic() < end:
                time.sleep(0.002)
            going.kill()
        made.append(len(recorded_touches(out)))
    assert 0 < made[0] < made[1] < made[2] < 144
    subprocess.run([*smoskin, *words], cwd=tmp_path, check=True, timeout=60)
    touches = recorded_touches(out)
    assert len(touches) == 144
    away = [touch.contact.position - target.position
            for touch, target in zip(touches, wanted.contacts, strict=True)]  # fmt: skip
    assert np.abs(away).max() < 0.15e-3
    counted = {"/rig/touch": 144, "/skin/reading": open_recording(out).reading_count}
    assert {topic: len(decoded_by_others(out)[topic]) for topic in counted} == counted
    from rosbags.highlevel import AnyReader

    with AnyReader([out]) as reader:
        seen = Counter(connection.topic for connection, _, _ in reader.messages())
    assert {topic: seen[topic] for topic in counted} == counted
    import h5py
    import pyarrow.parquet as pq

    export_recording(out, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert len(np.unique(file["touch"][:][file["touch"][:] >= 0])) == 144
    frames = export_lerobot(out, tmp_path / "a")
    assert pq.read_table(next((tmp_path / "a" / "data").rglob("*.parquet"))).num_rows == frames
