"""Calibration by touches: on a rig, by a sheet, and the skin that runs with its own table."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fuzzing import command
from smoskin.cli import app, ending
from smoskin.commands import run as watching
from smoskin.commands.calibrate import calibrate, plan_by_hand, write_plan
from smoskin.commands.run import Watch
from smoskin.design.document import format_design
from smoskin.errors import ArgumentError, CalibrationError, ModelError, RecordingError
from smoskin.measurement import read_touches, write_touches
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Motion, Status
from smoskin.sensing.response.calibrate import TouchPlanner
from smoskin.sensing.signals.signals import signal_noise
from smoskin.service.recorder import Recorder
from smoskin.twin.rig import VirtualRig
from tables_of_response import motions, plain, presses, signals, table_with_modes
from virtual_skins import MadeTwin, Saturating


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


@pytest.fixture(scope="module")
def table(skin):
    return table_with_modes(skin)


@pytest.fixture(scope="module")
def twin(skin):
    return MadeTwin(skin, seed=3)


def missed(skin, twin, table, drag=0.3):
    """What a table misses of the made skin's signals, root mean square, T."""
    where, push = presses(skin, 100, seed=5, drag=drag)
    exact = signals(skin, twin.readout, motions(skin, where, push))
    return float(np.sqrt(np.mean((table.signals(where, push) - exact.reshape(100, -1)) ** 2)))


# On a rig


def test_a_rig_finds_the_table_of_its_skin(skin, table, twin):
    steps = []
    rig = VirtualRig(twin, np.random.default_rng(0))
    done = calibrate(table, rig, design=skin, count=20, progress=steps.append)
    assert missed(skin, twin, done.table) < 0.1 * missed(skin, twin, table)
    assert done.used == len(steps) == len(done.labels) == 20
    assert list(done.errors) == sorted(done.errors, reverse=True)
    assert [step.error for step in steps] == list(done.errors[1:])
    # Each step names the next touch, which is then made.
    for before, after in pairwise(steps):
        assert np.allclose(before.following.position, after.contact.position, atol=2e-4)
    assert steps[-1].following is None
    assert steps[0].sentence.startswith("touch 1 of 20: located to ")
    assert "; next (" in steps[0].sentence


def test_a_rig_stops_where_touches_are_located_well_enough(skin, table, twin):
    rig = VirtualRig(twin, np.random.default_rng(0))
    whole = plan_by_hand(skin, table, count=10, drag=0.3, place_spread=20e-6, force_spread=2e-3)
    until = whole[3].error * 1.02
    done = calibrate(table, rig, design=skin, count=10, until=until)
    assert done.used < 7
    assert done.errors[-1] <= until < done.errors[-2]


def test_touches_that_no_chip_can_read_are_replaced(skin, table, twin):
    steps = []
    # Presses of 0.8 N in some places end the chip's range.
    rig = VirtualRig(Saturating(skin, 1.0e-3, seed=3), np.random.default_rng(0))
    done = calibrate(table, rig, design=skin, count=12, progress=steps.append)
    lost = [touch for touch in done.labels if touch.status is not None]
    assert lost
    assert done.used == 12
    assert len(done.labels) == 12 + len(lost)
    for k, label in enumerate(done.labels):
        for other in done.labels[k + 1 :]:
            near = np.allclose(label.contact.position, other.contact.position, atol=2e-4)
            same = np.allclose(label.contact.force, other.contact.force, atol=0.02)
            assert label.status is None or not (near and same)
    sentences = [step.sentence for step in steps if step.status is not None]
    assert all(sentence.startswith("left out (saturated); touch") for sentence in sentences)
    assert missed(skin, twin, done.table, drag=0.0) < 0.15 * missed(skin, twin, table, drag=0.0)


