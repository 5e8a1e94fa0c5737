"""Signals freed of the bend of made skins' fields: against the magnets' own."""

import numpy as np
import pytest

from smoskin.magnetics import sector
from smoskin.magnetics.nonlinearity import Bend, field_curvature
from smoskin.magnetics.straightening import Straightening
from smoskin.origami.geometry import geometry

OFF = np.array([2e-4, -3e-4, -4e-4])
"""Where a made skin's magnets are off their places, m."""


def fields(design, moved):
    """Exact fields of chips that stand so off their places against their magnets, (S, 3), T."""
    return np.stack(
        [
            sector.field(design.magnet(site.magnet), rest + moved)
            for site, rest in zip(design.halls, geometry(design).rest, strict=True)
        ]
    )


def test_motions_add_up_far_from_where_the_design_has_its_magnets(planar):
    rest = fields(planar, OFF)
    own = Straightening(planar, rest)
    weight, touch = np.array([5e-4, -4e-4, 1e-4]), np.array([-1e-4, 2e-4, -1.5e-4])
    first, second, both = (fields(planar, OFF + u) - rest for u in (weight, touch, weight + touch))
    bends = np.abs(both - first - second).max()
    left = own.straightened(both) - own.straightened(first) - own.straightened(second)
    # Point charges stand for the magnets to some millionths of the field.
    assert np.abs(left).max() < 1e-6
    # A second-order bend of the designed fields leaves a tenth.
    bend = Bend(field_curvature(planar))
    rough = bend.straightened(both) - bend.straightened(first) - bend.straightened(second)
    assert np.abs(rough).max() > 0.05 * bends > 1e-5
    assert own.bent(own.straightened(first) + own.straightened(second)) == pytest.approx(
        both, abs=1e-6
    )


def test_linear_signals_are_the_slope_times_the_motion(planar):
    rest, step = fields(planar, OFF), 1e-6
    own = Straightening(planar, rest)
    for axis in np.eye(3):
        slope = (fields(planar, OFF + step * axis) - fields(planar, OFF - step * axis)) / 2 / step
        moved = own.straightened(fields(planar, OFF + 3e-4 * axis) - rest)
        assert moved == pytest.approx(3e-4 * slope, abs=1e-6, rel=1e-3)


def test_there_and_back_is_the_same_in_any_shape(planar):
    own = Straightening(planar, fields(planar, OFF))
    rng = np.random.default_rng(0)
    signals = 1e-3 * rng.normal(size=(7, 2, 3 * len(planar.halls)))
    linear = own.straightened(signals)
    assert linear.shape == signals.shape
    assert own.bent(linear) == pytest.approx(signals, abs=1e-9)
    single = own.straightened(signals[3, 1].reshape(-1, 3))
    assert single.ravel() == pytest.approx(linear[3, 1], abs=1e-10)
    assert own.straightened(np.zeros((3, 3))) == pytest.approx(np.zeros((3, 3)), abs=1e-12)


def test_fields_that_no_motion_gives_stay_as_they_are(planar):
    own = Straightening(planar, fields(planar, OFF))
    wild = np.zeros((2, len(planar.halls), 3))
    wild[0, 1], wild[1, 2] = 0.5, np.nan
    answer = own.straightened(wild)
    assert answer[0, 1].tolist() == [0.5] * 3
    assert np.isnan(answer[1, 2]).all()
    assert answer[:, 0] == pytest.approx(0.0, abs=1e-12)
    # Nor does a rest field that no magnet gives: then chips stand where the design has them.
    nowhere = Straightening(planar, np.full((len(planar.halls), 3), 1.0))
    designed = Straightening(planar, fields(planar, 0.0))
    small = np.full((len(planar.halls), 3), 1e-4)
    assert nowhere.bent(small) == pytest.approx(designed.bent(small), abs=1e-7)
