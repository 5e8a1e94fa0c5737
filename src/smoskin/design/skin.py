"""Parts of a skin as records that refuse what cannot be made.

A `SkinDesign` is pure data in SI units. It checks what its own numbers decide (signs, angles,
overlaps, references between parts); whether the magnets' fields suit the chips is physics and
is decided in `smoskin.feasibility`.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from types import MappingProxyType
from typing import Any, Final, Literal

from smoskin.arrays import assign
from smoskin.design.checks import MOST_CELLS, choice, named, part_of_design, share, within
from smoskin.design.materials import ELASTOMERS, FILMS
from smoskin.errors import DesignError, ModelError

Origin = Literal["printed", "inferred", "assumed"]
AXES: Final = ("+x", "-x", "+y", "-y", "+z", "-z")
_LATER: Final = {"vertex_hole": 0.0, "vertex_rubber": 0.0, "rim_share": 1.0, "load_share": 0.0}
"""Values that designs were built with before they could be chosen; they leave a hash as it was."""


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Origin of a value."""

    origin: Origin
    """`printed` in the paper, `inferred` from what it prints, or `assumed`."""
    reason: str = ""
    """Reason for this value."""


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class MiuraCell:
    """The unit cell of the folded sheet (Figure S6)."""

    panel_a: float
    """m: edge a of the parallelogram panel, along the straight (a-) creases."""
    panel_b: float
    """m: edge b, along the zigzag (b-) creases."""
    sector_angle: float
    """rad, alpha: acute corner of the panel."""
    fold_angle: float
    """rad, phi: half the in-plane angle of the zigzag; alpha is flat."""

    def __post_init__(self) -> None:
        within("cell", panel_a=self.panel_a, panel_b=self.panel_b)
        if not 0.0 < self.sector_angle < math.pi / 2:
            raise DesignError(
                f"cell.sector_angle must lie in (0, pi/2) = (0, 1.571) rad; "
                f"got {self.sector_angle:.4g}"
            )
        if not 0.0 < self.fold_angle < self.sector_angle:
            raise DesignError(
                f"cell.fold_angle must lie in (0, alpha) = (0, {self.sector_angle:.4g}) rad; "
                f"got {self.fold_angle:.4g}: such a cell cannot fold"
            )


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Creases:
    """The bare film between two panels, about which they fold."""

    thickness: float
    """m: thickness of the film."""
    gap: float
    """m: width of film left free between the panels' edges."""
    material: str
    """A name in `smoskin.design.materials.FILMS`."""
    set_fraction: float = 1.0
    """Share of the fold that the film keeps unloaded: 1 as folded, 0 where it would lie flat."""
    strip_shift: float = 0.0
    """Share of the strip's shift out of the plane that counts: 0 for an ideal hinge, 1 in full."""
    vertex_hole: float = 0.0
    """m: radius of the holes at vertices that creases and panels lack; 0 for whole ones."""
    vertex_rubber: float = 0.0
    """Share that counts of how rubber on vertices resists their fold: 0 for a point, 1 in full."""

    def __post_init__(self) -> None:
        within("creases", thickness=self.thickness, gap=self.gap, vertex_hole=self.vertex_hole)
        share("creases", set_fraction=self.set_fraction, strip_shift=self.strip_shift)
        share("creases", vertex_rubber=self.vertex_rubber)
        choice("creases", "material", self.material, tuple(FILMS))


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Panels:
    """The stiff plates on both faces of the film, taken as one plate."""

    thickness: float
    """m: thickness of both plates together."""
    material: str
    """A name in `smoskin.design.materials.FILMS`."""
    bonding: float = 1.0
    """Bending stiffness over that of one solid plate: 1/4 where the adhesive lets plates slide."""

    def __post_init__(self) -> None:
        within("panels", thickness=self.thickness)
        share("panels", bonding=self.bonding)
        choice("panels", "material", self.material, tuple(FILMS))


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """The elastomer columns, one under each bottom vertex of the sheet."""

    radius: float
    """m: radius."""
    height: float
    """m: height from the board's upper face to the bottom vertices."""
    material: str
    """A name in `smoskin.design.materials.ELASTOMERS`."""
    rim_share: float = 1.0
    """Share of that height over which columns on the rim are free, where something holds their
    feet."""

    def __post_init__(self) -> None:
        within("columns", radius=self.radius, height=self.height, rim_share=self.rim_share)
        choice("columns", "material", self.material, tuple(ELASTOMERS))


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """The constraint frame round the sheet: a stop of the rim columns, outward only."""

    clearance: float
    """m: outward deflection of a rim column at the held height when it meets the frame."""
    held_height: float
    """m: height above the board's upper face at which the frame holds."""
    stands_on: Literal["board", "base"] = "board"
    """Body that carries the frame; one on the base takes its load past the shear layer."""

    def __post_init__(self) -> None:
        within("frame", clearance=self.clearance, held_height=self.held_height)


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """The circuit board that carries the chips on both faces, under the columns."""

    thickness: float
    """m: thickness."""
    sensing_height: float
    """m: distance from the board's face to the point inside the chip that senses."""

    def __post_init__(self) -> None:
        within("board", thickness=self.thickness, sensing_height=self.sensing_height)


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class ShearLayer:
    """The soft pillars that carry the board, so that a drag moves it over its base."""

    pillars: int
    """Number of pillars."""
    radius: float
    """m: radius."""
    height: float
    """m: height."""
    material: str
    """A name in `smoskin.design.materials.ELASTOMERS`."""
    load_share: float = 0.0
    """Share that counts of how weight and presses soften the pillars against sway."""

    def __post_init__(self) -> None:
        within("shear_layer", pillars=self.pillars, radius=self.radius, height=self.height)
        share("shear_layer", load_share=self.load_share)
        choice("shear_layer", "material", self.material, tuple(ELASTOMERS))


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Magnet:
    """A disc of four sectors, each magnetised along its bisector towards the centre."""

    name: str
    """Name by which hall sites refer to it."""
    mount: Literal["sheet", "base"]
    """Place: on the sheet, in a holder between columns, or on the base below the board."""
    corner: tuple[int, int]
    """(p, q): corner of the grid of cells at which it sits, at (p l, q w)."""
    radius: float
    """m: radius."""
    height: float
    """m: height along its axis z."""
    remanence: float
    """A/m: magnetisation m_0 of each sector."""
    polarity: Literal[-1, 1] = 1
    """+1: magnetised towards the centre; -1: away from it."""
    driver: Literal["notches", "column", "vertex"] = "notches"
    """Part that moves a magnet on the sheet: the notches in which its holder hangs, a column from
    its holder up to the sheet straight above, or the bottom vertex under which it stands in place
    of a column."""
    play: float = 1e-3
    """m: play of the holder's notches on either side of a column."""

    def __post_init__(self) -> None:
        named("magnet", self.name)
        owner = f"magnet {self.name!r}"
        within(owner, radius=self.radius, height=self.height, remanence=self.remanence)
        within(owner, play=self.play)


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class HallSite:
    """One chip, opposite the middle of its magnet at rest."""

    name: str
    """Name printed on the board."""
    magnet: str
    """Name of the magnet that it watches."""
    gap: float
    """m: gap from the magnet's nearer face to the sensing point, at rest."""
    axes: tuple[str, str, str]
    """Directions of the chip's x, y, z in the skin's axes there, such as ("+x", "-y", "-z")."""
    address: int
    """7-bit I2C address."""

    def __post_init__(self) -> None:
        named("hall site", self.name)
        owner = f"hall site {self.name!r}"
        within(owner, gap=self.gap)
        for axis in self.axes:
            choice(owner, "axes", axis, AXES)
        minus = sum(axis[0] == "-" for axis in self.axes)
        letters = "".join(axis[1] for axis in self.axes)
        if letters not in (("xyz", "yzx", "zxy"), ("yxz", "xzy", "zyx"))[minus % 2]:
            raise DesignError(
                f"{owner}.axes must be three different, right-handed directions such as "
                f"('+x', '+y', '+z') or ('+x', '-y', '-z'); got {self.axes}"
            )
        if not 0x08 <= self.address <= 0x77:
            raise DesignError(
                f"{owner}.address must be a 7-bit I2C address in 0x08..0x77; got {self.address:#x}"
            )


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class HallSetting:
    """Setting of every MLX90393 of the skin; the fields are its registers' own."""

    gain_selection: int
    """GAIN_SEL, 0..7: analogue gain 5, 4, 3, 2.5, 2, 1.67, 1.33, 1."""
    resolution: int
    """RES, 0..3: which 16 of the 19 converted bits are read."""
    oversampling: int
    """OSR, 0..3."""
    digital_filter: int
    """DIG_FILT, 0..7."""

    def __post_init__(self) -> None:
        limits = {"gain_selection": 7, "resolution": 3, "oversampling": 3, "digital_filter": 7}
        for name, most in limits.items():
            value = getattr(self, name)
            if not 0 <= value <= most:
                raise DesignError(f"hall_setting.{name} must lie in 0..{most}; got {value}")


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficients:
    """The numbers of the reduced model that theory does not give and calibration finds."""

    attenuation: tuple[float, float]
    """(v_aX, v_aY): how much less each next cell unfolds (S10); 1 is a rigid sheet."""
    stiffness_variation: float
    """v_s: measured over modelled stiffness (S27)."""
    folding_correction_x: tuple[float, ...]
    """N: v_f for shear in X, from the outermost layer of cells inwards (S27)."""
    folding_correction_y: tuple[float, ...]
    """N: v_f for shear in Y, from the outermost layer inwards."""

    def __post_init__(self) -> None:
        for value in self.attenuation:
            if not 0.0 < value <= 1.0:
                raise DesignError(f"coefficients.attenuation must lie in (0, 1]; got {value}")
        within("coefficients", stiffness_variation=self.stiffness_variation)
        layers = len(self.folding_correction_x), len(self.folding_correction_y)
        if not layers[0] == layers[1] > 0 or layers[0] > MOST_CELLS:
            raise DesignError(
                "coefficients.folding_correction_x and _y must name the same layers, from one to "
                f"{MOST_CELLS}; got {layers[0]} and {layers[1]}"
            )
        for value in self.folding_correction_x + self.folding_correction_y:
            within("coefficients", folding_correction=value)


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class Limb:
    """The round limb that a curved skin lies on, its axis along the skin's x: cylinder or cone."""

    skin_radius: float
    """m: radius on which the bottom vertices lie; the limb's own is less by columns, board,
    pillars and base. On a cone it is that at the skin's rim at x = 0."""
    far_radius: float | None = None
    """m: radius at the other rim along x; by default, and where it is the same, a cylinder's."""

    def __post_init__(self) -> None:
        within("limb", skin_radius=self.skin_radius)
        if self.far_radius is not None:
            within("limb", far_radius=self.far_radius)
            if self.far_radius == self.skin_radius:
                assign(self, far_radius=None)

    @property
    def radii(self) -> tuple[float, float]:
        """Radius at either rim along x, m."""
        return self.skin_radius, self.far_radius or self.skin_radius


