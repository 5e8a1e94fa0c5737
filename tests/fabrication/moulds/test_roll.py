"""A skin on a limb: parts rolled on to each other, all where the design has them."""

import io
from dataclasses import replace

import numpy as np
import pytest
import shapely
import trimesh

from smoskin.design.skin import Limb
from smoskin.errors import DesignError
from smoskin.fabrication.moulds import assembly
from smoskin.fabrication.moulds.files import solid_files
from smoskin.fabrication.moulds.holders import holders
from smoskin.fabrication.moulds.roll import STRIP, cut_across, developed, rolled
from smoskin.fabrication.moulds.sheet import folded_panels
from smoskin.fabrication.moulds.solids import Part, Slab, disc, extruded, prism
from smoskin.fabrication.moulds.tools import fold_jig, foot_jig
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import (
    board_box,
    circuit_thickness,
    frame_level,
    laid_flat,
    level_of,
    shell_thickness,
)
from smoskin.records import Contact
from solid_overlaps import overlaps

SHOP = Workshop()


@pytest.fixture(scope="module")
def cone_parts(small_cone):
    return assembly.assembled(small_cone, SHOP)


@pytest.fixture(scope="module")
def whole(curved):
    sheet = flat_sheet(curved, SHOP)
    return [*assembly.assembled(curved, SHOP), *folded_panels(curved, sheet, SHOP)]


def test_a_mesh_is_cut_along_planes_and_keeps_its_shape():
    solid = prism(shapely.box(0, 0, 0.01, 0.02).difference(disc((5e-3, 9e-3), 3e-3)), 0.0, 4e-3)
    mesh = solid.to_mesh64()
    triangles = np.asarray(mesh.tri_verts, dtype=np.int64)
    # Along x, and fanning out from a point.
    lines = [[0.0, 1.0, -y] for y in (2e-3, 9e-3, 9.5e-3, 20e-3)]
    lines += [[-np.sin(a), np.cos(a), -0.1 * np.sin(a) - 8e-3 * np.cos(a)] for a in (-0.05, 0.03)]
    vertices, triangles = cut_across(np.asarray(mesh.vert_properties), triangles, np.array(lines))
    cut = trimesh.Trimesh(vertices, triangles, process=False)
    assert cut.is_watertight
    assert cut.volume == pytest.approx(solid.volume(), rel=1e-12)
    for a, b, c in lines:
        away = (vertices[:, :2] @ [a, b] + c)[triangles]
        assert not ((away.min(1) < -1e-9) & (away.max(1) > 1e-9)).any()


def test_a_rolled_plate_has_the_volume_of_its_arc(curved):
    outline = shapely.box(0.0, 0.02, 0.05, 0.14)
    flat = extruded("plate", "", Slab(outline, -2e-3, 1e-3))
    part = rolled(curved, flat, 0.0)
    radius = curved.limb.skin_radius
    ring = 0.12 / radius * ((radius + 1e-3) ** 2 - (radius - 2e-3) ** 2) / 2
    assert part.solid.volume() == pytest.approx(0.05 * ring, rel=(STRIP / radius) ** 2 / 5)
    assert developed(curved, part).size == pytest.approx([0.05, 0.12, 3e-3], abs=1e-8)


def test_a_plate_rolled_on_to_a_cone_has_the_volume_of_its_layers(small_cone):
    outline = shapely.box(0.01, 0.02, 0.05, 0.06)
    flat = extruded("plate", "", Slab(outline, -2e-3, 1e-3))
    part, roll = rolled(small_cone, flat, 0.0), geometry(small_cone).roll
    # Of a layer at the level h arcs are longer by h over the radius about the axis.
    arcs = np.linspace(0.01, 0.05, 2001), np.linspace(0.02, 0.06, 3)
    grid = np.stack(np.meshgrid(*arcs, indexing="ij"), axis=-1)
    x = roll.from_flat(grid, 0.0)[..., 0]
    longer = np.sqrt(1 - roll.rise**2) * roll.curvature / roll.stretch(0.0, x)
    mean = float(longer.mean())
    volume = 0.04 * 0.04 * (3e-3 + mean * (1e-3**2 - 2e-3**2) / 2)
    assert part.solid.volume() == pytest.approx(volume, rel=(STRIP * roll.curvature) ** 2 / 5)


