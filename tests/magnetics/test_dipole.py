"""Dipoles: on their axis, beside it, and as parts of a magnet."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.magnetics import sector
from smoskin.magnetics.dipole import dipole_field, sector_dipoles


def test_a_dipole_on_its_axis_and_beside_it():
    moment = np.array([0.0, 0.0, 2.0])
    away = np.array([[0.0, 0.0, 0.5], [0.5, 0.0, 0.0]])
    field = dipole_field(np.broadcast_to(moment, (2, 3)), away)
    assert_allclose(field, 1e-7 * 2.0 / 0.125 * np.array([[0, 0, 2.0], [0, 0, -1.0]]), rtol=1e-12)


def test_its_field_has_neither_sources_nor_curl():
    moment, at, step = np.array([0.3, -0.2, 0.5]), np.array([0.04, 0.03, -0.05]), 1e-5
    around = at + step * np.concatenate([np.eye(3), -np.eye(3)])
    field = dipole_field(np.broadcast_to(moment, (6, 3)), around)
    slope = (field[:3] - field[3:]) / (2 * step)
    assert_allclose(slope, slope.T, atol=1e-6 * np.abs(slope).max())
    assert abs(np.trace(slope)) < 1e-6 * np.abs(slope).max()


@pytest.mark.parametrize("polarity", [1, -1])
def test_sectors_stronger_by_all_their_strength_are_the_magnet_again(planar, polarity):
    from dataclasses import replace

    magnet = replace(planar.magnets[1], polarity=polarity)
    places, moments = sector_dipoles(magnet, np.ones(4))
    points = np.array([[0.0, 0.0, -7e-3], [1e-3, 2e-3, -7e-3], [4e-3, -3e-3, -8e-3]])
    field = dipole_field(moments, points[:, None] - places).sum(axis=1)
    exact = sector.field(magnet, points)
    assert_allclose(field, exact, atol=0.03 * np.abs(exact).max())


def test_a_sector_of_its_own_pulls_along_its_bisector(planar):
    magnet = planar.magnets[1]
    for sector_number in range(4):
        strengths = np.eye(4)[sector_number] * 0.1
        places, moments = sector_dipoles(magnet, strengths)
        whole = moments.sum(axis=0)
        angle = np.pi / 2 * (sector_number + 0.5)
        volume = np.pi * magnet.radius**2 * magnet.height / 4
        expected = -0.1 * magnet.remanence * volume * np.array([np.cos(angle), np.sin(angle), 0])
        assert_allclose(whole, expected, atol=1e-12)
        strong = np.abs(moments).sum(axis=1) > 0
        middle = places[strong].mean(axis=0)
        assert middle[:2] @ expected[:2] < 0