@part_of_design
@dataclass(frozen=True, slots=True, kw_only=True)
class SkinDesign:
    """A whole skin: what the workshop builds and every model starts from.

    Raises
    ------
    DesignError
        If the parts do not fit each other.
    """

    name: str
    """Name that people call it by."""
    cells: tuple[int, int]
    """(N, M): cells along x and y."""
    cell: MiuraCell
    creases: Creases
    panels: Panels
    columns: Columns
    frame: Frame
    board: Board
    shear_layer: ShearLayer
    magnets: tuple[Magnet, ...]
    """Magnets on the sheet and on the base."""
    halls: tuple[HallSite, ...]
    """Chips in the order of every reading."""
    hall_setting: HallSetting
    coefficients: Coefficients
    limb: Limb | None = None
    """Limb that the skin lies on; a skin without one is planar."""
    provenance: Mapping[str, Provenance] = field(default_factory=dict, compare=False, hash=False)
    """Origin of each value, by dotted field path such as ``cell.panel_a``."""

    def __post_init__(self) -> None:
        assign(self, provenance=MappingProxyType(dict(self.provenance)))
        named("skin", self.name)
        columns, rows = self.cells
        if columns < 1 or rows < 1:
            raise DesignError(f"cells must be at least (1, 1); got {self.cells}")
        if max(self.cells) > MOST_CELLS:
            raise DesignError(f"cells must be at most {MOST_CELLS} a side; got {self.cells}")
        for part, many in (("magnets", self.magnets), ("halls", self.halls)):
            if len(many) > MOST_CELLS:
                raise DesignError(f"{part} must be at most {MOST_CELLS}; got {len(many)}")
        if not self.frame.held_height < self.columns.height:
            raise DesignError(
                f"frame.held_height must be below columns.height, "
                f"{self.columns.height * 1e3:g} mm; got {self.frame.held_height * 1e3:g} mm"
            )
        foot = (1 - self.columns.rim_share) * self.columns.height
        if not foot < self.frame.held_height:
            raise DesignError(
                f"columns.rim_share must leave the rim's columns free below frame.held_height, "
                f"{self.frame.held_height * 1e3:g} mm; got {self.columns.rim_share:g}, free from "
                f"{foot * 1e3:g} mm"
            )
        holed = 2 * self.creases.vertex_hole
        if not holed < (shorter := min(self.cell.panel_a, self.cell.panel_b)):
            raise DesignError(
                f"creases.vertex_hole must leave of creases of {shorter * 1e3:g} mm something "
                f"between two holes; got {self.creases.vertex_hole * 1e3:g} mm"
            )
        _unique("magnets", [magnet.name for magnet in self.magnets])
        _unique("hall sites", [site.name for site in self.halls])
        _unique("hall addresses", [f"{site.address:#x}" for site in self.halls])
        if not self.halls:
            raise DesignError("halls must name at least one chip; got none")
        names = [magnet.name for magnet in self.magnets]
        for site in self.halls:
            choice(f"hall site {site.name!r}", "magnet", site.magnet, tuple(names))
        for magnet in self.magnets:
            p, q = magnet.corner
            if not (0 <= p <= columns and 0 <= q <= rows):
                raise DesignError(
                    f"magnet {magnet.name!r}.corner must lie in (0..{columns}, 0..{rows}); "
                    f"got {magnet.corner}"
                )

    def __reduce__(self) -> tuple[Any, ...]:
        # A mapping proxy cannot be pickled; the dictionary that it shows can.
        values = {part.name: getattr(self, part.name) for part in fields(self)}
        return partial(SkinDesign, **values | {"provenance": dict(self.provenance)}), ()

    @property
    def curvature(self) -> float:
        """One over the limb's radius in the middle, 1/m; positive where the limb is inside."""
        return 0.0 if self.limb is None else 2.0 / sum(self.limb.radii)

    @property
    def content_hash(self) -> str:
        """SHA-256 over every value that is built, names and provenance left out."""
        built = [part.name for part in fields(self) if part.name not in ("name", "provenance")]
        values = {name: getattr(self, name) for name in built}
        if self.limb is None:  # a part that is not there changes nothing
            del values["limb"]
        text = json.dumps(values, default=_built, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    def check_own(self, name: str, content_hash: str) -> None:
        """Raise `ModelError`, naming it, for what was made for a design of another hash."""
        if content_hash != self.content_hash:
            raise ModelError(
                f"{name} must be of the design {self.name!r} ({self.content_hash[:12]}); got one "
                f"of {content_hash[:12]}"
            )

    def magnet(self, name: str) -> Magnet:
        """The magnet of this name."""
        magnets = {magnet.name: magnet for magnet in self.magnets}
        if name not in magnets:
            raise DesignError(f"magnet must be one of {', '.join(magnets)}; got {name!r}")
        return magnets[name]


def _built(part: Any) -> dict[str, Any]:
    """Values of a part that make it another one than it could be before `_LATER`."""
    return {name: v for name, v in asdict(part).items() if _LATER.get(name) != v}


def _unique(what: str, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise DesignError(f"{what} must have different names; {name!r} occurs twice")
