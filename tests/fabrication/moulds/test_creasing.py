"""The sheet on its way from flat to folded, and the moulds that bring it there."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import DesignError
from smoskin.fabrication.moulds.creasing import (
    FOLD_STAGES,
    creasing_moulds,
    faces,
    stage_cell,
    stage_of_limb,
    stage_on_cone,
)
from smoskin.fabrication.pattern.flat import bend_allowance, flat_sheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.cell import dihedral_angles, size
from smoskin.origami.geometry import geometry
from smoskin.origami.tessellation.unfold import lengths_of


def test_a_die_follows_the_sheet(planar):
    shop = Workshop(bend="sharp")
    parts = creasing_moulds(planar, shop, flat_sheet(planar, shop))
    assert len(parts) == 2 * len(FOLD_STAGES)
    length, width, height = (float(v) for v in size(planar.cell))
    area = planar.cells[0] * planar.cells[1] * length * width
    # The sheet's middle height is half of its own: every panel climbs evenly from edge to edge.
    die = next(part for part in parts if part.name == "crease_die_3")
    assert die.solid.volume() == pytest.approx(area * (3e-3 + height / 2), rel=5e-3)


def test_stages_follow_the_film_that_bends_evenly(planar):
    """At every stage the panels between the creases' arcs are the same."""
    shop, gap = Workshop(), planar.creases.gap
    for share in FOLD_STAGES:
        cell = stage_cell(planar, shop, share)
        fold_a, fold_b = (float(np.pi - angle) for angle in dihedral_angles(cell))
        final_a, final_b = (float(np.pi - angle) for angle in dihedral_angles(planar.cell))
        sine = np.sin(cell.sector_angle)
        for edge, own, now, final in (
            (cell.panel_a, planar.cell.panel_a, fold_b, final_b),
            (cell.panel_b, planar.cell.panel_b, fold_a, final_a),
        ):
            assert edge * sine - bend_allowance(gap, now) == pytest.approx(
                own * sine - bend_allowance(gap, final)
            )
    assert float(size(cell).height) == pytest.approx(float(size(planar.cell).height), rel=0.02)


def distances(places, pairs):
    return np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)


@pytest.mark.parametrize("share", FOLD_STAGES)
def test_a_limbs_sheet_keeps_every_length_of_its_panels_at_every_stage(curved, share):
    shop = Workshop(bend="sharp")
    sheet = flat_sheet(curved, shop)
    stage = stage_of_limb(curved, shop, sheet, share)
    vertices, pairs = stage.vertices(curved.cells), lengths_of(sheet.facets)
    assert distances(vertices, pairs) == pytest.approx(distances(sheet.vertices, pairs), abs=1e-12)
    low, high = stage.radii
    assert high - low == pytest.approx(share * float(size(curved.cell).height), rel=0.01)


@pytest.mark.parametrize("bend", ["sharp", "even"])
def test_the_last_stage_is_the_sheet_of_the_design(curved, bend):
    shop = Workshop(bend=bend)
    stage = stage_of_limb(curved, shop, flat_sheet(curved, shop), 1.0)
    own, pairs = geometry(curved).sheet, np.array(np.triu_indices(169, 1)).T
    vertices = stage.vertices(curved.cells)
    assert distances(vertices, pairs) == pytest.approx(distances(own.vertices, pairs), abs=1e-9)


@pytest.mark.parametrize("share", FOLD_STAGES)
def test_a_limbs_die_and_punch_close_on_the_panels(curved, share):
    """Between their faces lies the room of the panels and a clearance on either side."""
    shop = Workshop()
    lower, upper, facets, note = faces(curved, shop, flat_sheet(curved, shop), share)
    corners = lower[facets]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    apart = np.einsum("fkd,fd->fk", upper[facets] - corners, normals)
    assert apart == pytest.approx(2 * (shop.plate(curved) + shop.fit), abs=1e-12)
    assert np.degrees(np.arccos(normals[:, 2])).max() <= 70.0
    assert ("4 of 6 rows" in note) == (share == 1.0)


@pytest.mark.parametrize("bend", ["sharp", "even"])
def test_a_cones_sheet_keeps_its_panels_and_folds_on_time(small_cone, bend):
    shop = Workshop(bend=bend)
    sheet, own = flat_sheet(small_cone, shop), geometry(small_cone).sheet
    pairs = lengths_of(sheet.facets)
    for share in FOLD_STAGES:
        places = stage_on_cone(small_cone, shop, sheet, share)
        rows = places.reshape(7, 7, 3)
        height, full = (
            float(np.linalg.norm(at[:, 1::2] - (at[:, :-1:2] + at[:, 2::2]) / 2, axis=2).mean())
            for at in (rows, own.vertices.reshape(7, 7, 3))
        )
        assert height / full == pytest.approx(share, abs=1e-3 if bend == "sharp" else 0.01)
        if bend == "sharp":
            kept = distances(own.vertices, pairs)
            assert distances(places, pairs) == pytest.approx(kept, abs=1e-9)
    whole = np.array(np.triu_indices(49, 1)).T
    assert distances(places, whole) == pytest.approx(distances(own.vertices, whole), abs=2e-6)


def test_a_cones_die_and_punch_close_on_the_panels(small_cone):
    shop = Workshop()
    sheet = flat_sheet(small_cone, shop)
    for share in FOLD_STAGES:
        lower, upper, facets, _ = faces(small_cone, shop, sheet, share)
        corners = lower[facets]
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        apart = np.einsum("fkd,fd->fk", upper[facets] - corners, normals)
        assert apart == pytest.approx(2 * (shop.plate(small_cone) + shop.fit), abs=2e-7)
        assert np.degrees(np.arccos(normals[:, 2])).max() <= 70.0


def test_panels_too_steep_for_a_punch_are_refused(curved):
    steep = replace(curved, cell=replace(curved.cell, fold_angle=float(np.radians(20))))
    shop = Workshop(bend="sharp")
    with pytest.raises(DesignError, match="at most 70 deg steep in a row"):
        faces(steep, shop, flat_sheet(steep, shop), 1.0)
