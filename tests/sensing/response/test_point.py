"""One touch or two at a time: the same as a batch of them, with slopes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.sensing.response.basis import TouchBasis
from smoskin.sensing.response.fit import table_curvature
from smoskin.sensing.response.point import PointWindows
from tables_of_response import (
    BASIS,
    plain,
    random_table,
    random_touches,
    reduced_table,
    with_coupling,
)

PLACES = np.array([-0.004, 0.0, 0.006, 0.0101, 0.0152, 0.0231, 0.028, 0.0329, 0.0451, 0.049, 0.06])
"""m: outside, at the rim, round vertices and between them."""
AT = np.array([[0.031, 0.047], [0.0601, 0.081], [0.10, 0.12], [0.003, 0.158]])
PUSH = np.array([[0.1, -0.05, -0.5], [0.0, 0.0, -0.9], [-0.2, 0.1, -0.3], [0.05, 0.0, -0.7]])
WHERE = np.array([[[0.031, 0.047], [0.0601, 0.101]], [[0.098, 0.13], [0.02, 0.04]]])
PRESS = np.array([[0.5, 0.3], [0.8, 0.6]])


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def straight(press):
    force = np.zeros((*press.shape, 3))
    force[..., 2] = -press
    return force


@pytest.mark.parametrize("lines", [BASIS.lines_x, BASIS.lines_y, np.array([0.02])])
@pytest.mark.parametrize("other", [BASIS.lines_y, np.array([0.02])])
def test_windows_have_the_same_functions(lines, other):
    basis = TouchBasis(extent=(0.06, 0.06), lines_x=lines, lines_y=other, radius=BASIS.radius)
    vertices = (lines[:, None] + basis.radius * np.array([-1.0, -0.999, 0.0, 0.999, 1.0])).ravel()
    x = np.concatenate([PLACES, vertices])
    place = np.stack([x, np.roll(x, 3)], axis=1)
    windows = PointWindows(basis)
    first, rates = windows.near(place)
    near, vertices = windows.products(rates)[..., ::2, ::2], windows.vertices(first)
    near = near.reshape(len(place), 3, -1)
    (phi, by_x), (psi, by_y) = basis.along_x(place[:, 0]), basis.along_y(place[:, 1])
    n, m = len(lines), len(other)
    for row, (along, across) in enumerate(((phi, psi), (by_x, psi), (phi, by_y))):
        whole = (along[:, :n, None] * across[:, None, :m]).reshape(len(x), -1)
        for k in range(len(x)):
            summed = np.bincount(vertices[k], near[k, row], n * m)
            assert_allclose(summed, whole[k], atol=1e-8)
    for axis, (count, pair) in enumerate(((n, (phi, by_x)), (m, (psi, by_y)))):
        for k, at in enumerate(first[:, axis]):
            width = min(windows.width, count - at)
            for row, expected in enumerate(pair):
                shares, products = rates[k, axis, row, ::2], rates[k, axis, row, 1::2]
                assert_allclose(shares[:width], expected[k, at : at + width], atol=1e-10)
                part = expected[k, count + at : count + at + width - 1]
                assert_allclose(products[: width - 1], part, atol=1e-8)
                assert not shares[width:].any()


@pytest.mark.parametrize("temperature", [REFERENCE_TEMPERATURE, 15.0])
def test_one_touch_at_a_time_says_the_same_as_a_batch(skin, temperature):
    table = reduced_table(skin)
    table = replace(table, warmth=0.001 * table.mean)
    batch = table.signals(AT, PUSH, temperature)
    point = table.point_table(temperature)
    assert point.at(AT, PUSH)[0] == pytest.approx(batch, abs=1e-12)
    singly = [point.at(p[None], f[None])[0][0] for p, f in zip(AT, PUSH, strict=True)]
    assert np.stack(singly) == pytest.approx(batch, abs=1e-12)
    scanned, slopes = point.scan(AT[:, 0], AT[:, 1], PUSH[0])
    for k, place in enumerate(AT):
        (value,), (slope,) = point.at(place[None], PUSH[:1])
        assert scanned[k] == pytest.approx(value, abs=1e-12)
        assert slopes[k] == pytest.approx(slope, abs=1e-10)


def test_a_point_has_the_slopes_of_its_signals_on_any_skin():
    table = random_table()
    place, force = random_touches(8, seed=2)
    point = table.point_table()
    slopes = table.slopes(place, force)
    for k in range(8):
        (value,), (slope,) = point.at(place[k : k + 1], force[k : k + 1])
        assert_allclose(slope, slopes[k].T, rtol=1e-9, atol=1e-12)
        many = point.scan(place[:, 0], place[:, 1], force[k])
        assert_allclose(many[0][k], value, rtol=1e-9, atol=1e-15)
        assert_allclose(many[1][k], slope, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("row", [0, 1])
def test_one_pair_at_a_time_says_the_same_with_slopes(skin, row):
    table = replace(reduced_table(skin), grip=grip_compliance(skin))
    coupled = replace(table, curvature=table_curvature(table))
    point = coupled.point_table()
    place, press = WHERE[row], PRESS[row]
    (values,), (slopes,) = point.pairs(place[None], press[None])
    whole = coupled.together(place[None], straight(press)[None])[0]
    assert values == pytest.approx(whole, abs=1e-12)
    for k, step in enumerate([1e-6, 1e-6, 1e-5] * 2):
        ends = []
        for side in (-1, 1):
            at = np.concatenate([place, press[:, None]], axis=1).ravel()
            at[k] += side * step
            at = at.reshape(2, 3)
            ends.append(point.pairs(at[None, :, :2], at[None, :, 2])[0][0])
        slope = (ends[1] - ends[0]) / (2 * step)
        assert slopes[k] == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(slope).max())


def test_slopes_of_a_pair_are_derivatives_on_any_skin():
    table, rng = with_coupling(random_table(chips=(0, 1))), np.random.default_rng(7)
    place = rng.uniform(0, BASIS.extent, (6, 2, 2))
    point = table.point_table()
    for where, press in zip(place, rng.uniform(0.2, 1.0, (6, 2)), strict=True):
        (values,), (slopes,) = point.pairs(where[None], press[None])
        whole = table.together(where[None], straight(press)[None])[0]
        assert_allclose(values, whole, rtol=1e-9, atol=1e-12)
        at = np.concatenate([where, press[:, None]], axis=1).ravel()
        for k, step in enumerate([1e-7, 1e-7, 1e-6] * 2):
            ahead, behind = (
                (at + side * step * np.eye(6)[k]).reshape(2, 3) for side in (1.0, -1.0)
            )
            change = point.pairs(ahead[None, :, :2], ahead[None, :, 2])[0][0]
            change = change - point.pairs(behind[None, :, :2], behind[None, :, 2])[0][0]
            size = np.abs(slopes[k]).max()
            assert_allclose(slopes[k], change / (2 * step), atol=1e-4 * size)


def test_many_pairs_at_once_say_what_each_says():
    table, rng = with_coupling(random_table(chips=(0, 1))), np.random.default_rng(8)
    place, press = rng.uniform(0, BASIS.extent, (6, 2, 2)), rng.uniform(0.2, 1.0, (6, 2))
    point = table.point_table()
    for whole, *each in zip(
        point.pairs(place, press),
        *(point.pairs(p[None], f[None]) for p, f in zip(place, press, strict=True)),
        strict=True,
    ):
        assert_allclose(whole, np.concatenate(each), rtol=1e-9, atol=1e-12)
