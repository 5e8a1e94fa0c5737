"""A rubber block under an indenter: large deformation by finite elements.

Decides material (nearly incompressible neo-Hookean), elements (hexahedra of mean dilatation, as
plain ones lock) and load stepping. Hides FElupe, which assembles forces and stiffness, Newton's
method with conjugate gradients, and that a press in the middle is solved on a quarter. The
block's frame has its origin in the middle of the lower face, z upwards.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from paper.models.block_mesh import BlockMesh, Quarter, mesh_block, quarter
from smoskin.arrays import Bools, Floats, Ints, floats
from smoskin.errors import ArgumentError, MissingExtraError

Base = Literal["bonded", "sliding"]
"""How the lower face rests: nothing moves, or nothing moves in z."""
Hold = Literal["sticking", "sliding"]
"""How the indenter holds the upper face: no motion in the plane, or a free one."""

_ITERATIONS: Final = 12
"""Newton iterations before a step is cut in half."""
_HALVINGS: Final = 5
"""How often a load step is cut before the press is given up."""
_LINEAR_TOLERANCE: Final = 1e-4
"""Relative residual of a linear solution: four digits an iteration are enough for Newton."""
_LINEAR_ITERATIONS: Final = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A block of rubber on a table."""

    size: tuple[float, float, float]
    """m, along x, y and z."""
    shear_modulus: float
    """Pa, initial."""
    bulk_modulus: float
    """Pa."""
    base: Base = "bonded"
    """How the lower face rests."""

    def __post_init__(self) -> None:
        values = {
            "size": min(self.size),
            "shear_modulus": self.shear_modulus,
            "bulk_modulus": self.bulk_modulus,
        }
        for name, value in values.items():
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} must be positive and finite; got {value}")
        if not self.bulk_modulus > 2.0 * self.shear_modulus:
            raise ArgumentError(
                "bulk_modulus must be above twice the shear modulus, as rubber's is; got "
                f"{self.bulk_modulus:.4g} and {self.shear_modulus:.4g} Pa"
            )
        _one_of("base", self.base, ("bonded", "sliding"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressedBlock:
    """A block in each of K states of load, with the report on their convergence."""

    mesh: BlockMesh
    displacements: Floats
    """(K, P, 3), m; NaN in states that have not converged."""
    forces: Floats
    """(K, P, 3), N, that hold the nodes; zero, to the residual, where nothing holds them."""
    volume_ratios: Floats
    """(K, C): of each cell, deformed over undeformed."""
    residuals: Floats
    """(K,): forces on free nodes over forces on held ones, in the Euclidean norm."""
    iterations: Ints
    """(K,): Newton iterations, failed and halved steps included."""
    converged: Bools
    """(K,): whether the state is an equilibrium, to the tolerance asked for."""

    def at(self, states: Sequence[int]) -> "PressedBlock":
        """Some of the states, by their indices."""
        chosen = list(states)
        return replace(
            self,
            displacements=self.displacements[chosen],
            forces=self.forces[chosen],
            volume_ratios=self.volume_ratios[chosen],
            residuals=self.residuals[chosen],
            iterations=self.iterations[chosen],
            converged=self.converged[chosen],
        )

    @property
    def press_forces(self) -> Floats:
        """(K,), N: how hard the upper face is pressed; positive pushes down."""
        upper = self.mesh.nodes[:, 2] == self.mesh.nodes[:, 2].max()
        return np.asarray(-self.forces[:, upper, 2].sum(axis=1))


def press_block(
    block: Block,
    depths: ArrayLike,
    *,
    radius: float | None,
    hold: Hold = "sticking",
    fineness: int = 8,
    tolerance: float = 1e-8,
) -> PressedBlock:
    """Press a disc in the middle of the upper face down, state by state.

    Parameters
    ----------
    block : Block
    depths : array_like, shape (K,)
        How far, m, in the order in which they are reached.
    radius : float or None
        Of the disc, m; None presses the whole upper face.
    hold : Hold, optional
        Whether the rubber under the disc sticks to it or slides.
    fineness : int, optional
        As for `mesh_block`.
    tolerance : float, optional
        Largest relative residual of an equilibrium.

    Returns
    -------
    PressedBlock
        A state that does not converge, and those after it, hold NaN and say so.

    Raises
    ------
    ArgumentError
        If a depth is negative or reaches through the block, or as `mesh_block`.
    MissingExtraError
        If FElupe is not installed.

    Notes
    -----
    Source: SI Text S6: "a displacement boundary condition of -2 mm was applied at the center of
    the upper surface". Valid while no part of the upper face folds onto the disc's side.
    """
    steps = floats("depths", depths, (None,))
    if steps.ndim != 1 or not np.all((steps >= 0.0) & (steps < 0.9 * block.size[2])):
        raise ArgumentError(
            f"depths must be (K,) numbers in [0, {0.9 * block.size[2]:.4g}) m, within the block; "
            f"got {steps}"
        )
    _one_of("hold", hold, ("sticking", "sliding"))
    plate = 0.25 * min(block.size[:2])
    mesh = mesh_block(block.size, radius=plate if radius is None else radius, fineness=fineness)
    image = quarter(mesh)
    nodes = image.mesh.nodes
    reach = math.inf if radius is None else radius * (1.0 + 1e-9)
    patch = (nodes[:, 2] == nodes[:, 2].max()) & (np.hypot(nodes[:, 0], nodes[:, 1]) <= reach)
    base = nodes[:, 2] == 0.0
    held = np.zeros(nodes.shape, dtype=bool)
    held[:, :2] = nodes[:, :2] == 0.0
    held[base, 2] = held[patch, 2] = True
    if block.base == "bonded":
        held[base] = True
    if hold == "sticking":
        held[patch] = True
    prescribed = np.zeros((len(steps), *nodes.shape))
    prescribed[:, patch, 2] = -steps[:, None]
    return _whole(hold_block(block, image.mesh, held, prescribed, tolerance=tolerance), mesh, image)


def hold_block(
    block: Block,
    mesh: BlockMesh,
    held: ArrayLike,
    displacements: ArrayLike,
    *,
    tolerance: float = 1e-8,
) -> PressedBlock:
    """Equilibria of a block some of whose nodes are held where they are told.

    Parameters
    ----------
    block : Block
        Its moduli matter; its size and base are the mesh's and the caller's.
    mesh : BlockMesh
    held : array_like of bool, shape (P, 3)
        Which components of which nodes are held; enough that the block cannot move as a whole.
    displacements : array_like, shape (K, P, 3)
        Where they are held in each state, m; others are ignored.
    tolerance : float, optional
        Largest relative residual of an equilibrium.

    Returns
    -------
    PressedBlock
        A state that does not converge, and those after it, hold NaN and say so.

    Raises
    ------
    ArgumentError
        If a shape differs or a held displacement is not finite.
    MissingExtraError
        If FElupe is not installed.

    Notes
    -----
    Minimises the integral of G/2 (J^(-2/3) tr(F^T F) - 3) + K/2 (Jm - 1)^2, with Jm the mean of
    J over each cell. Valid for the small K/G-dependent change of volume of rubber.
    """
    nodes = mesh.nodes
    fixed = np.asarray(held, dtype=bool)
    if fixed.shape != nodes.shape:
        raise ArgumentError(f"held must have shape {nodes.shape}; got {fixed.shape}")
    prescribed = floats("displacements", displacements, nodes.shape)
    if prescribed.ndim != 3 or not np.isfinite(prescribed[:, fixed]).all():
        raise ArgumentError(
            "displacements must be (K, P, 3) and finite where nodes are held; "
            f"got shape {prescribed.shape}"
        )
    if not 0.0 < tolerance < 1.0:
        raise ArgumentError(f"tolerance must lie in (0, 1); got {tolerance}")
    count = len(prescribed)
    moved = np.full(prescribed.shape, np.nan)
    forces = moved.copy()
    ratios = np.full((count, len(mesh.cells)), np.nan)
    residuals = np.full(count, np.nan)
    iterations = np.zeros(count, dtype=np.int64)
    converged = np.zeros(count, dtype=bool)
    equilibrium = _Equilibrium(block, mesh, fixed, tolerance)
    for state, goal in enumerate(prescribed):
        reached, iterations[state] = equilibrium.move_to(goal[fixed])
        if reached is None:
            break
        moved[state], forces[state] = reached.displacement, reached.force
        ratios[state], residuals[state] = reached.volume_ratio, reached.residual
        converged[state] = True
    return PressedBlock(
        mesh=mesh,
        displacements=moved,
        forces=forces,
        volume_ratios=ratios,
        residuals=residuals,
        iterations=iterations,
        converged=converged,
    )


class _Reached(NamedTuple):
    """One equilibrium."""

    displacement: Floats
    force: Floats
    volume_ratio: Floats
    residual: float


class _Equilibrium:
    """Newton's method along a path of held displacements; lengths and moduli in natural units."""

    def __init__(self, block: Block, mesh: BlockMesh, held: Bools, tolerance: float) -> None:
        try:
            import felupe
        except ImportError as error:
            raise MissingExtraError("the finite elements of a rubber block", "paper") from error
        self._length = float(np.ptp(mesh.nodes, axis=0).min())
        self._newton = block.shear_modulus * self._length**2
        grid = felupe.Mesh(mesh.nodes / self._length, mesh.cells, "hexahedron")
        region = felupe.RegionHexahedron(grid)
        self._volume = region.dV.sum(axis=0)
        self._motion: Any = felupe.FieldContainer([felupe.Field(region, dim=3)])
        self._body: Any = felupe.SolidBodyNearlyIncompressible(
            felupe.NeoHooke(mu=1.0), self._motion, bulk=block.bulk_modulus / block.shear_modulus
        )
        self._held = held.ravel()
        self._tolerance = tolerance
        self._at = np.zeros(np.count_nonzero(held))

    def move_to(self, goal: Floats) -> tuple[_Reached | None, int]:
        """The equilibrium at held displacements, m, or None; and the iterations it took."""
        start, goal = self._at, goal / self._length
        done, step, spent = 0.0, 1.0, 0
        reached: _Reached | None = None
        while done < 1.0:
            share = min(1.0, done + step)
            reached, used = self._solve(start + share * (goal - start))
            spent += used
            if reached is not None:
                done = share
            elif step > 0.5**_HALVINGS:
                step /= 2.0
            else:
                return None, spent
        return reached, spent

    def _solve(self, held: Floats) -> tuple[_Reached | None, int]:
        """Newton's method from the last equilibrium to the next."""
        values = self._motion[0].values
        before = self._body.checkpoint()
        with np.errstate(all="ignore"):  # a step too long shows as NaN and is cut
            for iteration in range(_ITERATIONS):
                force = self._body.assemble.vector(self._motion).toarray().ravel()
                free = held - values.ravel()[self._held]
                scale = np.linalg.norm(force[self._held])
                loose = np.linalg.norm(force[~self._held])
                ratio = float(loose / scale) if scale > 0.0 else float(loose)
                if not free.any() and ratio <= self._tolerance:
                    if not np.all(np.linalg.det(_gradients(self._motion)) > 0.0):
                        break
                    self._at = held
                    return self._reached(force, ratio), iteration
                if not math.isfinite(ratio):
                    break
                values += self._newton_step(force, free)
        self._body.restore(before)
        return None, _ITERATIONS

    def _newton_step(self, force: Floats, free: Floats) -> Floats:
        """Correction of all displacements, (P, 3)."""
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import cg

        # Without the motion, so that the cells' pressures stay those of the linearised volumes:
        # pressures of the actual ones overshoot and can make the matrix indefinite.
        stiffness = self._body.assemble.matrix().tocsr()[~self._held]
        inner = stiffness[:, ~self._held]
        pull = -force[~self._held] - stiffness[:, self._held] @ free
        scale = 1.0 / np.sqrt(np.abs(inner.diagonal()))
        even = diags_array(scale) @ inner @ diags_array(scale)
        result, _ = cg(even, scale * pull, rtol=_LINEAR_TOLERANCE, maxiter=_LINEAR_ITERATIONS)
        step = np.empty(len(force))
        step[self._held] = free
        step[~self._held] = scale * result
        return step.reshape(-1, 3)

    def _reached(self, force: Floats, residual: float) -> _Reached:
        """The equilibrium in SI."""
        return _Reached(
            displacement=self._motion[0].values * self._length,
            force=force.reshape(-1, 3) * self._newton,
            volume_ratio=self._body.results.state.volume() / self._volume,
            residual=residual,
        )


def _gradients(motion: Any) -> Floats:
    """Deformation gradients at all quadrature points, (..., 3, 3)."""
    return np.moveaxis(motion.extract()[0], (0, 1), (-2, -1))


def _whole(pressed: PressedBlock, mesh: BlockMesh, image: Quarter) -> PressedBlock:
    """What a quarter says of the whole block."""
    return replace(
        pressed,
        mesh=mesh,
        displacements=pressed.displacements[:, image.node] * image.sign,
        forces=pressed.forces[:, image.node] * image.share,
        volume_ratios=pressed.volume_ratios[:, image.cell],
    )


def _one_of(name: str, value: str, valid: Sequence[str]) -> None:
    if value not in valid:
        raise ArgumentError(f"{name} must be one of {', '.join(valid)}; got {value!r}")
