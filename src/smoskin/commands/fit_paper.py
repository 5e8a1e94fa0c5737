"""The paper's model of one skin from touches of a bench: its file, and a report for people."""

import hashlib
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.errors import CalibrationError, MissingExtraError
from smoskin.measurement import TouchTable, write_touches
from smoskin.outputs import sealed, write_output
from smoskin.roles import Progress, VirtualSkin, unheard
from smoskin.sensing.closed_form.calibration import Calibration, Uncertainty, format_calibration
from smoskin.sensing.closed_form.fitting import Attenuation, Fit
from smoskin.sensing.closed_form.judgement import judged_fit
from smoskin.service.kept import read_sheet
from smoskin.service.recording import open_recording
from smoskin.twin.bench import calibration_loads, made_skin, measure, table_loads
from smoskin.units import SI_PER_SUFFIX

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

Sheet = Literal["whole", "reduced"]
"""Kind of virtual skin: the whole sheet's twin, or the SI's reduced model."""

_LEVEL: Final = 0.9
"""Confidence of the intervals shown."""
_FAR: Final = 100.0
"""Ratio of a press to the median one that no bench makes."""


class Line(NamedTuple):
    """One number of a calibration, in the unit of its file."""

    name: str
    value: float
    nominal: float
    """The number as designed."""
    standard_uncertainty: float
    """NaN where it was not measured and the value is nominal; infinite for a v_f whose effect was
    not seen."""
    half_width_90_percent: float
    """Half width of the interval of 90 % confidence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationReport:
    """A finished calibration in words and numbers."""

    design: SkinDesign
    fit: Fit
    warnings: tuple[str, ...] = ()
    """What is odd about the touches without being wrong."""

    @property
    def lines(self) -> list[Line]:
        """The numbers of the fit beside the design's, with their intervals."""
        nominal, own = Calibration.nominal(self.design), self.fit.calibration
        spread = self.fit.evidence.uncertainty
        factor = self.fit.evidence.coverage_factor(_LEVEL)
        rows = zip(
            _numbers(self.design, own.coefficients, own),
            _numbers(self.design, nominal.coefficients, nominal),
            _numbers(self.design, spread, spread),
            strict=True,
        )
        return [
            Line(name, value, designed, deviation, factor * deviation)
            for (name, value), (_, designed), (_, deviation) in rows
        ]

    def as_json(self) -> dict[str, object]:
        """Plain values for machines; what was not measured is null."""
        evidence = self.fit.evidence
        force, depth, field = self.fit.noise
        return {
            "design_hash": self.fit.calibration.design_hash,
            "date": evidence.date,
            "data_sha256": evidence.data_sha256,
            "touches": evidence.touches,
            "noise_force": _or_none(force),
            "noise_depth": _or_none(depth),
            "noise_field_uT": _or_none(_in_unit(field, "uT")),
            "numbers": [
                {name: _or_none(value) for name, value in line._asdict().items()}
                for line in self.lines
            ],
            "residuals": [
                {
                    "group": group.group,
                    "values": group.values,
                    f"rms_{group.unit}": _or_none(_in_unit(group.rms, group.unit)),
                    f"cross_validated_rms_{group.unit}": _or_none(_in_unit(left.rms, left.unit)),
                }
                for group, left in zip(evidence.residuals, self.fit.left_out, strict=True)
            ],
            "warnings": list(self.warnings),
        }

    def tables(self) -> "list[Table]":
        """The numbers and the residuals, for people."""
        from rich.table import Table

        numbers = Table("number", title="Calibration (+- at 90 % confidence)")
        for name in ("value", "+-", "as designed"):
            numbers.add_column(name, justify="right")
        for line in self.lines:
            width = f"{line.half_width_90_percent:.2g}"
            if not math.isfinite(line.standard_uncertainty):
                unmeasured = math.isnan(line.standard_uncertainty)
                width = "not measured" if unmeasured else "no effect seen"
            numbers.add_row(line.name, f"{line.value:.5g}", width, f"{line.nominal:.5g}")
        residuals = Table("measured", title="What the model leaves")
        for name in ("values", "rms", "rms of each touch by the others", "unit"):
            residuals.add_column(name, justify="right")
        for group, left in zip(self.fit.evidence.residuals, self.fit.left_out, strict=True):
            fitted, crossed = (
                f"{_in_unit(residual.rms, residual.unit):.3g}" for residual in (group, left)
            )
            residuals.add_row(group.group, str(group.values), fitted, crossed, group.unit)
        return [numbers, residuals]


