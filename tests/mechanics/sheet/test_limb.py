"""A sheet on a limb: one lattice and one law for it and for a plane, which it becomes far off."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.design.skin import Limb
from smoskin.errors import DesignError
from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.mechanics.sheet.foldability import fold_shares
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sliding, Touches
from smoskin.origami.cell import size
from smoskin.origami.geometry import geometry
from smoskin.origami.surface.analytic import Cylinder
from smoskin.origami.tessellation.hinges import rigid_modes
from smoskin.origami.tessellation.tessellate import tessellate
from textbook_sheet import inner_force, outer_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.twin.whole import Twin


@pytest.fixture(scope="module")
def curved():
    return read_design("curved")


@pytest.fixture(scope="module")
def small(curved):
    """Three cells along the limb, four round it."""
    magnets = [replace(m, corner=(min(m.corner[0], 2), m.corner[1])) for m in curved.magnets[:3]]
    return replace(curved, cells=(3, 4), magnets=tuple(magnets), halls=curved.halls[:3])


@pytest.fixture(scope="module")
def sheet(small):
    return BarHinge(small)


def on_limb(design, radius):
    return replace(design, limb=Limb(skin_radius=radius))


def some(design, rows=6, places=1, seed=0, most=0.6):
    """Touches anywhere, half of them with drags."""
    rng = np.random.default_rng(seed)
    force = rng.uniform(-0.3, 0.3, (rows, places, 3))
    force[..., 2] = -rng.uniform(0.2, most, (rows, places))
    force[::2, :, :2] = 0.0
    extent = geometry(design).extent
    return Touches(position=rng.uniform(0, 1, (rows, places, 2)) * extent, force=force)


def test_panels_are_plane_and_the_sheet_folds_and_its_bottom_lies_on_the_limb(curved):
    skin = geometry(curved)
    corners = skin.sheet.vertices[skin.sheet.facets]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    off = ((corners[:, 2] - corners[:, 0]) * normal).sum(axis=1)
    np.testing.assert_allclose(off, 0, atol=1e-16)
    values, _ = rigid_modes(skin.sheet.vertices, skin.sheet.facets)
    assert values[0] < 1e-12 < 1e-3 < values[1]
    middle = np.array([0.0, skin.extent[1] / 2, -curved.limb.skin_radius])
    away = (skin.sheet.vertices - middle)[:, 1:]
    radii = np.linalg.norm(away, axis=1)
    bottom = skin.sheet.columns.ravel()
    np.testing.assert_allclose(radii[bottom], curved.limb.skin_radius, rtol=1e-14)
    height = size(curved.cell).height
    np.testing.assert_allclose(radii[skin.sheet.loaded], curved.limb.skin_radius + height)
    outward = skin.axes[bottom][..., 2]
    np.testing.assert_allclose(outward[:, 1:], away[bottom] / radii[bottom, None], atol=1e-14)


def test_a_press_folds_its_cell_nearly_as_on_the_plane(curved, planar):
    thick = replace(curved, panels=planar.panels)
    shares = []
    for design in (planar, curved, thick):
        skin = geometry(design)
        normals = skin.axes[skin.sheet.columns][..., 2]
        shares.append(fold_shares(skin.sheet, normals, springs_of(design)).mean())
    assert 0.85 < shares[1] / shares[0] < 0.95
    assert shares[2] / shares[0] < 0.8  # panels round the pressed cell bend


@pytest.mark.slow
def test_magnets_move_no_less_than_on_the_plane(curved, planar):
    moved = []
    for design in (planar, curved):
        where = geometry(design).tops.reshape(-1, 1, 2)
        force = np.broadcast_to([0.0, 0.0, -0.5], (*where.shape[:2], 3))
        motion = Twin(design).motions(Touches(position=where, force=force))
        on_sheet = [k for k, magnet in enumerate(design.magnets) if magnet.mount == "sheet"]
        moved.append(np.linalg.norm(motion.magnets[:, on_sheet, :3], axis=-1).mean())
    assert moved[1] > moved[0]


def test_the_search_for_a_sheet_on_a_cylinder_finds_the_same_one(curved):
    """All distances agree with those of the tessellation, which lies elsewhere in space."""
    radius = curved.limb.skin_radius
    made = tessellate(Cylinder(radius), curved.cell, curved.cells, refold=False)
    ours, other = geometry(curved).sheet.vertices, made.sheet.vertices
    apart = [np.linalg.norm(v[:, None] - v[None], axis=-1) for v in (ours, other)]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-9)


def test_far_off_it_answers_as_the_planar_skin(planar):
    """Motions of magnets and board and what chips read differ by 1 / R."""
    touches = some(planar, 4)
    ideal = Twin(planar, seed=None)
    flat = ideal.motions(touches)
    signals = ideal.readout.risen(flat)
    off = []
    for radius in (10.0, 100.0, 1000.0):
        twin = Twin(on_limb(planar, radius), seed=None)
        moved = twin.motions(touches)
        parts = (
            moved.magnets[..., :3] - flat.magnets[..., :3],
            moved.magnets[..., 3:] - flat.magnets[..., 3:],
            moved.board - flat.board,
            twin.readout.risen(moved) - signals,
        )
        off.append([np.abs(part).max() for part in parts])
    slopes = np.diff(np.log10(off), axis=0)
    np.testing.assert_allclose(slopes, -1, atol=0.01)
    assert off[0][3] < 0.01 * np.abs(signals).max()


@pytest.mark.parametrize(
    "grip", [pytest.param(None, marks=pytest.mark.slow), Frictionless(), Covered()]
)
def test_presses_balance_vertex_by_vertex(small, grip):
    """Against forces computed apart from the solver, along each column's own axis."""
    model, cases = BarHinge(small, grip=grip), some(small, places=2)
    pressed = model.press(cases, tolerance=1e-9)
    assert pressed.converged.all()
    for row in range(len(cases)):
        if isinstance(grip, Covered):
            straight = Touches(
                position=cases.position[row : row + 1],
                force=cases.force[row : row + 1] * [0.0, 0.0, 1.0],
            )
            part = replace(pressed, reaction=pressed.reaction[row : row + 1])
            loads = outer_force(model, straight, part, 0)
        else:
            loads = outer_force(model, cases, pressed, row)
        unbalanced = inner_force(model.lattice, pressed.displacements[row]) - loads
        assert np.linalg.norm(unbalanced) <= 5e-9 * np.linalg.norm(loads)