def test_a_rig_on_which_nothing_can_be_read_is_given_up(skin, table, twin):
    rig = VirtualRig(Saturating(skin, 1e-6, seed=3), np.random.default_rng(0))
    with pytest.raises(ArgumentError, match="at least one that can be used; got"):
        calibrate(table, rig, design=skin, count=3)


def test_what_is_told_of_a_calibration(skin, table, twin):
    rig = VirtualRig(twin, np.random.default_rng(0))
    done = calibrate(table, rig, design=skin, count=3)
    answer = json.loads(json.dumps(done.as_json()))
    assert answer["touches"] == 3
    assert answer["left_out"] == 0
    assert answer["expected_error_mm"] == [round(1e3 * error, 4) for error in done.errors]
    assert len(answer["made"]) == 3
    shown, judged = done.tables()
    assert shown.row_count == 4
    assert judged.row_count == 3
    assert answer["refusal"] is None
    assert answer["warnings"] == ["3 touches are too few to be judged by each other; 5 would do"]
    assert answer["expected_now_mm"]["straight"] < answer["expected_now_mm"]["with_drag"]


def test_wrong_orders_and_tables_are_refused(planar, skin, table, twin):
    rig = VirtualRig(twin, np.random.default_rng(0))
    for wrong in ({"count": 0}, {"force": 0.0}, {"drag": -0.1}, {"until": -1e-3}):
        with pytest.raises(ArgumentError, match="count and force must be positive"):
            calibrate(table, rig, design=skin, **wrong)
    with pytest.raises(ArgumentError, match="recording must come with the path"):
        calibrate(table, rig, design=skin, recording="touches.mcap")
    with pytest.raises(ModelError, match="table must be of the design"):
        calibrate(table, rig, design=planar)
    with pytest.raises(ModelError, match="table must be of the design"):
        calibrate(table, rig)


def test_touches_that_have_been_made_calibrate_as_the_rig_that_makes_them(skin, table, twin):
    rig = VirtualRig(twin, np.random.default_rng(0))
    made = calibrate(table, rig, design=skin, count=8)
    again = VirtualRig(twin, np.random.default_rng(0))
    targets = plan_by_hand(skin, table, count=8, drag=0.3, place_spread=20e-6, force_spread=2e-3)
    held = [
        again.press(Contact(position=target.position, force=target.force)) for target in targets
    ]
    later = calibrate(table, held, design=skin, place_spread=20e-6, force_spread=2e-3)
    assert later.used == 8
    # The planner of the rig sees reported places, which the stage has moved by 20 um.
    assert np.allclose(later.table.mean, made.table.mean, atol=0.02 * np.abs(made.table.mean).max())


def test_a_sheet_in_millitesla_is_refused_by_name_or_accepted(skin, table, twin, tmp_path):
    plan, out = tmp_path / "plan.csv", tmp_path / "residuals.png"
    write_plan(plan, skin, plan_by_hand(skin, table, count=8))
    sheet = filled(plan, skin, twin, tmp_path)
    whole, _ = read_touches(sheet)
    write_touches(sheet, replace(whole, field=1e-3 * whole.field))
    with pytest.raises(CalibrationError, match="in mT where uT must stand") as caught:
        calibrate(table, sheet, design=skin)
    assert len(str(caught.value)) <= 300
    done = calibrate(table, sheet, design=skin, accept_bad_fit=True)
    assert "in mT" in done.judgement.refusal
    pytest.importorskip("matplotlib")
    done.figure(skin).savefig(out)
    assert out.stat().st_size > 1000


def test_rows_that_have_exchanged_places_are_named(skin, table, twin, tmp_path):
    plan = tmp_path / "plan.csv"
    write_plan(plan, skin, plan_by_hand(skin, table, count=12))
    sheet = filled(plan, skin, twin, tmp_path)
    whole, _ = read_touches(sheet)
    place = np.array(whole.position)
    place[[3, 6]] = place[[6, 3]]
    write_touches(sheet, replace(whole, position=place))
    with pytest.raises(CalibrationError, match="rows 4 and 7 seem to have exchanged"):
        calibrate(table, sheet, design=skin)


