"""The one check of arrays, and records that are filled once."""

from dataclasses import FrozenInstanceError, dataclass

import numpy as np
import pytest

from smoskin.arrays import Floats, assign, floats, freeze, frozen
from smoskin.errors import ArgumentError


@dataclass(frozen=True, eq=False)
class Pair:
    place: Floats
    force: Floats

    def __post_init__(self) -> None:
        freeze(self, place=(2,), force=(None, 3))


def test_an_array_of_the_right_shape_is_taken_as_it_is():
    given = np.zeros((4, 2, 3))
    assert floats("x", given, (2, 3)) is given
    assert floats("x", given, (None, 3)) is given
    assert floats("x", 3).dtype == np.float64
    assert floats("x", [1, 2], None).tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("value", "shape", "message"),
    [
        (np.zeros((2, 3)), (3, 3), r"x must have shape \(\.\.\., 3, 3\); got \(2, 3\)"),
        (np.zeros((2, 3)), (None, 2), r"x must have shape \(\.\.\., n, 2\); got \(2, 3\)"),
        (np.zeros(3), (1, 3), r"x must have shape \(\.\.\., 1, 3\); got \(3,\)"),
        ("long", None, "x must be an array of numbers; got 'long'"),
        ([[1.0], [1.0, 2.0]], None, "x must be an array of numbers"),
    ],
)
def test_other_arrays_are_refused_by_name(value, shape, message):
    with pytest.raises(ArgumentError, match=message):
        floats("x", value, shape)


def test_frozen_arrays_are_read_only_copies_of_exactly_one_shape():
    given = np.ones((2, 3))
    kept = frozen("x", given, (None, 3))
    given[:] = 0.0
    assert kept.all()
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 1.0
    with pytest.raises(ArgumentError, match=r"x must have 2 dimension\(s\); got shape \(1, 2, 3\)"):
        frozen("x", np.ones((1, 2, 3)), (None, 3))
    with pytest.raises(ArgumentError, match=r"x must have shape \(\.\.\., 2, 3\)"):
        frozen("x", np.ones((1, 3)), (2, 3))
    with pytest.raises(ArgumentError, match="x must be an array of numbers"):
        frozen("x", "long", (1,))


def test_a_record_is_frozen_once_it_is_made():
    pair = Pair([1, 2], np.ones((4, 3)))
    assert pair.place.tolist() == [1.0, 2.0]
    assert not pair.place.flags.writeable
    assert not pair.force.flags.writeable
    with pytest.raises(FrozenInstanceError):
        pair.place = np.zeros(2)
    with pytest.raises(ArgumentError, match=r"force must have shape"):
        Pair([1, 2], np.ones(4))
    assign(pair, place=3, force=4)
    assert (pair.place, pair.force) == (3, 4)
