"""The SI's calibration as one weighted least squares, with uncertainties and honest refusals.

Decides which numbers of a skin a table of touches determines and how well. Each touch's own depth
and drag are fitted with them and eliminated, since gauge and stage are noisier than the chips.
Noise levels are found from the residuals themselves. What the data cannot determine is refused by
name.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError
from smoskin.measurement import TouchTable
from smoskin.sensing.closed_form.calibration import (
    Calibration,
    Evidence,
    ResidualSummary,
    Uncertainty,
)
from smoskin.sensing.closed_form.press_model import LOGARITHMS, PressModel
from smoskin.sensing.signals.signals import chip_noise

Attenuation = Literal["equal", "separate"]

_RELATIVE: Final = 0.02
"""Noise of force and depth to start from, of their size."""
_FORCE_FLOOR: Final = 1e-3
"""N: noise of the gauge's zero."""
_DEPTH_FLOOR: Final = 0.5e-6
"""m: noise of the stage's zero."""
_UNTOUCHED: Final = (1e-6, 1e-9)
"""N and m: how sure it is that nothing touches an untouched skin."""
_OFFSET_PRIOR: Final = (2e-3, 2e-3, 1e-4)
"""T: what c_c can be before measuring: sideways a magnet hung 0.2 mm off, along the axis the
Earth's field and the chip's own offset. The last is what tells k_c from the gap."""
_ROUGH: Final = np.array([0.05, 0.05, 30.0])
"""Noise of a rough fit: force and depth relative to their size, fields over the chips' noise."""
_ROUGH_STEPS: Final = 10
"""Steps of it, at most."""
_ROUNDS: Final = 3
"""Fits, each with the noise that the one before has found."""
_LIMITS: Final = {
    "attenuation": (0.02, 0.9999, 0.1),
    "chip_rotation": (-0.5, 0.5, 0.05),
    "field_factor": (0.1, 10.0, 0.1),
    "field_offset": (-0.02, 0.02, 5e-3),
}
"""Least and largest value that is looked for, and largest standard uncertainty; rad and T."""
_LOGARITHM: Final = (-np.log(50.0), np.log(50.0), 0.3)
"""The same of a stiffness or a v_f, as a logarithm of its ratio to the nominal one."""
_OWN_STEPS: Final = 6
"""Newton steps, at most, on the touches' own depth and drag."""
_OWN_SETTLED: Final = 1e-3
"""Standard uncertainties: a smaller step on any of them is none."""
_LEAST_SHARE: Final = 0.1
"""A group's noise is found from it if at least this share of its values is left over."""
_LEAST_LOADS: Final = 3
"""Loads that each v_f and v_s need."""
_SHEARED: Final = 0.5
"""Drag over press from which on a load counts as a drag in its main direction."""
_STRAIGHT: Final = 0.05
"""Drag over press up to which a load counts as straight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A calibration with what it was fitted to."""

    calibration: Calibration
    evidence: Evidence
    """What the calibration rests on."""
    touches: TouchTable
    noise: tuple[float, float, float]
    """Noise found: force and depth relative to their size, fields in T; NaN where not read."""
    residual: Floats
    """(T, 4 + 3 S): measured less modelled force, N, depth, m, and fields in the skin's axes, T;
    NaN where nothing was measured."""
    left_out: tuple[ResidualSummary, ...]
    """Cross-validated residuals: of each touch by the fit to all others."""
    oddness: Floats
    """(T,): root mean square of these, in standard deviations of the noise found; about 1."""


class RoughFit(NamedTuple):
    """How well a skin of the design can explain a table, roughly."""

    misfit: Floats
    """(T,): squared residuals of each touch, in deviations of 5 % of force and depth and 30 times
    the chips' noise."""
    calibration: Calibration
    """The skin that does."""


