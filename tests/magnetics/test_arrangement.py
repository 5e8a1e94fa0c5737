"""Several placed and turned magnets against magpylib, and what no pose may change."""

from dataclasses import replace

import magpylib
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from magpylib_oracle import magpylib_disc
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics.arrangement import arrangement_field, rotation_matrix

DISC = Magnet(name="A", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3, remanence=8.04e5)
MAGNETS = (
    DISC,
    replace(DISC, name="B", remanence=5e5, polarity=-1),
    replace(DISC, name="C", radius=3e-3, height=4e-3),
)


def poses(rng, count):
    places = rng.uniform(-0.02, 0.02, (count, 3)) + np.arange(count)[:, None] * [0.05, 0, 0]
    return places, rng.normal(size=(count, 3))


def test_rotation_matrices_are_those_of_scipy() -> None:
    vectors = np.random.default_rng(0).normal(size=(50, 3)) * 3
    vectors[0] = 0
    vectors[1] *= 1e-12
    expected = Rotation.from_rotvec(vectors).as_matrix()
    assert_allclose(rotation_matrix(vectors), expected, atol=1e-14)


def test_placed_and_turned_magnets_agree_with_magpylib() -> None:
    rng = np.random.default_rng(1)
    places, turns = poses(rng, 3)
    points = rng.uniform(-0.05, 0.15, (40, 3)) + np.array([0, 0.03, 0])
    discs = [magpylib_disc(*posed) for posed in zip(MAGNETS, places, turns, strict=True)]
    with np.errstate(all="ignore"):
        expected = magpylib.getB(discs, points, sumup=True)
    ours = arrangement_field(MAGNETS, places, rotation_matrix(turns), points)
    assert_allclose(ours, expected, rtol=1e-6, atol=2e-10)  # magpylib loses digits far away


def test_turning_and_moving_everything_turns_the_field() -> None:
    rng = np.random.default_rng(2)
    places, turns = poses(rng, 3)
    points = rng.uniform(-0.05, 0.15, (20, 3)) + np.array([0, 0, 0.05])
    whole, shift = rotation_matrix(rng.normal(size=3)), rng.normal(size=3)
    here = arrangement_field(MAGNETS, places, rotation_matrix(turns), points)
    there = arrangement_field(
        MAGNETS, places @ whole.T + shift, whole @ rotation_matrix(turns), points @ whole.T + shift
    )
    assert_allclose(there, here @ whole.T, rtol=1e-8, atol=1e-14)


def test_batches_of_poses_and_of_points_broadcast() -> None:
    rng = np.random.default_rng(3)
    states = [poses(rng, 3) for _ in range(4)]
    places = np.stack([place for place, _ in states])
    turns = rotation_matrix(np.stack([turn for _, turn in states]))
    points = rng.uniform(-0.1, 0.1, (4, 5, 3))
    batch = arrangement_field(MAGNETS, places, turns, points)
    for k in range(4):
        single = arrangement_field(MAGNETS, places[k], turns[k], points[k])
        assert_allclose(batch[k], single, rtol=1e-9, atol=1e-15)
    same_points = arrangement_field(MAGNETS, places, turns, points[0])
    assert_allclose(same_points[0], batch[0], rtol=1e-9, atol=1e-15)
    still = arrangement_field(MAGNETS, places[0], turns[0], points)
    assert_allclose(still[2], arrangement_field(MAGNETS, places[0], turns[0], points[2]))


def test_a_pose_that_is_no_number_gives_no_field() -> None:
    places = np.zeros((2, 1, 3))
    places[1] = np.nan
    field = arrangement_field(MAGNETS[:1], places, np.eye(3)[None], [[0.0, 0.0, 0.01]])
    assert np.isfinite(field[0]).all()
    assert np.isnan(field[1]).all()


def test_no_magnet_is_refused() -> None:
    with pytest.raises(ArgumentError, match="magnets must name at least one magnet"):
        arrangement_field([], np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((1, 3)))
    with pytest.raises(ArgumentError, match=r"places must have shape \(\.\.\., 1, 3\)"):
        arrangement_field([DISC], np.zeros((2, 3)), np.eye(3)[None], np.zeros((1, 3)))
