"""A made chip: pose, sensitivity, cross-axis, zero and what they do to a reading."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.chip import MadeChips


def ideal(chips: int) -> MadeChips:
    """Chips as designed."""
    none = np.zeros((chips, 3))
    return MadeChips(
        place=none,
        turn=none,
        sensitivity=none + 1,
        cross_axis=np.zeros((chips, 3, 3)),
        zero=none,
        warmth=np.zeros(chips),
    )


def test_a_chip_as_designed_is_mounted_as_its_site_says(planar: SkinDesign) -> None:
    designed = [mlx90393.rotation(site) for site in planar.halls]
    assert_array_equal(ideal(3).rotations(planar.halls), designed)


def test_a_turned_chip_sees_the_field_turned_back(planar: SkinDesign) -> None:
    rng = np.random.default_rng(2)
    made = replace(ideal(3), place=rng.normal(size=(3, 3)), turn=rng.normal(size=(3, 3)))
    mounts = made.rotations(planar.halls)
    assert_allclose(
        mounts @ np.swapaxes(mounts, -1, -2), np.broadcast_to(np.eye(3), mounts.shape), atol=1e-14
    )
    field = rng.normal(size=3)
    for site, turn, mount in zip(planar.halls, made.turn, mounts, strict=True):
        turned = Rotation.from_rotvec(turn.copy()).inv().apply(field) @ mlx90393.rotation(site)
        assert_allclose(mount.T @ field, turned, rtol=1e-12)


def test_errors_come_in_their_order() -> None:
    cross = np.zeros((1, 3, 3))
    cross[0, 0, 2] = 0.01
    made = replace(
        ideal(1), sensitivity=[[2.0, 1.0, 1.0]], cross_axis=cross, zero=[[1e-6, 0.0, 0.0]]
    )
    # x: (1 mT + 1 % of 3 mT) twice, and 1 uT.
    assert_allclose(made.answers([[1e-3, 2e-3, 3e-3]]), [[2.061e-3, 2e-3, 3e-3]])
    field = np.ones((4, 2, 3))
    assert_array_equal(ideal(2).answers(field), field)


def test_each_chip_has_its_own_errors() -> None:
    rng = np.random.default_rng(5)
    gains, zeros = 1 + 0.02 * rng.normal(size=(3, 3)), 1e-5 * rng.normal(size=(3, 3))
    cross = 0.01 * rng.normal(size=(3, 3, 3)) * (1 - np.eye(3))
    field = rng.normal(size=(7, 3, 3))
    together = replace(ideal(3), sensitivity=gains, cross_axis=cross, zero=zeros).answers(field)
    for s in range(3):
        taken = field[:, s] + field[:, s] @ cross[s].T
        assert_allclose(together[:, s], gains[s] * taken + zeros[s], rtol=1e-12)


def test_records_are_read_only_copies() -> None:
    turn = np.zeros((2, 3))
    made = replace(ideal(2), turn=turn)
    turn[0] = 1.0
    assert made.turn[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        made.place[0] = 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"place": [[0, 0]]}, r"place must have shape \(\.\.\., 1, 3\)"),
        ({"zero": np.zeros((2, 3))}, r"zero must have shape \(\.\.\., 1, 3\)"),
        ({"place": [[0, 0, np.nan]]}, "place must be finite"),
        ({"sensitivity": [[1, 1, 0]]}, "sensitivity must be positive"),
        ({"cross_axis": [np.eye(3)]}, "zero on its diagonal"),
        ({"warmth": [np.inf]}, "warmth must be finite"),
    ],
)
def test_wrong_use(change, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        replace(ideal(1), **change)


def test_the_field_and_the_sites_are_of_as_many_chips(planar: SkinDesign) -> None:
    with pytest.raises(ArgumentError, match=r"field must have shape \(\.\.\., 1, 3\)"):
        ideal(1).answers([0.0])
    with pytest.raises(ArgumentError, match="sites must be those of 4 chips; got 3"):
        ideal(4).rotations(planar.halls)


def test_a_warm_chip_reads_less_of_the_field_and_keeps_its_zero() -> None:
    chips = replace(ideal(2), zero=np.full((2, 3), 5e-6), sensitivity=np.full((2, 3), 1.1))
    field = np.full((4, 2, 3), 1e-3)
    read = chips.answers(field, [[25.0, 35.0]])
    assert_allclose(read[:, 0], 1.1e-3 + 5e-6)
    assert_allclose(read[:, 1], 0.955 * 1.1e-3 + 5e-6)
    assert_array_equal(chips.answers(field), chips.answers(field, 25.0))