def test_a_planar_skins_parts_are_not_rolled(planar):
    part = extruded("plate", "", Slab(shapely.box(0, 0, 1, 1), 0.0, 1.0))
    assert rolled(planar, part) is part
    assert developed(planar, part) is part


def test_a_board_too_thin_for_a_shell_is_refused(curved):
    thin = replace(curved, board=replace(curved.board, thickness=0.11e-3))
    with pytest.raises(DesignError, match=r"at least 1.16 mm on a limb.*got 0.11 mm"):
        assembly.board(thin, SHOP)


def test_no_two_parts_of_a_skin_on_a_limb_intersect(whole):
    assert len(whole) > 400
    assert overlaps(whole) == {}
    assert [part.name for part in whole if len(part.solid.decompose()) != 1] == []


def test_columns_stand_under_the_bottom_vertices_along_their_normals(curved):
    skin = geometry(curved)
    feet = skin.sheet.columns.ravel()
    parts = assembly.columns(curved, SHOP)
    assert len(parts) == len(feet)
    for part, vertex in zip(parts, feet, strict=True):
        there = np.asarray(part.solid.to_mesh64().vert_properties)[:, :3]
        away = (there - skin.sheet.vertices[vertex]) @ skin.axes[vertex]
        assert away[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=1e-5)
        ends = -curved.columns.height, -SHOP.drip
        assert (away[:, 2].min(), away[:, 2].max()) == pytest.approx(ends, abs=1e-9)
        volume = np.pi * curved.columns.radius**2 * (ends[1] - ends[0])
        assert part.solid.volume() == pytest.approx(volume, rel=5e-3)


def test_the_circuit_lies_on_its_shell_and_the_shell_over_the_base(curved, whole):
    """As thick as the board is designed, the shear layer's height over the base."""
    box, inner = board_box(curved), -curved.columns.height - curved.board.thickness
    parts = {part.name: developed(curved, part) for part in whole}
    for name, low, high in (
        ("board", -curved.columns.height - circuit_thickness(curved), -curved.columns.height),
        ("shell", inner, -curved.columns.height - circuit_thickness(curved)),
    ):
        ends = np.array(parts[name].solid.bounding_box())[[2, 5]]
        assert ends == pytest.approx([low, high], abs=2e-5)  # chords of the strips
    assert np.array(parts["base"].solid.bounding_box())[5] == pytest.approx(
        assembly.base_top(curved)
    )
    middle = (
        curved.limb.skin_radius + (inner - curved.columns.height - circuit_thickness(curved)) / 2
    )
    arc = box.size[1] * middle / (curved.limb.skin_radius + level_of(curved))
    full = box.size[0] * arc * shell_thickness(curved)
    [shell] = [part.solid.volume() for part in whole if part.name == "shell"]
    half = 5.4e-3 + SHOP.fit
    window = 4 * half**2 * shell_thickness(curved)
    assert full - 1.5 * window < shell < full - window


def test_the_lower_chip_hangs_in_the_shells_window_over_its_magnet(curved, whole):
    parts = {part.name: part.solid for part in whole}
    site = next(s for s in curved.halls if curved.magnet(s.magnet).mount == "base")
    chip, magnet = parts[f"chip_{site.name}"], parts[f"magnet_{site.magnet}"]
    sensing = curved.board.sensing_height
    gap = chip.min_gap(magnet, 0.02)
    assert gap == pytest.approx(site.gap - (1e-3 - sensing), abs=1e-4)
    # Straight between them is no shell: a rod from chip to magnet meets none.
    ends = [np.array(solid.bounding_box()).reshape(2, 3).mean(axis=0) for solid in (chip, magnet)]
    assert parts["shell"].ray_cast(tuple(ends[0]), tuple(ends[1])) == []
    upper = next(s for s in curved.halls if s is not site)
    below = geometry(curved).chips[list(curved.halls).index(upper)]
    axis = geometry(curved).chip_axes[list(curved.halls).index(upper)][:, 2]
    assert parts["shell"].ray_cast(tuple(below), tuple(below - 5e-3 * axis))