# By a sheet


def filled(path, skin, twin, tmp_path, rows=None, noise=0.0):
    """The sheet at a path with what the made skin's chips read once settled."""
    plan, _ = read_touches(path)
    rng = np.random.default_rng(2)
    field, degrees = np.array(plan.field), np.array(plan.temperature)
    for row in range(len(field) if rows is None else rows):
        motion = Motion.rest(3, (1,))
        if plan.touched[row]:
            motion = motions(skin, plan.position[row : row + 1], plan.force[row : row + 1])
        field[row] = twin.readout.seen(motion)[0] + noise * rng.normal(size=(3, 3))
        degrees[row] = 25.0
    write_touches(tmp_path / "filled.csv", replace(plan, field=field, temperature=degrees))
    return tmp_path / "filled.csv"


def test_a_filled_sheet_calibrates_a_skin(skin, table, twin, tmp_path):
    targets = plan_by_hand(skin, table, count=25)
    assert all((target.force[:2] == 0).all() for target in targets)
    write_plan(tmp_path / "plan.csv", skin, targets)
    sheet = filled(tmp_path / "plan.csv", skin, twin, tmp_path, noise=2e-6)
    done = calibrate(table, sheet, design=skin, place_spread=1e-5, force_spread=1e-3)
    assert done.used == 25
    assert missed(skin, twin, done.table, drag=0.0) < 0.1 * missed(skin, twin, table, drag=0.0)


def test_a_sheet_may_be_filled_in_part_and_the_plan_go_on_from_there(skin, table, twin, tmp_path):
    targets = plan_by_hand(skin, table, count=12, drag=0.0)
    write_plan(tmp_path / "plan.csv", skin, targets)
    sheet = filled(tmp_path / "plan.csv", skin, twin, tmp_path, rows=6)
    plan, _ = read_touches(sheet)
    assert plan.made.tolist() == [True] * 6 + [False] * 8
    made = plan.rows(plan.made).contacts
    assert len(made) == len(plan.held_touches()) == 5
    assert calibrate(table, sheet, design=skin).used == 5
    assert calibrate(table, plan, design=skin).used == 5
    more = plan_by_hand(skin, table, count=3, drag=0.0, made=made)
    # Places are rounded to a hundredth of a millimetre in a sheet.
    for resumed, planned in zip(more, targets[5:8], strict=True):
        assert np.allclose(resumed.position, planned.position)
        assert np.allclose(resumed.force, planned.force)
    whole = plan_by_hand(skin, table, count=12, until=1.001 * more[0].error, drag=0.0)
    assert len(whole) == 6


def test_a_recording_fills_a_sheet_that_says_when_touches_were_held(skin, table, twin, tmp_path):
    pytest.importorskip("mcap")
    pytest.importorskip("rosbags")
    targets = plan_by_hand(skin, table, count=12, drag=0.0)
    write_plan(tmp_path / "plan.csv", skin, targets)
    plan, _ = read_touches(tmp_path / "plan.csv")
    held = np.array(plan.held)
    rig = VirtualRig(twin, np.random.default_rng(0), stage=0.0, gauge=0.0)
    with Recorder(tmp_path / "touches.mcap", skin) as sink:
        for row in np.flatnonzero(plan.touched):
            touch = rig.press(Contact(position=plan.position[row], force=plan.force[row]))
            for reading in touch.readings:
                sink.write(reading)
            held[row] = touch.held
            if not plan.touched[row - 1]:
                held[row - 1] = touch.rest
    sheet = tmp_path / "timed.csv"
    write_touches(sheet, replace(plan, held=held))
    done = calibrate(
        table, sheet, design=skin, recording=tmp_path / "touches.mcap", place_spread=1e-5,
        force_spread=1e-3,
    )  # fmt: skip
    assert done.used == 12
    assert missed(skin, twin, done.table, drag=0.0) < 0.15 * missed(skin, twin, table, drag=0.0)


