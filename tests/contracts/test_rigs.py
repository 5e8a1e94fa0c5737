"""What every rig promises, asked of the virtual one and of a stage and a gauge."""

from collections.abc import Iterator

import numpy as np
import pytest

from rigs import Bench
from smoskin.errors import ArgumentError, SourceError
from smoskin.feasibility import load_design
from smoskin.records import Contact
from smoskin.roles import Rig
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.rig import VirtualRig

TOUCH = Contact(position=(0.050, 0.067), force=(0.0, 0.0, -0.5))


@pytest.fixture(params=["virtual", "stage and gauge"])
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    if request.param == "virtual":
        yield VirtualRig(ReducedTwin(load_design("planar")), np.random.default_rng(0))
        return
    pytest.importorskip("serial")
    with Bench() as bench:
        yield bench.rig


def test_touches_are_reported_as_they_were_made(rig: Rig) -> None:
    assert rig.place_spread > 0
    assert rig.force_spread > 0
    touches = [rig.press(TOUCH) for _ in range(2)]
    for touch in touches:
        assert np.abs(touch.contact.position - TOUCH.position).max() < 6 * rig.place_spread
        assert abs(touch.contact.normal_force - 0.5) < 0.025
        times = [reading.time for reading in touch.readings]
        assert times == sorted(times)
        for start, end in (touch.rest, touch.held):
            assert sum(start <= time <= end for time in times) >= 5
        assert touch.rest[1] < touch.held[0]
    assert touches[0].held[1] < touches[1].rest[0]


def test_a_skin_that_cannot_be_touched_so_is_wrong_use(rig: Rig) -> None:
    with pytest.raises(ArgumentError):
        rig.press(Contact(position=TOUCH.position, force=(0.0, 0.0, 0.5)))
    assert rig.press(TOUCH).contact.normal_force > 0.4


def test_a_touch_that_gets_no_time_is_told(rig: Rig) -> None:
    with pytest.raises(SourceError):
        rig.press(TOUCH, 0.2)
    assert rig.press(TOUCH).contact.normal_force > 0.4


def test_a_rig_is_closed_any_number_of_times(rig: Rig) -> None:
    rig.close()
    rig.close()
