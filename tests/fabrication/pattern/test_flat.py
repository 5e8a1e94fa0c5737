"""Gaps and flat panels against plates that are folded by hand."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.design.skin import Limb
from smoskin.errors import DesignError
from smoskin.fabrication.pattern.flat import (
    bend_allowance,
    crease_folds,
    crease_gaps,
    flat_sheet,
    needed_gap,
    outlines,
    within_edges,
)
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.cell import dihedral_angles, size
from smoskin.origami.geometry import geometry
from smoskin.origami.tessellation.unfold import lengths_of


def corner_of_plate(gap, free, thickness, fold):
    """Distance of a plate's upper corner from the plane of symmetry, the film bent evenly."""
    radius = free / fold
    end = np.array([-radius * np.sin(fold / 2), radius * (1 - np.cos(fold / 2))])
    along = np.array([-np.cos(fold / 2), np.sin(fold / 2)])
    up = np.array([np.sin(fold / 2), np.cos(fold / 2)])
    return -(end + along * (gap - free) / 2 + up * thickness)[0]


@pytest.mark.parametrize("fold", [0.4, 0.96, 1.41])
@pytest.mark.parametrize("free", [1e-9, 0.8e-3])
def test_plates_in_the_needed_gap_do_not_touch(fold, free):
    shop = Workshop(kerf=0.0, crease_clearance=0.0)
    gap = needed_gap(0.65e-3, fold, shop)
    room = corner_of_plate(gap, free, 0.65e-3, fold)
    if free < 1e-6:
        assert room == pytest.approx(0.0, abs=1e-9)
    else:
        spare = bend_allowance(free, fold) * np.cos(fold / 2) / 2
        assert room == pytest.approx(spare, rel=1e-9)
    assert corner_of_plate(gap - 2 * bend_allowance(free, fold), free, 0.65e-3, fold) < 0


def test_the_convex_gap_is_the_free_film_of_the_mechanics(planar):
    at_a, at_b = crease_gaps(planar, Workshop())
    assert at_a.convex == at_b.convex == planar.creases.gap
    assert min(*at_a, *at_b) == planar.creases.gap
    assert at_b.concave > planar.creases.gap


@pytest.mark.parametrize("bend", ["even", "sharp"])
def test_the_folded_pattern_has_the_design_s_pitch(planar, bend):
    sheet = flat_sheet(planar, Workshop(bend=bend))
    columns, rows = (2 * n for n in planar.cells)
    grid = sheet.vertices.reshape(columns + 1, rows + 1, 2)
    folds = [float(np.pi - angle) for angle in dihedral_angles(planar.cell)]
    grow_a, grow_b = (
        bend_allowance(planar.creases.gap, fold) if bend == "even" else 0.0 for fold in folds
    )
    sine = np.sin(planar.cell.sector_angle)
    # What each inner crease adds when it is folded gives the panels of the design back.
    wide = np.diff(grid[:, 0, 0]).sum() + (columns - 1) * grow_a
    long = np.diff(grid[0, :, 1]).sum() + (rows - 1) * grow_b / sine
    assert wide == pytest.approx(columns * planar.cell.panel_b * sine, rel=1e-12)
    assert long == pytest.approx(rows * planar.cell.panel_a, rel=1e-12)


def test_panels_lie_half_a_gap_from_their_creases(planar):
    sheet = flat_sheet(planar, Workshop())
    upper, lower = (outlines(sheet, inset) for inset in (sheet.upper, sheet.lower))
    sides = np.concatenate([sheet.facets[:, [k, (k + 1) % 4]] for k in range(4)])
    of_facet = np.tile(np.arange(len(sheet.facets)), 4)
    beside = {}
    for facet, pair in zip(of_facet, np.sort(sides, axis=1).tolist(), strict=True):
        beside.setdefault(tuple(pair), []).append(facet)
    angles = size(planar.cell)
    assert angles.height > 0
    for pair, ridge in list(zip(sheet.creases.tolist(), sheet.mountain, strict=True))[::7]:
        start, end = sheet.vertices[pair]
        along = (end - start) / np.linalg.norm(end - start)
        across = np.array([-along[1], along[0]])
        kinds = sheet.at_a if abs(along[0]) < 1e-9 else sheet.at_b
        for corners, is_upper in ((upper, True), (lower, False)):
            near = [
                np.abs((corners[f] - start) @ across).min() for f in beside[tuple(sorted(pair))]
            ]
            gap = kinds.convex if bool(ridge) == is_upper else kinds.concave
            assert sum(near) == pytest.approx(gap, rel=1e-9)