def test_sheets_that_do_not_fit_are_refused(skin, table, twin, tmp_path):
    plan = tmp_path / "plan.csv"
    write_plan(plan, skin, plan_by_hand(skin, table, count=2))
    with pytest.raises(RecordingError, match=r"plan\.csv: touches must have been made"):
        calibrate(table, plan, design=skin)
    sheet = filled(plan, skin, twin, tmp_path)
    whole, _ = read_touches(sheet)
    write_touches(sheet, whole.rows(np.array([1, 2])))
    with pytest.raises(RecordingError, match="row 1 must come after a row of the untouched skin"):
        calibrate(table, sheet, design=skin)
    write_touches(sheet, replace(whole, field=whole.field[:, :2], temperature=25.0))
    with pytest.raises(RecordingError, match="touches must be read by 3 chips; got 2"):
        calibrate(table, sheet, design=skin)
    with pytest.raises(RecordingError, match=r"nowhere\.csv"):
        calibrate(table, tmp_path / "nowhere.csv", design=skin)


@pytest.mark.parametrize(("off", "refused"), [(0.9e-4, False), (1.1e-4, True)])
def test_touches_must_lie_on_the_skin(skin, table, twin, tmp_path, off, refused):
    plan = tmp_path / "plan.csv"
    write_plan(plan, skin, plan_by_hand(skin, table, count=2))
    sheet = filled(plan, skin, twin, tmp_path)
    whole, _ = read_touches(sheet)
    for corner, beyond in ((np.zeros(2), -off), (geometry(skin).extent, off)):
        for axis in range(2):
            place = np.array(whole.position)
            place[1] = corner
            place[1, axis] += beyond
            write_touches(sheet, replace(whole, position=place))
            if not refused:
                assert calibrate(table, sheet, design=skin, accept_bad_fit=True).used == 2
                continue
            with pytest.raises(RecordingError, match=r"filled\.csv: row 2 must lie on the skin"):
                calibrate(table, sheet, design=skin)


def test_spreads_are_the_rig_s_a_person_s_or_those_given(skin, table, twin):
    """What the labels' errors make of the same touches."""
    rig = VirtualRig(twin, np.random.default_rng(0), stage=1e-3, gauge=0.05)
    plan = plan_by_hand(skin, table, count=3, drag=0.3, place_spread=1e-3, force_spread=0.05)
    held = [rig.press(Contact(position=target.position, force=target.force)) for target in plan]
    again = VirtualRig(twin, np.random.default_rng(0), stage=1e-3, gauge=0.05)
    by_rig = calibrate(table, again, design=skin, count=3)
    planner = TouchPlanner(table, signal_noise(skin, table.chips))
    assert by_rig.errors[0] == pytest.approx(planner.error)
    same = calibrate(table, held, design=skin, place_spread=1e-3, force_spread=0.05)
    off = {"design": skin, "accept_bad_fit": True}  # a better stage than theirs is stated
    hand = calibrate(table, held, **off)
    given = calibrate(table, held, place_spread=0.5e-3, force_spread=0.01, **off)
    assert hand.errors == given.errors
    assert hand.errors[-1] < same.errors[-1]


