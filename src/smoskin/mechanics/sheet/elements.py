"""Stretch of bars and fold of hinges, with the forces that they exert: the sheet's two equations.

Both are written for displacements of nodes, so that the tiny strains of stiff panels keep all
their digits. Arrays carry the batch last, (..., 3, B), so that one element of neighbouring
presses fills a vector register.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

_SERIES = tuple((-1) ** k / (2 * k + 1) for k in range(18))
"""Series of atan(t) / t by t^2, good to the last digit up to t = tan(pi/8)."""


class Stretch(NamedTuple):
    """How much bars are longer than at rest: s = (l^2 - L^2) / (2 L)."""

    value: Array
    """(E, B), m: s."""
    direction: Array
    """(E, 3, B): derivative of s by the second end; by the first it is the opposite."""


class Fold(NamedTuple):
    """Angles of hinges, and the levers with which a moment acts on their nodes."""

    angle: Array
    """(H, B), rad, in (-pi, pi): 0 where both triangles lie in a plane."""
    normals: tuple[Array, Array]
    """(H, 3, B), m^2: normals of the triangles, as long as twice their areas."""
    levers: tuple[Array, Array]
    """(H, B), 1/m^3: derivative of the angle by a wing over that normal."""
    shares: tuple[Array, Array]
    """(H, B): place of each wing along the axis, 0 at its start and 1 at its end."""


def stretch(span: Array, length: Array, growth: Array) -> Stretch:
    """Stretch of bars whose ends moved apart.

    At rest the second end lies at `span`, (E, 3, 1), m, from the first, `length`, (E, 1), m, away;
    it moved past the first by `growth`, (E, 3, B), m.

    Notes
    -----
    Source: Green's strain of a bar, times its length; the energy is EA / (2 L) of its square.
    Valid for small strains and any rotation.
    """
    value = (dot(span, growth) + dot(growth, growth) / 2) / length
    return Stretch(value=value, direction=(span + growth) / length[:, None])


def fold(arms: Array, moved: Array) -> Fold:
    """Angle between the two triangles of hinges.

    `arms`, (3, H, 3, 1), m, lead at rest from the axis' start p to its end q and to the wings r and
    s; `moved`, (4, H, 3, B), m, are the displacements of p, q, r and s.

    Notes
    -----
    Source: with a = q - p and the normals n = a x (r - p), m = (s - p) x a, the angle is
    atan2((n x m) . a / |a|, n . m), continuous through flat; its derivative by a wing is
    -|a| n / n^2, and those by the axis' ends balance the wings' forces and moments.
    """
    axis, arm, wing = arms + (moved[1:] - moved[0])
    left, right = _cross(axis, arm), _cross(wing, axis)
    # Each of these feeds many others; without the barrier they are computed anew for each.
    barrier: Callable[[tuple[Array, ...]], tuple[Array, ...]] = jax.lax.optimization_barrier
    axis, arm, wing, left, right = barrier((axis, arm, wing, left, right))
    squared = dot(axis, axis)
    length = jnp.sqrt(squared)
    # (n x m) . a = -|a|^2 n . (s - p).
    return Fold(
        angle=_angle(-dot(left, wing) * length, dot(left, right)),
        normals=(left, right),
        levers=(-length / dot(left, left), -length / dot(right, right)),
        shares=(dot(arm, axis) / squared, dot(wing, axis) / squared),
    )


def pushes(bent: Fold, moment: Array) -> Array:
    """Derivative of the angle by the four nodes, times a moment (H, B): (4, H, 3, B), N."""
    by_one, by_other = (
        (moment * lever)[:, None] * normal
        for lever, normal in zip(bent.levers, bent.normals, strict=True)
    )
    by_end = -bent.shares[0][:, None] * by_one - bent.shares[1][:, None] * by_other
    return jnp.stack([-by_end - by_one - by_other, by_end, by_one, by_other])


def fold_curvature(arms: Array, moved: Array) -> Array:
    """Second derivative of the angle by the hinges' twelve coordinates, (H, 12, 12), rad/m^2.

    The arguments are those of `fold` for one press, with a batch of one.
    """

    def gradient(rest: Array, motion: Array) -> Array:
        bent = fold(rest.reshape(3, 1, 3, 1), motion.reshape(4, 1, 3, 1))
        return pushes(bent, jnp.ones((1, 1))).reshape(12)

    rest, motion = (jnp.moveaxis(part[..., 0], 0, 1) for part in (arms, moved))
    motion = motion.reshape(-1, 12)
    curvature: Array = jax.vmap(jax.jacfwd(gradient, argnums=1))(rest, motion)
    return curvature


def dot(left: Array, right: Array) -> Array:
    """Product of vectors in the last axis but one."""
    products = left * right
    return products[..., 0, :] + products[..., 1, :] + products[..., 2, :]


def _cross(left: Array, right: Array) -> Array:
    """Cross product of vectors in the last axis but one."""
    a, b, c = left[..., 0, :], left[..., 1, :], left[..., 2, :]
    d, e, f = right[..., 0, :], right[..., 1, :], right[..., 2, :]
    return jnp.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-2)


def _angle(sine: Array, cosine: Array) -> Array:
    """atan2 of values of any common scale, by halving the angle thrice.

    The library's atan2 is called element by element and costs as much as all the rest. Digits go
    where the angle comes near pi and the panels would touch.
    """
    tangent = sine / (cosine + jnp.sqrt(sine * sine + cosine * cosine))
    for _ in range(2):
        tangent = tangent / (1 + jnp.sqrt(1 + tangent * tangent))
    squared, series = tangent * tangent, jnp.zeros_like(tangent)
    for term in reversed(_SERIES):
        series = series * squared + term
    return 8 * tangent * series
