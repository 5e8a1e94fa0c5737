"""What distinguishes one skin from its design: the numbers an estimator works with, and its file.

Decides what a calibration holds: the coefficients of the reduced model, two stiffnesses, how each
chip's reading becomes the field of the magnet as designed (its turn, and k_c, c_c of S6), and how
the sheet answers on each cell, if that was measured.
The file is TOML with units in its keys, bound to the design by its hash.
"""

import difflib
import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, Final, Self, TypeVar

from smoskin.arrays import Floats
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.errors import ArgumentError, DesignError, MissingExtraError, ModelError
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.sensing.closed_form.press_table import PressTable
from smoskin.units import SI_PER_SUFFIX, from_si, to_si

Triple = tuple[float, float, float]
_Record = TypeVar("_Record")


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
    """S of them, rad."""
    field_factor: tuple[float, ...]
    """S of them."""
    field_offset: tuple[Triple, ...]
    """S of them, T."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualSummary:
    """How far the fitted model is from one group of the measured values."""

    group: str
    """Such as ``"force_z"`` or ``"field of chip S1"``."""
    unit: str
    """Suffix of the unit of `rms`."""
    values: int
    """How many were measured."""
    rms: float
    """SI."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What a calibration rests on."""

    date: str
    """ISO date of the measurement."""
    data_sha256: str
    """Of the measured file."""
    touches: int
    """Rows in it."""
    freedom: int
    """Degrees of freedom left over: measured values less what was fitted to them."""
    uncertainty: Uncertainty
    residuals: tuple[ResidualSummary, ...]

    def coverage_factor(self, level: float = 0.9) -> float:
        """Half width of the interval of this confidence, in standard uncertainties.

        Examples
        --------
        >>> nan = float("nan")
        >>> spread = Uncertainty(
        ...     attenuation=(0.01, 0.01), stiffness_variation=nan, folding_correction_x=(),
        ...     folding_correction_y=(), board_stiffness=nan, sheet_stiffness=nan,
        ...     chip_rotation=(), field_factor=(), field_offset=())
        >>> few = Evidence(date="2026-01-31", data_sha256="", touches=9, freedom=4,
        ...                uncertainty=spread, residuals=())
        >>> round(few.coverage_factor(0.9), 3)
        2.132
        """
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
    """S rotation vectors, rad, in the skin's axes: turn what a chip mounted as designed would
    have said back to what the field is."""
    field_factor: tuple[float, ...]
    """k_c of S of them: the designed magnet's field over the real one's, all axes alike."""
    field_offset: tuple[Triple, ...]
    """c_c, T: added after the factor, in the skin's axes."""
    press_table: PressTable | None = None
    """How the sheet answers on each cell; None where theory is to say it."""
    evidence: Evidence | None = None
    """What it rests on; None for a nominal calibration."""

    def __post_init__(self) -> None:
        for name in ("board_stiffness", "sheet_stiffness"):
            if not 0 < getattr(self, name) < math.inf:
                raise ModelError(f"{name} must be positive, N/m; got {getattr(self, name)}")
        chips = len(self.field_factor)
        for name in ("chip_rotation", "field_offset"):
            rows = getattr(self, name)
            if len(rows) != chips or any(len(row) != 3 for row in rows):
                raise ModelError(f"{name} must hold 3 numbers for each of {chips} chips")
            if not all(math.isfinite(value) for row in rows for value in row):
                raise ModelError(f"{name} must be finite; got {rows}")
        if not all(0 < value < math.inf for value in self.field_factor):
            raise ModelError(f"field_factor must be positive; got {self.field_factor}")

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

    def check_fits(self, design: SkinDesign) -> None:
        """Raise unless this calibration belongs to the design.

        Raises
        ------
        ModelError
            If the hashes or the numbers of chips differ.
        """
        if self.design_hash != design.content_hash:
            raise ModelError(
                f"calibration must belong to design {design.name!r} "
                f"({design.content_hash[:12]}); it was made for {self.design_hash[:12]}"
            )
        if len(self.field_factor) != len(design.halls):
            raise ModelError(
                f"calibration must hold {len(design.halls)} chips, as the design has; "
                f"got {len(self.field_factor)}"
            )
        if self.press_table is not None:
            self.press_table.check_fits(design)


#: Key and unit suffix of each number in the file; () is plain.
_NUMBERS: Final = (
    ("attenuation", ""),
    ("stiffness_variation", ""),
    ("folding_correction_x", "N"),
    ("folding_correction_y", "N"),
    ("board_stiffness", "N_per_mm"),
    ("sheet_stiffness", "N_per_mm"),
    ("chip_rotation", "deg"),
    ("field_factor", ""),
    ("field_offset", "uT"),
)
_COEFFICIENTS: Final = tuple(name for name, _ in _NUMBERS[:4])
_TABLE: Final = (("press", "um_per_N"), ("drag", "um_per_N"))
_EVIDENCE: Final = ("date", "data_sha256", "touches", "freedom", "uncertainty", "residuals")