def test_upper_chips_and_magnets_stand_where_the_design_has_them(curved, whole):
    parts = {part.name: part.solid for part in whole}
    skin = geometry(curved)
    for k, magnet in enumerate(curved.magnets):
        if magnet.mount == "base":
            continue
        there = np.asarray(parts[f"magnet_{magnet.name}"].to_mesh64().vert_properties)[:, :3]
        assert there.mean(axis=0) == pytest.approx(skin.magnets[k], abs=1e-6)
        away = (there - skin.magnets[k]) @ skin.magnet_axes[k]
        assert np.abs(away[:, 2]) == pytest.approx(magnet.height / 2, abs=1e-9)


@pytest.mark.parametrize("skin", ["curved", "small_cone"])
def test_the_frame_stops_every_rim_column_at_its_upper_edge(skin, request):
    design = request.getfixturevalue(skin)
    edge = developed(design, assembly.frame(design)).solid
    level, places = frame_level(design), geometry(design)
    cut = edge.slice(level - 3e-5)  # under the strips' chords
    rings = [places.roll.flat(np.asarray(ring), level) for ring in cut.to_polygons()]
    walls = shapely.union_all([shapely.LinearRing(ring) for ring in rings])
    grid = laid_flat(design, places.developed[places.sheet.columns, :2], level)
    for line in (grid[:, 0], grid[:, -1]):
        for place in line:
            gap = walls.distance(shapely.Point(place)) - design.columns.radius
            assert gap == pytest.approx(design.frame.clearance, abs=0.02e-3)
    # Rows round a cone are not quite level: the frame leaves all of them what the outermost needs.
    uneven = np.ptp(places.developed[places.sheet.columns][[0, -1], :, 0], axis=1).max()
    for line in (grid[0], grid[-1]):
        for place in line:
            gap = walls.distance(shapely.Point(place)) - design.columns.radius
            assert -0.02e-3 < gap - design.frame.clearance < uneven + 0.02e-3


def test_no_two_parts_of_a_skin_on_a_cone_intersect(small_cone, cone_parts):
    assert overlaps(cone_parts) == {}
    assert [part.name for part in cone_parts if len(part.solid.decompose()) != 1] == []
    solids = {part.name: part.solid for part in cone_parts}
    gap = solids["holder_M2"].min_gap(solids["holder_M3"], 5e-3)
    assert gap == pytest.approx(small_cone.magnets[1].play, abs=0.05e-3)  # a cell apart, yet free
    sizes = [part.size[1] for part in cone_parts if part.name.startswith("scale")]
    assert len({round(float(size), 6) for size in sizes}) > 1  # wider where the cone is


def test_holders_leave_leaning_columns_their_play(curved):
    columns = assembly.columns(curved, SHOP)
    for part in holders(curved, SHOP)[::2]:
        nearest = min(part.solid.min_gap(column.solid, 2e-3) for column in columns)
        assert nearest == pytest.approx(curved.magnets[1].play, abs=0.05e-3)


def upright(part, top):
    """A jig that was made on its head, put back by the height of its face over the middle."""
    return part.solid.transform(np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, top]]))


def turned_about_the_limb(design, solid, angle):
    """A solid slid round the limb's axis by an angle, rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    axis = np.array([0.0, geometry(design).roll.middle, -design.limb.skin_radius])
    turn = np.array([[1.0, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
    return solid.transform(np.concatenate([turn, (axis - turn @ axis)[:, None]], axis=1))


def test_the_fold_jig_closes_round_the_sheet_on_a_limb_and_comes_off(curved, whole):
    held = [p for p in whole if p.name.startswith(("upper", "lower", "column", "frame", "board"))]
    top = float(geometry(curved).developed[:, 2].max())
    halves = fold_jig(curved, SHOP, flat_sheet(curved, SHOP))
    assert [half.name for half in halves] == ["fold_jig_1", "fold_jig_2"]
    there = [upright(half, top) for half in halves]
    parts = [Part(name=p.name, title="", solid=s) for p, s in zip(halves, there, strict=True)]
    assert overlaps([*parts, *held]) == {}
    beside = [part for part in held if part.name != "frame"]  # they slide on that
    for solid, side in zip(there, (-1, 1), strict=True):
        for angle in (0.05, 0.15):
            slid = turned_about_the_limb(curved, solid, side * angle)
            assert overlaps([Part(name="half", title="", solid=slid), *beside]) == {}


def test_strips_of_the_foot_jig_lift_off_their_columns(curved):
    """Columns lean so little over a strip's own direction that rubber gives way."""
    strips = foot_jig(curved, SHOP)
    assert len(strips) == curved.cells[1] + 1
    columns = assembly.columns(curved, SHOP)
    middles = geometry(curved).sheet.columns
    for k, part in enumerate(strips):
        lean = geometry(curved).axes[middles[:, k]][:, 1, 2]
        angles = np.arcsin(lean)
        assert np.ptp(angles) / 2 * curved.columns.height < 1e-3
        assert len(part.solid.decompose()) == 1
    assert len(columns) == middles.size


