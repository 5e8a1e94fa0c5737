"""Touches: their patches on the vertices, and what they may be."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import (
    FINGERTIP,
    Sliding,
    Touches,
    cover_shares,
    patch_shares,
    patch_slopes,
    touches_of,
    vertex_shares,
)
from smoskin.origami.geometry import geometry
from smoskin.records import Contact

PRESS = (0.0, 0.0, -0.5)
on_skin = st.tuples(st.floats(0.0, 0.120), st.floats(0.0, 0.160))


def touch_at(position, radius=FINGERTIP):
    return Touches(position=[[position]], force=[[PRESS]], radius=radius)


@given(position=on_skin, radius=st.floats(1e-4, 2e-2))
def test_a_patch_shares_its_touch_out_whole(planar, position, radius):
    shares = patch_shares(planar, touch_at(position, radius))
    assert shares.shape == (1, 1, 6, 6)
    assert shares.sum() == pytest.approx(1, abs=1e-12)


@given(position=on_skin, radius=st.floats(1e-4, 2e-2))
def test_the_loads_of_a_touch_have_its_moment(planar, position, radius):
    """On the vertices they turn the skin as the touch does, even past the outermost vertices."""
    shares = patch_shares(planar, touch_at(position, radius))[0, 0]
    middle = np.einsum("nm,nmk->k", shares, geometry(planar).tops)
    np.testing.assert_allclose(middle, position, atol=1e-12)


def test_along_a_single_row_its_vertices_take_everything(planar):
    magnets = (replace(planar.magnets[0], corner=(0, 3)),)
    row = replace(planar, cells=(1, 6), magnets=magnets, halls=planar.halls[:1])
    shares = vertex_shares(row, [[0.0, 0.08], [0.02, 0.08]])
    np.testing.assert_array_equal(shares[0], shares[1])
    assert not patch_slopes(row, touch_at((0.005, 0.08)))[0, 0, 0].any()


@given(position=on_skin)
def test_a_patch_of_next_to_no_radius_is_a_point(planar, position):
    shares = patch_shares(planar, touch_at(position, radius=1e-9))[0, 0]
    np.testing.assert_allclose(shares, vertex_shares(planar, position), atol=1e-6)


def test_a_patch_is_the_mean_over_its_disc(planar):
    """Against a fine grid of points in the disc."""
    middle, radius = np.array([0.031, 0.064]), 9e-3
    grid = np.linspace(-radius, radius, 400)
    disc = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    disc = disc[(disc**2).sum(axis=1) <= radius**2]
    mean = vertex_shares(planar, middle + disc).mean(axis=0)
    np.testing.assert_allclose(
        patch_shares(planar, touch_at(middle, radius))[0, 0], mean, atol=3e-3
    )


@given(position=st.tuples(st.floats(0.02, 0.1), st.floats(0.03, 0.13)))
def test_a_patch_inside_keeps_its_middle(planar, position):
    """Shares that are linear between vertices do not move the centre of a symmetric patch much."""
    shares = patch_shares(planar, touch_at(position))[0, 0]
    middle = np.einsum("nm,nmd->d", shares, geometry(planar).tops)
    np.testing.assert_allclose(middle, position, atol=2e-5 + 1e-12)


def test_mirrored_patches_have_mirrored_shares(planar):
    shares = patch_shares(planar, touch_at((0.037, 0.052)))[0, 0]
    other = patch_shares(planar, touch_at((0.120 - 0.037, 0.160 - 0.052)))[0, 0]
    extent = geometry(planar).tops[-1, -1] + geometry(planar).tops[0, 0]
    np.testing.assert_allclose(extent, [0.120, 0.160], atol=1e-5)
    np.testing.assert_allclose(shares, other[::-1, ::-1], atol=1e-3)


def test_slopes_are_the_derivatives_of_the_shares(planar):
    rng = np.random.default_rng(1)
    where = rng.uniform([0.001, 0.001], [0.119, 0.159], (40, 2, 2))
    force = np.broadcast_to(PRESS, (40, 2, 3))
    slopes = patch_slopes(planar, Touches(position=where, force=force))
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = 1e-9
        more, less = (
            patch_shares(planar, Touches(position=where + sign * step, force=force))
            for sign in (1, -1)
        )
        np.testing.assert_allclose((more - less) / 2e-9, slopes[:, :, axis], atol=1e-5)


def test_a_cover_panel_takes_its_cells_touches(planar):
    touches = Touches(
        position=[[(0.001, 0.001), (0.0199, 0.0268)], [(0.12, 0.16), (0.06, 0.08)]],
        force=[[PRESS, PRESS], [PRESS, PRESS]],
    )
    shares = cover_shares(planar, touches)
    assert np.argwhere(shares).tolist() == [
        [0, 0, 0, 0],
        [0, 1, 0, 1],
        [1, 0, 5, 5],
        [1, 1, 3, 3],
    ]
    np.testing.assert_array_equal(shares.sum(axis=(2, 3)), 1)


def test_touches_are_made_of_contacts():
    contacts = [Contact(position=(0.01, 0.02), force=(0.1, 0.0, -0.4))]
    touches = touches_of([contacts, [], contacts * 2], radius=2e-3)
    assert len(touches) == 3
    assert touches.pressed.tolist() == [[True, False], [False, False], [True, True]]
    np.testing.assert_array_equal(touches.force[2, 1], [0.1, 0.0, -0.4])
    np.testing.assert_array_equal(touches.radius, 2e-3)
    assert not touches.position.flags.writeable
    assert touches_of([]).force.shape == (0, 0, 3)


def test_places_without_a_touch_may_lie_anywhere(planar):
    nowhere = Touches(position=[[(9.0, 9.0)]], force=[[(0.0, 0.0, 0.0)]])
    assert patch_shares(planar, nowhere).sum() == pytest.approx(1)


@pytest.mark.parametrize("weigh", [patch_shares, patch_slopes, cover_shares])
def test_touches_off_the_skin_are_refused(planar, weigh):
    with pytest.raises(
        ArgumentError, match=r"position must lie on the skin.*got \(121\.0, 10\.0\)"
    ):
        weigh(planar, touch_at((0.121, 0.010)))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("end", [0.0, 1.0])
def test_the_skin_ends_at_its_rim(planar, axis, end):
    """A micrometre off is rounding, more is not."""
    rim = geometry(planar).extent / 2
    rim[axis] *= 2 * end
    out = np.zeros(2)
    out[axis] = 2 * end - 1
    assert patch_shares(planar, touch_at(rim + 0.9e-6 * out)).sum() == pytest.approx(1)
    for off in (1.1e-6, 5e-3):
        with pytest.raises(ArgumentError, match="position must lie on the skin"):
            patch_shares(planar, touch_at(rim + off * out))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"force": [[(0.0, 0.0, 0.1)]]}, r"force must be finite and press, with z <= 0 N; got"),
        ({"force": [[(np.nan, 0.0, -0.1)]]}, "force must be finite and press"),
        ({"force": [[PRESS, PRESS]]}, r"force must have shape \(\.\.\., 1, 1, 3\)"),
        ({"position": [[(np.inf, 0.0)]]}, "position must be finite"),
        ({"position": [(0.01, 0.02)]}, r"position must have .*shape"),
        ({"radius": 0.0}, "radius must be positive and finite; got 0.0 m"),
        ({"radius": -1e-9}, "radius must be positive and finite; got -1e-09 m"),
        ({"radius": np.inf}, "radius must be positive and finite; got inf m"),
        ({"force": [[(0.0, 0.0, 1e-12)]]}, r"force must be finite and press, with z <= 0 N; got"),
    ],
)
def test_wrong_touches_are_refused(wrong, message):
    given = {"position": [[(0.01, 0.02)]], "force": [[PRESS]]} | wrong
    with pytest.raises(ArgumentError, match=message):
        Touches(**given)


def test_friction_is_a_number_from_zero_up():
    assert Sliding(friction=0.0).friction == 0.0
    for wrong in (-1e-9, np.inf, np.nan):
        with pytest.raises(ArgumentError, match=rf"friction must be finite and >= 0; got {wrong}"):
            Sliding(friction=wrong)
