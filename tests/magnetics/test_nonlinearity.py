"""Fields that bend: against the magnets' own, and freed of it."""

import numpy as np
import pytest

from smoskin.magnetics import sector
from smoskin.magnetics.nonlinearity import (
    Bend,
    cross_signals,
    field_curvature,
    straightened,
)
from smoskin.origami.geometry import geometry


def changes(design, shift):
    """Of each chip's field when it moves so against its magnet, (3 S,), T."""
    differences = []
    for site, rest in zip(design.halls, geometry(design).rest, strict=True):
        magnet = design.magnet(site.magnet)
        differences.append(sector.field(magnet, rest + shift) - sector.field(magnet, rest))
    return np.concatenate(differences)


def test_two_motions_of_a_magnet_read_as_that_says(planar):
    curvature = field_curvature(planar)
    u, v = np.array([1e-4, -5e-5, 8e-5]), np.array([-3e-5, 1e-4, 6e-5])
    first, second, both = (changes(planar, shift) for shift in (u, v, u + v))
    missing = both - first - second
    left = missing - cross_signals(curvature, first, second)
    assert np.abs(missing).max() > 50e-6
    assert np.abs(left).max() < 0.1 * np.abs(missing).max()


def test_its_own_field_has_no_sources(planar):
    """Neither divergence nor curl: the second derivatives behind it are harmonic and symmetric."""
    curvature = field_curvature(planar)
    assert curvature == pytest.approx(curvature.swapaxes(1, 2), abs=1e-3 * np.abs(curvature).max())


def test_the_product_of_two_motions_is_that_of_each_chip():
    rng = np.random.default_rng(3)
    curvature, first, second = rng.normal(size=(2, 3, 3, 3)), rng.normal(size=6), rng.normal(size=6)
    expected = np.einsum("sijk,si,sj->sk", curvature, first.reshape(2, 3), second.reshape(2, 3))
    assert cross_signals(curvature, first, second) == pytest.approx(expected.ravel())


def test_signals_freed_of_their_curvature_add_up():
    rng = np.random.default_rng(2)
    bend = rng.normal(size=(2, 3, 3, 3))
    bend = bend + bend.swapaxes(1, 2)
    flat = rng.normal(size=(2, 20, 6)) * 2e-3
    first, second, both = (Bend(bend).bent(u) for u in (flat[0], flat[1], flat.sum(axis=0)))
    assert straightened(bend, both) == pytest.approx(flat.sum(axis=0), abs=1e-8)
    assert Bend(bend).bent(straightened(bend, both)) == pytest.approx(both, abs=1e-8)
    # To second order in the signals.
    together = first + second + cross_signals(bend, first, second)
    missed, plainly = (np.abs(total - both).max() for total in (together, first + second))
    assert missed < 0.1 * plainly
