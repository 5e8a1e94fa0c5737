"""Stiffnesses and the force law."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.mechanics.beam import beam
from smoskin.mechanics.reduced.stiffness import (
    board_stiffness,
    cell_layers,
    column_stiffness,
    folding_correction_map,
    normal_force,
    pillar_stiffness,
    press_depth,
    relative_stiffness_map,
    shear_gain,
    sheet_stiffness,
    stiffness_map,
)


def test_the_reference_columns_and_skin_are_as_stiff_as_planned(planar):
    assert column_stiffness(planar) == pytest.approx(74.01, abs=0.01)
    stiffness = stiffness_map(planar, planar.coefficients)
    assert 6.6e3 < stiffness.min() < stiffness.max() < 8.8e3
    assert board_stiffness(planar) == pytest.approx(8 * beam(3e-3, 3e-3, 25e3).lateral)
    assert sheet_stiffness(planar) == pytest.approx(91 * 74.007, rel=1e-4)


def test_a_pillar_shears_as_a_beam_of_the_same_rubber():
    """k = S G / h from the energy of uniform shear, G/2 (u/h)^2 over the volume."""
    radius, height, modulus, u = 2e-3, 8e-3, 30e3, 1e-4
    energy = 0.5 * modulus * (u / height) ** 2 * math.pi * radius**2 * height
    assert pillar_stiffness(radius, height, modulus) == pytest.approx(2 * energy / u**2)


@given(v=st.floats(0.05, 1.0), n=st.integers(1, 7), m=st.integers(1, 7))
def test_stiffness_is_positive_and_mirror_symmetric_in_x(planar, v, n, m):
    stiffness = relative_stiffness_map(planar.cell, (n, m), (v, v))
    assert np.all(stiffness > 0)
    np.testing.assert_allclose(stiffness, stiffness[::-1], rtol=1e-12)


@given(
    press=st.floats(1e-6, 1e-3),
    shear=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    more=st.floats(1e-6, 1e-3),
)
def test_force_law_is_monotone_and_undone_by_its_inverse(press, shear, more):
    gain = shear_gain(shear, (0.6, 0.9))
    assert gain >= 1
    force = normal_force(press, 1700.0, gain)
    assert press_depth(force, 1700.0, gain) == pytest.approx(press, rel=1e-12)
    assert normal_force(press + more, 1700.0, gain) > force


def test_shear_gain_is_the_printed_one_on_each_axis():
    assert shear_gain([0.3, 0.0], [0.6, 0.9]) == pytest.approx(1 + 0.3 / 0.6)
    assert shear_gain([0.0, -0.45], [0.6, 0.9]) == pytest.approx(1 + 0.45 / 0.9)


def test_shear_gain_adds_both_axes_as_legs_of_a_right_angle():
    assert shear_gain([0.3, 0.45], [0.6, 0.9]) == pytest.approx(1 + math.hypot(0.5, 0.5))
    assert shear_gain([-0.3, 0.45], [0.6, 0.6]) == pytest.approx(1 + math.hypot(0.5, 0.75))
    many = shear_gain([[0.3, 0.0], [0.0, 0.0]], [[0.6, 0.9], [0.6, 0.9]])
    np.testing.assert_allclose(many, [1.5, 1.0])


def test_layers_count_from_the_rim(planar):
    layers = cell_layers((6, 6))
    assert [int(layers[k, k]) for k in range(6)] == [0, 1, 2, 2, 1, 0]
    table = folding_correction_map((9, 9), planar.coefficients)
    assert table[4, 4].tolist() == [0.9, 1.1]  # deeper than the named layers: the innermost
    assert table[0, 4].tolist() == [0.6, 0.9]
