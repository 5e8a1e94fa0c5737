"""How touches anywhere on the skin become loads on top vertices, and how they grip it.

The SI loads top vertices only. A touch between them presses the four round it through the
elastomer scales, in shares that keep its force and its moment: linear along each axis. Past the
outermost vertices the scales are a lever over the last two, so that the inner one is pulled. A
touch of some radius takes the mean of that over its disc.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats, assign, floats, frozen
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact

_SLACK = 1e-6
"""m: distance past the rim that is taken for rounding."""

FINGERTIP: Final = 4e-3
"""m: radius of the patch under a fingertip that presses with about a newton. Assumed."""

_RINGS, _SPOKES = 4, 12
"""Points of the rule that averages over a disc; the shares bend at the lines between vertices,
where the rule is good to about a thousandth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sticking:
    """Touch that stands still in the plane while it presses, then drags what it has gripped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sliding:
    """Touch that sticks until the sideways force passes what friction holds."""

    friction: float
    """Largest sideways force over the normal force."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.friction) and self.friction >= 0.0):
            raise ArgumentError(f"friction must be finite and >= 0; got {self.friction}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Frictionless:
    """Touch that holds nothing in the plane: only the drag asked for acts sideways."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Covered:
    """Cover panels, one for each cell, each on a bar that the board guides along z.

    Notes
    -----
    Source: SI Figure S16: a touch anywhere above a cell becomes a motion of its top vertex in z
    alone. A drag goes through the guides into the board.
    """


Grip = Sticking | Sliding | Frictionless | Covered


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Touches:
    """Touches of the skin in each of B cases, up to K touches a case.

    It raises an `ArgumentError` if shapes disagree, a number is not finite, a force pulls or a
    radius is not positive.

    Examples
    --------
    >>> touches = Touches(position=[[[0.05, 0.07]]], force=[[[0.0, 0.0, -0.5]]])
    >>> touches.radius.tolist(), touches.pressed.tolist()
    ([[0.004]], [[True]])
    """

    position: Floats
    """(B, K, 2), m: places on the undeformed skin."""
    force: Floats
    """(B, K, 3), N: forces on the skin, z <= 0; where all three are zero there is no touch."""
    radius: Floats
    """(B, K), m: radii of the patches; `FINGERTIP` by default."""

    def __init__(
        self, *, position: ArrayLike, force: ArrayLike, radius: ArrayLike = FINGERTIP
    ) -> None:
        where = frozen("position", position, (None, None, 2))
        push = frozen("force", force, (*where.shape[:2], 3))
        if not np.isfinite(where).all():
            raise ArgumentError("position must be finite; got NaN or infinity")
        bad = ~np.isfinite(push).all(axis=-1) | (push[..., 2] > 0)
        if bad.any():
            raise ArgumentError(
                f"force must be finite and press, with z <= 0 N; got {push[bad][0]} N"
            )
        wide = np.broadcast_to(floats("radius", radius), where.shape[:2])
        if not (np.isfinite(wide) & (wide > 0)).all():
            raise ArgumentError(f"radius must be positive and finite; got {np.min(wide)} m")
        assign(self, position=where, force=push, radius=frozen("radius", wide, where.shape[:2]))

    def __len__(self) -> int:
        return len(self.position)

    @property
    def pressed(self) -> Bools:
        """Whether there is a touch in each place, (B, K)."""
        return np.asarray((self.force != 0).any(axis=-1))


def touches_of(cases: Sequence[Sequence[Contact]], *, radius: float = FINGERTIP) -> Touches:
    """Touches of some cases, each a sequence of contacts; shorter ones are filled up.

    Examples
    --------
    >>> press = Contact(position=(0.05, 0.07), force=(0.0, 0.0, -0.5))
    >>> touches_of([[press], [], [press, press]]).pressed.tolist()
    [[True, False], [False, False], [True, True]]
    """
    most = max((len(contacts) for contacts in cases), default=0)
    position, force = np.zeros((len(cases), most, 2)), np.zeros((len(cases), most, 3))
    for row, contacts in enumerate(cases):
        for place, contact in enumerate(contacts):
            position[row, place], force[row, place] = contact.position, contact.force
    return Touches(position=position, force=force, radius=radius)


def vertex_shares(design: SkinDesign, positions: ArrayLike) -> Floats:
    """Share of a touch at positions (..., 2), m, that each cell's top vertex takes, (..., N, M).

    Their sum over the cells is 1, their mean place the touch's own; along an axis with a single
    cell that one takes it all. It raises an `ArgumentError` if a position lies off the skin.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> shares = vertex_shares(read_design("planar"), [[0.015, 0.160 / 12], [0.0, 0.160 / 12]])
    >>> shares[:, :3, 0].round(3).tolist()
    [[0.75, 0.25, 0.0], [1.5, -0.5, 0.0]]
    """
    where = floats("positions", positions, (2,))
    _check_places(design, where)
    along, across = _both_lines(design, where)
    return np.asarray(along[..., :, None] * across[..., None, :])


def patch_shares(design: SkinDesign, touches: Touches) -> Floats:
    """Mean of `vertex_shares` over each touch's disc, shape (B, K, N, M).

    A disc counts whole where it reaches past the rim; a touch whose middle lies off the skin raises
    an `ArgumentError`.
    """
    check_on_skin(design, touches)
    return mean_shares(design, patch_points(touches, touches.radius))


def mean_shares(design: SkinDesign, points: Floats) -> Floats:
    """Mean of bilinear shares over points (B, K, P, 2), m, anywhere; shape (B, K, N, M)."""
    along, across = _both_lines(design, points)
    total: Floats = np.einsum("bkpn,bkpm->bknm", along, across)
    return np.asarray(total / along.shape[2])


def patch_slopes(design: SkinDesign, touches: Touches) -> Floats:
    """Derivative of `patch_shares` by the touches' positions, shape (B, K, 2, N, M), 1/m."""
    check_on_skin(design, touches)
    points = patch_points(touches, touches.radius)
    along, across = _both_lines(design, points)
    along_slope, across_slope = _both_lines(design, points, slopes=True)
    by_x = np.einsum("bkpn,bkpm->bknm", along_slope, across)
    by_y = np.einsum("bkpn,bkpm->bknm", along, across_slope)
    return np.asarray(np.stack([by_x, by_y], axis=2) / points.shape[2])


def cover_shares(design: SkinDesign, touches: Touches) -> Floats:
    """Shares under cover panels: each touch's own cell takes it whole, shape (B, K, N, M).

    A touch whose middle lies off the skin raises an `ArgumentError`.
    """
    check_on_skin(design, touches)
    extent = geometry(design).cell
    cell = (touches.position / [extent.length, extent.width]).astype(np.int64)
    cell = np.clip(cell, 0, np.subtract(design.cells, 1))
    shares = np.zeros((*cell.shape[:2], *design.cells))
    row, place = np.indices(cell.shape[:2])
    shares[row, place, cell[..., 0], cell[..., 1]] = 1.0
    return shares


def patch_points(touches: Touches, radius: Floats) -> Floats:
    """Points of discs of these radii, (B, K), m, round the touches' places: (B, K, P, 2), m."""
    ring, spoke = np.indices((_RINGS, _SPOKES)).reshape(2, -1)
    # Rings of equal area, every other one turned by half a spoke.
    reach = np.sqrt((ring + 0.5) / _RINGS)
    angle = 2 * np.pi * (spoke + 0.5 * (ring % 2)) / _SPOKES
    offset = np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=-1)
    points: Floats = touches.position[:, :, None] + radius[..., None, None] * offset
    return points