def test_a_patch_that_sticks_stands_still_along_the_limb(small, sheet):
    straight = some(small, 4)
    straight = Touches(position=straight.position, force=straight.force * [0.0, 0.0, 1.0])
    pressed = sheet.press(straight, tolerance=1e-10)
    lattice, board = sheet.lattice, sheet.board
    top = lattice.loaded.ravel()
    whole = pressed.displacements[:, top] + np.einsum(
        "tds,bs->btd", carried(board, lattice.nodes[top]), pressed.board
    )
    local = np.einsum("tid,bti->btd", lattice.loaded_axes[..., :2], whole)
    shares = sheet._loads(straight).shares[:, 0]
    scale = np.abs(pressed.displacements).max()
    np.testing.assert_allclose(np.einsum("bt,btd->bd", shares, local), 0, atol=1e-7 * scale)


def test_the_board_resists_as_its_pillars_do_one_by_one(curved):
    """Against pillars placed on a fine grid, each soft aside and stiff along its normal."""
    board, skin = board_of(curved), geometry(curved)
    flat = board_of(replace(curved, limb=None)).stiffness
    x, y = ((np.arange(400) + 0.5) / 400 * end for end in skin.extent)
    depth = -curved.columns.height - curved.board.thickness
    places = skin.roll.places(np.stack([0 * y, y, 0 * y + depth], axis=-1))
    axes = skin.roll.axes(y)
    rng = np.random.default_rng(0)
    inverse = np.linalg.inv(board.modes)
    for _ in range(5):
        shift, turn = rng.normal(size=3), rng.normal(size=3) / 0.05
        stored = (board.stiffness * (inverse @ [*shift, *turn]) ** 2).sum()
        grid = places[None] + np.stack([x, 0 * x, 0 * x], axis=-1)[:, None]
        moved = shift + np.cross(turn, grid - board.middle)
        local = np.einsum("qid,pqi->pqd", axes, moved)
        summed = (flat[:3] * local**2).sum(axis=-1).mean()
        assert stored == pytest.approx(summed, rel=1e-5)


