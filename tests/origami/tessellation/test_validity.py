"""Gates notice what they are for: each fault moves its own."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.origami.cell import size
from smoskin.origami.sheet import build_sheet
from smoskin.origami.surface.analytic import Plane, Saddle, Sphere
from smoskin.origami.tessellation.arc import arc_sheet
from smoskin.origami.tessellation.conditions import net_of
from smoskin.origami.tessellation.hinges import frame_of
from smoskin.origami.tessellation.validity import (
    Candidate,
    Nominal,
    coverage,
    gates,
    intersections,
    reason,
    thinned,
)

CELLS = (3, 3)


@pytest.fixture
def regular(planar):
    """The planar sheet as a candidate, and what is expected of it."""
    sheet = build_sheet(planar.cell, CELLS)
    height = float(size(planar.cell).height)
    parameters, heights = arc_sheet(planar.cell, CELLS, np.inf)
    layers = np.column_stack([parameters.reshape(-1, 2), heights.ravel()])
    candidate = Candidate(
        surface=Plane(),
        net=net_of(sheet.facets),
        frame=frame_of(layers, sheet.facets, sheet.creases),
        layers=layers,
        vertices=layers,
        bottom=heights.ravel() == 0,
        mountain=sheet.mountain,
        closure=0.0,
        flat_foldable=True,
    )
    nominal = Nominal(
        asked=parameters.reshape(-1, 2),
        depth=height,
        plate=0.5e-3,
        column=10e-3,
        own_columns=False,
    )
    return candidate, nominal


def failing(candidate, nominal):
    return {gate.name for gate in gates(candidate, nominal) if not gate.holds}


def moved(candidate, vertex, motion):
    layers = candidate.layers.copy()
    layers[vertex] += motion
    return replace(candidate, layers=layers, vertices=layers)


def test_the_planar_sheet_passes_every_gate(regular):
    measures = {gate.name: gate for gate in gates(*regular)}
    assert len(measures) == 13
    assert all(gate.holds for gate in measures.values())
    np.testing.assert_allclose(measures["least_sector_angle"].value, 52.3184, atol=1e-4)
    np.testing.assert_allclose(measures["coverage"].value, 1.0)
    assert measures["planarity"].as_json() == {
        "name": "planarity",
        "value": measures["planarity"].value,
        "limit": 1e-9,
        "unit": "1",
        "holds": True,
    }


def test_a_fault_fails_its_gate(regular):
    candidate, nominal = regular
    lifted = failing(moved(candidate, 23, [0, 0, 0.06e-3]), nominal)  # a bottom vertex
    assert lifted == {"planarity", "angle_sum", "flat_folding", "distance_to_surface"}
    own = replace(nominal, own_columns=True)
    assert "distance_to_surface" not in failing(moved(candidate, 23, [0, 0, 0.9e-3]), own)
    assert "distance_to_surface" in failing(moved(candidate, 23, [0, 0, 1.1e-3]), own)
    assert "column_height_deviation" in failing(moved(candidate, 23, [0, 0, 1.1e-3]), nominal)
    assert "depth_deviation" in failing(moved(candidate, 24, [0, 0, 2e-3]), nominal)
    assert "creases_turned_over" in failing(moved(candidate, 24, [0, 0, -16e-3]), nominal)
    assert failing(replace(candidate, closure=2e-9), nominal) == {"unfolding_closure"}
    assert failing(candidate, replace(nominal, asked=1.04 * nominal.asked)) == {"coverage"}
    assert failing(candidate, replace(nominal, plate=2e-3)) == {"crease_gap"}
    assert failing(candidate, replace(nominal, depth=nominal.depth * 1.3)) == {"depth_deviation"}
    flat = replace(candidate, vertices=candidate.vertices * [1.0, 3.0, 1.0])
    assert {"least_sector_angle", "largest_sector_angle"} <= failing(flat, nominal)


def test_thinner_plates_change_the_gaps_alone(regular):
    candidate, nominal = regular
    thin = thinned(gates(candidate, replace(nominal, plate=2e-3)), 0.25)
    assert {g.name: g.value for g in thin} == pytest.approx(
        {g.name: g.value for g in gates(candidate, nominal)}
    )
    assert all(gate.holds for gate in thin)


def test_what_is_not_finite_does_not_hold(regular):
    candidate, nominal = regular
    gate = gates(replace(candidate, closure=np.nan), nominal)[3]
    assert not gate.holds
    assert gate.as_json()["value"] is None


def test_panels_that_pass_through_each_other_are_found():
    floor = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    wall = np.array([[0.5, 0.2, -0.5], [0.5, 0.8, -0.5], [0.5, 0.8, 0.5], [0.5, 0.2, 0.5]])
    facets, up = np.arange(8).reshape(2, 4), np.array([0, 0, 0.6])
    assert intersections(np.concatenate([floor, wall]), facets).tolist() == [[0, 1]]
    assert len(intersections(np.concatenate([floor, wall + up]), facets)) == 0
    assert len(intersections(np.concatenate([floor, floor + up]), facets)) == 0


def test_coverage_is_the_share_of_the_asked_patch_under_the_sheet(planar):
    facets = build_sheet(planar.cell, (12, 12)).facets
    line = np.linspace(-0.1, 0.1, 25)
    asked = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)

    def covered(surface, move=(0.0, 0.0), stretch=1.0):
        """Coverage of a square sheet that was moved and stretched in the chart."""
        layers = np.pad(stretch * asked + move, ((0, 0), (0, 1)))
        return coverage(surface, layers, facets, asked)

    for surface in (Plane(), Sphere(0.15), Saddle(0.1)):
        assert covered(surface) == 1.0
        assert covered(surface, stretch=1.5) == 1.0
        assert covered(surface, move=(0.25, 0.0)) == 0.0
    # Points of the patch stand 1.4 mm apart.
    assert covered(Plane(), move=(0.03, -0.05)) == pytest.approx(0.85 * 0.75, abs=0.01)
    assert covered(Plane(), stretch=0.9) == pytest.approx(0.81, abs=0.015)
    # By the stereographic chart's area element, integrated by another rule.
    fine = (np.arange(400) + 0.5) / 2000 - 0.1
    square = fine[:, None] ** 2 + fine**2
    element = (1 + square / (4 * 0.15**2)) ** -2
    share = element[120:].sum() / element.sum()
    assert covered(Sphere(0.15), move=(0.06, 0.0)) == pytest.approx(share, abs=0.01)
    # A saddle's chart makes the patch larger than the sheet, whose own area is then enough.
    element = np.sqrt(1 + square / 0.1**2)
    whole = 0.2**2 / 400**2 / 0.04
    share = element[120:].sum() * whole
    assert covered(Saddle(0.1), move=(0.06, 0.0)) == pytest.approx(share, abs=0.01)


def test_a_sheet_beside_its_patch_fails_and_tells_where_it_lies(regular):
    candidate, nominal = regular
    length, width, _ = nominal_size = np.ptp(candidate.layers, axis=0)
    assert failing(moved(candidate, slice(None), [0.02 * length, 0, 0]), nominal) == set()
    for way in ([0.1 * length, 0, 0], [0, -0.1 * width, 0], 3 * nominal_size * [1, 1, 0]):
        assert failing(moved(candidate, slice(None), way), nominal) == {"coverage"}
    away = moved(candidate, slice(None), np.array([0.2, -0.1, 0]))
    failed = [gate for gate in gates(away, nominal) if not gate.holds]
    assert reason(away, failed) == (
        "coverage is 0, its limit 0.95; the sheet's middle lies (200, -99) mm away from the patch's"
    )
