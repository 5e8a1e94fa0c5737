"""Material values that designs refer to by name, each with the source it was taken from.

Values of soft and bonded materials scatter by tens of percent from batch to batch; they are
where a design starts, and calibration replaces them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final


@dataclass(frozen=True, slots=True, kw_only=True)
class Elastomer:
    """A rubber for columns, pillars and scales."""

    shear_modulus: float
    """Pa: initial slope at 25 degC, long-term, under a load that stays."""
    source: str
    """Source of the modulus."""
    relaxing_shares: tuple[float, ...] = (0.03, 0.02, 0.02, 0.02)
    """g_k: shares of the instantaneous modulus that relax (`mechanics.viscoelasticity.Prony`)."""
    relaxation_times: tuple[float, ...] = (0.05, 0.5, 5.0, 50.0)
    """s: tau_k, relaxation time of each share, rising."""
    relaxation_source: str = (
        "assumed, 9 % over four decades: no Prony series of it is known to be published; Ecoflex "
        "relaxes markedly when new and hardly once it has been worked (Liao, Hossain and Yao 2020, "
        "Mechanics of Materials 144). Fit a recorded recovery instead"
    )
    """Source of the shares and times."""
    temperature_coefficient: float = 1 / 298.15
    """1/degC: relative rise of the modulus per degree from 25 degC; assumed in proportion to the
    absolute temperature, as of an ideal rubber."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """A stiff material for panels and crease film."""

    young_modulus: float
    """Pa: stiffness in tension."""
    poisson_ratio: float
    """Transverse over axial strain, sign reversed."""
    source: str
    """Source of the values."""


ELASTOMERS: Final[Mapping[str, Elastomer]] = MappingProxyType(
    {
        "Ecoflex 00-30": Elastomer(
            shear_modulus=25e3,
            source="Smooth-On Ecoflex series technical bulletin: 69 kPa (10 psi) at 100 % strain",
        ),
        "Ecoflex 00-50": Elastomer(
            shear_modulus=30e3,
            source="Smooth-On Ecoflex series technical bulletin: 83 kPa (12 psi) at 100 % strain",
        ),
        "Dragon Skin 10": Elastomer(
            shear_modulus=55e3,
            source="Smooth-On Dragon Skin series technical bulletin: 152 kPa at 100 % strain",
        ),
    }
)
"""A neo-Hookean rubber at stretch 2 carries G (2 - 1/4), whence G from the printed modulus;
the Ecoflex 00-30 value is lowered to the middle of what small-strain tests report."""

FILMS: Final[Mapping[str, Film]] = MappingProxyType(
    {
        "acrylic": Film(
            young_modulus=3.2e9,
            poisson_ratio=0.37,
            source="cast PMMA sheet, typical data sheet values",
        ),
        "polyimide": Film(
            young_modulus=2.5e9,
            poisson_ratio=0.34,
            source="DuPont Kapton HN summary of properties, 23 degC",
        ),
    }
)

PLATES: Final = (2e-3, 1.5e-3, 1e-3, 0.8e-3, 0.5e-3, 0.38e-3, 0.25e-3)
"""m: thicknesses of plates that are sold, of panels on one face of the film. Assumed, as usual of
acrylic sheets and films."""

DENSITY: Final[Mapping[str, float]] = MappingProxyType(
    {
        "acrylic": 1190.0,
        "polyimide": 1420.0,
        "adhesive": 1000.0,
        "rubber": 1070.0,
        "magnet": 5500.0,
        "board": 1850.0,
        "print": 1240.0,
    }
)
"""kg/m3; rubber: Smooth-On's Ecoflex bulletin, magnet: bonded NdFeB, print: solid PLA or PETG."""