def test_small_loads_are_reciprocal(small):
    compliance = grip_compliance(small)[..., :2]
    scale = np.abs(compliance).max()
    np.testing.assert_allclose(compliance, compliance.transpose(2, 3, 0, 1), atol=1e-12 * scale)


def test_a_mirror_across_the_limb_mirrors_the_answer(small, sheet):
    extent, cases = geometry(small).extent, some(small)
    mirrored = Touches(
        position=[extent[0], 0.0] + cases.position * [-1.0, 1.0],
        force=cases.force * [-1.0, 1.0, 1.0],
    )
    direct, reflected = sheet.press(cases, tolerance=1e-10), sheet.press(mirrored, tolerance=1e-10)
    rows = np.arange(len(sheet.lattice.nodes)).reshape(7, 9)[::-1].ravel()
    back = reflected.displacements[:, rows] * [-1.0, 1.0, 1.0]
    atol = 1e-8 * np.abs(back).max()
    np.testing.assert_allclose(direct.displacements, back, atol=atol)
    np.testing.assert_allclose(
        direct.board, reflected.board * [-1, 1, 1, 1, -1, -1], atol=10 * atol
    )


@pytest.mark.slow
@pytest.mark.parametrize("grip", [None, Sliding(friction=0.3), Frictionless()])
def test_derivatives_are_those_of_presses_on_either_side(small, grip):
    model, cases = BarHinge(small, grip=grip), some(small, 2, seed=3)
    exact = model.sensitivity(cases)
    for part in range(5):
        step = 1e-6 if part < 2 else 1e-4
        ends = []
        for sign in (1.0, -1.0):
            place, force = cases.position.copy(), cases.force.copy()
            if part < 2:
                place[..., part] += sign * step
            else:
                force[..., part - 2] += sign * step
            ends.append(model.press(Touches(position=place, force=force), tolerance=1e-11))
        for name in ("displacements", "board"):
            slope = (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * step)
            own = getattr(exact, name)[:, 0, part]
            np.testing.assert_allclose(own, slope, atol=2e-5 * np.abs(own).max())


def test_magnets_follow_a_sheet_that_turns_round_the_limb(curved):
    """A turn about the axis moves each magnet along its own arc and turns it about its own x."""
    skin, lattice = geometry(curved), build_lattice(curved)
    middle = np.array([0.0, skin.extent[1] / 2, -curved.limb.skin_radius])
    turn = 1e-3
    moved = np.cross([turn, 0.0, 0.0], lattice.nodes - middle)
    motions = np.einsum("gpvd,vd->gp", holder_matrix(curved), moved)
    for magnet, place, motion in zip(curved.magnets, skin.magnets, motions, strict=True):
        if magnet.mount == "sheet":
            radius = np.linalg.norm((place - middle)[1:])
            # About its own x a turn of the limb's skin is one against the arc.
            np.testing.assert_allclose(motion[:3], [0.0, -radius * turn, 0.0], atol=1e-12)
            np.testing.assert_allclose(motion[3:], [turn, 0.0, 0.0], atol=1e-12)


def on_cone(design, wider, radius=0.08):
    """The design on a limb whose radius grows by so much from rim to rim."""
    return replace(design, limb=Limb(skin_radius=radius - wider / 2, far_radius=radius + wider / 2))


def test_a_cone_without_taper_is_the_cylinder(curved):
    same = replace(curved, limb=Limb(skin_radius=0.08, far_radius=0.08))
    assert same == curved
    assert same.content_hash == curved.content_hash
    assert on_cone(curved, 0.01).content_hash != curved.content_hash


