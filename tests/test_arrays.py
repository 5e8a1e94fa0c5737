"""The one check of arrays, and records that are filled once."""

from dataclasses import FrozenInstanceError, dataclass

import numpy as np
import pytest

from smoskin.arrays import (
    Floats,
    assign,
    floats,
    freeze,
    frozen,
    inverse_and_log_det,
    solve_definite,
    wholes,
)
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


@pytest.mark.parametrize("size", [1, 3, 9])
def test_definite_systems_are_solved_as_numpy_solves_any(size):
    rng = np.random.default_rng(size)
    half = rng.normal(size=(size, size))
    matrix, right = half @ half.T + 0.1 * np.eye(size), rng.normal(size=(size, 2))
    given = matrix.copy()
    np.testing.assert_allclose(solve_definite(matrix, right), np.linalg.solve(matrix, right))
    inverse, log_det = inverse_and_log_det(matrix)
    np.testing.assert_allclose(inverse, np.linalg.inv(matrix), rtol=1e-9)
    assert (inverse == inverse.T).all()
    assert log_det == pytest.approx(np.linalg.slogdet(matrix)[1])
    assert (matrix == given).all()


def test_what_rounding_has_left_indefinite_is_solved_all_the_same():
    matrix = np.array([[1.0, 2.0], [2.0, 1.0]])
    np.testing.assert_allclose(solve_definite(matrix, np.ones(2)), [1 / 3, 1 / 3])
    inverse, log_det = inverse_and_log_det(matrix)
    np.testing.assert_allclose(inverse, np.linalg.inv(matrix))
    assert log_det == pytest.approx(np.log(3.0))


@pytest.mark.parametrize("kind", [np.int8, np.uint16, np.int64, np.uint64, bool])
def test_whole_numbers_of_any_kind_are_taken(kind):
    assert wholes("n", np.array([0, 1], dtype=kind), (2,)).tolist() == [0, 1]


@pytest.mark.parametrize("value", [np.array([1 << 63], dtype=np.uint64), [1.0], [1 << 70], ["1"]])
def test_what_is_no_whole_number_of_64_bits_is_refused(value):
    with pytest.raises(ArgumentError, match="n must be whole numbers"):
        wholes("n", value, (1,))
