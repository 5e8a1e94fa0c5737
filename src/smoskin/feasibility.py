"""Feasibility of a design: what its geometry and its fields decide together.

`smoskin.design` refuses numbers that are wrong by themselves. Here the parts meet: magnets
must clear columns and each other, fit between board and sheet, and keep every chip inside its
range over the whole stroke.
"""

import os
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.document import read_design
from smoskin.design.skin import HallSite, Magnet, SkinDesign
from smoskin.errors import DesignError
from smoskin.magnetics import mlx90393, sector
from smoskin.mechanics.reduced.attenuation import magnet_displacements, profiles
from smoskin.mechanics.reduced.stiffness import board_stiffness, stiffness_map
from smoskin.mechanics.sheet.lattice import swaying_stiffness
from smoskin.origami.geometry import from_columns, geometry

RATED_PRESS: Final = 1.0
"""N: the largest press that a skin must read without saturating, as in the paper."""
RATED_SHEAR: Final = 0.5
"""N: the largest drag that it must read without saturating."""
MARGIN: Final = 0.95
"""Share of a chip's range that the rated stroke may use."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldExtent:
    """Fields at a chip while its magnet goes through the rated stroke."""

    rest: Floats
    """(3,), T: field in the chip's axes, untouched."""
    largest: Floats
    """(3,), T: largest magnitude on each chip axis."""
    stroke: float
    """m: farthest that the magnet moves against the chip along x or y."""


def load_design(name_or_path: str | os.PathLike[str]) -> SkinDesign:
    """Read a design, by the name of a shipped one or as a TOML document, and check that it works.

    Raises
    ------
    DesignError
        If there is no such design, or it cannot be built, fold or be read by its chips; the
        message says which value is wrong and what would be valid.

    Examples
    --------
    >>> load_design("planar").cells
    (6, 6)
    """
    design = read_design(name_or_path)
    try:
        check_design(design)
    except DesignError as error:
        raise DesignError(f"{os.fspath(name_or_path)}: {error}") from error
    return design


def check_design(design: SkinDesign) -> None:
    """Raise `DesignError`, naming part, number and what would be valid, unless it can work."""
    try:
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            _check_room(design)
            _check_depth(design)
            _check_fields(design)
    except ArithmeticError as error:
        raise DesignError(f"the design's values must suit each other; got {error}") from error


def field_extent(design: SkinDesign, site: HallSite) -> FieldExtent:
    """Fields that a chip must read from rest to the rated press and drag anywhere."""
    magnet = design.magnet(site.magnet)
    stroke = _stroke(design, magnet)
    steps = np.linspace(-stroke, stroke, 9)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    rest = geometry(design).rest[design.halls.index(site)]
    points = np.stack([x, y, np.full_like(x, rest[2])], axis=-1)
    seen = sector.field(magnet, points) @ mlx90393.rotation(site)
    return FieldExtent(rest=seen[4, 4], largest=np.abs(seen).max(axis=(0, 1)), stroke=stroke)


def _stroke(design: SkinDesign, magnet: Magnet) -> float:
    """Farthest that a magnet moves against its chip along x or y under the rated touch."""
    if magnet.mount == "base":
        return RATED_SHEAR / board_stiffness(design)
    coefficients = design.coefficients
    depth = RATED_PRESS / stiffness_map(design, coefficients)
    parts = profiles(design.cell, design.cells, coefficients.attenuation, -1.0)
    pressed = np.abs(magnet_displacements(parts, magnet.corner)) * depth[..., None]
    return float(pressed.max()) + RATED_SHEAR / swaying_stiffness(design)