def _both_lines(design: SkinDesign, where: Floats, *, slopes: bool = False) -> list[Floats]:
    """`_line_shares` along x, (..., N), and along y, (..., M), of loads at `where`, (..., 2)."""
    return [
        _line_shares(vertices, where[..., axis], slopes)
        for axis, vertices in enumerate(geometry(design).lines)
    ]


def _line_shares(vertices: Floats, where: Floats, slopes: bool) -> Floats:
    """Shares, (..., L), that keep a load's force and moment on a line, or their slopes, 1/m."""
    line = np.arange(len(vertices))
    if len(line) == 1:
        return np.full((*where.shape, 1), 0.0 if slopes else 1.0)
    before = np.searchsorted(vertices, where, side="right") - 1
    before = np.clip(before, 0, len(line) - 2)
    pitch = np.diff(vertices)[before]
    here, after = line == before[..., None], line == before[..., None] + 1
    if slopes:
        return np.asarray((after * 1.0 - here) / pitch[..., None])
    past = ((where - vertices[before]) / pitch)[..., None]
    return np.asarray(here * (1 - past) + after * past)


def check_on_skin(design: SkinDesign, touches: Touches) -> None:
    """Raise an `ArgumentError` if the middle of a touch lies off the skin."""
    _check_places(design, touches.position[touches.pressed])


def _check_places(design: SkinDesign, where: Floats) -> None:
    """Refuse positions off the skin."""
    whole = geometry(design).extent
    off = ~((where >= -_SLACK) & (where <= whole + _SLACK)).all(axis=-1)
    if off.any():
        x, y = where[off][0] * 1e3
        raise ArgumentError(
            f"position must lie on the skin, (0..{whole[0] * 1e3:.1f}, 0..{whole[1] * 1e3:.1f}) "
            f"mm; got ({x:.1f}, {y:.1f}) mm"
        )
