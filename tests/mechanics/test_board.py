"""The board on pillars that weight and presses soften: against beams, finite elements, presses."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import DesignError
from smoskin.mechanics.beam import beam, sway, unloaded
from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.masses import mass_on_pillars
from smoskin.mechanics.sheet.touches import Sticking, Touches
from smoskin.mechanics.weight import board_load, hung_masses, magnet_masses
from smoskin.origami.geometry import geometry


def loaded(design, share=1.0):
    return replace(design, shear_layer=replace(design.shear_layer, load_share=share))


def sliding(design, load):
    """Stiffness of all pillars against sway under a load, N, by Haringx's column, N/m."""
    layer = design.shear_layer
    pillar = beam(layer.radius, layer.height, 25e3)
    unit = pillar.lateral / unloaded(pillar.shear_share)
    z = load / layer.pillars / (unit * layer.height)
    return layer.pillars * unit * sway(z, pillar.shear_share).value


def test_the_mass_on_the_pillars_is_that_of_all_that_hangs_and_stands(planar):
    hung = hung_masses(planar).sum() + sum(magnet_masses(planar))
    assert mass_on_pillars(planar) == pytest.approx(hung + board_load(planar)[2, 2])


def test_weight_softens_the_board_as_haringxs_columns(planar):
    """Against sway and yaw, by 4.8 % for the reference; sinking and tilting it does not."""
    plain, soft = board_of(planar), board_of(loaded(planar))
    factor = sliding(planar, 9.81 * mass_on_pillars(planar)) / plain.stiffness[0]
    assert factor == pytest.approx(0.952, abs=5e-4)
    np.testing.assert_allclose(soft.stiffness / plain.stiffness, [factor] * 2 + [1] * 3 + [factor])
    assert not plain.softening.any()
    half = board_of(loaded(planar, 0.5)).stiffness[0]
    assert half == pytest.approx(sliding(planar, 9.81 * mass_on_pillars(planar) / 2))


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_softening_is_the_third_derivative_of_the_pillars_energy(name, request):
    """A sum over pillars that stand densely, each with d |u|^2 / 2 of its own sway and sink."""
    design = loaded(request.getfixturevalue(name))
    board, skin = board_of(design), geometry(design)
    layer = design.shear_layer
    pillar = beam(layer.radius, layer.height, 25e3)
    weight = 9.81 * mass_on_pillars(design)
    slope = (sliding(design, weight + 1e-3) - sliding(design, weight - 1e-3)) / 2e-3
    x, y = (end * (np.arange(80) + 0.5) / 80 for end in skin.extent)
    flat = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((80, 80), board.middle[2])], -1)
    if design.limb is not None:
        flat[..., 2] = -design.columns.height - design.board.thickness
    motion = np.random.default_rng(0).normal(size=6) * [1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3]
    moved = carried(board, skin.roll.places(flat)) @ board.modes @ motion
    local = (np.swapaxes(skin.roll.axes(flat[..., 1]), -1, -2) @ moved[..., None])[..., 0]
    energy = pillar.axial * layer.pillars * slope / 2
    energy *= (-local[..., 2] * (local[..., :2] ** 2).sum(axis=-1)).mean()
    by_softening = np.einsum("ijk,i,j,k", board.softening, motion, motion, motion) / 6
    assert by_softening == pytest.approx(energy, rel=1e-3)
    for order in ((1, 0, 2), (2, 1, 0), (0, 2, 1)):
        turned, largest = board.softening.transpose(order), np.abs(board.softening).max()
        np.testing.assert_allclose(board.softening, turned, atol=1e-12 * largest)


@pytest.mark.slow
def test_a_drag_moves_the_board_farther_under_a_press(planar):
    """By 2.9 % under 1 N in the middle, as the beams say; at a corner, where it sinks, by 6.9 %."""
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge

    design, skin = loaded(planar), geometry(planar)
    model = BarHinge(design, grip=Sticking())
    for place, softer in ((skin.extent / 2, None), (skin.tops[0, 0], 0.069)):
        force = [[(drag, 0.0, push)] for push in (-0.01, -1.0) for drag in (0.3, 0.0)]
        board = model.press(Touches(position=[[place]] * 4, force=force)).board[:, 0]
        light, heavy = board[0] - board[1], board[2] - board[3]
        if softer is None:
            weight = 9.81 * mass_on_pillars(planar)
            assert 0.3 / heavy == pytest.approx(sliding(planar, weight + 1.0), rel=2e-3)
            softer = 0.029
        assert heavy / light - 1 == pytest.approx(softer, abs=1e-3)


def test_pillars_that_their_load_topples_are_refused(planar):
    slim = replace(planar, shear_layer=replace(planar.shear_layer, radius=0.7e-3, height=9e-3))
    with pytest.raises(DesignError, match=r"shear_layer.height must let .* under 255 mN each; got"):
        board_of(loaded(slim))


@pytest.mark.slow
def test_finite_elements_of_a_squat_pillar_soften_as_the_beam():
    """h = r, pressed by 8 %: to 0.935 of the unloaded stiffness, the beam to 0.942; a sway of a
    fifth of the height changes it by half a per cent."""
    felupe = pytest.importorskip("felupe")
    mesh = felupe.Circle(n=4, radius=1.0).expand(n=6, z=1.0)
    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(mesh), dim=3)])
    rubber = felupe.SolidBodyNearlyIncompressible(felupe.NeoHooke(mu=1.0), field, bulk=1000.0)
    stiffness, load = [], 0.0
    for pressed, aside in ((0.0, 1e-3), (0.08, 1e-3), (0.08, 0.2)):
        bounds = {"foot": felupe.dof.Boundary(field[0], fz=0.0)}
        for axis, value in enumerate((aside, 0.0, -pressed)):
            others = tuple(int(other != axis) for other in range(3))
            bounds["xyz"[axis]] = felupe.dof.Boundary(field[0], fz=1.0, skip=others, value=value)
        held, free = felupe.dof.partition(field, bounds)
        moved = felupe.dof.apply(field, bounds, held)
        felupe.newtonraphson(items=[rubber], dof0=held, dof1=free, ext0=moved, tol=1e-7, verbose=0)
        forces = rubber.assemble.vector(field).toarray().reshape(-1, 3)
        push = forces[np.isclose(mesh.points[:, 2], 1.0)].sum(axis=0)
        stiffness.append(push[0] / aside)
        load = load or -push[2] * (pressed > 0)
    pillar = beam(1.0, 1.0, 1.0)
    z = load / pillar.lateral * unloaded(pillar.shear_share)
    expected = sway(z, pillar.shear_share).value / unloaded(pillar.shear_share)
    assert stiffness[0] == pytest.approx(pillar.lateral, rel=0.04)
    assert stiffness[1] / stiffness[0] == pytest.approx(expected, abs=0.01)
    assert stiffness[2] / stiffness[1] == pytest.approx(1.0, abs=6e-3)
    assert math.isclose(stiffness[1] / stiffness[0], 0.935, abs_tol=2e-3)
