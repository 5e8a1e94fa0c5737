"""The paper's model of one skin from touches of a bench: its file, and a report for people."""

import hashlib
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError
from smoskin.measurement import read_touches, write_touches
from smoskin.roles import VirtualSkin
from smoskin.sensing.closed_form.calibration import Calibration, Uncertainty, format_calibration
from smoskin.sensing.closed_form.fitting import Attenuation, Fit, fit_calibration
from smoskin.service.recorder import open_recording
from smoskin.twin.bench import calibration_loads, made_skin, measure, table_loads
from smoskin.units import SI_PER_SUFFIX

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

Sheet = Literal["whole", "reduced"]
"""Kind of virtual skin: the whole sheet's twin, or the SI's reduced model."""

_LEVEL: Final = 0.9
"""Confidence of the intervals shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One number of a calibration, in the unit of its file."""

    name: str
    value: float
    nominal: float
    """As designed."""
    standard_uncertainty: float
    """NaN where it was not measured and the value is nominal; infinite for a v_f whose effect was
    not seen."""
    half_width: float
    """Half width of the interval of 90 % confidence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationReport:
    """A finished calibration in words and numbers."""

    fit: Fit
    lines: tuple[Line, ...]

    def as_json(self) -> dict[str, object]:
        """Plain values for machines; what was not measured is null."""
        evidence = self.fit.calibration.evidence
        assert evidence is not None, "a fit rests on something"
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
                {
                    "name": line.name,
                    "value": line.value,
                    "nominal": line.nominal,
                    "standard_uncertainty": _or_none(line.standard_uncertainty),
                    "half_width_90_percent": _or_none(line.half_width),
                }
                for line in self.lines
            ],
            "residuals": [
                {
                    "group": one.group,
                    "values": one.values,
                    f"rms_{one.unit}": _or_none(_in_unit(one.rms, one.unit)),
                }
                for one in evidence.residuals
            ],
        }

    def tables(self) -> "list[Table]":
        """The numbers and the residuals, for people."""
        from rich.table import Table

        numbers = Table(title="Calibration (+- at 90 % confidence)")
        for name in ("number", "value", "+-", "as designed"):
            numbers.add_column(name, justify="left" if name == "number" else "right")
        for line in self.lines:
            width = f"{line.half_width:.2g}"
            if not math.isfinite(line.half_width):
                width = "not measured" if math.isnan(line.half_width) else "no effect seen"
            numbers.add_row(line.name, f"{line.value:.5g}", width, f"{line.nominal:.5g}")
        residuals = Table(title="What the model leaves")
        for name in ("measured", "values", "rms", "unit"):
            residuals.add_column(name, justify="left" if name == "measured" else "right")
        evidence = self.fit.calibration.evidence
        assert evidence is not None, "a fit rests on something"
        for group in evidence.residuals:
            rms = _in_unit(group.rms, group.unit)
            residuals.add_row(group.group, str(group.values), f"{rms:.3g}", group.unit)
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

    Parameters
    ----------
    design : SkinDesign
    touches : path
        CSV, as `smoskin.measurement.read_touches` describes it.
    output : path
        TOML file to write.
    date : str
        ISO date of the measurement.
    recording : path, optional
        MCAP file with the chips' readings, where the CSV says only when each touch was held.
    attenuation : {"equal", "separate"}
        Whether v_a is one number or one each in X and Y.

    Raises
    ------
    RecordingError
        If the CSV or the recording cannot be read.
    ArgumentError, ModelError
        As `fit_calibration`.
    """
    table, digest = read_touches(touches)
    if recording is not None:
        table = table.with_readings(open_recording(recording).readings())
        both = digest + hashlib.sha256(Path(recording).read_bytes()).hexdigest()
        digest = hashlib.sha256(both.encode()).hexdigest()
    fit = fit_calibration(design, table, date=date, data_sha256=digest, attenuation=attenuation)
    Path(output).write_text(format_calibration(fit.calibration), encoding="utf-8")
    return report(design, fit)