def fit_paper(
    design: SkinDesign,
    touches: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    date: str,
    recording: str | os.PathLike[str] | None = None,
    attenuation: Attenuation = "equal",
) -> CalibrationReport:
    """Fit the paper's model to touches on a skin's top vertices and write its calibration.

    Touches are a CSV, as `smoskin.measurement.read_touches` describes it, or a rig's recording; the
    output is a TOML file; a recording, an MCAP file, has the chips' readings where the CSV says
    only when each touch was held. It raises a `RecordingError` if one cannot be read, a
    `CalibrationError` if one force is far from all others or a wrong unit, sign, chip, axis, place
    or row explains touches that fit badly, else as `fit_calibration`.
    """
    table, digest = read_sheet(touches)
    if recording is not None:
        table = table.with_readings(open_recording(recording).readings())
        both = digest + hashlib.sha256(Path(recording).read_bytes()).hexdigest()
        digest = hashlib.sha256(both.encode()).hexdigest()
    _check_forces(table)
    fit, warnings = judged_fit(
        design, table, date=date, data_sha256=digest, attenuation=attenuation
    )
    write_output(output, sealed(format_calibration(fit.calibration)).encode())
    return CalibrationReport(design=design, fit=fit, warnings=warnings)


def _check_forces(table: TouchTable) -> None:
    """Raise on a force that no bench gives beside the others: one row in another unit."""
    press = np.where(table.touched, -table.force[:, 2], np.nan)
    ratio = press / np.nanmedian(press) if table.touched.any() else np.ones(len(press))
    far = np.maximum(ratio, 1 / ratio) > _FAR
    if far.any():
        row = int(np.argmax(far))
        raise CalibrationError(
            f"force of row {row + 1} must be like the others; got {press[row]:g} N, "
            f"{ratio[row]:.3g} times their median: another unit?"
        )


def write_virtual_bench(
    design: SkinDesign,
    output: str | os.PathLike[str],
    *,
    seed: int,
    sheet: Sheet = "whole",
    progress: Progress = unheard,
) -> None:
    """Write the touches that a bench would measure on a virtual skin unlike its design.

    The skin is the whole sheet's twin, every cell of which is pressed and dragged, or one of the
    reduced model, whose coefficients the loads of SI Text S5 tell. The seed is that of the skin
    and of the bench's noise. The whole sheet without the extra ``twin`` raises a
    `MissingExtraError`.
    """
    progress("making the skin", 0.0)
    rng = np.random.default_rng(seed)
    if sheet == "reduced":
        skin: VirtualSkin = made_skin(design, rng)
        loads = calibration_loads(design)
    else:
        from smoskin.twin.whole import Twin

        skin = Twin(design, seed=seed, manufactured=True)
        loads = table_loads(design)
    write_touches(output, measure(skin, loads, rng, progress=progress))


def residual_figure(fit: Fit) -> "Figure":
    """Three panels: relative residuals of force and depth over force, fields over time."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("plotting residuals", "plots") from error
    touches = fit.touches
    press: Floats = np.where(touches.touched, -touches.force[:, 2], np.nan)
    depth: Floats = np.where(touches.touched & (touches.depth > 0), touches.depth, np.nan)
    figure = Figure(figsize=(9, 8), layout="constrained")
    *relative_axes, field_axes = figure.subplots(3, 1)
    panels = (
        ("force", -fit.residual[:, 2] / press, fit.noise[0]),
        ("depth", fit.residual[:, 3] / depth, fit.noise[1]),
    )
    for axes, (name, values, level) in zip(relative_axes, panels, strict=True):
        axes.plot(press, 100 * values, ".", markersize=4)
        if math.isfinite(level):
            axes.axhspan(-100 * level, 100 * level, alpha=0.15)
        axes.set(xlabel="press force (N)", ylabel=f"{name}: measured less model (%)")
    fields: Floats = np.reshape(fit.residual[:, 4:], touches.field.shape)
    rms = np.sqrt(np.mean(fields**2, axis=-1)) / 1e-6
    for s, values in enumerate(rms.T, start=1):
        field_axes.plot(values, ".", markersize=4, label=f"chip {s}")
    if rms.size:
        field_axes.legend()
    field_axes.set(xlabel="touch", ylabel="field: rms residual (uT)")
    return figure


def _numbers(
    design: SkinDesign, model: Coefficients | Uncertainty, skin: Calibration | Uncertainty
) -> Iterator[tuple[str, float]]:
    """Name and value, in its unit, of every number of a calibration or of its uncertainty."""
    for axis, value in zip("xy", model.attenuation, strict=True):
        yield f"attenuation_{axis}", value
    yield "stiffness_variation", model.stiffness_variation
    for axis, layers in (("x", model.folding_correction_x), ("y", model.folding_correction_y)):
        for layer, value in enumerate(layers, start=1):
            yield f"layer {layer} folding_correction_{axis}_N", value
    yield "board_stiffness_N_per_mm", _in_unit(skin.board_stiffness, "N_per_mm")
    yield "sheet_stiffness_N_per_mm", _in_unit(skin.sheet_stiffness, "N_per_mm")
    for s, site in enumerate(design.halls):
        yield f"{site.name} field_factor", skin.field_factor[s]
        for axis, value in zip("xyz", skin.chip_rotation[s], strict=True):
            yield f"{site.name} rotation_{axis}_deg", _in_unit(value, "deg")
        for axis, value in zip("xyz", skin.field_offset[s], strict=True):
            yield f"{site.name} field_offset_{axis}_uT", _in_unit(value, "uT")


def _in_unit(value: float, suffix: str) -> float:
    return value / float(SI_PER_SUFFIX[suffix])


def _or_none(value: object) -> object:
    """What is no number or a finite one; None for other numbers."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
