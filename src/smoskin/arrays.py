"""Array types, and the one check that every public array argument goes through."""

import functools
import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smoskin.errors import ArgumentError

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]


def floats(name: str, value: ArrayLike, shape: Sequence[int | None] | None = None) -> Floats:
    """`value` as a float64 array, checked against the trailing shape that the argument must have.

    ``None`` stands for any length: ``(None, 3)`` accepts ``(..., S, 3)``. What already is such an
    array is returned itself; `name` is the argument's, for the message.

    Raises
    ------
    ArgumentError
        If it is not numeric or its trailing shape differs.

    Examples
    --------
    >>> floats("position", [0.01, 0.02], (2,))
    array([0.01, 0.02])
    >>> floats("position", [0.01, 0.02, 0.03], (2,))
    Traceback (most recent call last):
    smoskin.errors.ArgumentError: position must have shape (..., 2); got (3,)
    """
    try:
        array = np.asarray(_real(value), dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"{name} must be an array of numbers; got {value!r:.100}") from error
    if shape is not None:
        tail = array.shape[-len(shape) :] if shape else ()
        fits = len(tail) == len(shape) and all(
            want is None or got == want for want, got in zip(shape, tail, strict=True)
        )
        if not fits:
            wanted = ", ".join("n" if want is None else str(want) for want in shape)
            raise ArgumentError(f"{name} must have shape (..., {wanted}); got {array.shape}")
    return array


def frozen(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """A read-only copy of `value` with exactly this shape (``None``: any length)."""
    try:
        copy = np.array(_real(value), dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"{name} must be an array of numbers; got {value!r:.100}") from error
    if copy.shape != shape:
        floats(name, copy, shape)
        if copy.ndim != len(shape):
            raise ArgumentError(
                f"{name} must have {len(shape)} dimension(s); got shape {copy.shape}"
            )
    copy.flags.writeable = False
    return copy


def wholes(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Ints:
    """A read-only copy of `value`, whole numbers with exactly this shape."""
    try:
        given = np.asarray(value)
        copy, kind = given.astype(np.int64), given.dtype.kind
        exact = kind in "ib" or (kind == "u" and bool((copy == given).all()))
    except (TypeError, ValueError, OverflowError):
        exact = False
    if not exact:
        raise ArgumentError(f"{name} must be whole numbers; got {value!r:.100}")
    if copy.shape != shape:
        raise ArgumentError(f"{name} must have shape {shape}; got {copy.shape}")
    copy.flags.writeable = False
    return copy


def each(name: str, value: ArrayLike, count: int) -> Floats:
    """`value` as one number for each of so many rows, (count,); one alone stands for all."""
    given = floats(name, value)
    if given.shape not in ((), (1,), (count,)):
        raise ArgumentError(f"{name} must be one number or {count}; got shape {given.shape}")
    return np.broadcast_to(given, count)


def _real(value: ArrayLike) -> ArrayLike:
    """The value itself, which must not be complex: NumPy would drop its imaginary part."""
    if getattr(getattr(value, "dtype", None), "kind", "f") == "c":
        raise TypeError("complex")
    return value


def assign(record: object, **values: object) -> None:
    """Set fields of a frozen record while it is being made: the one place that may."""
    for name, value in values.items():
        object.__setattr__(record, name, value)


def freeze(record: object, **shapes: tuple[int | None, ...]) -> None:
    """Turn fields of a frozen record into read-only arrays of these shapes, while it is being made.

    For the record's `__post_init__`; ``None`` stands for any length. It raises an `ArgumentError`
    if a field is not numeric or has another shape.
    """
    for name, shape in shapes.items():
        assign(record, **{name: frozen(name, getattr(record, name), shape)})


def solve_definite(matrix: Floats, right: Floats) -> Floats:
    """The x of A x = b for a covariance or a precision A, (C, C); b is (C,) or (C, N).

    NumPy's own, which takes any A, takes three to five times as long for a few unknowns. Where
    rounding has left A no longer positive definite, it answers.
    """
    _, solution, refused = _lapack().dposv(matrix, right)
    return np.asarray(np.linalg.solve(matrix, right) if refused else solution)


def inverse_and_log_det(matrix: Floats) -> tuple[Floats, float]:
    """Inverse of a covariance or a precision, (C, C), and the logarithm of its determinant.

    NumPy answers where `solve_definite` leaves it to it.
    """
    factor, refused = _lapack().dpotrf(matrix)
    if refused:
        inverse = np.linalg.inv(matrix)
        return np.asarray(inverse, dtype=np.float64), float(np.linalg.slogdet(matrix)[1])
    half, _ = _lapack().dpotri(factor)
    whole = half + half.T
    whole.flat[:: len(half) + 1] *= 0.5
    return whole, 2.0 * math.fsum(map(math.log, factor.diagonal().tolist()))


@functools.cache
def _lapack() -> Any:
    """LAPACK's own functions, loaded by whoever needs them first: importing it takes a while."""
    from scipy.linalg import lapack

    return lapack


def log_density(values: Floats, covariance: Floats) -> float:
    """Logarithm of the normal density of values (C,) of mean 0 and a covariance (C, C)."""
    precision, log_det = inverse_and_log_det(2 * np.pi * covariance)
    return -0.5 * (2 * np.pi * float(values @ precision @ values) + log_det)


def cross(first: Floats, second: Floats) -> Floats:
    """Vector products of (..., 3) and (..., 3); numpy's own takes three times as long."""
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)