@pytest.mark.slow
def test_panels_and_jig_of_a_skin_on_a_cone_meet_nothing(curved):
    cone = replace(curved, limb=Limb(skin_radius=0.07, far_radius=0.09))
    sheet = flat_sheet(cone, SHOP)
    whole = [*assembly.assembled(cone, SHOP), *folded_panels(cone, sheet, SHOP)]
    assert overlaps(whole) == {}
    held = [p for p in whole if p.name.startswith(("upper", "lower", "column", "frame", "board"))]
    top = float(geometry(cone).developed[:, 2].max())
    halves = [
        Part(name=half.name, title="", solid=upright(half, top))
        for half in fold_jig(cone, SHOP, sheet)
    ]
    assert overlaps([*halves, *held]) == {}
    assert all(len(part.solid.decompose()) == 1 for part in (*halves, *foot_jig(cone, SHOP)))


@pytest.mark.slow
def test_every_solid_of_a_limbs_bundle_is_watertight(curved):
    solids = solid_files(curved, SHOP)
    names = {part.name for part in (*solids.parts, *solids.tools)}
    assert {"shell", "frame", "base", "foot_jig_7", "fold_jig_2", "crease_die_1"} <= names
    for file in solids.files:
        if file.kind == "stl":
            mesh = trimesh.load(io.BytesIO(file.content), file_type="stl")
            assert mesh.is_volume, file.path
            assert mesh.body_count == 1, file.path
            assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-3)


def moved(part, shift, turn, about):
    """A part moved by a small motion about a point."""
    matrix = np.array([[1, -turn[2], turn[1]], [turn[2], 1, -turn[0]], [-turn[1], turn[0], 1]])
    pose = np.concatenate([matrix, (about + shift - matrix @ about)[:, None]], axis=1)
    return Part(name=part.name, title="", solid=part.solid.transform(pose))


@pytest.mark.slow
@pytest.mark.parametrize("cell", [(0, 0), (3, 2), (5, 5), (0, 3)])
def test_presses_of_1_n_on_a_limb_bring_no_two_parts_together(curved, cell):
    pytest.importorskip("jax")
    from smoskin.twin.whole import Twin

    twin, skin = Twin(curved, seed=None), geometry(curved)
    press = [Contact(position=skin.tops[cell], force=(0.0, 0.0, -1.0))]
    vertices, motion = twin.sheet_vertices(press), twin.motion(press)
    assert motion.valid.all()
    top = skin.sheet.loaded[cell]
    sunk = (skin.sheet.vertices[top] - vertices[top]) @ skin.axes[top][:, 2]
    assert sunk > 0.1e-3
    parts = folded_panels(curved, flat_sheet(curved, SHOP), SHOP, vertices=vertices)
    names = [magnet.name for magnet in curved.magnets]
    for part in [*holders(curved, SHOP), *assembly.magnets(curved)]:
        k = names.index(part.name.split("_")[-1])
        axes, way = skin.magnet_axes[k], motion.magnets[k]
        parts.append(moved(part, axes @ way[:3], axes @ way[3:], skin.magnets[k]))
    fixed = [*assembly.chips(curved), *assembly.board(curved, SHOP), assembly.frame(curved)]
    overlapping = overlaps([*parts, *fixed])
    inside = {
        pair: shared
        for pair, shared in overlapping.items()
        # A magnet in its own holder is moved with it.
        if not (pair[0].startswith("holder") and pair[1].startswith("magnet"))
    }
    assert inside == {}
