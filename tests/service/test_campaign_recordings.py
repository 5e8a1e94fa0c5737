"""A campaign's recording: all of a rig's streams on one clock, each touch once after any kill."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, RecordingError
from smoskin.measurement import TouchTable
from smoskin.records import Contact, HeldTouch, Reading, Trace
from smoskin.roles import Rig
from smoskin.service.campaign import press_plan, table_of
from smoskin.service.guided import grid_plan
from smoskin.service.kept import Campaign, read_sheet, recorded_touches, rig_of
from smoskin.service.recording import open_recording
from touch_recordings import DESIGN, decoded_by_others, record

PLAN = grid_plan(30e-3, 20e-3, 6, force=0.4)


class Arm(Rig):
    """Two seconds a touch on a clock of its own, with a gauge at 20 Hz and a stage at 5 Hz."""

    place_spread, force_spread = 2e-5, 2e-3

    def __init__(self, begun: float = 7.0) -> None:
        self.now, self.pressed = begun, 0

    def press(self, contact: Contact, timeout: float = 30.0) -> HeldTouch:
        begin, self.now = self.now, self.now + 2.0
        self.pressed += 1
        times = begin + np.arange(20) / 10
        readings = [
            Reading(time=t, field=np.full((3, 3), 1e-3 + 1e-6 * (t - begin >= 1.0)), flags=[0] * 3)
            for t in times
        ]
        gauge = begin + np.arange(40) / 20
        load = np.outer(gauge - begin >= 1.0, contact.force)
        stage = begin + np.arange(10) / 5
        height = np.where(stage - begin >= 1.0, -1e-4, 5e-3)
        return HeldTouch(
            contact=contact,
            readings=tuple(readings),
            rest=(begin, begin + 0.9),
            held=(begin + 1.0, begin + 1.9),
            trace=Trace(
                gauge=np.column_stack([gauge, load]),
                stage=np.column_stack([stage, np.tile(contact.position, (10, 1)), height]),
                phases=[("rest", begin, begin + 1.0), ("hold", begin + 1.0, begin + 1.95)],
            ),
        )

    def close(self) -> None:
        pass


def pressed(path: Path, plan: TouchTable = PLAN, rig: Rig | None = None) -> TouchTable:
    with Campaign(path, DESIGN, plan=b"a,b\n", rig={"rig": "arm"}) as campaign:
        return press_plan(rig or Arm(), plan, made=campaign.made, on_touch=campaign.add)


def test_a_touch_comes_back_as_it_was_made(tmp_path: Path) -> None:
    path, arm = tmp_path / "a.mcap", Arm()
    made = [arm.press(contact) for contact in PLAN.contacts]
    with Campaign(path, DESIGN) as campaign:
        for touch in made:
            campaign.add(touch)
    again = recorded_touches(path)
    for touch, back in zip(made, again, strict=True):
        assert (back.contact, back.readings) == (touch.contact, touch.readings)
        assert (back.rest, back.held) == (touch.rest, touch.held)
        assert back.trace is not None
        assert touch.trace is not None
        assert back.trace.phases == touch.trace.phases
        # Stamps of standard messages are whole nanoseconds.
        assert_allclose(back.trace.gauge, touch.trace.gauge, rtol=0, atol=2e-9)
        assert_allclose(back.trace.stage, touch.trace.stage, rtol=0, atol=2e-9)


def test_all_streams_are_open_to_other_programs(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    pressed(path)
    messages = decoded_by_others(path)
    counts = {"/skin/reading": 120, "/rig/gauge": 240, "/rig/stage": 60, "/rig/phase": 12}
    assert {topic: len(messages[topic]) for topic in counts} == counts
    assert [message.touch for _, message in messages["/rig/touch"]] == list(range(6))
    # One time base: the gauge feels the load when the chips see it.
    loaded = [stamp for stamp, message in messages["/rig/gauge"] if message.wrench.force.z < -0.3]
    seen = [stamp for stamp, message in messages["/skin/reading"] if message.field[0] > 1.0005e-3]
    assert abs(min(loaded) - min(seen)) < 1_000_000
    from mcap.reader import make_reader

    with open(path, "rb") as file:
        kept = {each.name: each.data for each in make_reader(file).iter_attachments()}
    assert set(kept) == {"design.toml", "plan.csv", "rig.json"}
    assert kept["plan.csv"] == b"a,b\n"
    assert rig_of(path) == {"rig": "arm"}


def test_a_campaign_that_is_cut_anywhere_goes_on_and_makes_each_touch_once(tmp_path: Path) -> None:
    whole = tmp_path / "whole.mcap"
    pressed(whole)
    content = whole.read_bytes()
    spans = open_recording(whole).spans
    described = spans[0].offset + spans[0].length
    cuts = np.random.default_rng(1).integers(described, len(content), 12)
    unbegun = [0, 5, 8, spans[0].offset // 2, described - 1]
    for cut in [*unbegun, described, *cuts.tolist(), spans[3].offset + 10, len(content) - 1]:
        path, arm = tmp_path / "cut.mcap", Arm(begun=-3.0)
        path.write_bytes(content[:cut])
        there = 0 if cut in unbegun else len(recorded_touches(path))
        pressed(path, rig=arm)
        assert there + arm.pressed == 6
        touches = recorded_touches(path)
        assert_allclose([touch.contact.position for touch in touches], PLAN.position)
        times = [reading.time for reading in open_recording(path).readings()]
        assert (np.diff(times) > 0).all()
        assert not open_recording(path).damage
        assert os.listdir(tmp_path).count("cut.mcap.before") == 0


def test_the_readings_of_a_touch_that_was_not_whole_stay(tmp_path: Path) -> None:
    path, arm = tmp_path / "a.mcap", Arm()
    pressed(path, PLAN.rows(np.arange(2)), arm)
    with Campaign(path, DESIGN) as campaign:
        for reading in arm.press(PLAN.contacts[2]).readings[:7]:
            campaign._recorder.write(reading)
    pressed(path)
    assert open_recording(path).reading_count == 6 * 20 + 7
    assert len(recorded_touches(path)) == 6


def test_a_kill_while_the_first_part_is_taken_over_loses_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    pressed(path, PLAN.rows(np.arange(3)))
    path.rename(tmp_path / "a.mcap.before")
    path.write_bytes(b"\x89MCAP")
    arm = Arm()
    pressed(path, rig=arm)
    assert arm.pressed == 3
    assert len(recorded_touches(path)) == 6


def test_another_plan_or_design_is_refused_and_the_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    pressed(path)
    with pytest.raises(ArgumentError, match="those of the plan; touch 1 is not at"):
        pressed(path, grid_plan(30e-3, 20e-3, 6, seed=1))
    assert len(recorded_touches(path)) == 6
    with pytest.raises(ArgumentError, match="holds touches of the design planar"):
        Campaign(path, read_design("curved"))
    assert len(recorded_touches(path)) == 6
    (tmp_path / "other").write_bytes(b"something else")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        Campaign(tmp_path / "other", DESIGN)
    assert (tmp_path / "other").read_bytes() == b"something else"


def test_a_recording_is_a_sheet_of_touches(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    pressed(path)
    table, digest = read_sheet(path)
    assert table.touched.tolist() == 6 * [False, True]
    assert_allclose(table.field[1::2] - table.field[::2], 1e-6)
    assert len(digest) == 64
    assert_allclose(table.held, table_of(recorded_touches(path)).held)
    with pytest.raises(RecordingError, match="holds no touch of a rig"):
        read_sheet(record(tmp_path / "b.mcap", 3))


_KILLED = """
import sys
from pathlib import Path
sys.path[:0] = {paths!r}
from test_campaign_recordings import Arm, pressed
import time
class Slow(Arm):
    def press(self, contact, timeout=30.0):
        print("all of before is taken over", flush=True)
        time.sleep(0.1)
        return super().press(contact, timeout)
