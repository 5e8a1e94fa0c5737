"""How a made skin differs from its design: tolerances, and one draw from them.

Decides what scatters, by how much and how: normally, cut at three standard deviations, so that no
skin is absurd. A draw is data: the twin applies it to its springs, magnets and chips.
"""

import math
from dataclasses import asdict, dataclass, replace
from typing import Final

import numpy as np

from smoskin.arrays import Floats, freeze
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.chip import MadeChips
from smoskin.mechanics.board import Board, board_of
from smoskin.mechanics.sheet.contact import ContactLaw, ScaleContact
from smoskin.mechanics.sheet.lattice import Lattice, build_lattice
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.origami.geometry import geometry

_CUT = 3.0
"""Standard deviations beyond which a part is thrown away."""
CONTACTS: Final = {
    "spread": (3e-3, 7e-3),
    "rim": (0.85, 1.15),
    "patch": (0.2, 0.4),
    "tilt": (1e-3, 4e-3),
}
"""Ranges of a made skin's `ScaleContact`: those of finite elements of covers of 1 to 4 mm and a
little more (`python -m studies.scales`), and patches round Hertz's third."""
_RELATIVE = (
    "stiffness_variation",
    "column_stiffness",
    "crease_stiffness",
    "frame_clearance",
    "remanence",
    "sector_strength",
    "chip_sensitivity",
    "chip_cross_axis",
)
"""Tolerances of factors, which must not come out negative."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """Standard deviations of what scatters from skin to skin and from part to part.

    The paper prints none of them. Each default is an assumption with its reason beside it. It
    raises an `ArgumentError` if one is negative, not finite, or so large that a stiffness could
    come out negative.
    """

    stiffness_variation: float = 0.10
    """v_s: of all rubber of one skin together, relative; a platinum silicone's modulus changes by
    about as much from batch to batch and with the cure."""
    column_stiffness: float = 0.05
    """Stiffness of each column, relative; bubbles, and the radius by 0.02 mm, counting fourfold."""
    column_height: float = 0.1e-3
    """Height of each column, m; what a mould's meniscus and a trimming blade leave. The rubber
    dripped on its top takes the difference up, so that it changes the column's stiffness alone, to
    the first power along the axis and to the third against sway."""
    crease_stiffness: float = 0.15
    """Stiffness of each crease, relative; the gap by a tenth of a millimetre, laser-cut."""
    frame_clearance: float = 0.10
    """Clearance of the whole frame, relative; how it is screwed down."""
    remanence: float = 0.03
    """Remanence of each magnet, relative; filling of the mould, and the coil's pulse."""
    magnet_place: float = 0.15e-3
    """Place of each magnet along each axis, m; hand assembly into a printed holder."""
    magnet_tilt: float = math.radians(1.0)
    """Tilt of each magnet about each axis, rad; 0.17 mm across its diameter."""
    chip_place: float = 0.1e-3
    """Place of each chip along each axis, m; placement and its package's sensing point."""
    chip_tilt: float = math.radians(1.0)
    """Tilt of each chip about each axis, rad; reflow lets a small package turn by as much."""
    chip_sensitivity: float = 0.02
    """Sensitivity of each axis of each chip, relative; as chips of one reel differ."""
    chip_cross_axis: float = 0.01
    """Share of each other axis that each axis of each chip reads, relative."""
    chip_zero: float = 20e-6
    """Zero of each axis of each chip, T; the offset that is left without a field."""
    chip_warmth: float = 1.0
    """Error of each chip's temperature reading, degC."""
    sector_strength: float = 0.0
    """Strength of each of a magnet's four sectors apart from the others, relative."""
    contact: float = 0.0
    """Share of the way from the usual contact law (0) to one drawn for each skin (1): a
    `ScaleContact` anywhere in `CONTACTS`, as mould and glue have it."""

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not 0.0 <= value < math.inf:
                raise ArgumentError(f"{name} must be finite and >= 0; got {value}")
            if name == "contact" and value > 1.0:
                raise ArgumentError(f"contact must lie in [0, 1]; got {value}")
            if name in _RELATIVE and value >= 1.0 / _CUT:
                raise ArgumentError(f"{name} must be below {1 / _CUT:.3f}; got {value}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Deviations:
    """How one made skin differs from its design."""

    columns: Floats
    """(2N + 1, M + 1): stiffness of each column along its axis over the designed one, its rubber
    included."""
    heights: Floats
    """(2N + 1, M + 1): height of each column over the designed one."""
    shear_layer: float
    """Stiffness of the shear layer over the designed one."""
    creases: Floats
    """(C,): stiffness of each crease over the designed one, in the order of the sheet's."""
    frame: float
    """Clearance of the frame over the designed one."""
    remanence: Floats
    """(G,): of each magnet over the designed one."""
    magnet_place: Floats
    """(G, 3), m: off the designed place."""
    magnet_turn: Floats
    """(G, 3), rad: rotation vector off the designed attitude, in the skin's axes."""
    chips: MadeChips
    """Poses and errors of the S chips."""
    sectors: Floats | None = None
    """(G, 4): what each sector of a magnet is stronger than the magnet; None: nothing."""
    contact: ContactLaw | None = None
    """Contact law of the made skin; None: the usual one."""

    def __post_init__(self) -> None:
        freeze(self, columns=(None, None), heights=(None, None))
        freeze(self, creases=(None,), remanence=(None,))
        freeze(self, magnet_place=(None, 3), magnet_turn=(None, 3))
        if self.sectors is not None:
            freeze(self, sectors=(len(self.magnet_place), 4))


def as_designed(design: SkinDesign) -> Deviations:
    """No deviation at all."""
    nothing = Tolerances(**dict.fromkeys(asdict(Tolerances()), 0.0))
    return draw(design, np.random.default_rng(0), nothing)


def drawn_skin(design: SkinDesign, seed: int, tolerances: Tolerances | None = None) -> Deviations:
    """The skin of a seed, as a twin with this seed has it."""
    of_skin, _ = np.random.SeedSequence(seed).spawn(2)
    return draw(design, np.random.default_rng(of_skin), tolerances)


def draw(
    design: SkinDesign, rng: np.random.Generator, tolerances: Tolerances | None = None
) -> Deviations:
    """One skin out of all that the workshop would make; a generator's state gives the same skin.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> made = draw(read_design("planar"), np.random.default_rng(0))
    >>> made.columns.shape, bool(abs(made.columns - 1).max() < 0.6)
    ((13, 7), True)
    """
    limits = tolerances or Tolerances()

    def scatter(spread: float, *shape: int) -> Floats:
        return np.asarray(spread * np.clip(rng.normal(size=shape), -_CUT, _CUT))

    def factor(spread: float, *shape: int) -> Floats:
        return 1.0 + scatter(spread, *shape)

    sheet = geometry(design).sheet
    chips, magnets = len(design.halls), len(design.magnets)
    rubber = float(factor(limits.stiffness_variation))
    height = 1.0 + scatter(limits.column_height, *sheet.columns.shape) / design.columns.height
    columns = rubber * factor(limits.column_stiffness, *sheet.columns.shape) / height
    made = Deviations(
        columns=columns,
        heights=height,
        shear_layer=rubber,
        creases=factor(limits.crease_stiffness, len(sheet.creases)),
        frame=float(factor(limits.frame_clearance)),
        remanence=factor(limits.remanence, magnets),
        magnet_place=scatter(limits.magnet_place, magnets, 3),
        magnet_turn=scatter(limits.magnet_tilt, magnets, 3),
        chips=MadeChips(
            place=scatter(limits.chip_place, chips, 3),
            turn=scatter(limits.chip_tilt, chips, 3),
            sensitivity=factor(limits.chip_sensitivity, chips, 3),
            cross_axis=scatter(limits.chip_cross_axis, chips, 3, 3) * (1 - np.eye(3)),
            zero=scatter(limits.chip_zero, chips, 3),
            warmth=scatter(limits.chip_warmth, chips),
        ),
    )
    # Last, so that all else is the same with and without them.
    contact = _drawn_contact(limits.contact, rng)
    sectors = scatter(limits.sector_strength, magnets, 4) if limits.sector_strength else None
    return replace(made, contact=contact, sectors=sectors)


def _drawn_contact(share: float, rng: np.random.Generator) -> ContactLaw | None:
    """A contact law so far from the usual one to one of `CONTACTS`."""
    if not share:
        return None
    usual = {"spread": 0.0, "rim": 1.0, "patch": 0.0, "tilt": 0.0}
    drawn = {name: rng.uniform(*ends) for name, ends in CONTACTS.items()}
    return ScaleContact(
        **{name: usual[name] + share * (drawn[name] - usual[name]) for name in CONTACTS}
    )


def made_mechanics(
    design: SkinDesign, deviations: Deviations, temperature: float
) -> tuple[Lattice, Board]:
    """The lattice and board that the made skin's mechanics are solved on, its rubber so warm."""
    layer, whole = design.shear_layer, build_lattice(design)
    warmth = float(modulus_factor(design.columns.material, temperature))
    softness = deviations.shear_layer * float(modulus_factor(layer.material, temperature))
    stiffer, height = (part.ravel() for part in (warmth * deviations.columns, deviations.heights))
    supports = replace(
        whole.supports,
        lateral=stiffer / height**2 * whole.supports.lateral,
        axial=stiffer * whole.supports.axial,
    )
    # The frame props columns as stiff as they are; how far they are from it is its own.
    rim = np.zeros(len(whole.nodes))
    rim[whole.feet] = supports.lateral / whole.supports.lateral
    stops = replace(
        whole.stops,
        stiffness=rim[whole.stops.nodes] * whole.stops.stiffness,
        free=deviations.frame * whole.stops.free,
    )
    hinges = whole.hinge_stiffness.copy()
    hinges[whole.panel_hinges :] *= deviations.creases
    made = replace(whole, supports=supports, stops=stops, hinge_stiffness=hinges)
    return made, board_of(design).stiffer(softness)
