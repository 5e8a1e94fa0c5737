"""The assembled skin: nothing runs into anything, and parts are as large as the design says."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import DesignError
from smoskin.fabrication.layout import column_places
from smoskin.fabrication.moulds import assembly
from smoskin.fabrication.moulds.holders import holders
from smoskin.fabrication.moulds.sheet import folded_panels
from smoskin.fabrication.moulds.solids import Part, disc, prism
from smoskin.fabrication.moulds.tools import fold_jig
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.pattern.sheets import panels
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from solid_overlaps import overlaps


def sheet_parts(design, shop, **more):
    return folded_panels(design, flat_sheet(design, shop), shop, **more)


@pytest.fixture(scope="module")
def whole(planar):
    return [*assembly.assembled(planar, Workshop()), *sheet_parts(planar, Workshop())]


def test_no_two_parts_of_the_assembled_skin_intersect(whole):
    assert len(whole) > 400
    assert overlaps(whole) == {}


@pytest.mark.parametrize("bend", ["even", "sharp"])
def test_panels_in_narrower_gaps_would_run_into_each_other(planar, bend):
    """The check finds what it looks for: panels twice as thick in the same gaps."""
    shop = Workshop(bend=bend)
    sheet = flat_sheet(planar, shop)
    thick = replace(planar, panels=replace(planar.panels, thickness=3.6e-3))
    assert overlaps(folded_panels(thick, sheet, shop)[:60])


def test_folded_panels_are_those_that_are_cut(planar):
    shop = Workshop()
    sheet = flat_sheet(planar, shop)
    parts = folded_panels(planar, sheet, shop)
    areas = [panels(sheet, shop, upper=upper).area for upper in (True, False)]
    volume = sum(part.solid.volume() for part in parts)
    assert volume == pytest.approx(sum(areas) * planar.panels.thickness / 2, rel=1e-5)


def test_film_joins_folded_panels_in_the_length_that_it_has(planar):
    """Between two panels' edges on the convex face lies an arc of the free film."""
    shop = Workshop()
    sheet = flat_sheet(planar, shop)
    thin = replace(planar, panels=replace(planar.panels, thickness=1e-6))
    parts = folded_panels(thin, sheet, replace(shop, adhesive=0.0))
    upper = [part.solid for part in parts[: len(sheet.facets)]]
    folded = geometry(planar).sheet.vertices
    beside = {}
    for k, facet in enumerate(sheet.facets.tolist()):
        for side in range(4):
            beside.setdefault(tuple(sorted((facet[side], facet[(side + 1) % 4]))), []).append(k)
    for pair, ridge in list(zip(sheet.creases.tolist(), sheet.mountain, strict=True))[::11]:
        if not ridge:
            continue  # the upper face is the convex one of ridges
        start, end = folded[pair]
        along = (end - start) / np.linalg.norm(end - start)
        edges, away = [], []
        for k in beside[tuple(sorted(pair))]:
            points = np.asarray(upper[k].to_mesh64().vert_properties)[:, :3] - start
            apart = points - np.outer(points @ along, along)
            edges.append(apart[np.linalg.norm(apart, axis=1).argmin()])
            away.append(apart.mean(axis=0) / np.linalg.norm(apart.mean(axis=0)))
        chord = np.linalg.norm(edges[0] - edges[1])
        fold = np.pi - np.arccos(away[0] @ away[1])
        arc = chord * fold / (2 * np.sin(fold / 2))
        assert arc == pytest.approx(planar.creases.gap, rel=0.02)


def test_columns_stand_under_the_bottom_vertices_and_are_as_large_as_designed(planar):
    shop = Workshop()
    cast = assembly.columns(planar, shop)
    assert len(cast) == 91
    feet = geometry(planar).sheet.vertices[geometry(planar).sheet.columns.ravel(), :2]
    for part, place in zip(cast, feet, strict=True):
        box = np.array(part.solid.bounding_box()).reshape(2, 3)
        assert box[:, :2].mean(axis=0) == pytest.approx(place, abs=1e-5)
        height = planar.columns.height - shop.drip
        volume = np.pi * planar.columns.radius**2 * height
        assert part.solid.volume() == pytest.approx(volume, rel=5e-3)


