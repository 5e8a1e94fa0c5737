"""The comparison with a soft magnet, as arrays and rows: Figure S10.

Decides what is pressed and where it is watched: the soft magnet in its middle, at the SI's two
points and along their line; the folded sheet on its corner cell, from which chips lie 100 mm away
each way. What the rubber, the magnets and the sheet do is `paper.models.soft_magnet`'s.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from paper.models.soft_magnet import (
    PressedSkin,
    PressResponse,
    SoftMagnet,
    magnet_field,
    skin_response,
    soft_magnet_like,
    soft_response,
)
from paper.models.solid import PressedBlock, press_block
from paper.rows import Row, stated
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.mlx90393 import noise
from smoskin.origami.geometry import geometry

DEPTHS: Final = (0.0, 0.5e-3, 1.0e-3, 1.5e-3, 2.0e-3)
"""m; the last as printed."""
PATCH: Final = 5e-3
"""m: radius of the pressed disc. Assumed."""
POINTS: Final = ((0.0, 0.0), (0.1, 0.1))
"""m from the press, as printed."""
AWAY: Final = 0.1
"""m: what counts as far from the press."""
_LINE: Final = 9
"""Places from the press to the far point."""
_SECTION: Final = (13, 9)
"""Places of the field map along x, to either side of the middle, and along z above and below."""
_REACH: Final = (40e-3, 12e-3)
"""m that the map reaches along x, and above and below the magnet."""
_CLEAR: Final = 0.7e-3
"""m that the map keeps from the magnet."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Variant:
    """The same press of another soft magnet that the SI's words allow too."""

    name: str
    change: Floats
    """(2, 3), T: at both points, after the whole press."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """The soft magnet and the folded sheet under presses of the same depths."""

    magnet: SoftMagnet
    pressed: PressedBlock
    points: PressResponse
    """At the SI's two points."""
    line: PressResponse
    """On the line from one to the other."""
    sheet: PressResponse
    """At chips under the folded sheet."""
    variants: tuple[Variant, ...]
    noise: Floats
    """(3,), T: of one reading of a chip."""
    sheet_visibility: Floats
    """(S,): change over noise after the whole press."""
    visibility: Floats
    """(2,): the same at the SI's two points."""
    line_visibility: Floats
    """(L,): the same on the line."""
    section_x: Floats
    """(I,), m."""
    section_z: Floats
    """(J,), m; none lies within the magnet's height."""
    section: Floats
    """(2, J, I), T: magnitude of B in the plane y = 0 at rest and after the whole press."""
    section_change: Floats
    """(J, I), T: magnitude of the change from one to the other."""


def compare(design: SkinDesign, skin: PressedSkin, *, fineness: int = 6) -> Comparison:
    """Press both.

    Parameters
    ----------
    design : SkinDesign
        The skin whose dimensions the soft magnet takes.
    skin : PressedSkin
        A twin, without noise, of that skin with chips all over it
        (`paper.models.soft_magnet.watched_everywhere`).
    fineness : int, optional
        Of the soft magnet's mesh.

    Raises
    ------
    MissingExtraError
        If FElupe is not installed.
    """
    magnet = soft_magnet_like(design)
    pressed = press_block(magnet.block, DEPTHS, radius=PATCH, fineness=fineness)
    setting = design.hall_setting
    points = soft_response(magnet, pressed, POINTS)
    line = soft_response(
        magnet, pressed.at([-1]), np.linspace(0.0, 1.0, _LINE)[:, None] * np.array(POINTS[1])
    )
    sheet = skin_response(skin, geometry(design).tops[0, 0], DEPTHS)
    x, z, section, change = _section(magnet, pressed)
    return Comparison(
        magnet=magnet,
        pressed=pressed,
        points=points,
        line=line,
        sheet=sheet,
        variants=_variants(magnet, pressed, fineness),
        noise=noise(setting),
        sheet_visibility=sheet.visibility(setting)[-1],
        visibility=points.visibility(setting)[-1],
        line_visibility=line.visibility(setting)[-1],
        section_x=x,
        section_z=z,
        section=section,
        section_change=change,
    )


