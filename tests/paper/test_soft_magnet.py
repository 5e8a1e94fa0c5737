"""The soft magnet against magpylib, exact motions and Maxwell's equations; Figure S10's verdict."""

from dataclasses import replace
from itertools import pairwise

import magpylib
import numpy as np
import pytest
from numpy.testing import assert_allclose

from paper.figure_s10 import compare, comparison_rows, draw
from paper.models.block_mesh import BlockMesh, mesh_block
from paper.models.magnetisation import MagnetisationLoop
from paper.models.soft_magnet import (
    STANDOFF,
    SoftMagnet,
    magnet_field,
    magnetisation,
    skin_response,
    soft_magnet_like,
    soft_response,
    watched_everywhere,
)
from paper.models.solid import Block, PressedBlock, press_block
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.sector import VACUUM_PERMEABILITY
from smoskin.origami.cell import size
from smoskin.records import Reading
from smoskin.twin.reduced import ReducedTwin

BLOCK = Block(size=(40e-3, 32e-3, 10e-3), shear_modulus=25e3, bulk_modulus=2.5e6)
SECTORS = SoftMagnet(block=BLOCK, profile="sectors")
SINUSOID = SoftMagnet(block=BLOCK, profile="sinusoid")
MESH = mesh_block(BLOCK.size, radius=5e-3, fineness=2)
POINTS = np.array(
    [
        [0.0, 0.0, -3e-3],
        [0.0, 0.0, -0.3e-3],
        [1e-3, 2e-3, -1e-3],
        [12e-3, -9e-3, -3e-3],
        [21e-3, 3e-3, 5e-3],
        [-5e-3, 7e-3, 12e-3],
        [0.1, 0.1, -3e-3],
    ]
)


def moved(displacements: Floats, mesh: BlockMesh = MESH) -> PressedBlock:
    """A block whose nodes have been put somewhere, in K states."""
    count = len(displacements)
    return PressedBlock(
        mesh=mesh,
        displacements=displacements,
        forces=np.zeros_like(displacements),
        volume_ratios=np.ones((count, len(mesh.cells))),
        residuals=np.zeros(count),
        iterations=np.zeros(count, dtype=np.int64),
        converged=np.ones(count, dtype=bool),
    )


AT_REST = moved(np.zeros((1, *MESH.nodes.shape)))


def dented(amplitude: float = 1.5e-3) -> PressedBlock:
    """A smooth dent, deepest at the top, that is no equilibrium but bends every cell."""
    x, y, z = MESH.nodes.T
    bell = np.exp(-(x**2 + y**2) / (10e-3) ** 2) * z / BLOCK.size[2]
    displacement = np.stack([20 * x * bell, 15 * y * bell, -bell], axis=-1) * amplitude
    return moved(displacement[None])


def cuboids(stretches: tuple[float, float, float], points: Floats) -> Floats:
    """The four sectors after a homogeneous stretch, from magpylib: B_r = F B_r0 / J."""
    gradient = np.diag(stretches)
    half = gradient @ BLOCK.size * [0.5, 0.5, 1.0]
    total = np.zeros_like(points)
    for along_x in (-1, 1):
        for along_y in (-1, 1):
            rest = -np.sqrt(0.5) * SECTORS.remanence * np.array([along_x, along_y, 0.0])
            total += magpylib.magnet.Cuboid(
                dimension=half,
                position=half / 2 * [along_x, along_y, 1.0],
                polarization=VACUUM_PERMEABILITY * gradient @ rest / np.linalg.det(gradient),
            ).getB(points)
    return total


