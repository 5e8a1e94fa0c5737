"""The functions of place and force that response tables are made of."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import FINGERTIP, Touches, patch_shares
from smoskin.sensing.response.basis import TouchBasis
from tables_of_response import BASIS, plain, random_touches

PLACES = np.array([-0.004, 0.0, 0.006, 0.0101, 0.0152, 0.0231, 0.028, 0.0329, 0.0451, 0.049, 0.06])
"""m: outside, at the rim, round vertices and between them."""


def hat(lines, k):
    """Share of vertex k in a point, past the outermost by a lever over the last two."""

    def share(x):
        left = min(max(np.searchsorted(lines, x) - 1, 0), len(lines) - 2)
        along = (x - lines[left]) / (lines[left + 1] - lines[left])
        return {left: 1 - along, left + 1: along}.get(k, 0.0)

    return share


def over_the_disc(function, x, radius):
    """Mean over a disc, by the midpoint rule in the angle that makes its density even."""
    angle = (np.arange(4000) + 0.5) * np.pi / 4000
    weight = 2 / np.pi * np.sin(angle) ** 2
    return np.mean(weight * [function(x + radius * np.cos(a)) for a in angle]) * np.pi


@pytest.mark.parametrize("axis", ["x", "y"])
def test_shares_are_means_of_a_points_over_the_disc(axis):
    lines, along = (BASIS.lines_x, BASIS.along_x) if axis == "x" else (BASIS.lines_y, BASIS.along_y)
    # Ramps carry on straight past the ends, so that the mean there is the middle's.
    n = len(lines)
    phi = along(PLACES)[0]
    assert phi.shape == (len(PLACES), 2 * n - 1)
    for k in range(n):
        expected = [over_the_disc(hat(lines, k), x, BASIS.radius) for x in PLACES]
        assert_allclose(phi[:, k], expected, atol=1e-5)
    assert_allclose(phi[:, n:], phi[:, : n - 1] * phi[:, 1:n], atol=1e-15)


def test_the_functions_are_the_shares_that_load_the_vertices(planar):
    skin = plain(planar)
    place = np.array([[0.031, 0.047], [0.0601, 0.081], [0.10, 0.12], [0.003, 0.158]])
    basis = TouchBasis.of(skin)
    assert basis.radius == FINGERTIP
    assert basis.shape == (11, 11, 15)
    touches = Touches(position=place[:, None], force=np.tile([0.0, 0.0, -0.5], (4, 1, 1)))
    x, y = basis.along_x(place[:, 0])[0][:, :6], basis.along_y(place[:, 1])[0][:, :6]
    separable = x[:, :, None] * y[:, None, :]
    assert_allclose(separable.sum(axis=(1, 2)), 1.0)
    # Apart from the disc's corners and the rule that averages over it.
    assert_allclose(separable, patch_shares(skin, touches)[:, 0], atol=0.01)


def test_slopes_of_functions_are_derivatives():
    for along in (BASIS.along_x, BASIS.along_y):
        difference = (along(PLACES + 1e-8)[0] - along(PLACES - 1e-8)[0]) / 2e-8
        assert_allclose(along(PLACES)[1], difference, atol=1e-4)
    force = random_touches(6)[1]
    slopes = BASIS.products(force)[1]
    for k, step in enumerate(1e-6 * np.eye(3)):
        ahead, behind = (BASIS.products(force + sign * step)[0] for sign in (1, -1))
        assert_allclose(slopes[:, k], (ahead - behind) / 2e-6, atol=1e-8)


def test_products_of_forces_are_those_up_to_third_order_with_the_normal_one():
    x, y, z = force = np.array([0.3, -0.2, -0.7])
    expected = [x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]
    expected += [z**3, x * z * z, y * z * z, x * x * z, y * y * z, x * y * z]
    assert_allclose(BASIS.products(force)[0], expected)


def test_rows_hold_every_product_and_sums_sum_them():
    place, force = random_touches(2053)
    rows = BASIS.rows(place, force)
    phi, psi = BASIS.along_x(place[:, 0])[0], BASIS.along_y(place[:, 1])[0]
    g = BASIS.products(force)[0]
    assert_allclose(rows, np.einsum("bp,bq,bd->bpqd", phi, psi, g).reshape(len(place), -1))
    coefficients = np.random.default_rng(2).normal(size=(*BASIS.shape, 4))
    expected = np.einsum("bp,bq,bd,pqdv->bv", phi, psi, g, coefficients, optimize=True)
    # More touches than are laid out at once, and none.
    assert_allclose(BASIS.sums(coefficients, place, force), expected, atol=1e-12)
    assert BASIS.sums(coefficients, place[:0], force[:0]).shape == (0, 4)


def test_slopes_of_sums_are_derivatives():
    place, force = random_touches(7)
    coefficients = np.random.default_rng(3).normal(size=(*BASIS.shape, 2))
    values, slopes = BASIS.sums_and_slopes(coefficients, place, force)
    assert_allclose(values, BASIS.sums(coefficients, place, force), atol=1e-12)
    both = np.concatenate([place, force], axis=1)
    for k, step in enumerate(np.diag([1e-7, 1e-7, 1e-6, 1e-6, 1e-6])):
        ahead, behind = (
            BASIS.sums(coefficients, at[:, :2], at[:, 2:]) for at in (both + step, both - step)
        )
        difference = (ahead - behind) / (2 * step[k])
        assert_allclose(slopes[:, k], difference, rtol=1e-5, atol=1e-5)


def test_what_is_no_basis_is_refused():
    good = {"extent": (0.06, 0.05), "lines_x": (0.0, 0.06), "lines_y": (0.02,)}
    basis = TouchBasis(**good)
    assert (basis.radius, basis.vertices) == (FINGERTIP, 2)
    assert_array_equal(basis.exponents.dtype, np.int64)
    for name, wrong in (
        ("lines_x", (-1e-9, 0.06)), ("lines_x", (0.0, 0.0601)), ("lines_x", (0.02, 0.02)),
        ("lines_y", ()), ("lines_y", (0.04, 0.03)), ("lines_y", (0.055,)),
        ("lines_y", (0.01, 0.04, 0.03)),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=f"{name} must rise within"):
            TouchBasis(**(good | {name: wrong}))
    for radius in (0.0, 11.0, np.inf, np.nan):
        with pytest.raises(ArgumentError, match="radius and extent must be positive"):
            TouchBasis(**good, radius=radius)
    for wrong in (
        [(0, 0, 0)],
        [(1, 0, 0), (2, -1, 0)],
        [(0.5, 0, 1)],
        [(99, 0, 0)],
        np.zeros((0, 3)),
    ):
        with pytest.raises(ArgumentError, match="exponents must be whole"):
            TouchBasis(**good, exponents=wrong)
    with pytest.raises(ArgumentError, match="exponents must have shape"):
        TouchBasis(**good, exponents=[(1, 0)])
    with pytest.raises(ValueError, match="read-only"):
        basis.exponents[0, 0] = 2


def test_what_is_no_batch_of_touches_is_refused():
    place, force = random_touches(3)
    for wrong in ((place[:2], force), (place, force[:2]), (place[None], force[None])):
        with pytest.raises(ArgumentError, match="position and force must have shapes"):
            BASIS.rows(*wrong)
    with pytest.raises(ArgumentError, match="force must have shape"):
        BASIS.rows(place, place)


@pytest.mark.parametrize("shapes", [((2, 1, 2), (2, 3)), ((2, 2), (3, 3)), ((2, 2), (2, 1, 3))])
def test_touches_are_rows_of_places_and_as_many_of_forces(shapes):
    with pytest.raises(ArgumentError, match=r"must have shapes \(B, 2\) and \(B, 3\)"):
        TouchBasis(extent=(0.06, 0.05), lines_x=(0.0, 0.06), lines_y=(0.02,)).rows(
            *map(np.zeros, shapes)
        )
