"""A rig of stage and gauge: its touches, and how every kind of failure ends."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rigs import ORIGIN, SURFACE, Bench, FakeGauge, FakeStage, World, straight
from smoskin.commands.report.courses import course_of
from smoskin.commands.report.rig import compliance_of, lag_of
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.rig.press import STEP, PressRig

pytest.importorskip("serial")


def test_a_skin_is_pressed_as_hard_and_where_it_is_asked() -> None:
    with Bench(noise=1e-3) as bench:
        for force, place in ((0.5, (0.01, 0.02)), (0.2, (0.03, 0.005))):
            touch = bench.rig.press(straight(force, place))
            assert_allclose(touch.contact.position, place, atol=1e-6)
            assert touch.contact.normal_force == pytest.approx(force, abs=0.02)
            pressed = [r.field[0, 0] for r in touch.readings
                       if touch.held[0] <= r.time <= touch.held[1]]  # fmt: skip
            still = [r.field[0, 0] for r in touch.readings
                     if touch.rest[0] <= r.time <= touch.rest[1]]  # fmt: skip
            assert_allclose(1e3 * np.array(pressed), touch.contact.normal_force, atol=3e-3)
            assert np.abs(still).max() == 0.0
            assert min(len(pressed), len(still)) >= 5
            assert bench.lifted
            # The spring gives way by 1 mm/N, and is felt when it is pressed.
            course = course_of(touch)
            assert course is not None
            assert compliance_of([course]).value == pytest.approx(1e-3, rel=0.06)
            assert abs(lag_of(touch, course)) < 5e-3
        assert bench.world.most <= 0.5 + STEP / 2 + 5e-3


def test_a_stage_turns_a_limb_and_the_skin_is_read_on_after_the_touch() -> None:
    radius = 0.08
    with Bench(radius=radius, recovery=0.3) as bench:
        touch = bench.rig.press(straight(0.3, (0.01, 0.02)))
        degrees = np.degrees(0.02 / radius)
        sent = [line for line in bench.stage.asked if f"Y{1e3 * ORIGIN[1] + degrees:.4f}" in line]
        assert len(sent) > 5
    assert_allclose(touch.contact.position, (0.01, 0.02), atol=1e-5)
    assert touch.trace is not None
    assert_allclose(touch.trace.stage[-1, 1:3], (0.01, 0.02), atol=1e-5)
    name, begin, end = touch.trace.phases[-1]
    assert name == "released"
    assert end - begin > 0.5
    assert touch.readings[-1].time > begin + 0.4
    with pytest.raises(ArgumentError, match="recovery must be finite and not negative"):
        Bench(recovery=-1.0)
    with pytest.raises(ArgumentError, match="radius must be positive"):
        Bench(radius=0.0)


def test_no_step_adds_more_than_its_force() -> None:
    world = World(stiffness=2000.0)
    felt = []
    with Bench(world) as bench:
        go = world.go
        world.go = lambda place: (go(place), felt.append(world.force()))
        bench.rig.press(straight(0.6))
        heights = [float(line.split("Z")[1].split()[0]) for line in bench.stage.asked]
    assert max(np.diff(felt)) <= STEP
    below = [z for z in heights if 1e-3 * z < ORIGIN[2] - 1e-6]
    assert max(-np.diff(below)) <= 0.02 + 1e-4  # 50 mN at 2,500 N/m
    # The next touch begins in steps from just above where the skin was met.
    assert min(heights) > 1e3 * (SURFACE - 0.6 / 2000.0) - 0.05


def test_a_place_much_stiffer_than_was_said_is_left_after_its_first_step() -> None:
    # Forty times as stiff as was said, from 0.2 mm on.
    world = World(stiffness=1000.0, hard=0.2e-3)
    with (
        Bench(world, limit=0.6) as bench,
        pytest.raises(SourceError, match=r"press: .*; the probe is lifted"),
    ):
        bench.rig.press(straight(0.5))
    assert bench.lifted
    assert world.most < 0.2 + 1e5 * 0.02e-3 + 0.03


def test_the_limit_ends_a_touch_within_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PressRig, "_check", lambda *_: None)
    with Bench() as bench:
        bench.rig._touched = 10.0  # a rig that does not see where the skin is
        with pytest.raises(SourceError, match=r"descend: .* beyond the limit of 1\.5 N; the probe"):
            bench.rig.press(straight(0.5))
        assert bench.lifted
        assert bench.world.most <= 1.5 + STEP


def test_a_gauge_that_dies_on_the_way_ends_the_touch() -> None:
    with Bench() as bench:
        bench.gauge.dies_above = 0.15
        with pytest.raises(SourceError, match=r"press: gauge .* not answered within 1 s.*lifted"):
            bench.rig.press(straight(0.5))
        assert bench.lifted
        assert bench.world.most <= 0.15 + STEP


def test_a_skin_that_is_read_no_more_ends_the_touch() -> None:
    with Bench() as bench:
        bench.skin.ends_above = 0.15
        with pytest.raises(SourceError, match=r"press: the skin is not read: .* ended; the probe"):
            bench.rig.press(straight(0.8))
        assert bench.lifted
        assert bench.world.most < 0.4


def test_a_stage_in_alarm_says_that_the_probe_must_be_lifted_by_hand() -> None:
    with Bench() as bench:
        bench.stage.alarm_below = SURFACE - 0.2e-3
        with pytest.raises(SourceError, match=r"a limit switch was hit.*could not be lifted"):
            bench.rig.press(straight(0.5))
        assert bench.world.most <= 0.2 + STEP
        with pytest.raises(SourceError, match=r"is in alarm .*home the stage \(\$H\)"):
            bench.rig.press(straight(0.5))


def test_an_emergency_stop_stands_where_it_is_for_good() -> None:
    with Bench(share=1.0) as bench:

        def watch():
            end = time.monotonic() + 20.0
            while bench.world.force() < 0.1 and time.monotonic() < end:
                time.sleep(0.001)
            bench.rig.stop()

        thread = threading.Thread(target=watch)
        thread.start()
        with pytest.raises(SourceError, match=r"stopped.*stands where it stood"):
            bench.rig.press(straight(0.8))
        thread.join()
        here = bench.world.force()
        assert 0.05 < here <= 0.1 + 2 * STEP
        with pytest.raises(SourceError, match=r"has been stopped: .* open it again"):
            bench.rig.press(straight(0.5))
        assert bench.world.force() == here


def test_an_interruption_lifts_the_probe(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with Bench() as bench:
        monkeypatch.setattr(PressRig, "_dwell", lambda *_: ((0.0, 1.0), 0.0))
        monkeypatch.setattr(PressRig, "_push", interrupted)
        with pytest.raises(KeyboardInterrupt):
            bench.rig.press(straight(0.5))
        assert bench.world.most > 0
        assert bench.lifted


def test_a_gauge_whose_zero_moves_is_not_believed() -> None:
    with Bench() as bench:
        bench.gauge.drift = 0.02
        # Half of a small drift is taken off, as it has come meanwhile.
        assert bench.rig.press(straight(0.5)).contact.normal_force == pytest.approx(0.5, abs=0.025)
    with Bench() as bench:
        bench.gauge.drift = 0.06
        with pytest.raises(SourceError, match=r"gauge reads 60 mN with the probe lifted: let it"):
            bench.rig.press(straight(0.5))
        assert bench.lifted


def test_a_gauge_of_the_other_sign_is_told() -> None:
    with Bench(form="{:.3f} N") as bench:
        bench.rig._gauge._sign = -1
        with pytest.raises(SourceError, match=r"a pull of 0\.\d+ N where it is pressed.*negative"):
            bench.rig.press(straight(0.5))
        assert bench.lifted
        assert bench.world.most < 0.2


def test_no_skin_and_no_time_are_told() -> None:
    with Bench(reach=1e-3) as bench:
        with pytest.raises(SourceError, match=r"within 1 mm below the origin: is the origin right"):
            bench.rig.press(straight(0.5))
        with pytest.raises(SourceError, match=r"not over in time"):
            bench.rig.press(straight(0.5), timeout=0.3)
        assert bench.lifted


@pytest.mark.parametrize(
    ("force", "message"),
    [
        ((0, 0, 0.5), "normal force must be from"),
        ((0, 0, -1.46), r"to 1.45 N, one step below the rig's limit; got 1.46 N"),
        ((0, 0, np.nan), "normal force must be"),
        ((0.1, 0, -0.5), "straight down"),
    ],
)
def test_touches_that_the_rig_cannot_make_are_refused(force, message) -> None:
    with Bench() as bench:
        contact = straight(0.5)
        contact = type(contact)(position=contact.position, force=force)
        with pytest.raises(ArgumentError, match=message):
            bench.rig.press(contact)
        assert bench.stage.asked == []


HOST = """
import sys
sys.path[:0] = {path!r}
import numpy as np
from smoskin.hardware.rig.gauge import AsciiGauge
from smoskin.hardware.rig.press import PressRig
from smoskin.hardware.rig.stage import GrblStage
from rigs import ORIGIN, Skin, World, straight
rig = PressRig(Skin(World()), GrblStage({stage!r}), AsciiGauge({gauge!r}), origin=ORIGIN)
rig.press(straight(1.4))
"""


@pytest.mark.slow
def test_a_host_that_is_killed_leaves_the_stage_within_one_step() -> None:
    world = World(stiffness=2000.0)
    stage, gauge = FakeStage(world, share=1.0), FakeGauge(world)
    try:
        words = HOST.format(path=[*sys.path, str(Path(__file__).parents[2])],
                            stage=stage.port, gauge=gauge.port)  # fmt: skip
        host = subprocess.Popen([sys.executable, "-c", words], env={**os.environ})
        end = time.monotonic() + 60.0
        while world.force() < 0.3 and host.poll() is None and time.monotonic() < end:
            time.sleep(0.001)
        host.send_signal(signal.SIGKILL)
        host.wait()
        at = world.force()
        time.sleep(0.3)
        assert at >= 0.3
        assert world.force() <= at + STEP
        after = world.force()
        time.sleep(0.1)
        assert world.force() == after
    finally:
        stage.close()
        gauge.close()


@pytest.mark.parametrize("name", ["reach", "limit", "stiffness", "place_spread", "force_spread"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_absurd_rigs_are_refused(name, value) -> None:
    with Bench() as bench:
        parts = (bench.skin, bench.rig._stage, bench.rig._gauge)
        with pytest.raises(ArgumentError, match=f"{name} must be positive and finite"):
            PressRig(*parts, origin=(0, 0, 0), **{name: value})


def test_gauge_and_stage_are_told_on_the_clock_of_the_readings():
    with Bench() as bench:
        touch = bench.rig.press(straight(0.4, (0.01, 0.02)))
    trace = touch.trace
    names = [name for name, _, _ in trace.phases]
    assert names == ["approach", "tare", "rest", "descend", "press", "hold", "retract", "released"]
    begins = {name: begin for name, begin, _ in trace.phases}
    times, force = trace.gauge[:, 0], -trace.gauge[:, 3]
    held = (times >= touch.held[0]) & (times <= touch.held[1])
    assert held.sum() >= 3
    np.testing.assert_allclose(force[held], 0.4, atol=0.03)
    assert np.abs(force[times < begins["descend"]]).max() < 0.01
    assert begins["hold"] <= touch.held[0] < touch.held[1] <= begins["retract"]
    # Places are told from the height at which the probe travels.
    height = trace.stage[:, 3]
    assert height[0] == pytest.approx(0.0, abs=1e-6)
    assert height.min() == pytest.approx(SURFACE - ORIGIN[2] - 0.4e-3, abs=0.1e-3)
    # What the chips read while the probe was lifted is there too.
    assert touch.readings[-1].time > begins["retract"]