def test_parts_on_a_cone_stand_along_its_normals(curved):
    cone = on_cone(curved, 0.02)
    skin = geometry(cone)
    taper = np.arcsin(skin.roll.rise)
    # The axis, from the skin's middle on the surface.
    axis = np.array([np.cos(taper), 0.0, -np.sin(taper)])
    origin = [skin.extent[0] / 2, skin.roll.middle, 0.0] - 0.08 * np.array(
        [np.sin(taper), 0.0, np.cos(taper)]
    )

    def radii(places):
        away = places - origin
        along = away @ axis
        return along, np.linalg.norm(away - along[:, None] * axis, axis=1)

    feet = skin.sheet.columns.ravel()
    along, radius = radii(skin.sheet.vertices[feet])
    np.testing.assert_allclose(radius, 0.08 + np.tan(taper) * along, atol=1e-5)
    for places, axes, heights in (
        (skin.magnets, skin.magnet_axes, skin.roll.developed(skin.magnets)[:, 2]),
        (skin.chips, skin.magnet_axes[:4], skin.roll.developed(skin.chips)[:, 2]),
        (skin.sheet.vertices, skin.axes, skin.developed[:, 2]),
    ):
        on_it = places - heights[:, None] * axes[..., 2]
        along, radius = radii(on_it)
        np.testing.assert_allclose(radius, 0.08 + np.tan(taper) * along, atol=1e-12)
        # Normals lean back by the taper; generators run along the surface.
        np.testing.assert_allclose(axes[..., 2] @ axis, -np.sin(taper), atol=1e-12)
        np.testing.assert_allclose(axes[..., 0] @ axis, np.cos(taper), atol=1e-12)
        np.testing.assert_allclose(axes[..., 1] @ axis, 0.0, atol=1e-12)
    values, _ = rigid_modes(skin.sheet.vertices, skin.sheet.facets)
    assert values[0] < 1e-9  # it folds


def test_answers_on_a_cone_leave_the_cylinders_with_its_taper(small):
    cases = some(small, 3)
    straight = BarHinge(small).press(cases, tolerance=1e-11)
    off = [
        np.abs(BarHinge(on_cone(small, wider)).press(cases, tolerance=1e-11).board - straight.board)
        for wider in (2e-5, 2e-4, 2e-3)
    ]
    np.testing.assert_allclose(np.diff(np.log10([x.max() for x in off])), 1.0, atol=0.05)


def test_small_loads_on_a_cone_are_reciprocal(small):
    compliance = grip_compliance(on_cone(small, 0.02))[..., :2]
    scale = np.abs(compliance).max()
    np.testing.assert_allclose(compliance, compliance.transpose(2, 3, 0, 1), atol=1e-12 * scale)


def test_a_cone_turned_round_gives_the_mirrored_answer(small):
    extent, cases = geometry(small).extent, some(small)
    mirrored = Touches(
        position=[extent[0], 0.0] + cases.position * [-1.0, 1.0],
        force=cases.force * [-1.0, 1.0, 1.0],
    )
    direct = BarHinge(on_cone(small, 0.02)).press(cases, tolerance=1e-10)
    reflected = BarHinge(on_cone(small, -0.02)).press(mirrored, tolerance=1e-10)
    rows = np.arange(63).reshape(7, 9)[::-1].ravel()
    back = reflected.displacements[:, rows] * [-1.0, 1.0, 1.0]
    atol = 1e-7 * np.abs(back).max()
    np.testing.assert_allclose(direct.displacements, back, atol=atol)


def test_cones_that_cells_cannot_follow_are_refused(curved):
    with pytest.raises(DesignError, match=r"limb\.far_radius must lie within 60\.0 mm of skin_rad"):
        geometry(on_cone(curved, 0.13))
    with pytest.raises(DesignError, match="limb must be a cone that the cells can follow"):
        geometry(on_cone(curved, 0.058, 0.06))


def test_limbs_that_a_skin_cannot_wrap_are_refused(planar):
    with pytest.raises(DesignError, match=r"limb\.skin_radius must be at least 50\.9 mm"):
        geometry(on_limb(planar, 0.05))
    with pytest.raises(DesignError, match=r"limb\.skin_radius must be positive"):
        on_limb(planar, -0.1)
