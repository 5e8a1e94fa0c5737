"""The SI's preprocessing: what it takes off on theory's own sheet, and what it multiplies."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from paper.models.preprocessing import (
    corrected_force,
    folding_corrections,
    shear_displacement,
    shear_force,
    shear_signals,
    without_shear,
)
from smoskin.errors import ArgumentError
from smoskin.magnetics.inversion import FieldInverse
from smoskin.mechanics.reduced.stiffness import folding_correction_map
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.twin.readout import Readout
from tables_of_response import motions, plain, presses, signals


def noiseless(design, where, push):
    """Signals of theory's sheet without noise."""
    return signals(design, Readout(design), motions(design, where, push))


def test_drag_slides_board_and_sheet_in_series(planar):
    calibration = Calibration.nominal(planar)
    force = np.array([[0.3, -0.1], [0.0, 0.5]])
    assert_allclose(shear_force(force / calibration.board_stiffness, calibration), force)
    assert_allclose(shear_displacement(force, calibration), force / calibration.sheet_stiffness)


def test_field_of_a_slide_is_that_from_which_the_inverse_finds_it(planar):
    moved = np.array([[0.0, 0.0], [0.2e-3, -0.1e-3], [-0.3e-3, 0.4e-3]])
    change = shear_signals(moved, planar)
    inverse = FieldInverse(planar)
    estimate = inverse.displacements(inverse.rest_field + change)
    assert estimate.within.all()
    # Chips move against their magnets as magnets do against chips, reversed; the lower stays.
    assert_allclose(estimate.moved[:, 1:, :2], -np.repeat(moved[:, None], 2, axis=1), atol=1e-6)
    assert_allclose(estimate.moved[:, 1:, 2], 0.0, atol=1e-6)
    assert (change[:, 0] == 0).all()
    assert (change[0] == 0).all()


def test_a_drag_alone_leaves_nothing(planar):
    where = np.tile([[0.06, 0.08]], (3, 1))
    push = np.array([[0.4, 0.0, -1e-9], [0.0, -0.4, -1e-9], [-0.2, 0.3, -1e-9]])
    given = noiseless(planar, where, push)
    parted = without_shear(given, planar, Calibration.nominal(planar))
    assert_allclose(parted.shear, push[:, :2], rtol=2e-2, atol=2e-3)
    assert np.abs(given[:, 1:]).max() > 300e-6
    assert np.abs(parted.signals[:, 1:]).max() < 0.03 * np.abs(given[:, 1:]).max()
    assert (parted.signals[:, 0] == given[:, 0]).all()


def test_on_theorys_sheet_the_press_is_left(planar):
    design = plain(planar)
    where, push = presses(design, 200, drag=0.4)
    shares = []
    for size in (1.0, 0.5, 0.25):
        both = noiseless(design, where, size * push)
        press = noiseless(design, where, size * push * (0.0, 0.0, 1.0))
        parted = without_shear(both, design, Calibration.nominal(design))
        added, left = (values[:, 1:] - press[:, 1:] for values in (both, parted.signals))
        shares.append(np.sqrt((left**2).mean() / (added**2).mean()))
    # The field bends: what is left of shear and press together is of second order.
    assert shares[0] < 0.2
    assert shares[2] < 0.3 * shares[0]


def test_a_ready_inverse_gives_the_same(planar):
    where, push = presses(planar, 5)
    values, calibration = noiseless(planar, where, push), Calibration.nominal(planar)
    first = without_shear(values, planar, calibration)
    again = without_shear(values, planar, calibration, inverse=FieldInverse(planar))
    assert_allclose(first.signals, again.signals, rtol=0, atol=0)


def test_folding_correction_is_that_of_the_cell_below(planar):
    table = folding_correction_map(planar.cells, planar.coefficients)
    middle = geometry(planar).tops
    corrections = folding_corrections(middle.reshape(-1, 2), planar, table)
    assert_allclose(corrections.reshape(6, 6, 2), table)
    beyond = [[-1e-3, -1e-3], [0.121, 0.161]]
    assert_allclose(folding_corrections(beyond, planar, table), table[[0, 5], [0, 5]])


@given(
    force=st.floats(0.0, 2.0),
    shear=st.floats(-1.0, 1.0),
    v_f=st.floats(0.1, 10.0),
    axis=st.integers(0, 1),
)
def test_force_grows_by_one_plus_shear_over_v_f(force, shear, v_f, axis):
    along, other = np.zeros((1, 2)), np.full((1, 2), 3.0)
    along[0, axis], other[0, axis] = shear, v_f
    expected = force * (1 + abs(shear) / v_f)
    assert_allclose(corrected_force([force], along, other), [expected])
    assert_allclose(corrected_force([force], along, np.full((1, 2), np.inf)), [force])


def test_wrong_arguments_are_named(planar):
    calibration = Calibration.nominal(planar)
    with pytest.raises(ArgumentError, match=r"signals must have shape .*3, 3.*got \(2, 9\)"):
        without_shear(np.zeros((2, 9)), planar, calibration)
    floating = replace(
        planar, magnets=tuple(replace(magnet, mount="sheet") for magnet in planar.magnets)
    )
    with pytest.raises(ArgumentError, match="one chip over a magnet of the base; 'planar' has 0"):
        without_shear(np.zeros((1, 3, 3)), floating, calibration)
    with pytest.raises(ArgumentError, match=r"folding must have shape \(6, 6, 2\); got \(3, 2\)"):
        folding_corrections([[0.0, 0.0]], planar, np.ones((3, 2)))