def slabs(points: Floats, count: int) -> Floats:
    """The sinusoid from magpylib: slabs across x with M_x, slabs across y with M_y."""
    total = np.zeros_like(points)
    wave = np.pi / max(BLOCK.size[:2])
    for axis in (0, 1):
        edges = np.linspace(-0.5, 0.5, count + 1) * BLOCK.size[axis]
        for low, high in pairwise(edges.tolist()):
            dimension, position = np.array(BLOCK.size), np.array([0, 0, BLOCK.size[2] / 2])
            dimension[axis], position[axis] = high - low, (low + high) / 2
            charge = np.zeros(3)
            charge[axis] = -VACUUM_PERMEABILITY * SINUSOID.remanence * np.sin(wave * position[axis])
            total += magpylib.magnet.Cuboid(
                dimension=dimension, position=position, polarization=charge
            ).getB(points)
    return total


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
def test_sectors_at_rest_are_four_cuboids(tolerance):
    field = magnet_field(SECTORS, AT_REST, POINTS, tolerance=tolerance)[0]
    assert np.abs(field - cuboids((1, 1, 1), POINTS)).max() < tolerance


def test_sinusoid_at_rest_is_the_limit_of_thin_slabs():
    points = POINTS[[0, 3, 4, 5, 6]]
    coarse, fine = slabs(points, 40), slabs(points, 80)
    exact = (4 * fine - coarse) / 3
    assert np.abs(fine - coarse).max() > 1e-5
    assert_allclose(magnet_field(SINUSOID, AT_REST, points)[0], exact, atol=2e-6)


def test_stretched_rubber_carries_its_magnetisation():
    stretches = (1.2, 1.1, 1 / (1.2 * 1.1 * 1.02))
    states = moved((MESH.nodes * (np.array(stretches) - 1))[None])
    field = magnet_field(SECTORS, states, POINTS[:4])[0]
    assert_allclose(field, cuboids(stretches, POINTS[:4]), atol=1e-7)


def test_turned_magnet_turns_its_field():
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    shift = np.array([5e-3, -2e-3, 8e-3])
    assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    states = moved((MESH.nodes @ turn.T + shift - MESH.nodes)[None])
    for magnet in (SECTORS, SINUSOID):
        still = magnet_field(magnet, AT_REST, POINTS[2:])[0]
        field = magnet_field(magnet, states, POINTS[2:] @ turn.T + shift)[0]
        assert_allclose(field, still @ turn.T, atol=1e-9)


def test_tilted_lines_tilt_the_moment():
    # u_z = c |x| tilts M_x into z, downwards everywhere: far away one more vertical dipole.
    tilt = 0.1
    displacements = np.zeros((2, *MESH.nodes.shape))
    displacements[1, :, 2] = tilt * np.abs(MESH.nodes[:, 0])
    far = np.array([[0.0, 0.0, -4.0]])
    rest, tilted = magnet_field(SECTORS, moved(displacements), far, tolerance=1e-16)[:, 0]
    moment = -tilt * np.sqrt(0.5) * SECTORS.remanence * np.prod(BLOCK.size)
    dipole = VACUUM_PERMEABILITY / (2 * np.pi) * moment / (4.0 + BLOCK.size[2] / 2) ** 3
    assert_allclose(tilted - rest, [0, 0, dipole], rtol=2e-3, atol=1e-14)


@pytest.mark.parametrize("magnet", [SECTORS, SINUSOID])
def test_quadrature_keeps_its_tolerance_in_bent_cells(magnet):
    exact = magnet_field(magnet, dented(), POINTS, tolerance=1e-10)
    for tolerance in (1e-4, 1e-6, 1e-8):
        field = magnet_field(magnet, dented(), POINTS, tolerance=tolerance)
        assert np.abs(field - exact).max() < tolerance


def test_field_has_neither_sources_nor_curl():
    step = 1e-4
    around = np.array([5e-3, 4e-3, -4e-3]) + step * np.concatenate([np.eye(3), -np.eye(3)])
    field = magnet_field(SINUSOID, dented(), around, tolerance=1e-11)[0]
    slope = (field[:3] - field[3:]) / (2 * step)  # [j, i] = dB_i/dx_j
    size_of = np.abs(slope).max()
    assert abs(np.trace(slope)) < 1e-3 * size_of
    assert np.abs(slope - slope.T).max() < 1e-3 * size_of


