"""The bound on a patch's Gaussian curvature against what is known of membranes and of spheres."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.origami.cell import fold_angle, size
from smoskin.origami.surface.analytic import Bump, Cone, Cylinder, Plane, Saddle, Sphere
from smoskin.origami.tessellation.survey import fold_range, largest_share


def test_a_slight_dome_asks_what_a_loaded_membrane_sags(planar):
    cell, radius = planar.cell, 5.0
    asked = fold_range(Sphere(radius), cell, (6, 5))
    c = np.sin(cell.fold_angle) * np.cos(cell.fold_angle)
    stiff = c / np.cos(asked.rim) ** 2, np.cos(asked.rim) ** 2 / c
    p, q = (
        n * float(side) / 2 / np.sqrt(by)
        for n, side, by in zip((6, 5), size(cell)[:2], stiff, strict=True)
    )
    odd = np.arange(1, 60, 2)
    signs = (-1.0) ** ((odd - 1) // 2)
    series = (signs / np.cosh(np.minimum(odd * np.pi * q / (2 * p), 700.0)) / odd**3).sum()
    load = np.tan(asked.rim) / np.tan(cell.fold_angle) / radius**2
    sag = load * p**2 / 2 * (1 - 32 / np.pi**3 * series)
    assert asked.middle - asked.rim == pytest.approx(sag, rel=0.003)


def test_a_long_strip_round_a_sphere_folds_as_its_parallels_shorten(planar):
    """Rows along parallels: sin(phi) goes with their radius, and the steps across with cos(phi)."""
    cell, radius = planar.cell, 0.2
    cells = (60, 6)
    asked = fold_range(Sphere(radius), cell, cells)
    angle = np.linspace(0.0, np.arccos(np.sin(asked.rim) / np.sin(asked.middle)), 2001)
    folds = np.arcsin(np.sin(asked.middle) * np.cos(angle))
    half = radius * np.trapezoid(np.cos(folds), angle) / np.cos(cell.fold_angle)
    assert asked.middle - asked.rim > np.radians(3)
    assert half == pytest.approx(cells[1] * float(size(cell).width) / 2, rel=2e-4)


@pytest.mark.parametrize(
    "surface", [Plane(), Cylinder(0.08), Cone(0.07, 0.09, 0.2), Bump(0.01, 0.05)]
)
def test_what_is_bent_one_way_or_to_and_fro_asks_nothing(planar, surface):
    asked = fold_range(surface, planar.cell, (6, 6))
    assert asked.holds
    assert asked.middle == pytest.approx(asked.rim, abs=1e-4)


def test_a_saddle_folds_its_middle_less_than_its_rim(planar):
    asked = fold_range(Saddle(0.1), planar.cell, (6, 6))
    assert asked.left[0] < asked.middle < asked.rim == asked.left[1]


def test_what_is_left_is_what_keeps_the_depth(planar):
    least, most = fold_range(Plane(), planar.cell, (1, 1)).left
    height = float(size(planar.cell).height)
    assert float(size(planar.cell, least).height) == pytest.approx(1.2 * height)
    assert float(size(planar.cell, most).height) == pytest.approx(0.8 * height)
    upright = replace(planar.cell, fold_angle=0.2)
    assert fold_range(Plane(), upright, (1, 1)).left[0] == pytest.approx(
        float(fold_angle(upright, height=upright.panel_a * np.sin(upright.sector_angle)))
    )


def test_up_to_the_largest_share_the_bound_holds(planar):
    patch = (Sphere(0.1), planar.cell, (8, 8))
    assert not fold_range(*patch).holds
    share = largest_share(*patch)
    assert 0.5 < share < 1.0
    assert fold_range(*patch, share=share).holds
    assert not fold_range(*patch, share=share + 0.01).holds
