"""The rubber block against closed-form deformations, its own energy, and conservation laws."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from paper.models.block_mesh import BlockMesh, mesh_block
from paper.models.solid import Block, PressedBlock, hold_block, press_block
from smoskin.arrays import Floats
from smoskin.errors import ArgumentError, MissingExtraError

SHEAR = 25e3
BLOCK = Block(size=(40e-3, 32e-3, 12e-3), shear_modulus=SHEAR, bulk_modulus=100 * SHEAR)


@pytest.fixture(scope="module")
def pressed() -> PressedBlock:
    """A disc of 5 mm pressed 1 and 2 mm deep, bonded below."""
    block = press_block(BLOCK, [1e-3, 2e-3], radius=5e-3, fineness=4)
    assert block.converged.all()
    return block


def uniaxial(block: Block, stretch: float) -> tuple[float, float]:
    """Transverse stretch, and stress in the loaded direction on the undeformed area."""
    shear, bulk = block.shear_modulus, block.bulk_modulus

    def stresses(across: float) -> tuple[float, float]:
        jacobian = stretch * across**2
        third = (stretch**2 + 2 * across**2) / 3
        iso = shear * jacobian ** (-2 / 3)
        pressure = bulk * (jacobian - 1) * jacobian
        return (
            iso * (stretch - third / stretch) + pressure / stretch,
            iso * (across - third / across) + pressure / across,
        )

    across = float(brentq(lambda trial: stresses(trial)[1], 0.5, 2.0, xtol=1e-15))
    return across, stresses(across)[0]


def cube(cells: int, side: float) -> BlockMesh:
    """A regular grid of the cube 0..side."""
    line = np.linspace(0, side, cells + 1)
    nodes = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange((cells + 1) ** 3).reshape((cells + 1,) * 3)
    a, b = slice(None, -1), slice(1, None)
    corners = [(a, a, a), (b, a, a), (b, b, a), (a, b, a)]
    corners += [(x, y, b) for x, y, _ in corners]
    return BlockMesh(nodes=nodes, cells=np.stack([index[c].ravel() for c in corners], axis=-1))


def surface(mesh: BlockMesh) -> np.ndarray:
    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    return ((mesh.nodes == low) | (mesh.nodes == high)).any(axis=1)


def energy(block: Block, mesh: BlockMesh, displacement: Floats) -> float:
    """Elastic energy of trilinear cells of mean dilatation, by two Gauss points a side."""
    place = np.array([-1, 1]) / np.sqrt(3)
    total = 0.0
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = np.concatenate([np.c_[corners, [-1] * 4], np.c_[corners, [1] * 4]])
    rest = mesh.nodes[mesh.cells]
    now = rest + displacement[mesh.cells]
    volume, swollen = np.zeros(len(rest)), np.zeros(len(rest))
    for x in place:
        for y in place:
            for z in place:
                f = 1 + corners * [x, y, z]
                slope = corners / 8 * np.c_[f[:, 1] * f[:, 2], f[:, 0] * f[:, 2], f[:, 0] * f[:, 1]]
                before = np.einsum("nj,cnx->cxj", slope, rest)
                after = np.einsum("nj,cnx->cxj", slope, now)
                gradient = after @ np.linalg.inv(before)
                weight, ratio = np.linalg.det(before), np.linalg.det(gradient)
                square = (gradient**2).sum(axis=(1, 2))
                total += float(weight @ (block.shear_modulus / 2 * (square / ratio ** (2 / 3) - 3)))
                volume += weight
                swollen += weight * ratio
    return total + float(volume @ (block.bulk_modulus / 2 * (swollen / volume - 1) ** 2))


@pytest.mark.parametrize("ratio", [10.0, 100.0, 5000.0])
def test_lubricated_compression_is_exact(ratio):
    block = replace(BLOCK, bulk_modulus=ratio * SHEAR, base="sliding")
    depths = np.array([1e-3, 4e-3])
    solved = press_block(block, depths, radius=None, hold="sliding", fineness=2)
    area = block.size[0] * block.size[1]
    for k, depth in enumerate(depths):
        stretch = 1 - depth / block.size[2]
        across, stress = uniaxial(block, stretch)
        assert_allclose(solved.press_forces[k], -stress * area, rtol=1e-6)
        exact = solved.mesh.nodes * [across - 1, across - 1, stretch - 1]
        assert_allclose(solved.displacements[k], exact, atol=1e-7 * block.size[0])
        assert_allclose(solved.volume_ratios[k], stretch * across**2, rtol=1e-7)


def test_affine_rim_gives_affine_inside():
    mesh = mesh_block(BLOCK.size, radius=5e-3, fineness=2)
    gradient = np.array([[1.1, 0.2, -0.1], [0.05, 0.9, 0.15], [0.0, -0.1, 1.02]])
    prescribed = mesh.nodes @ (gradient - np.eye(3)).T
    held = np.repeat(surface(mesh)[:, None], 3, axis=1)
    solved = hold_block(BLOCK, mesh, held, prescribed[None])
    assert not held.all()
    assert_allclose(solved.displacements[0], prescribed, atol=1e-9)
    assert_allclose(solved.volume_ratios[0], np.linalg.det(gradient), rtol=1e-7)


def test_error_falls_with_the_square_of_the_cell_size():
    # Antiplane shear u_z = w(x, y) with a harmonic w is in equilibrium in an incompressible
    # neo-Hookean solid, whatever its amplitude.
    side = 10e-3
    block = Block(size=(side,) * 3, shear_modulus=SHEAR, bulk_modulus=1e4 * SHEAR)
    errors = []
    for cells in (4, 6, 9):
        mesh = cube(cells, side)
        x, y, _ = mesh.nodes.T * (1.5 / side)
        exact = np.zeros((1, len(mesh.nodes), 3))
        exact[0, :, 2] = 0.06 * side * np.exp(x) * np.sin(y)
        held = np.repeat(surface(mesh)[:, None], 3, axis=1)
        solved = hold_block(block, mesh, held, exact)
        assert solved.converged.all()
        errors.append(np.sqrt(((solved.displacements - exact) ** 2)[0].sum(axis=1).mean()) / side)
    orders = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(1.5)
    assert errors[-1] < 1e-5
    assert_allclose(orders, 2.0, atol=0.25)


def test_force_is_the_slope_of_the_energy(pressed):
    step = 1e-5
    solved = press_block(BLOCK, [1e-3 - step, 1e-3 + step], radius=5e-3, fineness=4)
    less, more = (
        energy(BLOCK, solved.mesh, displacements) for displacements in solved.displacements
    )
    assert_allclose((more - less) / (2 * step), pressed.press_forces[0], rtol=1e-4)


def test_forces_and_moments_balance(pressed):
    largest = pressed.press_forces[:, None]
    assert (np.abs(pressed.forces.sum(axis=1)) < 1e-6 * largest).all()
    arms = pressed.mesh.nodes + pressed.displacements
    moments = np.cross(arms, pressed.forces).sum(axis=1)
    assert (np.abs(moments) < 1e-6 * largest * BLOCK.size[0]).all()
    assert (pressed.residuals <= 1e-8).all()


def test_indented_disc_goes_where_it_is_told(pressed):
    nodes = pressed.mesh.nodes
    disc = (nodes[:, 2] == BLOCK.size[2]) & (np.hypot(nodes[:, 0], nodes[:, 1]) < 5.0001e-3)
    for depth, displacement in zip((1e-3, 2e-3), pressed.displacements, strict=True):
        assert_allclose(displacement[disc], np.tile([0, 0, -depth], (disc.sum(), 1)), atol=1e-15)
        assert_allclose(displacement[nodes[:, 2] == 0.0], 0.0, atol=0)


def test_a_quarter_stands_for_the_whole(pressed):
    # The same press, solved on the whole mesh, where nothing imposes the symmetry.
    nodes = pressed.mesh.nodes
    base, top = nodes[:, 2] == 0.0, nodes[:, 2] == BLOCK.size[2]
    disc = top & (np.hypot(nodes[:, 0], nodes[:, 1]) < 5.0001e-3)
    prescribed = np.zeros((2, *nodes.shape))
    prescribed[:, disc, 2] = [[-1e-3], [-2e-3]]
    held = np.repeat((base | disc)[:, None], 3, axis=1)
    solved = hold_block(BLOCK, pressed.mesh, held, prescribed)
    assert_allclose(solved.displacements, pressed.displacements, atol=1e-9)
    assert_allclose(solved.forces, pressed.forces, atol=1e-6 * solved.press_forces[0])
    assert_allclose(solved.volume_ratios, pressed.volume_ratios, atol=1e-7)


def test_volume_changes_as_little_as_the_bulk_modulus_lets_it():
    # Volume changes by pressure over K: ten times the K, a tenth of the change.
    change = []
    for ratio in (100.0, 1000.0):
        block = replace(BLOCK, bulk_modulus=ratio * SHEAR)
        solved = press_block(block, [1e-3], radius=5e-3, fineness=2)
        cells = mesh_volumes(solved.mesh)
        change.append(1 - float(cells @ solved.volume_ratios[0]) / cells.sum())
        mean_pressure = solved.press_forces[0] / (np.pi * 5e-3**2)
        assert np.abs(solved.volume_ratios - 1).max() < 3 * mean_pressure / block.bulk_modulus
    assert change[0] > 0
    assert_allclose(change[0] / change[1], 10.0, rtol=0.05)


def mesh_volumes(mesh: BlockMesh) -> Floats:
    """Of prisms: mean of the two plan areas times the height."""
    corners = mesh.nodes[mesh.cells]
    diagonals = corners[:, 2, :2] - corners[:, 0, :2], corners[:, 3, :2] - corners[:, 1, :2]
    area = 0.5 * (diagonals[0][:, 0] * diagonals[1][:, 1] - diagonals[0][:, 1] * diagonals[1][:, 0])
    return area * (corners[:, 4, 2] - corners[:, 0, 2])


@pytest.mark.parametrize("fineness", [2, 6])
def test_mesh_fills_the_block(fineness):
    mesh = mesh_block(BLOCK.size, radius=5e-3, fineness=fineness)
    volumes = mesh_volumes(mesh)
    assert (volumes > 0).all()
    assert_allclose(volumes.sum(), np.prod(BLOCK.size), rtol=1e-12)
    assert len(np.unique(np.rint(mesh.nodes * 1e9), axis=0)) == len(mesh.nodes)
    assert_allclose(np.abs(mesh.nodes).max(axis=0), [0.5, 0.5, 1] * np.array(BLOCK.size))
    for axis in (0, 1):  # no cell straddles a plane of symmetry
        corners = mesh.nodes[mesh.cells][:, :, axis]
        assert (np.sign(corners.min(axis=1)) * np.sign(corners.max(axis=1)) >= 0).all()


def test_no_answer_without_equilibrium():
    mesh = cube(2, 10e-3)
    top, bottom = mesh.nodes[:, 2] == 10e-3, mesh.nodes[:, 2] == 0
    prescribed = np.zeros((3, len(mesh.nodes), 3))
    prescribed[0, top, 2] = -1e-3
    prescribed[1:, top, 2] = -15e-3  # through the lower face
    held = np.repeat((top | bottom)[:, None], 3, axis=1)
    solved = hold_block(BLOCK, mesh, held, prescribed)
    assert solved.converged.tolist() == [True, False, False]
    assert np.isfinite(solved.displacements[0]).all()
    for values in (solved.displacements, solved.forces, solved.volume_ratios, solved.residuals):
        assert np.isnan(values[1:]).all()
    assert solved.iterations[1] > 0


def test_a_sliding_block_yields_more_than_a_bonded_one():
    forces = {
        (base, hold): press_block(
            replace(BLOCK, base=base), [1e-3], radius=5e-3, hold=hold, fineness=2
        ).press_forces[0]
        for base in ("bonded", "sliding")
        for hold in ("sticking", "sliding")
    }
    assert forces["sliding", "sliding"] < forces["bonded", "sliding"] < forces["bonded", "sticking"]
    assert forces["sliding", "sticking"] < forces["bonded", "sticking"]


@pytest.mark.slow
def test_punch_force_converges():
    # The rim of a flat punch is a singular edge: first order is what to expect of the force.
    forces = [
        press_block(BLOCK, [1e-3], radius=5e-3, fineness=n).press_forces[0] for n in (4, 8, 16)
    ]
    falls = -np.diff(forces)
    assert (falls > 0).all()
    assert 0.9 < np.log2(falls[0] / falls[1]) < 1.5


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"size": (1e-3, -1e-3, 1e-3)}, "size must be positive and finite; got -0.001"),
        ({"shear_modulus": np.nan}, "shear_modulus must be positive"),
        ({"bulk_modulus": SHEAR}, "bulk_modulus must be above twice the shear modulus"),
        ({"base": "floating"}, "base must be one of bonded, sliding; got 'floating'"),
    ],
)
def test_wrong_blocks_say_so(wrong, message):
    with pytest.raises(ArgumentError, match=message):
        replace(BLOCK, **wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"depths": [0.011]}, r"depths must be \(K,\) numbers in \[0, 0.0108\) m"),
        ({"depths": [-1e-3]}, "depths must be"),
        ({"radius": 0.02}, r"radius must lie in \(0, 0.0144\) m, on the upper face; got 0.02"),
        ({"fineness": 3}, "fineness must be an even number >= 2; got 3"),
        ({"hold": "glued"}, "hold must be one of sticking, sliding; got 'glued'"),
        ({"tolerance": 0.0}, r"tolerance must lie in \(0, 1\); got 0"),
    ],
)
def test_wrong_presses_say_so(wrong, message):
    asked = {"depths": [1e-3], "radius": 5e-3, "fineness": 2} | wrong
    with pytest.raises(ArgumentError, match=message):
        press_block(BLOCK, asked.pop("depths"), **asked)


def test_wrong_holds_say_so():
    mesh = cube(2, 10e-3)
    held = np.ones(mesh.nodes.shape, dtype=bool)
    with pytest.raises(ArgumentError, match="held must have shape"):
        hold_block(BLOCK, mesh, held[1:], np.zeros((1, *held.shape)))
    with pytest.raises(ArgumentError, match="finite where nodes are held"):
        hold_block(BLOCK, mesh, held, np.full((1, *held.shape), np.nan))
    with pytest.raises(ArgumentError, match=r"cells must have shape \(C, 8\)"):
        BlockMesh(nodes=mesh.nodes, cells=mesh.cells[:, :6])
    with pytest.raises(ArgumentError, match=r"cells must name nodes 0..26"):
        BlockMesh(nodes=mesh.nodes, cells=mesh.cells + 1)
    with pytest.raises(ArgumentError, match="turned inside out"):
        BlockMesh(nodes=mesh.nodes, cells=np.roll(mesh.cells, 4, axis=1))


def test_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "felupe", None)
    with pytest.raises(MissingExtraError, match=r"pip install .*\[paper\]'"):
        press_block(BLOCK, [1e-3], radius=5e-3, fineness=2)