def test_states_share_their_quadrature():
    both = moved(np.concatenate([AT_REST.displacements, dented(1e-9).displacements]))
    field = magnet_field(SINUSOID, both, POINTS[3:], tolerance=1e-4)
    exact = magnet_field(SINUSOID, both, POINTS[3:], tolerance=1e-10)
    change, true = field[1] - field[0], exact[1] - exact[0]
    assert np.abs(change - true).max() < 1e-3 * np.abs(true).max()


def test_unconverged_states_have_no_field():
    states = moved(
        np.concatenate([dented().displacements, np.full((1, *MESH.nodes.shape), np.nan)])
    )
    states = replace(states, converged=np.array([True, False]))
    field = magnet_field(SINUSOID, states, POINTS)
    assert np.isfinite(field[0]).all()
    assert np.isnan(field[1]).all()
    response = soft_response(SINUSOID, states, [[0.0, 0.0]])
    assert np.isnan(response.changes[1]).all()
    assert np.isfinite(response.changes[0]).all()


@pytest.mark.parametrize("inside", [[1e-3, 1e-3, 5e-3], [1e-3, 2e-3, 0.0], [30e-3, 0.0, np.nan]])
def test_points_in_the_magnet_are_refused(inside):
    with pytest.raises(ArgumentError, match="points must"):
        magnet_field(SINUSOID, AT_REST, [inside])


def test_sinusoid_is_centripetal_and_strongest_at_the_farther_rim():
    x, y = np.meshgrid(np.linspace(-20e-3, 20e-3, 9), np.linspace(-16e-3, 16e-3, 7))
    where = np.stack([x, y, 0 * x], axis=-1)
    for magnet in (SECTORS, SINUSOID):
        magnetised = magnetisation(magnet, where)
        assert (np.sum(magnetised * where, axis=-1)[np.hypot(x, y) > 0] < 0).all()
        assert np.abs(magnetised).max() <= magnet.remanence * (1 + 1e-12)
    assert_allclose(magnetisation(SINUSOID, [20e-3, 0, 0])[0], -SINUSOID.remanence)


@pytest.fixture(scope="module")
def study(planar: SkinDesign) -> tuple[SoftMagnet, PressedBlock]:
    """The SI's soft magnet, pressed by 1 and 2 mm, on a coarse mesh."""
    magnet = soft_magnet_like(planar)
    shear = magnet.block.shear_modulus
    magnet = replace(magnet, block=replace(magnet.block, bulk_modulus=200 * shear))
    return magnet, press_block(magnet.block, [1e-3, 2e-3], radius=5e-3, fineness=4)


def test_stand_in_has_the_skins_dimensions(planar):
    block = soft_magnet_like(planar).block
    assert_allclose(block.size[:2], [0.12, 0.16], rtol=1e-5)
    tops = planar.columns.height + float(size(planar.cell).height)
    assert_allclose(block.size[2] + STANDOFF, tops - planar.board.sensing_height)


def test_mirrored_places_see_mirrored_changes(study):
    magnet, pressed = study
    changes = soft_response(magnet, pressed, [[8e-3, 5e-3], [-8e-3, 5e-3], [8e-3, -5e-3]]).changes
    assert_allclose(changes[:, 1], changes[:, 0] * [-1, 1, 1], atol=2e-7)
    assert_allclose(changes[:, 2], changes[:, 0] * [1, -1, 1], atol=2e-7)


def test_soft_magnet_tells_of_near_presses_only(study, planar):
    magnet, pressed = study
    response = soft_response(magnet, pressed, [[0.0, 0.0], [0.1, 0.1]])
    assert_allclose(response.depths, [1e-3, 2e-3])
    near, far = response.visibility(planar.hall_setting).T
    assert (near > 100).all()
    assert (far < 1).all()
    assert_allclose(response.changes[:, 0, :2], 0, atol=1e-7)


def test_folded_sheet_carries_the_signal(planar):
    skin = ReducedTwin(watched_everywhere(planar), seed=None)
    cell = size(planar.cell)
    press = (float(cell.length) / 2, float(cell.width) / 2)
    response = skin_response(skin, press, [0.0, 2e-3])
    assert response.changes.shape == (2, 25, 3)
    assert_allclose(response.changes[0], 0, atol=0)
    away = np.hypot(*response.offsets.T) >= 0.1
    assert away.sum() >= 9
    assert (response.visibility(planar.hall_setting)[1, away] > 100).all()