def comparison_rows(found: Comparison) -> list[Row]:
    """What Text S6 says of Figure S10, beside what came out."""
    near, far = np.linalg.norm(found.points.changes[-1], axis=-1) * 1e6
    away = np.hypot(*found.sheet.offsets.T) >= AWAY
    least = np.linalg.norm(found.sheet.changes[-1, away], axis=-1).min() * 1e6
    others = "; ".join(
        f"{one.name} {np.linalg.norm(one.change[0]) * 1e6:.0f} and "
        f"{np.linalg.norm(one.change[1]) * 1e6:.2g} uT"
        for one in found.variants
    )
    place = "Text S6, Figure S10b"
    return [
        stated(
            "figure_s10.near",
            place,
            "a notable change in the magnetic field near the deformed area",
            f"{near:.0f} uT at (0, 0, -3) mm, {found.visibility[0]:.0f} times the chip's noise",
            bool(found.visibility[0] > 10),
            "finite elements of a bonded block, magnetised as S3, pressed by 2 mm on a disc of "
            "5 mm radius",
        ),
        stated(
            "figure_s10.far",
            place,
            "at (100, 100, -3) minimal change, which the chip does not detect",
            f"{far:.2g} uT, {found.visibility[1]:.2g} times the noise of one reading",
            bool(found.visibility[1] < 1),
            f"the same block; others that the words allow, near and far: {others}",
        ),
        stated(
            "figure_s10.sheet",
            "Text S6",
            "the comparison illustrates the effect of the folded structure",
            f"{least:.0f} uT or more at every chip {AWAY * 1e3:.0f} mm or more away, "
            f"{found.sheet_visibility[away].min():.0f} times the noise",
            bool(found.sheet_visibility[away].min() > 10),
            "the twin pressed by 2 mm on cell (1,1), chips under all inner corners of the cells",
        ),
    ]


def _variants(magnet: SoftMagnet, pressed: PressedBlock, fineness: int) -> tuple[Variant, ...]:
    """Four sectors; a magnet that reaches over both points; one that slides on its base."""
    length, width, height = magnet.block.size
    wide = replace(magnet, block=replace(magnet.block, size=(2 * length, 2 * width, height)))
    loose = replace(magnet, block=replace(magnet.block, base="sliding"))
    found = [("in four sectors", replace(magnet, profile="sectors"), pressed.at([-1]))]
    for name, other in (("twice as long and wide", wide), ("sliding on its base", loose)):
        block = press_block(other.block, DEPTHS[-1:], radius=PATCH, fineness=fineness)
        found.append((name, other, block))
    return tuple(
        Variant(name=name, change=soft_response(other, block, POINTS).changes[-1])
        for name, other, block in found
    )


def _section(magnet: SoftMagnet, pressed: PressedBlock) -> tuple[Floats, Floats, Floats, Floats]:
    """Magnitudes of B and its change above and below the magnet; x < 0 mirrors the other half."""
    reach, beyond = _REACH
    height = magnet.block.size[2]
    half = np.linspace(0.0, reach, _SECTION[0])
    step = np.linspace(_CLEAR, beyond, _SECTION[1])
    z = np.concatenate([-step[::-1], height + step])
    where = np.stack(np.meshgrid(half, [0.0], z, indexing="ij"), axis=-1)[:, 0]
    field = magnet_field(magnet, pressed.at([0, -1]), where.reshape(-1, 3), tolerance=1e-3)
    both = np.concatenate([field, field[1:] - field[:1]])
    size = np.linalg.norm(both, axis=-1).reshape(3, len(half), len(z)).swapaxes(1, 2)
    whole = np.concatenate([size[:, :, :0:-1], size], axis=2)
    return np.concatenate([-half[:0:-1], half]), z, whole[:2], whole[2]
