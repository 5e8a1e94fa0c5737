"""A made chip: pose, sensitivity, cross-axis, zero and what they do to a reading."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.chip import ChipErrors, ChipPose, answered, mounting


def test_a_chip_as_designed_is_mounted_as_its_site_says(planar: SkinDesign) -> None:
    still = ChipPose(offset=np.zeros(3), turn=np.zeros(3))
    designed = [mlx90393.rotation(site) for site in planar.halls]
    assert_array_equal(mounting(planar.halls, still), designed)


def test_a_turned_chip_sees_the_field_turned_back(planar: SkinDesign) -> None:
    rng = np.random.default_rng(2)
    chips = len(planar.halls)
    pose = ChipPose(offset=rng.normal(size=(chips, 3)), turn=rng.normal(size=(chips, 3)))
    mounts = mounting(planar.halls, pose)
    assert_allclose(
        mounts @ np.swapaxes(mounts, -1, -2), np.broadcast_to(np.eye(3), mounts.shape), atol=1e-14
    )
    field = rng.normal(size=3)
    for site, turn, mount in zip(planar.halls, pose.turn, mounts, strict=True):
        turned = Rotation.from_rotvec(turn.copy()).inv().apply(field) @ mlx90393.rotation(site)
        assert_allclose(mount.T @ field, turned, rtol=1e-12)


def test_errors_come_in_their_order() -> None:
    cross = np.zeros((3, 3))
    cross[0, 2] = 0.01
    errors = ChipErrors(sensitivity=[2.0, 1.0, 1.0], cross_axis=cross, zero=[1e-6, 0.0, 0.0])
    # x: (1 mT + 1 % of 3 mT) twice, and 1 uT.
    assert_allclose(answered([1e-3, 2e-3, 3e-3], errors), [2.061e-3, 2e-3, 3e-3])
    field = np.ones((4, 2, 3))
    assert_array_equal(answered(field, ChipErrors()), field)


def test_all_chips_of_a_skin_at_once() -> None:
    rng = np.random.default_rng(5)
    gains, zeros = 1 + 0.02 * rng.normal(size=(3, 3)), 1e-5 * rng.normal(size=(3, 3))
    field = rng.normal(size=(7, 3, 3))
    together = answered(field, ChipErrors(sensitivity=gains, zero=zeros))
    for s in range(3):
        alone = answered(field[:, s], ChipErrors(sensitivity=gains[s], zero=zeros[s]))
        assert_array_equal(together[:, s], alone)


def test_records_are_read_only_copies() -> None:
    turn = np.zeros(3)
    pose = ChipPose(offset=np.zeros(3), turn=turn)
    turn[0] = 1.0
    assert pose.turn[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        pose.offset[0] = 1.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ChipPose(offset=[0, 0], turn=[0, 0, 0]), r"offset must have shape \(\.\.\., 3\)"),
        (lambda: ChipPose(offset=[0, 0, np.nan], turn=[0, 0, 0]), "offset must be finite"),
        (lambda: ChipErrors(sensitivity=[1, 1, 0]), "sensitivity must be positive"),
        (lambda: ChipErrors(cross_axis=np.eye(3)), "zero on its diagonal"),
        (lambda: ChipErrors(warmth=np.inf), "warmth must be finite"),
        (lambda: answered([0.0], ChipErrors()), "field must have shape"),
    ],
)
def test_wrong_use(call, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        call()


def test_a_pose_of_another_skin(planar: SkinDesign) -> None:
    with pytest.raises(ArgumentError, match="pose must be of one chip or of 3"):
        mounting(planar.halls, ChipPose(offset=np.zeros((4, 3)), turn=np.zeros((4, 3))))
