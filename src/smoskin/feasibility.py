"""Feasibility of a design: what its geometry and its fields decide together.

`smoskin.design` refuses numbers that are wrong by themselves. Here the parts meet: magnets
must clear columns and each other, fit between board and sheet, and keep every chip inside its
range over the whole stroke.
"""

import os
from bisect import bisect_left
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.document import read_design
from smoskin.design.skin import HallSite, Magnet, SkinDesign
from smoskin.errors import ArgumentError, DesignError
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
SHIM: Final = 0.1e-3
"""m: step in which gaps are made."""
_REMANENCES: Final = 0.3e6, 1.2e6
"""A/m: 0.38 to 1.5 T, of what may be a bonded magnet."""
_LEAST_GAP: Final = 2.0e-3
"""m: the package over the sensing point, the holder's floor, a deep press and play."""
_MOST_GAP: Final = 12e-3
"""m: more than columns leave room for."""
_SLIP: Final = 0.5e-3
"""m: nearer than designed, a made skin's magnet under the rated press."""
_STRONGER: Final = 1.09
"""Strongest magnet of a set over the one measured."""
_FRONT_END: Final = 50e-3
"""T: largest field along an axis for which the chip is specified."""


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


def suited_to(design: SkinDesign, remanence: float) -> SkinDesign:
    """The design with gaps and gain for magnets of this remanence, A/m.

    Each gap changes, by shims or a lower holder, until its chip reads at rest as designed, or is as
    small as can be; the finest gain follows that holds the rated stroke of made skins.

    Raises
    ------
    ArgumentError
        If the remanence is no permanent magnet's.
    DesignError
        If no gap and gain keep a chip in its range.

    Examples
    --------
    >>> weak = suited_to(load_design("planar"), 0.55 / 1.2566e-6)  # bonded magnets of 0.55 T
    >>> [round(1e3 * site.gap, 1) for site in weak.halls], weak.hall_setting.gain_selection
    ([4.4, 4.3, 4.3], 3)
    """
    if not _REMANENCES[0] <= remanence <= _REMANENCES[1]:
        low, high = _REMANENCES
        raise ArgumentError(f"remanence must lie in {low:g}..{high:g} A/m; got {remanence:g}")
    magnets = tuple(replace(magnet, remanence=remanence) for magnet in design.magnets)
    other = replace(design, magnets=magnets, provenance={})
    sites, worst = [], np.zeros(3)
    for site in design.halls:
        gap = _suited_gap(design, other, site)
        sites.append(replace(site, gap=gap))
        worst = np.maximum(worst, _made_field(other, site, gap))
    for gain in reversed(range(8)):
        setting = replace(design.hall_setting, gain_selection=gain)
        if (worst <= MARGIN * mlx90393.full_scale(setting)).all():
            return replace(other, halls=tuple(sites), hall_setting=setting)
    raise DesignError(
        f"no gain holds {1e3 * float(worst.max()):.1f} mT at resolution "
        f"{design.hall_setting.resolution}; a coarser one would do"
    )


def _suited_gap(design: SkinDesign, other: SkinDesign, site: HallSite) -> float:
    """Least gap at which a chip of the other design reads no more at rest than designed, m."""
    most = np.linalg.norm(field_extent(design, site).rest)

    def fits(gap: float) -> bool:
        near = replace(site, gap=gap)
        rest = np.linalg.norm(field_extent(_with_site(other, site, near), near).rest)
        return bool(rest <= most and (_made_field(other, site, gap) <= _FRONT_END).all())

    gaps = np.arange(_LEAST_GAP, _MOST_GAP, SHIM).round(9).tolist()
    k = bisect_left(gaps, True, key=fits)
    if k == len(gaps):
        raise DesignError(
            f"hall site {site.name!r}: no gap up to {1e3 * _MOST_GAP:g} mm brings the magnets into "
            "the range of the chip"
        )
    return float(gaps[k])


def _made_field(design: SkinDesign, site: HallSite, gap: float) -> Floats:
    """Largest field on each axis of a chip over the rated stroke of made skins, (3,), T."""
    near = replace(site, gap=gap - _SLIP)
    return _STRONGER * field_extent(_with_site(design, site, near), near).largest


def _with_site(design: SkinDesign, old: HallSite, new: HallSite) -> SkinDesign:
    """The design with one chip at another gap."""
    return replace(design, halls=tuple(new if site == old else site for site in design.halls))


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
