"""What two touches do to each other: how they hold the sheet, and what a table makes of it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.magnetics.nonlinearity import cross_signals
from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Touches, patch_shares
from smoskin.sensing.response.fit import add_coupling, table_curvature
from smoskin.sensing.response.pairs import mutual_drags
from tables_of_response import BASIS, plain, random_table, reduced_table, with_coupling

WHERE = np.array([[[0.031, 0.047], [0.0601, 0.101]], [[0.098, 0.13], [0.02, 0.04]]])
PRESS = np.array([[0.5, 0.3], [0.8, 0.6]])


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


@pytest.fixture(scope="module")
def grip(skin):
    return grip_compliance(skin)


@pytest.fixture(scope="module")
def coupled(skin, grip):
    """A table that knows how touches hold the sheet and how fields bend."""
    table = replace(reduced_table(skin), grip=grip)
    return replace(table, curvature=table_curvature(table))


def straight(press):
    force = np.zeros((*press.shape, 3))
    force[..., 2] = -press
    return force


def test_how_the_sheet_gives_way_is_reciprocal(grip):
    sideways = grip[..., :2].reshape(72, 72)
    assert sideways == pytest.approx(sideways.T, rel=1e-6, abs=1e-12)
    assert np.linalg.eigvalsh(sideways).min() > 0


@pytest.mark.slow
def test_touches_of_the_whole_sheet_drag_each_other_so(skin, grip):
    sheet = BarHinge(skin)
    light = 1e-3 * PRESS
    pairs = Touches(position=WHERE, force=straight(light))
    both = sheet.press(pairs).reaction
    alone = [
        sheet.press(Touches(position=WHERE[:, [k]], force=straight(light[:, [k]]))).reaction[:, 0]
        for k in (0, 1)
    ]
    shares = patch_shares(skin, pairs).reshape(2, 2, -1)
    expected = both - np.stack(alone, axis=1)
    drags, _ = mutual_drags(grip, shares, light)
    assert drags == pytest.approx(expected, rel=5e-3, abs=2e-3 * np.abs(expected).max())
    assert mutual_drags(np.zeros_like(grip), shares, light)[0] == pytest.approx(0.0)


def test_a_table_shows_how_its_fields_bend(skin, coupled):
    """Two forces at one place are one touch with their sum."""
    where = np.array([[0.045, 0.07], [0.08, 0.1], [0.06, 0.04]])
    first, second = np.array([[0.1, 0.2, -0.4]] * 3), np.array([[-0.2, 0.1, -0.3]] * 3)
    table = reduced_table(skin)
    alone = [table.signals(where, force) for force in (first, second)]
    both = table.signals(where, first + second)
    missing = both - sum(alone)
    left = missing - cross_signals(coupled.curvature, *alone)
    assert np.abs(left).max() < 0.25 * np.abs(missing).max()


def test_the_order_of_touches_does_not_matter(coupled):
    force = straight(PRESS)
    signals = coupled.together(WHERE, force)
    assert coupled.together(WHERE[:, ::-1], force[:, ::-1]) == pytest.approx(signals, abs=1e-12)
    plainly = sum(coupled.signals(WHERE[:, k], force[:, k]) for k in (0, 1))
    assert np.abs(signals - plainly).max() > 20e-6


def test_coupling_is_found_from_pairs(skin, grip, coupled):
    rng = np.random.default_rng(4)
    where = rng.uniform(0, coupled.basis.extent, (600, 2, 2))
    where = where[np.hypot(*(where[:, 0] - where[:, 1]).T) > 0.03]
    force = straight(rng.uniform(0.1, 1.0, where.shape[:2]))
    true = replace(coupled, curvature=1.3 * coupled.curvature)
    both = true.together(where, force).reshape(len(where), 3, 3)
    table = add_coupling(reduced_table(skin), grip, where[:-50], force[:-50], both[:-50])
    late = where[-50:], force[-50:]
    flat = both[-50:].reshape(50, -1)
    added = sum(table.signals(late[0][:, k], late[1][:, k]) for k in (0, 1))
    left, before = (np.sqrt(np.mean((sums - flat) ** 2)) for sums in (table.together(*late), added))
    assert left < 0.05 * before
    assert np.linalg.eigvalsh(table.pair_misfit).min() >= -1e-20
    # What it takes to be unsure covers what it misses.
    stated = np.sqrt(np.trace(table.pair_misfit) / 9 * np.mean((late[1] ** 2).sum(axis=(1, 2))))
    assert left < 2 * stated


def test_chips_left_out_take_their_curvature_along(coupled):
    fewer = coupled.of_chips((2, 1))
    whole = coupled.together(WHERE, straight(PRESS)).reshape(-1, 3, 3)
    signals = fewer.together(WHERE, straight(PRESS))
    assert signals == pytest.approx(whole[:, [2, 1]].reshape(-1, 6))


@pytest.fixture(scope="module")
def small():
    rng = np.random.default_rng(7)
    return random_table(chips=(0, 1)), rng.uniform(0, BASIS.extent, (6, 2, 2)), rng


def test_no_patch_moves_that_is_held(small):
    """Against the equations of equilibrium, written out one pair after the other."""
    table, place, rng = small
    press = rng.uniform(0.1, 1.0, (6, 2))
    shares = table.basis.vertex_shares(place)
    drags, _ = mutual_drags(table.grip, shares, press)
    for a, p, extra in zip(shares, press, drags, strict=True):
        moved = np.einsum("ih,hdge,jg->idje", a, table.grip, a)
        alone = [np.linalg.solve(moved[k, :, k, :2], -moved[k, :, k, 2] * p[k]) for k in (0, 1)]
        forces = np.concatenate([alone + extra, -0.0 + p[:, None]], axis=1)
        left = np.einsum("idje,je->id", moved, forces)
        assert_allclose(left, 0.0, atol=1e-6 * np.abs(moved).max())
        assert np.abs(extra).max() > 1e-3 * p.max()


def test_pairs_read_their_sum_their_drags_and_the_curvature(small):
    table, place, rng = small
    force = straight(rng.uniform(0.1, 1.0, (6, 2)))
    shares = table.basis.vertex_shares(place)
    drags, _ = mutual_drags(table.grip, shares, -force[..., 2])
    force[..., :2] += drags
    first, second = (table.signals(place[:, k], force[:, k]) for k in (0, 1))
    product = np.einsum(
        "bsi,bsj,sijk->bsk", first.reshape(6, 2, 3), second.reshape(6, 2, 3), table.curvature
    )
    force[..., :2] -= drags
    expected = first + second + product.reshape(6, 6)
    assert_allclose(table.together(place, force), expected, rtol=1e-9, atol=1e-15)
    assert_allclose(table.dragged(place, force), [first, second], rtol=1e-9, atol=1e-15)


def test_columns_under_load_add_a_product_of_all_that_both_touches_load(small):
    """The sheet takes what each touch holds it with beside its press; order does not matter."""
    table, place, rng = small
    coupled, force = with_coupling(table), straight(rng.uniform(0.1, 1.0, (6, 2)))
    shares = table.basis.vertex_shares(place)
    moved = np.einsum("bih,hdge,bjg->bidje", shares, table.grip, shares)
    for b, (a, push) in enumerate(zip(shares, force, strict=True)):
        c = moved[b][..., :2].reshape(4, 4)
        sideways = np.linalg.solve(c, moved[b][..., 2].reshape(4, 2) @ push[:, 2]).reshape(2, 2)
        first, second = np.concatenate([sideways, -push[:, 2:]], axis=1)
        added = np.einsum("h,d,hdgec,g,e->c", a[0], first, coupled.coupling, a[1], second)
        extra = coupled.coupled(place[[b]], force[[b]])[0]
        assert_allclose(extra, added, rtol=1e-5)
        assert np.abs(extra).max() > 1e-5
    turned = coupled.together(place[:, ::-1], force[:, ::-1])
    both = coupled.together(place, force)
    assert_allclose(turned, both, rtol=1e-9, atol=1e-12)
    assert_allclose(both - table.together(place, force), coupled.coupled(place, force), atol=1e-12)
    fewer = coupled.of_chips((1,))
    assert_allclose(fewer.together(place, force), both[:, 3:], rtol=1e-9, atol=1e-12)
    assert_allclose(table.coupled(place, force), 0.0)