print("on", flush=True)
pressed(Path({path!r}), rig=Slow())
"""


@pytest.mark.slow
def test_a_campaign_that_is_killed_three_times_is_complete(tmp_path: Path) -> None:
    path, made = tmp_path / "a.mcap", []
    paths = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
    words = [sys.executable, "-c", _KILLED.format(paths=paths, path=str(path))]
    for patience in (0.35, 0.2, 0.25):
        with subprocess.Popen(words, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            process.stdout.readline()
            time.sleep(patience)
            process.send_signal(signal.SIGKILL)
        made.append(len(recorded_touches(path)) if path.exists() else 0)
    assert made == sorted(made)
    arm = Arm()
    pressed(path, rig=arm)
    assert arm.pressed == 6 - made[-1]
    assert_allclose([touch.contact.position for touch in recorded_touches(path)], PLAN.position)
    assert len(decoded_by_others(path)["/rig/touch"]) == 6


def test_all_streams_become_columns_of_one_rate(tmp_path: Path) -> None:
    from smoskin.service.exchange import export_recording

    path = tmp_path / "a.mcap"
    pressed(path)
    assert export_recording(path, tmp_path / "a.csv") == 120
    with open(tmp_path / "a.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    held = [row for row in rows if row["touch"] == "2"]
    assert len(held) == 10
    assert {row["phase"] for row in rows} <= {"rest", "hold", ""}
    # The gauge's 20 Hz and the stage's 5 Hz, at the readings' 10 Hz.
    for row in held[:-2]:
        assert float(row["gauge_Fz_N"]) == pytest.approx(-0.4)
        assert float(row["stage_z_m"]) == pytest.approx(-1e-4)
        assert float(row["touch_x_m"]) == pytest.approx(PLAN.position[2, 0])
        assert row["touch_Fz_N"] == "-0.4"
    assert rows[0]["touch"] == "-1"
    assert rows[0]["touch_x_m"] == "nan"
    h5py = pytest.importorskip("h5py")
    export_recording(path, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["gauge_N"].shape == file["stage_m"].shape == (120, 3)
        assert file["phase"][15] == b"hold"
        assert (file["touch"][:] >= 0).sum() == 60


def test_frames_for_robots_have_the_rigs_streams(tmp_path: Path) -> None:
    from smoskin.service.exchange import export_lerobot

    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "a.mcap"
    pressed(path)
    count = export_lerobot(path, tmp_path / "set", rate=10, window=2)
    table = parquet.read_table(tmp_path / "set/data/chunk-000/file-000.parquet").to_pydict()
    touch = np.array(table["observation.tactile.touch"])
    force = np.array(table["observation.tactile.touch_force"])
    gauge = np.array(table["observation.tactile.gauge"])
    assert len(touch) == count
    assert 50 <= touch.sum() <= 61
    assert_allclose(force[touch > 0, 2], -0.4, atol=1e-6)
    assert_allclose(force[touch == 0], 0.0)
    assert_allclose(gauge[touch > 0, 2], -0.4, atol=1e-6)