def fit_calibration(
    design: SkinDesign,
    touches: TouchTable,
    *,
    date: str,
    data_sha256: str,
    attenuation: Attenuation = "equal",
) -> Fit:
    """Calibration of the skin on which these touches were measured.

    Parameters
    ----------
    touches : TouchTable
        Straight presses on cells of every layer, 45-degree loads in X and in Y on every layer
        and, best, readings of all chips, some of them untouched. Without any reading K_sf, the
        sheet's stiffness and the chips' numbers stay nominal.
    date, data_sha256 : str
        ISO date of the measurement and SHA-256 of its file.
    attenuation : {"equal", "separate"}
        Whether v_a is one number, as the SI takes it, or one each in X and Y.

    Raises
    ------
    ArgumentError
        If a touch lies on no top vertex or has no depth, or the readings have another number of
        chips.
    ModelError
        If the touches cannot determine a number; it is named.

    Notes
    -----
    Source: SI Text S5, "Calibration Process", with Eqs. (S6), (S26), (S27).
    Valid for touches on top vertices with depths in the linear range of S7.
    """
    model = PressModel(design, touches, 1 if attenuation == "equal" else 2)
    _check_loads(model)
    nominal = Calibration.nominal(design)
    values, levels, sigma = _fitted(model, nominal)
    # The uncertainty is that of the noise found last.
    solved = _Problem(model, sigma)
    solved.solve(values)
    measured = np.isfinite(sigma)
    freedom = int(measured.sum() - 3 * len(touches.force) - model.size + (_prior(model) > 0).sum())
    residual = np.where(measured, solved.residual, np.nan)
    odd = _left_out(solved)
    evidence = Evidence(
        date=date,
        data_sha256=data_sha256,
        touches=len(touches.force),
        freedom=freedom,
        uncertainty=_uncertainty(model, values, solved.reduced),
        residuals=tuple(_summaries(design, residual)),
    )
    field = float(levels[2] * chip_noise(design)[0]) if model.read.any() else np.nan
    return Fit(
        calibration=replace(model.calibration(values, nominal), evidence=evidence),
        evidence=evidence,
        touches=touches,
        noise=(*levels[:2].tolist(), field),
        residual=residual,
        left_out=tuple(_summaries(design, np.where(measured, odd * sigma, np.nan))),
        oddness=np.sqrt((odd**2).sum(axis=1) / np.maximum(measured.sum(axis=1), 1)),
    )


def rough_fit(design: SkinDesign, touches: TouchTable) -> RoughFit:
    """The best that a skin of the design can do about a table that may hold mistakes.

    It raises as `PressModel`.
    """
    from scipy.optimize import least_squares

    model, nominal = PressModel(design, touches, 1), Calibration.nominal(design)
    sigma = _sigmas(model, _ROUGH, 0.0)
    problem = _Problem(model, sigma)
    _, least, most, _ = _limits(model, nominal)
    values = least_squares(
        problem.residuals,
        np.clip(_start(model, nominal, sigma), least, most),
        jac=problem.jacobian,
        bounds=(least, most),
        x_scale="jac",
        max_nfev=_ROUGH_STEPS,
    ).x
    problem.solve(values)
    return RoughFit(
        misfit=(problem.scaled**2).sum(axis=1), calibration=model.calibration(values, nominal)
    )


def _left_out(solved: "_Problem") -> Floats:
    """Residuals (T, V) of each touch by the fit to all others, in standard deviations.

    With A_t the derivatives of a touch's values, r_t its residuals and C the covariance of the
    numbers, they are (1 - A_t C A_t^T)^-1 r_t.
    """
    count, values = solved.scaled.shape
    slopes = solved.reduced[: count * values].reshape(count, values, -1)
    covariance = np.linalg.inv(solved.reduced.T @ solved.reduced)
    others = np.eye(values) - slopes @ covariance @ slopes.swapaxes(1, 2)
    return np.asarray(np.linalg.solve(others, solved.scaled[..., None])[..., 0])


def _fitted(model: PressModel, nominal: Calibration) -> tuple[Floats, Floats, Floats]:
    """Fitted numbers (P,), noise levels (3,) and the noise of every value (T, V)."""
    from scipy.optimize import least_squares

    levels, group = np.array([_RELATIVE, _RELATIVE, 1.0]), _groups(model)
    names, least, most, tolerance = _limits(model, nominal)
    sigma = _sigmas(model, levels, 0.0)
    values = _start(model, nominal, sigma)
    for _ in range(_ROUNDS):
        problem = _Problem(model, sigma)
        values = least_squares(
            problem.residuals,
            np.clip(values, least, most),
            jac=problem.jacobian,
            bounds=(least, most),
            x_scale="jac",
            max_nfev=60,
        ).x
        problem.solve(values)
        _check_determined(names, tolerance, problem.reduced)
        levels = _levels(levels, group, problem, merged=not model.read.any())
        # Noise as large as the modelled values say: the measured ones would weigh low values more.
        sigma = _sigmas(model, levels, problem.residual)
    for name, value, low, high in zip(names, values, least, most, strict=True):
        if not low + 1e-6 < value < high - 1e-9:
            raise ModelError(
                f"the touches fit no {name} inside ({low:g}, {high:g}); check "
                "the cells, units and signs of the table and that it belongs to this design"
            )
    return values, levels, sigma


