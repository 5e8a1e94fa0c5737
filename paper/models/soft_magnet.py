"""The paper's comparison: one soft magnet as large as the skin, pressed, beside the folded sheet.

Decides how large the soft magnet is and how it is magnetised, and what is compared with what:
changes of the field at chips, step by step of a press (Figure S10b). Hides how the folded sheet
is pressed to the same depth. Magnet frame as the block's: origin in the middle of the lower
face, z upwards.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from paper.models.block_mesh import BlockMesh
from paper.models.magnetic_rubber import MagneticRubber
from paper.models.solid import Block, PressedBlock
from smoskin.arrays import Floats, floats, freeze
from smoskin.design.materials import ELASTOMERS
from smoskin.design.skin import HallSetting, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.mlx90393 import noise
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Reading

Profile = Literal["sectors", "sinusoid"]
"""How the magnet is magnetised towards its middle: by quadrants, as the skin's magnets, or S3."""

STANDOFF: Final = 3e-3
"""m: how far under the lower face the SI's two points lie."""
REMANENCE: Final = 8.04e5
"""A/m: M_r of Text S6."""
BULK_OVER_SHEAR: Final = 1000.0
"""Ratio of the soft magnet's moduli: Poisson's ratio 0.4995. Rubber has ten times more; a tenth of
it would move the field change by ten percent already."""
_STRONGEST: Final = 1e3
"""N: largest force that is tried to press a skin."""
_CLOSE: Final = 1e-3
"""Relative step of force within which a twin's loss of equilibrium is found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SoftMagnet:
    """A block of magnetic rubber, magnetised towards its middle."""

    block: Block
    remanence: float = REMANENCE
    """A/m, m_0."""
    profile: Profile = "sinusoid"
    """`sinusoid`: S3, of a quarter wave to the farther rim. `sectors`: each quadrant along its
    diagonal."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.remanence) and self.remanence > 0.0):
            raise ArgumentError(f"remanence must be positive and finite; got {self.remanence}")
        if self.profile not in ("sectors", "sinusoid"):
            raise ArgumentError(f"profile must be sectors or sinusoid; got {self.profile!r}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressResponse:
    """What chips at S places see while something is pressed in K steps."""

    depths: Floats
    """(K,), m."""
    forces: Floats
    """(K,), N, of the indenter; NaN where no equilibrium was found."""
    offsets: Floats
    """(S, 2), m, along x and y from the press to the chip."""
    changes: Floats
    """(K, S, 3), T, from the field at rest; NaN where no equilibrium was found."""

    def __post_init__(self) -> None:
        freeze(self, depths=(None,), offsets=(None, 2))
        steps = len(self.depths)
        freeze(self, forces=(steps,), changes=(steps, len(self.offsets), 3))

    def visibility(self, setting: HallSetting) -> Floats:
        """Change over a chip's noise, on the axis where that is largest, shape (K, S)."""
        return np.asarray(np.max(np.abs(self.changes) / noise(setting), axis=-1))


class PressedSkin(Protocol):
    """A twin without noise, as far as the comparison needs it."""

    @property
    def design(self) -> SkinDesign:
        """As built."""
        ...

    def read(self, contacts: Sequence[Contact] = ...) -> Reading:
        """What the chips read under these contacts."""
        ...

    def sheet_vertices(self, contacts: Sequence[Contact] = ...) -> Floats:
        """Vertices of the deformed sheet, shape (V, 3), m."""
        ...


def soft_magnet_like(design: SkinDesign, *, profile: Profile = "sinusoid") -> SoftMagnet:
    """The soft magnet that stands in for a skin.

    Parameters
    ----------
    design : SkinDesign
        Gives the length and width, and the distance from the tops of the sheet to the chips.
    profile : Profile, optional

    Returns
    -------
    SoftMagnet
        As long and as wide as the grid of cells, bonded below, of the columns' rubber.

    Raises
    ------
    ArgumentError
        If the skin is not thicker than the points' distance under the magnet.

    Notes
    -----
    Source: SI Text S6: the dimensions are those of the skin, and the points lie 3 mm under the
    magnet so "that the distance between it and the upper surface of the magnet in the z direction
    matches the thickness" of the skin. Hence the magnet is thinner than the skin by 3 mm; the
    skin's thickness is taken from the tops of the sheet down to the sensing points of the chips.
    """
    cell = geometry(design).cell
    columns, rows = design.cells
    thickness = design.columns.height + float(cell.height) - design.board.sensing_height
    if not thickness > STANDOFF:
        raise ArgumentError(
            f"design must be thicker than {STANDOFF * 1e3:.3g} mm from chip to top; "
            f"got {thickness * 1e3:.3g} mm"
        )
    shear = ELASTOMERS[design.columns.material].shear_modulus
    return SoftMagnet(
        block=Block(
            size=(columns * float(cell.length), rows * float(cell.width), thickness - STANDOFF),
            shear_modulus=shear,
            bulk_modulus=BULK_OVER_SHEAR * shear,
        ),
        profile=profile,
    )


def magnetisation(magnet: SoftMagnet, points: ArrayLike) -> Floats:
    """Remanent magnetisation of the magnet at rest.

    Parameters
    ----------
    magnet : SoftMagnet
    points : array_like, shape (..., 3)
        Where in the undeformed magnet, m.

    Returns
    -------
    Floats, shape (..., 3)
        A/m, in the plane, towards the axis x = y = 0.

    Raises
    ------
    ArgumentError
        If `points` is not (..., 3).

    Notes
    -----
    Source: SI Eq. (S3) for the sinusoid, its sign turned towards the middle and its wave length
    twice the longer side; Text S2's four centripetal segments for the sectors.

    Examples
    --------
    >>> block = Block(size=(0.12, 0.16, 0.01), shear_modulus=25e3, bulk_modulus=2.5e6)
    >>> magnetisation(SoftMagnet(block=block, remanence=1.0), [0.04, -0.08, 0.0]).round(3) + 0.0
    array([-0.707,  1.   ,  0.   ])
    """
    where = floats("points", points, (3,))
    plane = where[..., :2]
    if magnet.profile == "sectors":
        shape = math.sqrt(0.5) * np.sign(plane)
    else:
        shape = np.sin(_wave_number(magnet) * plane)
    result = np.zeros_like(where)
    result[..., :2] = -magnet.remanence * shape
    return result


def magnet_field(
    magnet: SoftMagnet, pressed: PressedBlock, points: ArrayLike, *, tolerance: float = 1e-7
) -> Floats:
    """Flux density of the deformed magnet outside of it.

    Parameters
    ----------
    magnet : SoftMagnet
    pressed : PressedBlock
        Its rubber in K states.
    points : array_like, shape (Q, 3)
        Where, m, fixed in space.
    tolerance : float, optional
        Quadrature error of each component, T.

    Returns
    -------
    Floats, shape (K, Q, 3)
        T; NaN in states that have not converged. All states of a call share their quadrature, so
        that a change between two of them is free of what far, unmoved rubber contributes.

    Raises
    ------
    ArgumentError
        If a shape differs, or a point lies in the magnet or touches it.

    Notes
    -----
    Source: SI Text S6, Figure S10b. A piece of rubber keeps its moment but for stretch and turn,
    m = F m_0 a reference volume, as ideal hard-magnetic rubber does; magnetisation induced in the
    rubber is left out, recoil permeability one. Valid for points outside.
    """
    where = floats("points", points, (None, 3))
    return _fields(magnet, pressed.mesh, pressed.displacements, where, tolerance)


def soft_response(
    magnet: SoftMagnet,
    pressed: PressedBlock,
    offsets: ArrayLike,
    *,
    standoff: float = STANDOFF,
    tolerance: float = 1e-7,
) -> PressResponse:
    """Field changes under the soft magnet while it is pressed in the middle.

    Parameters
    ----------
    magnet : SoftMagnet
    pressed : PressedBlock
        In K states.
    offsets : array_like, shape (S, 2)
        Of the chips from the press, m.
    standoff : float, optional
        How far they lie under the lower face, m.
    tolerance : float, optional
        As for `magnet_field`.

    Raises
    ------
    ArgumentError
        As `magnet_field`.
    """
    places = floats("offsets", offsets, (None, 2))
    chips = np.column_stack([places, np.full(len(places), -standoff)])
    rest = np.zeros_like(pressed.displacements[:1])
    states = np.concatenate([rest, pressed.displacements])
    field = _fields(magnet, pressed.mesh, states, chips, tolerance)
    upper = pressed.mesh.nodes[:, 2] == pressed.mesh.nodes[:, 2].max()
    return PressResponse(
        depths=-pressed.displacements[:, upper, 2].min(axis=1),
        forces=pressed.press_forces,
        offsets=places,
        changes=field[1:] - field[:1],
    )


def skin_response(skin: PressedSkin, position: ArrayLike, depths: ArrayLike) -> PressResponse:
    """Field changes at a folded skin's chips while one place is pressed.

    Parameters
    ----------
    skin : PressedSkin
        A twin without noise (``seed=None``).
    position : array_like, shape (2,)
        Of the press, m.
    depths : array_like, shape (K,)
        How far the lowest-sunk vertex of the sheet goes down, m.

    Returns
    -------
    PressResponse
        In the chips' own axes; NaN where the twin finds no equilibrium.

    Raises
    ------
    ArgumentError
        If a depth is negative, the position lies off the skin, or no force of up to 1 kN
        presses so deep.
    """
    steps = floats("depths", depths, (None,))
    if steps.ndim != 1 or not np.all(steps >= 0.0):
        raise ArgumentError(f"depths must be (K,) numbers >= 0 m; got {steps}")
    place = floats("position", position, (2,))
    rest = skin.sheet_vertices()

    def contacts(force: float) -> tuple[Contact, ...]:
        return (Contact(position=place, force=(0.0, 0.0, -force)),) if force else ()

    def sunk(force: float) -> float:
        return float((rest - skin.sheet_vertices(contacts(force)))[:, 2].max())

    still = skin.read().field
    forces = np.array([_force_to(depth, sunk) for depth in steps.tolist()])
    changes = np.full((len(steps), len(still), 3), np.nan)
    for step, force in enumerate(forces.tolist()):
        if math.isfinite(force):
            changes[step] = skin.read(contacts(force)).field - still
    chips = geometry(skin.design).chips[:, :2]
    return PressResponse(depths=steps, forces=forces, offsets=chips - place, changes=changes)


def watched_everywhere(design: SkinDesign) -> SkinDesign:
    """The same skin with a magnet on the sheet and a chip at every inner corner of its cells.

    Raises
    ------
    ArgumentError
        If no chip watches a magnet on the sheet, which would be the one to repeat.
    """
    on_sheet = {magnet.name: magnet for magnet in design.magnets if magnet.mount == "sheet"}
    sites = [site for site in design.halls if site.magnet in on_sheet]
    if not sites:
        raise ArgumentError("design must have a chip that watches a magnet on the sheet; got none")
    site, magnet = sites[0], on_sheet[sites[0].magnet]
    columns, rows = design.cells
    corners = [(p, q) for p in range(1, columns) for q in range(1, rows)]
    return replace(
        design,
        name=f"{design.name}, watched everywhere",
        magnets=tuple(replace(magnet, name=f"M{p}{q}", corner=(p, q)) for p, q in corners),
        halls=tuple(
            replace(site, name=f"S{p}{q}", magnet=f"M{p}{q}", address=0x08 + index)
            for index, (p, q) in enumerate(corners)
        ),
    )


def _force_to(depth: float, sunk: Callable[[float], float]) -> float:
    """Force, N, under which the skin sinks so far; NaN where the twin finds no equilibrium."""
    # Here, so that whoever only imports the package does not wait for it.
    from scipy.optimize import brentq

    if depth == 0.0:
        return 0.0
    low, high, lost = 0.0, 1.0, math.inf
    while not (reach := sunk(high)) >= depth:
        if math.isnan(reach):
            lost = high
        else:
            low = high
        high = min(2.0 * high, 0.5 * (low + lost))
        if high > _STRONGEST:
            raise ArgumentError(
                f"depths must be within reach of {_STRONGEST:g} N; {depth * 1e3:.3g} mm is not"
            )
        if lost - low < _CLOSE * low:
            return math.nan
    return float(brentq(lambda force: sunk(force) - depth, low, high, xtol=1e-7, rtol=1e-6))


def _fields(
    magnet: SoftMagnet, mesh: BlockMesh, displacements: Floats, points: Floats, tolerance: float
) -> Floats:
    """B (K, Q, 3) at points outside, all states by one quadrature; NaN in states without one."""
    solved = np.asarray(np.isfinite(displacements).all(axis=(1, 2)))
    states = mesh.nodes + displacements[solved]
    rubber = MagneticRubber(
        mesh.nodes[mesh.cells],
        states[:, mesh.cells],
        partial(magnetisation, magnet),
        strength=magnet.remanence,
        smoothness=2.0 / _wave_number(magnet) if magnet.profile == "sinusoid" else math.inf,
    )
    fields = np.full((len(solved), *points.shape), np.nan)
    fields[solved] = rubber.field(points, tolerance=tolerance)
    return fields


def _wave_number(magnet: SoftMagnet) -> float:
    """Wave number k of S3, 1/m: a quarter wave to the farther rim."""
    return math.pi / max(magnet.block.size[:2])