def test_a_limbs_sheet_lies_flat_with_every_length_kept(curved):
    sheet, folded = flat_sheet(curved, Workshop(bend="sharp")), geometry(curved).sheet
    pairs = lengths_of(sheet.facets)
    flat, space = (
        np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
        for places in (sheet.vertices, folded.vertices)
    )
    assert flat == pytest.approx(space, abs=1e-12)
    folds = crease_folds(curved)
    assert np.degrees(np.unique(folds.round(9))) == pytest.approx([52.15, 71.25, 84.85], abs=0.01)
    assert sheet.at_b.concave == pytest.approx(
        needed_gap(Workshop().plate(curved), float(folds.max()), Workshop())
    )


@pytest.mark.parametrize(
    ("skin", "bend", "off"),
    [
        ("curved", "even", 1e-12),
        ("small_cone", "sharp", 1e-12),
        # Less what film takes up, panels that differ along a generator do not quite tile.
        ("small_cone", "even", 25e-6),
    ],
)
def test_a_limbs_finished_panels_are_those_between_its_folded_creases(skin, bend, off, request):
    """Flat panels within their gaps are the folded ones within gaps and what film bends by."""
    design = request.getfixturevalue(skin)
    sheet, folded = flat_sheet(design, Workshop(bend=bend)), geometry(design).sheet.vertices
    flat = outlines(sheet, sheet.upper)
    corners = folded[sheet.facets]
    along = corners[:, 1] - corners[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.cross(along, corners[:, 3] - corners[:, 0])
    across = np.cross(normal / np.linalg.norm(normal, axis=1, keepdims=True), along)
    arms = corners - corners[:, :1]
    plane = np.stack([np.einsum("fkd,fd->fk", arms, axis) for axis in (along, across)], axis=-1)
    space = within_edges(plane, sheet.upper + sheet.allowances)
    for first, second in ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)):
        lengths = [np.linalg.norm(c[:, first] - c[:, second], axis=1) for c in (flat, space)]
        assert lengths[0] == pytest.approx(lengths[1], abs=off)


def test_a_cone_of_little_taper_has_nearly_the_cylinders_flat_sheet(small_cone):
    def lengths(taper):
        limb = Limb(skin_radius=0.075 - taper / 2, far_radius=0.075 + taper / 2)
        sheet = flat_sheet(replace(small_cone, limb=limb), Workshop())
        pairs = lengths_of(sheet.facets)
        return np.linalg.norm(sheet.vertices[pairs[:, 0]] - sheet.vertices[pairs[:, 1]], axis=1)

    cylinder = lengths(0.0)
    off = [np.abs(lengths(taper) - cylinder).max() for taper in (1e-5, 1e-4, 1e-3)]
    assert np.diff(np.log10(off)) == pytest.approx([1.0, 1.0], abs=0.1)


def test_gaps_wider_than_panels_are_refused(planar):
    thick = replace(planar, panels=replace(planar.panels, thickness=14e-3))
    with pytest.raises(DesignError, match=r"b-creases must leave panels at least 2 mm wide; got"):
        flat_sheet(thick, Workshop())
    wide = replace(planar, creases=replace(planar.creases, gap=10e-3))
    with pytest.raises(DesignError, match=r"a gap of 10.00 mm in panels 11.27 mm wide"):
        flat_sheet(wide, Workshop())