class _Problem:
    """The least squares over the skin's P numbers alone; T touches with V values each."""

    residual: Floats
    """(T, V), SI, at the numbers solved last."""
    scaled: Floats
    """(T, V): residual over the noise."""
    used: Floats
    """(T, V): share of each value that the touches' own unknowns have used up."""
    reduced: Floats
    """(T V + P, P): weighted derivatives without the touches' own unknowns, then the prior's."""

    def __init__(self, model: PressModel, sigma: Floats) -> None:
        self._model = model
        self._weight = 1 / sigma
        self._prior = _prior(model)
        self._own = np.column_stack([model.depth, model.touches.force[:, :2]])
        self._values = np.full(model.size, np.nan)

    def residuals(self, values: Floats) -> Floats:
        """Weighted residuals of the values, then of the prior, which holds c_c at zero."""
        self.solve(values)
        return np.concatenate([self.scaled.ravel(), self._prior * values])

    def jacobian(self, values: Floats) -> Floats:
        """Derivatives of the residuals."""
        self.solve(values)
        return self.reduced

    def solve(self, values: Floats) -> None:
        """Find every touch's own depth and drag for these numbers, and what is left."""
        if np.array_equal(self._values, values):
            return
        weight = self._weight
        for _ in range(_OWN_STEPS):
            own = self._own
            self.residual, by_own, _ = self._model.predict(values, own, by_own_alone=True)
            basis, triangle = np.linalg.qr(by_own * weight[..., None])
            self.scaled = self.residual * weight
            inside = np.einsum("tvk,tv->tk", basis, self.scaled)
            if np.abs(inside).max() < _OWN_SETTLED:
                break
            self._own = own - np.linalg.solve(triangle, inside[..., None])[..., 0]
        by_skin = self._model.predict(values, own)[2] * weight[..., None]
        by_skin -= np.einsum("tvk,tkp->tvp", basis, np.einsum("tvk,tvp->tkp", basis, by_skin))
        self.used = (basis**2).sum(axis=-1)
        self.reduced = np.concatenate([by_skin.reshape(-1, len(values)), np.diag(self._prior)])
        self._values = np.array(values)


def _check_loads(model: PressModel) -> None:
    """Enough loads of each kind, counted."""
    press = -model.touches.force[:, 2]
    shear = np.abs(model.touches.force[:, :2])
    straight = model.touched & (shear.max(axis=1) <= _STRAIGHT * press)
    needs = [("stiffness_variation", straight, "straight presses")]
    for layer in range(len(model.design.coefficients.folding_correction_x)):
        for axis, name in enumerate("xy"):
            mainly = (shear[:, axis] > shear[:, 1 - axis]) & (shear[:, axis] >= _SHEARED * press)
            number = f"folding_correction_{name} of layer {layer + 1} (from the rim inwards)"
            what = f"loads with a drag in {name.upper()} on its cells"
            needs.append((number, model.touched & mainly & (model.layer == layer), what))
    for site, read in zip(model.design.halls, model.read.T, strict=False):
        needs.append((f"field_factor of chip {site.name}", read, "readings"))
    for number, loads, what in needs:
        if loads.sum() < _LEAST_LOADS:
            raise ModelError(
                f"the touches cannot determine {number}: it needs at least {_LEAST_LOADS} {what}; "
                f"got {loads.sum()}"
            )


def _sigmas(model: PressModel, levels: Floats, residual: Floats | float) -> Floats:
    """Noise of every value, shape (T, V), SI; infinite where nothing was measured."""
    measured = np.column_stack([model.touches.force, model.depth])
    shape = len(measured), 4 + 3 * model.read.shape[1]
    size = np.abs(measured - np.broadcast_to(residual, shape)[:, :4])
    force = np.hypot(levels[0] * size[:, :3], _FORCE_FLOOR)
    depth = np.hypot(levels[1] * size[:, 3], _DEPTH_FLOOR)
    force[~model.touched], depth[~model.touched] = _UNTOUCHED
    field = np.where(model.read[..., None], levels[2] * chip_noise(model.design), np.inf)
    return np.concatenate([force, depth[:, None], field.reshape(len(depth), -1)], axis=1)


def _groups(model: PressModel) -> Ints:
    """Which noise level each value tells of, shape (T, V); -1: none."""
    force = np.where(np.abs(model.touches.force) * _RELATIVE > _FORCE_FLOOR, 0, -1)
    depth = np.where(model.depth * _RELATIVE > _DEPTH_FLOOR, 1, -1)
    return np.column_stack([force, depth, np.where(np.repeat(model.read, 3, axis=1), 2, -1)])