def test_magnets_clear_their_chips_by_the_gap(planar):
    chips = {part.name[5:]: part for part in assembly.chips(planar)}
    magnets = {part.name[7:]: part for part in assembly.magnets(planar)}
    sensing = planar.board.sensing_height
    for site in planar.halls:
        gap = chips[site.name].solid.min_gap(magnets[site.magnet].solid, 0.02)
        assert gap == pytest.approx(site.gap - (1e-3 - sensing), abs=1e-6)
    for part in holders(planar, Workshop()):
        assert min(part.solid.min_gap(chip.solid, 0.02) for chip in chips.values()) > 1e-3


def test_a_column_on_the_holder_reaches_up_to_the_sheet_and_clears_it(planar):
    magnets = tuple(replace(magnet, driver="column") for magnet in planar.magnets)
    design, shop = replace(planar, magnets=magnets), Workshop()
    parts = holders(design, shop)
    assert len(parts) == 6
    assert overlaps([*parts, *sheet_parts(design, shop)]) == {}
    drivers = [part for part in parts if part.name.startswith("holder_driver")]
    panels_there = sheet_parts(design, shop)
    for part in drivers:
        assert min(part.solid.min_gap(panel.solid, 5e-3) for panel in panels_there) < 2e-3


def test_holders_leave_columns_their_play(planar):
    shop = Workshop()
    columns = assembly.columns(planar, shop)
    for part in holders(planar, shop)[::2]:
        assert part.name.startswith("holder_M")
        nearest = min(part.solid.min_gap(column.solid, 2e-3) for column in columns)
        assert nearest == pytest.approx(planar.magnets[1].play, abs=0.05e-3)
        assert len(part.solid.decompose()) == 1


def test_rim_columns_meet_the_frame_after_their_clearance(planar):
    frame = assembly.frame(planar).solid
    grid = geometry(planar).sheet.columns
    stands = geometry(planar).sheet.vertices
    for line in (grid[0], grid[-1], grid[:, 0], grid[:, -1]):
        for vertex in line:
            [place] = [p for p in column_places(planar) if np.allclose(p, stands[vertex, :2])]
            column = prism(disc(place, planar.columns.radius), -planar.columns.height, 0.0)
            gap = column.min_gap(frame, 0.02)
            assert gap == pytest.approx(planar.frame.clearance, abs=0.02e-3)


def test_the_fold_jig_closes_round_the_sheet_without_touching_it(planar, whole):
    shop = Workshop()
    [made] = fold_jig(planar, shop, flat_sheet(planar, shop))
    jig = made.solid
    top = float(geometry(planar).sheet.vertices[:, 2].max())
    # As it is made it lies on its head.
    turn = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, top]])
    there = Part(name="jig", title="", solid=jig.transform(turn))
    held = [
        part
        for part in whole
        if part.name.startswith(("upper", "lower", "column", "frame", "board"))
    ]
    assert overlaps([there, *held]) == {}
    panels_only = [part for part in held if part.name.startswith(("upper", "lower"))]
    nearest = min(there.solid.min_gap(part.solid, 0.02) for part in panels_only[:40])
    assert nearest == pytest.approx(shop.fit, abs=0.02e-3)


def test_parts_that_cannot_be_made_are_refused_with_their_measure(planar):
    shop = Workshop()
    with pytest.raises(DesignError, match=r"drip must be at least 0.65 mm.*got 0.30 mm"):
        assembly.columns(planar, replace(shop, drip=0.3e-3))
    tight = replace(planar, frame=replace(planar.frame, clearance=2.5e-3))
    with pytest.raises(DesignError, match=r"teeth must be at least 3.50 mm wide.*got 3.00 mm"):
        assembly.frame(tight)
    sites = tuple(replace(site, gap=0.9e-3) for site in planar.halls)
    with pytest.raises(DesignError, match=r"'M2'.* 0.65 mm above its chip's package; got -0.30 mm"):
        holders(replace(planar, halls=sites), shop)
    with pytest.raises(
        DesignError, match=r"'M1' must lie below the base's face.*2.40 mm; got 0.90"
    ):
        assembly.base(replace(planar, halls=sites), shop)
    low = replace(planar, shear_layer=replace(planar.shear_layer, height=0.8e-3))
    with pytest.raises(DesignError, match=r"shear_layer.height must be at least 1.15.*got 0.80 mm"):
        assembly.base(low, shop)
