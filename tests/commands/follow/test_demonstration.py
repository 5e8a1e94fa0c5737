"""The scripted demonstration: what it judges, and that it keeps its promises."""

import json
from dataclasses import replace

import numpy as np
import pytest

from smoskin.commands.follow.demonstration import Moment, Press, judged
from smoskin.commands.follow.script import scripted_presses
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.robot.follow import Command, State
from smoskin.robot.law import Limits
from smoskin.robot.reasons import Reason

PRESS = Press(place=(0.05, 0.05), direction=(0.0, 0.0, -1.0), times=(0.0, 1.0), forces=(0.0, 1.0))


def moments(moves, reason=Reason.MOVING, angle=2.0, fastest=0.05):
    """One touch whose force rises evenly to 1 N, moved where `moves` says so of the force."""
    rows = []
    for k in range(101):
        force = k / 100
        speeds = np.full(3, 0.1 * bool(moves(force)))
        state = State.MOVING if speeds.any() else State.STANDING
        command = Command(speeds=speeds, state=state, reason=reason)
        rows.append(
            Moment(k / 100, 0, force, command, angle, 0.01, fastest, np.zeros(3), np.zeros(3))
        )
    return rows


def summary(rows):
    return judged(rows, [PRESS], Limits(), 100.0).summary


def test_an_arm_that_does_as_promised_keeps_its_promises():
    found = summary(moments(lambda force: force > 0.5))
    assert found.kept
    assert (found.touches, found.direction_error_deg_max, found.rate_hz) == (1, 2.0, 100.0)


@pytest.mark.parametrize(
    ("rows", "name"),
    [
        (moments(lambda force: force > 0.3), "moved_below_0_40_N"),
        (moments(lambda force: force > 0.8), "still_above_0_60_N"),
        (moments(lambda force: force > 0.5, fastest=0.11), "limit_violations"),
    ],
)
def test_each_broken_promise_is_counted(rows, name):
    found = summary(rows)
    assert getattr(found, name) >= 1
    assert not found.kept


def test_faults_count_once_and_directions_have_a_limit():
    rows = moments(lambda force: force > 0.5)
    stop = Command(speeds=np.zeros(3), state=State.FAULT, reason=Reason.STALE)
    found = summary([*rows[:90], *(row._replace(command=stop) for row in rows[90:])])
    assert (found.faults, found.kept) == (1, False)
    off = summary(moments(lambda force: force > 0.5, angle=11.0))
    assert not off.kept
    assert not replace(off, direction_error_deg_max=None).kept
    assert json.dumps(judged(rows, [PRESS], Limits(), 100.0).as_json())


def test_a_late_stop_is_told():
    rows = moments(lambda force: force < 0.7)
    falling = [row._replace(force=1.0 - row.force) for row in rows]
    found = summary(falling)
    assert found.stop_ms_max == pytest.approx(90.0, abs=15.0)
    assert not found.kept


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

    found = demonstrate(read_design("curved"), seed=3)
    kept = found.summary
    assert (kept.touches, kept.limit_violations, kept.faults) == (8, 0, 0)
    assert (kept.moved_below_0_40_N, kept.still_above_0_60_N) == (0, 0)
    assert kept.direction_error_deg_max <= 2.0