def smoskin(*arguments):
    return subprocess.run(
        [sys.executable, "-c", "from smoskin.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        env=os.environ | {"COLUMNS": "120"},
    )


def test_sheets_on_the_command_line(skin, table, twin, tmp_path):
    pytest.importorskip("typer")
    pytest.importorskip("safetensors")
    from smoskin.design.document import format_design

    design, response, plan = (tmp_path / name for name in ("own.toml", "own.table", "plan.csv"))
    design.write_text(format_design(skin), encoding="utf-8")
    table.save(response)
    made = smoskin(
        "touches", "plan", design, "--table", response, "--out", plan, "--count", "6", "--json"
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert len(json.loads(made.stdout)["expected_error_mm"]) == 6
    sheet = filled(plan, skin, twin, tmp_path)
    own = tmp_path / "skin.table"
    done = smoskin(
        "calibrate", design, "--table", response, "--sheet", sheet, "--out", own, "--json"
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["touches"] == 6
    assert own.exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--sheet", "touches.csv", "--touches", "3"), "--sheet must come without --rig"),
        (("--sheet", "touches.csv", "--rig", "virtual?seed=1"), "--sheet must come without --rig"),
        (("--recording", "touches.mcap"), "--recording must come with --sheet"),
        (("--rig", "robot"), "rig must be virtual"),
        (("--rig", "virtual?seed=-1"), "seed of a rig must not be negative"),
        (("--rig", "virtual?seed=one"), "a rig's options must be numbers"),
        (("--rig", "virtual?speed=1"), "with the options seed, temperature, ramp"),
    ],
)  # fmt: skip
def test_options_that_exclude_each_other_say_so(options, sentence, table, tmp_path):
    pytest.importorskip("typer")
    pytest.importorskip("safetensors")
    from typer.testing import CliRunner

    table.save(tmp_path / "own.table")
    asked = ["calibrate", "planar", "--table", str(tmp_path / "own.table"), *options]
    done = CliRunner().invoke(app, asked)
    assert isinstance(done.exception, ArgumentError)
    assert sentence in str(done.exception)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_virtual_rig_calibrates_the_twin_that_then_runs(planar, tmp_path, monkeypatch):
    pytest.importorskip("jax")
    pytest.importorskip("safetensors")
    from smoskin.commands.table import Effort, make_table
    from smoskin.service.source import open_source

    small = Effort(presses=4000, pairs=0, skins=10, draws=3, presses_a_skin=200)
    response, own = tmp_path / "planar.table", tmp_path / "skin.table"
    make_table(planar, small).save(response)
    done = smoskin(
        "calibrate", "--table", response, "--touches", "30", "--rig", "virtual?seed=4",
        "--out", own, "--json"
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["expected_error_mm"][-1] < 1.2 < answer["expected_error_mm"][0]
    url = "twin://planar?manufactured=yes&seed=4&creep=yes&speed=max"
    ran = smoskin("run", url, "--calibration", own, "--seconds", "0.5", "--json")
    assert ran.returncode == 0, ran.stderr
    statuses = [json.loads(line)["status"] for line in ran.stdout.splitlines()]
    assert set(statuses[:20]) == {"NOT_CALIBRATED"}
    assert set(statuses[20:]) == {"NO_CONTACT"}
    source = open_source(url)
    monkeypatch.setattr(watching, "open_source", lambda url: source)
    touch = Contact(position=(0.07, 0.11), force=(0.0, 0.0, -0.6))
    contacts = []
    for estimate in Watch(url, planar, calibration=own, seconds=0.8):
        if estimate.status is Status.NO_CONTACT:
            source.touch([touch])
        contacts += estimate.contacts
    off = np.array([contact.position for contact in contacts[5:]]) - touch.position
    assert np.hypot(*off.T).mean() < 2.5e-3


def calibration_by(rig, skin, table, folder, monkeypatch):
    """The words of a calibration whose touches this rig makes, and the file that it writes."""
    pytest.importorskip("mcap")
    pytest.importorskip("rosbags")
    design, start, own = (folder / name for name in ("d.toml", "start.table", "skin.table"))
    table.save(start)
    design.write_text(format_design(skin), encoding="utf-8")
    monkeypatch.setattr("smoskin.cli.calibration.open_rig", lambda name, design: rig)
    return ["calibrate", str(design), "--table", str(start), "--out", str(own)], own


def test_the_touches_of_a_refused_calibration_are_kept(
    skin, table, twin, tmp_path, monkeypatch, capsys
):
    class InMillinewton(VirtualRig):
        def press(self, contact, timeout=30.0):
            touch = super().press(contact, timeout)
            return replace(touch, contact=replace_force(touch.contact, 1e3))

    def replace_force(contact, factor):
        return Contact(position=contact.position, force=factor * contact.force)

    rig = InMillinewton(twin, np.random.default_rng(0))
    words, own = calibration_by(rig, skin, table, tmp_path, monkeypatch)
    (tmp_path / "skin.touches.csv").touch()  # of an earlier calibration
    with pytest.raises(CalibrationError, match="1000 times too large: in mN"):
        app([*words, "--touches", "12"], standalone_mode=False)
    sheet, recording = (tmp_path / f"skin.touches2.{end}" for end in ("csv", "mcap"))
    message = f"the touches are kept: --sheet {sheet} --recording {recording}\n"
    assert message in capsys.readouterr().err
    kept, _ = read_touches(sheet)
    assert kept.touched.sum() >= 12
    assert not own.exists()
    mended = replace(kept, force=1e-3 * kept.force)
    done = calibrate(table, mended, design=skin, recording=recording, force_spread=2e-3)
    assert done.used >= 12
    assert missed(skin, twin, done.table) < 0.2 * missed(skin, twin, table)


@pytest.mark.parametrize("made", [0, 4])
def test_ctrl_c_keeps_the_touches_that_the_rig_has_made(
    skin, table, twin, tmp_path, monkeypatch, made
):
    class Interrupting(VirtualRig):
        pressed = 0

        def press(self, contact, timeout=30.0):
            if self.pressed == made:
                signal.raise_signal(signal.SIGINT)
            self.pressed += 1
            return super().press(contact, timeout)

    rig = Interrupting(twin, np.random.default_rng(0))
    words, own = calibration_by(rig, skin, table, tmp_path, monkeypatch)
    for name in ("_heard", "_kept"):
        monkeypatch.setattr(ending, name, [])
    # Whoever runs the tests in the background may have had Ctrl-C ignored.
    interrupt = signal.signal(signal.SIGINT, signal.default_int_handler)
    alarm = signal.getsignal(signal.SIGALRM)
    try:
        answer = command(*words)
    finally:
        signal.signal(signal.SIGALRM, alarm)
        signal.signal(signal.SIGINT, interrupt)
    assert answer.code == 130
    assert not own.exists()
    sheet, recording = (tmp_path / f"skin.touches.{end}" for end in ("csv", "mcap"))
    if not made:
        assert answer.err.endswith("Stopped by Ctrl-C; no touch was made.\n")
        return
    message = f"the touches are kept: --sheet {sheet} --recording {recording}"
    assert answer.err.endswith(f"Stopped by Ctrl-C; {message}.\n")
    kept, _ = read_touches(sheet)
    assert kept.touched.sum() == made
    done = calibrate(table, kept, design=skin, recording=recording, accept_bad_fit=True)
    assert done.used == made


def test_a_rigs_recording_calibrates_as_the_rig_does(skin, table, twin, tmp_path):
    from smoskin.service.kept import Campaign

    class Recorded(VirtualRig):
        def press(self, contact, timeout=30.0):
            touch = super().press(contact, timeout)
            campaign.add(touch)
            return touch

    path = tmp_path / "campaign.mcap"
    rig = Recorded(twin, np.random.default_rng(0))
    spreads = {"place_spread": rig.place_spread, "force_spread": rig.force_spread}
    with Campaign(path, skin, rig=spreads) as campaign:
        by_rig = calibrate(table, rig, design=skin, count=6)
    done = calibrate(table, path, design=skin)
    assert done.used == by_rig.used == 6
    assert done.expected == pytest.approx(by_rig.expected, rel=1e-6)
    wrong = missed(skin, twin, by_rig.table)
    assert missed(skin, twin, done.table) == pytest.approx(wrong, rel=1e-6)
