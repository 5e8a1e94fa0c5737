"""How far a skin's zero may be off its design's."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.records import Reading
from smoskin.sensing.signals.signals import Signals
from smoskin.twin.reduced import ReducedTwin


@pytest.mark.parametrize("chip", [0, 1, 2])
@pytest.mark.parametrize(("share", "taken"), [(0.49, True), (0.51, False)])
def test_a_chip_may_be_off_by_half_of_its_magnets_field(planar, chip, share, taken):
    signals = Signals(planar, zeroed=False)
    rest = np.array(ReducedTwin(planar, seed=None).read().field)
    signals.zero([Reading(time=0.1 * k, field=rest) for k in range(3)])
    size = np.linalg.norm(signals.rest_field[chip])
    field = np.array(rest)
    field[chip] += share * size * np.array([2.0, -1.0, 2.0]) / 3
    readings = [Reading(time=0.1 * k, field=field) for k in range(3)]
    if taken:
        signals.zero(readings)
        return
    with pytest.raises(ArgumentError, match="near the design's rest field, each chip over its own"):
        signals.zero(readings)
    signals.zero(readings, force=True)
