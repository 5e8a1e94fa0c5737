"""The scripted demonstration: what it judges, and that it keeps its promises."""

import json
from dataclasses import replace

import numpy as np
import pytest

from smoskin.commands.follow import demonstration
from smoskin.commands.follow.demonstration import Moment, Press, judged
from smoskin.commands.follow.script import scripted_presses
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.robot.follow import Command, State
from smoskin.robot.law import Limits
from smoskin.robot.reasons import Reason

PLACE = np.array([0.4, 0.0, 0.5])
PRESS = Press(place=(0.05, 0.05), direction=(0.0, 0.0, -1.0), times=(0.0, 1.0), forces=(0.0, 1.0))


def moments(moves, reason=Reason.MOVING, angle=2.0, fastest=0.05):
    """One touch whose force rises evenly to 1 N, moved where `moves` says so of the force."""
    rows = []
    for k in range(101):
        force = k / 100
        speeds = np.full(3, 0.1 * bool(moves(force)))
        state = State.MOVING if speeds.any() else State.STANDING
        command = Command(speeds=speeds, state=state, reason=reason)
        rows.append(Moment(k / 100, 0, force, command, angle, 0.01, fastest, PLACE, np.zeros(3)))
    return rows


def summary(rows):
    return judged(rows, [PRESS], Limits(), 100.0).summary


def test_an_arm_that_does_as_promised_keeps_its_promises():
    figures = summary(moments(lambda force: force > 0.5))
    assert figures.kept
    assert (figures.touches, figures.direction_error_deg_max, figures.rate_hz) == (1, 2.0, 100.0)


@pytest.mark.parametrize(
    ("rows", "name"),
    [
        (moments(lambda force: force > 0.3), "moved_below_0_40_N"),
        (moments(lambda force: force > 0.8), "still_above_0_60_N"),
        (moments(lambda force: force > 0.5, fastest=0.11), "limit_violations"),
    ],
)
def test_each_broken_promise_is_counted(rows, name):
    figures = summary(rows)
    assert getattr(figures, name) >= 1
    assert not figures.kept


LIMITS = Limits()
ALONG = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("name", "within", "beyond"),
    [
        ("speed", {"fastest": LIMITS.speed}, {"fastest": 1.03 * LIMITS.speed}),
        ("acceleration", {"gain": LIMITS.acceleration}, {"gain": 1.0001 * LIMITS.acceleration}),
        ("acceleration", {"gain": -99.0}, {"gain": 99.0}),  # speed is lost as fast as need be
        ("joint range", {"room": 0.0}, {"room": -1e-6}),
        ("workspace", {"height": LIMITS.floor}, {"height": LIMITS.floor - 1e-6}),
        ("workspace", {"place": LIMITS.low}, {"place": LIMITS.low - 1e-6 * ALONG}),
        ("workspace", {"place": LIMITS.high}, {"place": LIMITS.high + 1e-6 * ALONG}),
    ],
)
def test_each_limit_is_judged_at_every_moment(name, within, beyond):
    rows = moments(lambda force: force > 0.5)
    for asked, count in ((within, 0), (beyond, 1)):
        demo = judged([*rows[:60], rows[60]._replace(**asked), *rows[61:]], [PRESS], LIMITS, 100.0)
        assert demo.summary.limit_violations == count
        assert [key for key, times in demo.exceeded.items() if times] == [name] * count
        assert demo.summary.kept is demo.kept is (count == 0)
    assert demo.broken == (f"Limits were exceeded, each so often: {name} 1.",)
    # Between touches the robot's own programme moves it.
    between = judged([*rows, rows[60]._replace(press=-1, **beyond)], [PRESS], LIMITS, 100.0)
    assert between.kept


def test_a_touch_may_move_the_arm_so_far_and_so_long():
    long = replace(PRESS, times=(0.0, 11.0))
    rows = moments(lambda force: force > 0.5, fastest=0.01)
    for slower, count in ((10.1, 0), (10.3, 1)):  # moved from a half of it to its end
        stretched = [row._replace(time=slower * row.time, speed=1e-3) for row in rows]
        demo = judged(stretched, [long], LIMITS, 100.0)
        assert demo.exceeded["time"] == demo.summary.limit_violations == count
    # Let go in between it is two touches.
    stretched[75] = stretched[75]._replace(force=0.0)
    assert judged(stretched, [long], LIMITS, 100.0).exceeded["time"] == 0
    for speed, count in ((0.099, 0), (0.102, 1)):
        demo = judged([row._replace(speed=speed) for row in rows], [PRESS], LIMITS, 100.0)
        assert demo.exceeded["way"] == demo.summary.limit_violations == count


