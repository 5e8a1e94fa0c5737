"""The numbers of the paper's model that tell one skin from its design, and their file.

Decides what a calibration holds: the coefficients of the reduced model, two stiffnesses, and how
each chip's reading becomes the field of the magnet as designed (its turn, and k_c, c_c of S6). The
file is TOML with units in its keys, bound to the design by its hash.
"""

import math
import os
from dataclasses import dataclass
from decimal import Decimal
from typing import Final, Self

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.documents import Form, format_toml
from smoskin.errors import ModelError
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.outputs import is_damaged, read_text
from smoskin.sensing.files import check_within

Triple = tuple[float, float, float]

_LIMITS: Final = {
    "board_stiffness": (1e-3, 1e7),
    "sheet_stiffness": (1e-3, 1e7),
    "chip_rotation": (-2 * math.pi, 2 * math.pi),
    "field_factor": (1e-3, 1e3),
    "field_offset": (-1.0, 1.0),
}
"""Least and largest numbers of a skin, SI."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """Standard uncertainty of each number of a calibration; NaN where it was not measured."""

    attenuation: tuple[float, float]
    stiffness_variation: float
    folding_correction_x: tuple[float, ...]
    """N."""
    folding_correction_y: tuple[float, ...]
    """N."""
    board_stiffness: float
    """N/m."""
    sheet_stiffness: float
    """N/m."""
    chip_rotation: tuple[Triple, ...]
    """Those of S chips, rad."""
    field_factor: tuple[float, ...]
    """Those of S chips."""
    field_offset: tuple[Triple, ...]
    """Those of S chips, T."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualSummary:
    """How far the fitted model is from one group of the measured values."""

    group: str
    """Name such as ``"force_z"`` or ``"field of chip S1"``."""
    unit: str
    """Suffix of the unit of `rms`."""
    values: int
    """Number of values measured."""
    rms: float
    """Root mean square, SI."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What a calibration rests on."""

    date: str
    """ISO date of the measurement."""
    data_sha256: str
    """SHA-256 of the measured file."""
    touches: int
    """Rows in it."""
    freedom: int
    """Degrees of freedom left over: measured values less what was fitted to them."""
    uncertainty: Uncertainty
    residuals: tuple[ResidualSummary, ...]

    def coverage_factor(self, level: float = 0.9) -> float:
        """Half width of the interval of this confidence, in standard uncertainties."""
        from scipy.stats import t

        return float(t.ppf(0.5 + level / 2, self.freedom))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """The numbers of one skin.

    Raises
    ------
    ModelError
        If a number cannot be, or the chips' numbers are not as many.
    """

    design_hash: str
    """`SkinDesign.content_hash` of the design that it belongs to."""
    coefficients: Coefficients
    """v_a, v_s and v_f."""
    board_stiffness: float
    """N/m, K_sf: drag over motion of the board."""
    sheet_stiffness: float
    """N/m: drag over motion of the sheet against the board."""
    chip_rotation: tuple[Triple, ...]
    """S rotation vectors, rad, in the skin's axes: turn what a chip mounted as designed would read
    into the field."""
    field_factor: tuple[float, ...]
    """k_c of S chips: the designed magnet's field over the real one's, all axes alike."""
    field_offset: tuple[Triple, ...]
    """c_c, T: added after the factor, in the skin's axes."""
    evidence: Evidence | None = None
    """Measurements behind it; None for a nominal calibration."""

    def __post_init__(self) -> None:
        for name, limits in _LIMITS.items():
            check_within(f"calibration: {name}", getattr(self, name), *limits)
        for name in ("folding_correction_x", "folding_correction_y", "stiffness_variation"):
            check_within(f"calibration: {name}", getattr(self.coefficients, name), 1e-9, 1e9)
        chips = np.size(self.field_factor)
        for name in ("chip_rotation", "field_offset"):
            if np.shape(getattr(self, name)) != (chips, 3):
                raise ModelError(f"{name} must hold 3 numbers for each of {chips} chips")

    @classmethod
    def nominal(cls, design: SkinDesign) -> Self:
        """The calibration of a skin that is exactly as designed."""
        chips = len(design.halls)
        return cls(
            design_hash=design.content_hash,
            coefficients=design.coefficients,
            board_stiffness=board_stiffness(design),
            sheet_stiffness=sheet_stiffness(design),
            chip_rotation=((0.0, 0.0, 0.0),) * chips,
            field_factor=(1.0,) * chips,
            field_offset=((0.0, 0.0, 0.0),) * chips,
        )

    @property
    def field_correction(self) -> tuple[Floats, Floats]:
        """Turn and factor, (S, 3, 3), and offset, (S, 3), T, of each chip's field (S6)."""
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_rotvec(np.array(self.chip_rotation)).as_matrix()
        return np.array(self.field_factor)[:, None, None] * turns, np.array(self.field_offset)

    def check_fits(self, design: SkinDesign) -> None:
        """Raise a `ModelError` unless this calibration belongs to the design and all its chips."""
        design.check_own("calibration", self.design_hash)
        if len(self.field_factor) != len(design.halls):
            raise ModelError(
                f"calibration must hold {len(design.halls)} chips, as the design has; "
                f"got {len(self.field_factor)}"
            )


_FORM: Final = Form(
    units={
        "folding_correction_x": "N",
        "folding_correction_y": "N",
        "board_stiffness": "N_per_mm",
        "sheet_stiffness": "N_per_mm",
        "chip_rotation": "deg",
        "field_offset": "uT",
        "rms": "unit",
    },
    error=ModelError,
    inline=("coefficients",),
    gaps=True,
    number=Decimal,
)


def format_calibration(calibration: Calibration) -> str:
    """The TOML document of a calibration; `parse_calibration` reads the same numbers back."""
    return format_toml(_FORM.table(calibration), "writing a calibration")


def parse_calibration(text: str) -> Calibration:
    """The calibration that a TOML document describes; a `ModelError` for what cannot be."""
    if is_damaged(text):
        raise ModelError(
            "the calibration is damaged: its checksum does not fit; make it again or copy it anew "
            "(where it was changed by hand, remove its last line)"
        )
    document = _FORM.parse_toml(text)
    if "press_table" in document:
        raise ModelError(
            "press_table is of an older version; touch the skin anew with `smoskin calibrate`, "
            "whose response table the closed forms read too"
        )
    return _FORM.record(Calibration, document)


def read_calibration(path: str | os.PathLike[str], design: SkinDesign) -> Calibration:
    """The calibration in a file, or a `ModelError` where it is none of this design."""
    text = read_text(path, error=ModelError)
    try:
        calibration = parse_calibration(text)
        calibration.check_fits(design)
    except ModelError as error:
        raise ModelError(f"{os.fspath(path)}: {error}") from error
    return calibration