def _levels(levels: Floats, group: Ints, solved: _Problem, *, merged: bool) -> Floats:
    """Noise levels that the residuals show; without readings force and depth share one factor."""
    group = np.where(group == 1, 0, group) if merged else group
    scaled = levels.copy()
    by_data = solved.reduced[: solved.used.size]
    shared = np.einsum("ip,pi->i", by_data, np.linalg.pinv(solved.reduced)[:, : len(by_data)])
    used = solved.used + shared.reshape(solved.used.shape)
    for k in range(3):
        mine = group == k
        left = mine.sum() - used[mine].sum()
        if left > max(_LEAST_SHARE * mine.sum(), 3):
            scaled[k] *= np.sqrt((solved.scaled[mine] ** 2).sum() / left)
    if merged:
        scaled[1] = levels[1] * scaled[0] / levels[0]
    return scaled


def _prior(model: PressModel) -> Floats:
    """Weight of zero for each number, shape (P,)."""
    weight = np.zeros(model.size)
    place = model.layout.field_offset
    weight[place] = np.resize(1 / np.array(_OFFSET_PRIOR), len(weight[place]))
    return weight


def _start(model: PressModel, nominal: Calibration, sigma: Floats) -> Floats:
    """Numbers to start from: the v_a of least residual, each with the v_s that fits the presses."""
    press = -model.touches.force[:, 2]
    straight = model.touched & (model.depth > 0)
    straight &= np.abs(model.touches.force[:, :2]).max(axis=1) <= _STRAIGHT * press
    problem = _Problem(model, sigma)
    candidates = []
    for v_a in (0.12, 0.2, 0.3, 0.45, 0.7):
        values = model.start(nominal)
        values[model.layout.attenuation] = v_a
        modelled = model.press_stiffness(values)[straight] * model.depth[straight]
        values[model.layout.stiffness_variation] = np.log(np.median(press[straight] / modelled))
        candidates.append((float((problem.residuals(values) ** 2).sum()), values))
    return min(candidates, key=lambda candidate: candidate[0])[1]


def _limits(model: PressModel, nominal: Calibration) -> tuple[list[str], Floats, Floats, Floats]:
    """Name, least, largest value and largest standard uncertainty of each of P numbers."""
    names, rows, start = [], [], model.start(nominal)
    for part, place in model.layout._asdict().items():
        for k in range(place.start, min(place.stop, model.size)):
            alone = place.stop - place.start == 1
            names.append(part if alone else f"{part}[{k - place.start}]")
            least, most, tolerance = _LIMITS.get(part, _LOGARITHM)
            middle = start[k] if part in LOGARITHMS else 0.0
            rows.append((middle + least, middle + most, tolerance))
    least_values, most_values, tolerances = np.array(rows).T
    return names, least_values, most_values, tolerances


def _check_determined(names: list[str], tolerance: Floats, reduced: Floats) -> None:
    """Raise on a number that the data leaves too wide."""
    _, size, rows = np.linalg.svd(reduced * tolerance, full_matrices=False)
    spread = np.sqrt(((rows / np.maximum(size, 1e-9)[:, None]) ** 2).sum(axis=0))
    worst = int(np.argmax(spread))
    if spread[worst] > 1:
        raise ModelError(
            f"the touches cannot determine {names[worst]}: its standard uncertainty would be "
            f"{spread[worst] * tolerance[worst]:.2g} and must be at most {tolerance[worst]:g} "
            "(relative for stiffnesses and v_f); measure more touches that it acts on"
        )


def _uncertainty(model: PressModel, values: Floats, reduced: Floats) -> Uncertainty:
    """Standard uncertainties in the numbers' own units."""
    spread = np.sqrt(np.diag(np.linalg.inv(reduced.T @ reduced)))
    for part in LOGARITHMS:
        place = getattr(model.layout, part)
        spread[place] *= np.exp(values[place])
    return Uncertainty(**model.fields(spread))


def _summaries(design: SkinDesign, residual: Floats) -> Iterator[ResidualSummary]:
    """Root mean square of each group of residuals."""
    groups = [(f"force_{axis}", "N", residual[:, k]) for k, axis in enumerate("xyz")]
    groups.append(("depth", "mm", residual[:, 3]))
    for s in range((residual.shape[1] - 4) // 3):
        name = f"field of chip {design.halls[s].name}"
        groups.append((name, "uT", residual[:, 4 + 3 * s : 7 + 3 * s]))
    for name, unit, values in groups:
        measured = values[np.isfinite(values)]
        yield ResidualSummary(
            group=name,
            unit=unit,
            values=measured.size,
            rms=float(np.sqrt(np.mean(measured**2))) if measured.size else float("nan"),
        )