def write_virtual_bench(
    design: SkinDesign, output: str | os.PathLike[str], *, seed: int, sheet: Sheet = "whole"
) -> None:
    """Write the touches that a bench would measure on a virtual skin unlike its design.

    Parameters
    ----------
    design : SkinDesign
    output : path
        CSV to write.
    seed : int
        Seed of the skin and of the bench's noise.
    sheet : {"whole", "reduced"}
        Whether the skin is the whole sheet's twin, every cell of which is pressed and dragged, or
        one of the reduced model, whose coefficients the loads of SI Text S5 tell.

    Raises
    ------
    MissingExtraError
        If the whole sheet is asked for without the extra ``twin``.
    """
    rng = np.random.default_rng(seed)
    if sheet == "reduced":
        skin: VirtualSkin = made_skin(design, rng)
        loads = calibration_loads(design)
    elif sheet == "whole":
        from smoskin.twin.whole import Twin

        skin = Twin(design, seed=seed, manufactured=True)
        loads = table_loads(design)
    else:
        raise ArgumentError(f"sheet must be 'whole' or 'reduced'; got {sheet!r}")
    write_touches(output, measure(skin, loads, rng))


def report(design: SkinDesign, fit: Fit) -> CalibrationReport:
    """The numbers of a fit beside the design's, with their intervals."""
    evidence = fit.calibration.evidence
    assert evidence is not None, "a fit rests on something"
    factor = evidence.coverage_factor(_LEVEL)
    nominal = Calibration.nominal(design)
    lines = []
    for (name, suffix, value), (_, _, designed), (_, _, deviation) in zip(
        _numbers(design, fit.calibration.coefficients, fit.calibration),
        _numbers(design, nominal.coefficients, nominal),
        _numbers(design, evidence.uncertainty, evidence.uncertainty),
        strict=True,
    ):
        lines.append(
            Line(
                name=f"{name}_{suffix}" if suffix else name,
                value=_in_unit(value, suffix),
                nominal=_in_unit(designed, suffix),
                standard_uncertainty=_in_unit(deviation, suffix),
                half_width=factor * _in_unit(deviation, suffix),
            )
        )
    return CalibrationReport(fit=fit, lines=tuple(lines))


def residual_figure(fit: Fit) -> "Figure":
    """Three panels: relative residuals of force and depth over force, fields over time.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("plotting residuals", "plots") from error
    touches = fit.touches
    press: Floats = np.where(touches.touched, -touches.force[:, 2], np.nan)
    depth: Floats = np.where(touches.touched & (touches.depth > 0), touches.depth, np.nan)
    figure = Figure(figsize=(9, 8), layout="constrained")
    force_axes, depth_axes, field_axes = figure.subplots(3, 1)
    for axes, values, name, level in (
        (force_axes, -fit.residual[:, 2] / press, "force", fit.noise[0]),
        (depth_axes, fit.residual[:, 3] / depth, "depth", fit.noise[1]),
    ):
        axes.plot(press, 100 * values, ".", markersize=4)
        if math.isfinite(level):
            axes.axhspan(-100 * level, 100 * level, alpha=0.15)
        axes.set_xlabel("press force (N)")
        axes.set_ylabel(f"{name}: measured less model (%)")
    fields: Floats = np.reshape(fit.residual[:, 4:], touches.field.shape)
    for s in range(fields.shape[1]):
        rms = np.sqrt(np.mean(fields[:, s] ** 2, axis=-1))
        field_axes.plot(rms / 1e-6, ".", markersize=4, label=f"chip {s + 1}")
    field_axes.set_xlabel("touch")
    field_axes.set_ylabel("field: rms residual (uT)")
    if fields.shape[1]:
        field_axes.legend()
    return figure


def _numbers(
    design: SkinDesign, model: Coefficients | Uncertainty, skin: Calibration | Uncertainty
) -> Iterator[tuple[str, str, float]]:
    """Name, unit suffix and value of every number of a calibration or of its uncertainty."""
    for axis, value in zip("xy", model.attenuation, strict=True):
        yield f"attenuation_{axis}", "", value
    yield "stiffness_variation", "", model.stiffness_variation
    for axis, layers in (("x", model.folding_correction_x), ("y", model.folding_correction_y)):
        for layer, value in enumerate(layers, start=1):
            yield f"layer {layer} folding_correction_{axis}", "N", value
    yield "board_stiffness", "N_per_mm", skin.board_stiffness
    yield "sheet_stiffness", "N_per_mm", skin.sheet_stiffness
    for s, site in enumerate(design.halls):
        yield f"{site.name} field_factor", "", skin.field_factor[s]
        for axis, value in zip("xyz", skin.chip_rotation[s], strict=True):
            yield f"{site.name} rotation_{axis}", "deg", value
        for axis, value in zip("xyz", skin.field_offset[s], strict=True):
            yield f"{site.name} field_offset_{axis}", "uT", value


def _in_unit(value: float, suffix: str) -> float:
    return value / float(SI_PER_SUFFIX[suffix]) if suffix else value


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