def test_a_machine_must_keep_up_with_the_rate_that_was_asked_for():
    rows = moments(lambda force: force > 0.5)
    for able, kept in ((100.0, True), (99.9, False)):
        demo = replace(judged(rows, [PRESS], LIMITS, able), asked_hz=100.0)
        assert demo.kept is kept
        assert demo.summary.kept
    assert demo.broken == ("This machine can only turn 99.9 of 100 readings a second.",)
    assert demo.as_json()["broken"] == list(demo.broken)


def test_faults_count_once_and_directions_have_a_limit():
    rows = moments(lambda force: force > 0.5)
    stop = Command(speeds=np.zeros(3), state=State.FAULT, reason=Reason.STALE)
    figures = summary([*rows[:90], *(row._replace(command=stop) for row in rows[90:])])
    assert (figures.faults, figures.kept) == (1, False)
    off = summary(moments(lambda force: force > 0.5, angle=11.0))
    assert not off.kept
    assert not replace(off, direction_error_deg_max=None).kept
    assert json.dumps(judged(rows, [PRESS], Limits(), 100.0).as_json())


def test_the_table_tells_in_words_what_was_broken():
    stop = Command(speeds=np.zeros(3), state=State.FAULT, reason=Reason.STALE)
    for rows, words in (
        (moments(lambda force: force > 0.5), ""),
        (moments(lambda force: force > 0.3), "moved by too little"),
        ([*moments(lambda force: force > 0.8)[:-1], moments(bool)[-1]._replace(command=stop)],
         "stood under too much, STALE"),
    ):  # fmt: skip
        (table,) = judged(rows, [PRESS], LIMITS, 100.0).tables()
        assert list(table.columns[-1].cells) == [words]
        assert table.rows[0].style == ("red" if words else "")


def test_a_late_stop_is_told():
    rows = moments(lambda force: force < 0.7)
    falling = [row._replace(force=1.0 - row.force) for row in rows]
    figures = summary(falling)
    assert figures.stop_ms_max == pytest.approx(90.0, abs=15.0)
    assert not figures.kept


def test_the_script_goes_through_the_threshold_on_the_skin():
    for design in map(read_design, ("curved", "planar")):
        presses = scripted_presses(design)
        assert len(presses) == 8
        for press in presses:
            assert press.forces.max() >= 0.7
            assert press.contacts(-1.0) == press.contacts(press.seconds + 1.0) == ()
            (contact,) = press.contacts(press.seconds / 3) or (None,)
            assert contact is None or contact.normal_force > 0.0
    with pytest.raises(ArgumentError):
        Press(place=(0, 0), direction=(0, 0, -1), times=(1.0, 0.5), forces=(0, 0))


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_demonstration_keeps_its_promises_on_a_made_skin():
    pytest.importorskip("mujoco")
    from smoskin.commands.follow.demonstration import demonstrate

    demo = demonstrate(read_design("curved"), seed=3)
    kept = demo.summary
    assert set(demo.exceeded.values()) == {0}
    assert (demo.asked_hz, demo.not_recorded) == (100.0, "")
    assert (kept.touches, kept.limit_violations, kept.faults) == (8, 0, 0)
    assert (kept.moved_below_0_40_N, kept.still_above_0_60_N) == (0, 0)
    assert kept.direction_error_deg_max <= 2.0


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_long_and_strong_touches_are_ended_within_the_limits(monkeypatch):
    """Where a touch would lead the arm beyond its time or its way, as it does not in the script."""
    pytest.importorskip("mujoco")
    skin = read_design("planar")
    place, direction = 0.5 * geometry(skin).extent, (0.0, 0.0, -1.0)
    presses = [
        Press(place=place, direction=direction, times=(0.0, 0.5, 7.5, 8.0), forces=(0, f, f, 0))
        for f in (0.62, 0.9)
    ]
    monkeypatch.setattr(demonstration, "scripted_presses", lambda skin: presses)
    seen = []
    # Slow enough for the light touch to be at its time before it is at its way.
    limits = Limits(resistance=12.0, duration=3.0)
    demo = demonstration.demonstrate(
        skin, seed=3, calibration_touches=5, limits=limits, watch=lambda stage, m: seen.append(m)
    )
    over = (Reason.DURATION, Reason.DISTANCE)
    reasons = [[m.command.reason for m in seen if m.press == k] for k in range(2)]
    assert [next(reason for reason in each if reason in over) for each in reasons] == [*over]
    assert set(demo.exceeded.values()) == {0}
    assert demo.summary.kept
    light, strong = demo.touches
    assert 10.0 < light.moved_mm < strong.moved_mm <= 100.0
    gains = [m.gain for m in seen if m.press >= 0]
    assert 0.9 * limits.acceleration < max(gains) <= (1 + 1e-9) * limits.acceleration