def format_calibration(calibration: Calibration) -> str:
    """The TOML document of a calibration; `parse_calibration` reads the same numbers back.

    Raises
    ------
    MissingExtraError
        If the TOML writer is not installed.
    """
    try:
        import tomli_w
    except ImportError as error:
        raise MissingExtraError("writing a calibration", "cli") from error
    document: dict[str, Any] = {"design_hash": calibration.design_hash}
    for name, suffix in _NUMBERS:
        owner = calibration.coefficients if name in _COEFFICIENTS else calibration
        document[_key(name, suffix)] = _written(getattr(owner, name), suffix)
    table = calibration.press_table
    if table is not None:
        document["press_table"] = {
            _key(name, suffix): _written(_tuples(getattr(table, name)), suffix)
            for name, suffix in _TABLE
        }
    evidence = calibration.evidence
    if evidence is not None:
        document["evidence"] = {
            "date": evidence.date,
            "data_sha256": evidence.data_sha256,
            "touches": evidence.touches,
            "freedom": evidence.freedom,
            "uncertainty": {
                _key(name, suffix): _written(getattr(evidence.uncertainty, name), suffix)
                for name, suffix in _NUMBERS
            },
            "residuals": [
                {"group": one.group, "values": one.values, "unit": one.unit,
                 "rms": _written(one.rms, one.unit)}
                for one in evidence.residuals
            ],
        }  # fmt: skip
    return tomli_w.dumps(document)


def parse_calibration(text: str) -> Calibration:
    """The calibration that a TOML document describes.

    Raises
    ------
    ModelError
        If the document is not TOML, has unknown or missing keys, or holds what cannot be.
    """
    try:
        document = tomllib.loads(text, parse_float=Decimal)
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"not a TOML document: {error}") from error
    keys = [_key(name, suffix) for name, suffix in _NUMBERS]
    _refuse("", document, ["design_hash", *keys], ["press_table", "evidence"])
    values = _numbers("", document)
    values["coefficients"] = _made(Coefficients, {name: values.pop(name) for name in _COEFFICIENTS})
    table = document.get("press_table")
    if table is not None:
        _refuse("press_table", table, [_key(name, suffix) for name, suffix in _TABLE], [])
        table = _made(PressTable, _numbers("press_table.", table, _TABLE))
    evidence = document.get("evidence")
    if evidence is not None:
        _refuse("evidence", evidence, list(_EVIDENCE), [])
        spread = evidence["uncertainty"]
        _refuse("evidence.uncertainty", spread, keys, [])
        residuals = []
        for one in _tables("evidence.residuals", evidence["residuals"]):
            _refuse("evidence.residuals", one, ["group", "values", "unit", "rms"], [])
            if one["unit"] not in SI_PER_SUFFIX:
                raise ModelError(f"evidence.residuals.unit is unknown: {one['unit']!r}")
            rms = _read("evidence.residuals.rms", one["rms"], one["unit"])
            residuals.append(_made(ResidualSummary, {**one, "rms": rms}))
        evidence = _made(
            Evidence,
            {
                **evidence,
                "uncertainty": _made(Uncertainty, _numbers("evidence.uncertainty.", spread)),
                "residuals": tuple(residuals),
            },
        )
    return _made(
        Calibration,
        {
            **values,
            "design_hash": str(document["design_hash"]),
            "press_table": table,
            "evidence": evidence,
        },
    )


def read_calibration(path: str | os.PathLike[str], design: SkinDesign) -> Calibration:
    """The calibration in a file, made sure to belong to the design.

    Raises
    ------
    ModelError
        If it cannot be read or was made for another design.
    """
    try:
        calibration = parse_calibration(Path(path).read_text(encoding="utf-8"))
        calibration.check_fits(design)
    except (OSError, UnicodeDecodeError, ModelError) as error:
        raise ModelError(f"{os.fspath(path)}: {error}") from error
    return calibration


def _key(name: str, suffix: str) -> str:
    return f"{name}_{suffix}" if suffix else name


def _written(value: Any, suffix: str) -> Any:
    """A number or nested tuple of numbers in the suffix's unit."""
    if isinstance(value, tuple):
        return [_written(one, suffix) for one in value]
    return from_si(value, suffix) if suffix and math.isfinite(value) else value


def _tuples(array: Floats) -> Any:
    """An array as nested tuples of numbers."""
    return tuple(map(_tuples, array)) if array.ndim else float(array)


def _numbers(
    path: str, table: Mapping[str, Any], numbers: tuple[tuple[str, str], ...] = _NUMBERS
) -> dict[str, Any]:
    return {name: _read(path + name, table[_key(name, suffix)], suffix) for name, suffix in numbers}


def _read(path: str, value: Any, suffix: str) -> Any:
    """A number or nested tuple of numbers in SI."""
    if isinstance(value, list):
        return tuple(_read(path, one, suffix) for one in value)
    if isinstance(value, bool) or not isinstance(value, int | Decimal):
        raise ModelError(f"{path} must be a number; got {value!r}")
    if suffix and math.isfinite(value):
        return to_si(value, suffix)
    return float(value)


def _tables(path: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ModelError(f"{path} must be an array of tables")
    return value


def _refuse(path: str, table: Any, required: list[str], optional: list[str]) -> None:
    """Raise on a key that is unknown or missing."""
    where = f"{path}: " if path else ""
    if not isinstance(table, dict):
        raise ModelError(f"{where}must be a table; got {table!r}")
    known = [*required, *optional]
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ModelError(f"{where}unknown key {key!r}{hint} Valid: {', '.join(known)}")
    for key in required:
        if key not in table:
            raise ModelError(f"{where}missing key {key!r}")


def _made(cls: type[_Record], values: dict[str, Any]) -> _Record:
    """A record of values from a file, whose faults are the file's."""
    try:
        return cls(**values)
    except (TypeError, ArgumentError, DesignError) as error:
        raise ModelError(f"a value is of the wrong kind ({error})") from error
