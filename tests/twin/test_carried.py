"""A skin on an arm: weight and acceleration are one, and the Earth's field turns with the arm."""

import numpy as np
import pytest

pytest.importorskip("jax")

from smoskin.design.document import read_design
from smoskin.magnetics import mlx90393
from smoskin.magnetics.arrangement import rotation_matrix
from smoskin.mechanics.masses import GRAVITY
from smoskin.origami.geometry import geometry
from smoskin.twin.carried import CarriedSkin
from smoskin.twin.whole import Twin

DESIGN = read_design("planar")
NOWHERE = np.zeros(3)
TURN = rotation_matrix(np.array([0.5, -0.3, 0.0]))
NOISE = 2e-6


@pytest.fixture(scope="module")
def twin():
    return Twin(DESIGN, seed=0)


def mean(skin, turn, **more):
    fields = [skin.read(k / 100, (), turn, **more).field for k in range(40)]
    return np.mean(fields, axis=0)


def test_weight_and_acceleration_are_one(twin):
    down = np.array([0.0, 0.0, -GRAVITY])
    tilted = mean(CarriedSkin(twin, earth=NOWHERE, drift=0.0), TURN)
    pulled = mean(
        CarriedSkin(twin, seed=1, earth=NOWHERE, drift=0.0),
        np.eye(3),
        acceleration=down - TURN.T @ down,
    )
    level = mean(CarriedSkin(twin, seed=2, earth=NOWHERE, drift=0.0), np.eye(3))
    assert tilted == pytest.approx(pulled, abs=NOISE)
    assert np.abs(tilted - level).max() > 100e-6


def test_the_earth_is_felt_alike_by_all_chips_along_the_skin(twin):
    earth = np.array([30e-6, 0.0, -40e-6])
    field, none = (
        mean(CarriedSkin(twin, seed=seed, earth=ambient, drift=0.0), TURN)
        for seed, ambient in enumerate((earth, NOWHERE))
    )
    inward = np.swapaxes(geometry(DESIGN).chip_axes, 1, 2)
    for site, axes, felt in zip(DESIGN.halls, inward, field - none, strict=True):
        expected = mlx90393.rotation(site).T @ axes @ TURN.T @ earth
        assert felt == pytest.approx(expected, abs=NOISE)