def test_skin_is_pressed_as_deep_as_asked(planar):
    skin = ReducedTwin(planar, seed=None)
    cell = size(planar.cell)
    press = (3.5 * float(cell.length), 2.5 * float(cell.width))
    depths = np.array([0.4e-3, 1.0e-3])
    response = skin_response(skin, press, depths)
    assert_allclose(response.forces[1] / response.forces[0], 2.5, rtol=1e-5)  # it is linear
    assert_allclose(response.depths, depths)
    assert_allclose(response.offsets[1], np.array([0.5, -0.5]) * [cell.length, cell.width])


class BrokenSkin(ReducedTwin):
    """A twin that finds no equilibrium beyond half a millimetre."""

    def sheet_vertices(self, contacts=()):
        vertices = super().sheet_vertices(contacts)
        deepest = (super().sheet_vertices() - vertices)[:, 2].max()
        return np.full_like(vertices, np.nan) if deepest > 0.5e-3 else vertices

    def read(self, contacts=(), **_) -> Reading:
        return super().read(contacts)


def test_a_press_without_equilibrium_says_so(planar):
    response = skin_response(BrokenSkin(planar, seed=None), (0.07, 0.067), [1e-3])
    assert np.isnan(response.forces).all()
    assert np.isnan(response.changes).all()


@pytest.mark.slow
def test_changes_converge_with_the_mesh(planar):
    magnet = soft_magnet_like(planar)
    near = []
    for fineness in (4, 6, 8):
        pressed = press_block(magnet.block, [1e-3], radius=5e-3, fineness=fineness)
        near.append(soft_response(magnet, pressed, [[0.0, 0.0], [0.1, 0.1]]).changes[0])
    first, second = (np.abs(np.diff(near, axis=0))[:, 0, 2]) / abs(near[-1][0, 2])
    assert second < first < 0.1
    assert np.abs(np.diff(near, axis=0))[1, 1].max() < 0.5e-6


def test_wrong_use_says_so(planar, study):
    magnet, pressed = study
    with pytest.raises(ArgumentError, match="remanence must be positive"):
        replace(magnet, remanence=0.0)
    with pytest.raises(ArgumentError, match="profile must be sectors or sinusoid"):
        replace(magnet, profile="radial")
    with pytest.raises(ArgumentError, match="tolerance must be positive"):
        magnet_field(magnet, pressed, POINTS, tolerance=0.0)
    thin = replace(planar, board=replace(planar.board, sensing_height=19e-3))
    with pytest.raises(ArgumentError, match="thicker than 3 mm"):
        soft_magnet_like(thin)
    skin = ReducedTwin(planar, seed=None)
    with pytest.raises(ArgumentError, match="depths must be"):
        skin_response(skin, (0.07, 0.067), [-1e-3])
    with pytest.raises(ArgumentError, match="within reach of 1000 N; 1e"):
        skin_response(skin, (0.07, 0.067), [1e3])
    bare = replace(
        planar,
        magnets=planar.magnets[:1],
        halls=planar.halls[:1],
    )
    with pytest.raises(ArgumentError, match="chip that watches a magnet on the sheet"):
        watched_everywhere(bare)


@pytest.mark.slow
def test_report_says_what_the_paper_says(planar, tmp_path):
    comparison = compare(planar, ReducedTwin(watched_everywhere(planar), seed=None), fineness=4)
    assert {row.verdict for row in comparison_rows(comparison)} == {"reproduced"}
    assert comparison.section.shape == (2, len(comparison.section_z), len(comparison.section_x))
    assert_allclose(comparison.section_x, -comparison.section_x[::-1], atol=1e-15)
    assert np.isfinite(comparison.section).all()
    plate = draw(comparison, MagnetisationLoop())
    first, second = (plate.write(tmp_path).read_bytes() for _ in range(2))
    assert first == second
    assert f"{comparison.visibility[1]:.2g} times the noise of one reading" in plate.caption