def _check_room(design: SkinDesign) -> None:
    """Magnets against columns, each other, board and sheet."""
    skin = geometry(design)
    for magnet, place in zip(design.magnets, skin.magnets, strict=True):
        if magnet.mount != "sheet":
            continue
        apart = from_columns(skin, place)
        if magnet.driver == "vertex":
            apart = np.delete(apart, apart.argmin())
        room = float(apart.min()) - design.columns.radius
        if magnet.radius >= room:
            raise DesignError(
                f"magnet {magnet.name!r} overlaps a column: radius must be below "
                f"{room * 1e3:.2f} mm at corner {magnet.corner}; got {magnet.radius * 1e3:.2f} mm"
            )
    placed = zip(design.magnets, skin.magnets, skin.magnet_axes[..., 2], strict=True)
    for (other, place, _), (magnet, own, axis) in combinations(placed, 2):
        between = float(np.linalg.norm(np.cross(own - place, axis)))
        least = magnet.radius + other.radius
        if magnet.mount == other.mount and between <= least:
            raise DesignError(
                f"magnets {other.name!r} and {magnet.name!r} overlap: they must be more than "
                f"{least * 1e3:.1f} mm apart; got {between * 1e3:.1f} mm"
            )
    for site in design.halls:
        magnet = design.magnet(site.magnet)
        needed = design.board.sensing_height + site.gap + magnet.height
        if magnet.mount == "sheet" and needed >= design.columns.height:
            raise DesignError(
                f"magnet {magnet.name!r} does not fit between chip and sheet: columns.height must "
                f"exceed {needed * 1e3:.2f} mm (sensing height, gap and magnet); "
                f"got {design.columns.height * 1e3:.2f} mm"
            )


def _check_depth(design: SkinDesign) -> None:
    """What the rated press does to the sheet and to the holders' notches."""
    deepest = float((RATED_PRESS / stiffness_map(design, design.coefficients)).max())
    height = float(geometry(design).cell.height)
    if deepest >= height:
        raise DesignError(
            f"columns are too soft: a press of {RATED_PRESS:g} N must sink the sheet by less than "
            f"its height {height * 1e3:.2f} mm; got {deepest * 1e3:.2f} mm"
        )
    for magnet in design.magnets:
        if magnet.mount == "sheet":
            _check_play(design, magnet)


def _check_play(design: SkinDesign, magnet: Magnet) -> None:
    """Refuse notches so tight that they tie the columns on either side of the magnet together.

    Two tops tied rigidly lock the whole sheet: a press then folds it by a quarter as much.
    """
    parts = profiles(design.cell, design.cells, design.coefficients.attenuation, -1.0)
    depth = (RATED_PRESS / stiffness_map(design, design.coefficients)).max(axis=1)
    p = 2 * magnet.corner[0]
    left, right = max(p - 1, 0), min(p + 1, parts.x.shape[1] - 1)
    needed = float((np.abs(parts.x[:, right] - parts.x[:, left]) * depth).max()) / 2
    if magnet.play < needed:
        raise DesignError(
            f"magnet {magnet.name!r}.play must be at least {needed * 1e3:.2f} mm, so that its "
            f"notches do not tie the columns beside it; got {magnet.play * 1e3:.2f} mm"
        )


def _check_fields(design: SkinDesign) -> None:
    """Every chip inside its range over the rated stroke."""
    limit = MARGIN * mlx90393.full_scale(design.hall_setting)
    for site in design.halls:
        largest = field_extent(design, site).largest
        for axis, name in enumerate("xyz"):
            if largest[axis] > limit[axis]:
                raise DesignError(
                    f"hall site {site.name!r}: |B_{name}| reaches {largest[axis] * 1e3:.1f} mT "
                    f"over the rated stroke and must stay within {limit[axis] * 1e3:.1f} mT "
                    f"({MARGIN:.0%} of the range at this hall_setting); {_remedy(design, site)}"
                )


def _remedy(design: SkinDesign, site: HallSite) -> str:
    """Change that would bring a chip back into its range, as a sentence."""
    limit = MARGIN * mlx90393.full_scale(design.hall_setting)
    magnet = design.magnet(site.magnet)
    stroke = _stroke(design, magnet)
    corners = np.array([[0, 0], [stroke, 0], [0, stroke], [stroke, stroke]])
    for gap in np.arange(site.gap, 10 * magnet.radius, 1e-4):
        depth = np.full((len(corners), 1), -(gap + magnet.height / 2))
        seen = sector.field(magnet, np.concatenate([corners, depth], axis=1)) @ mlx90393.rotation(
            site
        )
        if (np.abs(seen) <= limit).all():
            return f"a gap of at least {gap * 1e3:.1f} mm would do; got {site.gap * 1e3:.1f} mm"
    return f"no gap up to {10 * magnet.radius * 1e3:.0f} mm would do: choose a wider range"
