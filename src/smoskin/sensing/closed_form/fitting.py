"""The SI's calibration as one weighted least squares, with uncertainties and honest refusals.

Decides which numbers of a skin a table of touches determines and how well. All touches are fitted
together; each touch's own depth and drag are fitted with them and eliminated, since gauge and
stage are noisier than the chips. Noise levels are found from the residuals themselves. What the
data cannot determine is refused by name.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError
from smoskin.measurement import TouchTable
from smoskin.sensing.closed_form.calibration import (
    Calibration,
    Evidence,
    ResidualSummary,
    Uncertainty,
)
from smoskin.sensing.closed_form.confidence import chip_noise
from smoskin.sensing.closed_form.press_model import PressModel, triples

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
_ROUNDS: Final = 3
"""Fits, each with the noise that the one before has found."""
_ATTENUATIONS: Final = ((0.02,), (0.9999,))
"""Least and largest v_a that is looked for; 1 is a rigid sheet."""
_RATIO: Final = 50.0
"""By how much a stiffness or a v_f may be off its nominal value, either way."""
_FACTORS: Final = ((0.1,), (10.0,))
"""k_c."""
_TURNS: Final = ((-0.5,), (0.5,))
"""rad, of a chip."""
_OFFSETS: Final = ((-0.02,), (0.02,))
"""T: c_c."""
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
    touches: TouchTable
    noise: tuple[float, float, float]
    """Found: of the force and of the depth relative to their size, of the fields in T;
    NaN where none were read."""
    depth: Floats
    """(T,), m: of each touch, as fitted."""
    drag: Floats
    """(T, 2), N, as fitted."""
    residual: Floats
    """(T, 4 + 3 S): measured less modelled force, N, depth, m, and fields in the skin's axes, T;
    NaN where nothing was measured."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solved:
    """One weighted solution."""

    values: Floats
    """(P,)."""
    own: Floats
    """(T, 3)."""
    residual: Floats
    """(T, V), SI."""
    scaled: Floats
    """(T, V): over the noise."""
    used: Floats
    """(T, V): share of each value that the touches' own unknowns have used up."""
    reduced: Floats
    """(T V + P, P): weighted derivatives without the touches' own unknowns, then the prior's."""


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
    design : SkinDesign
    touches : TouchTable
        Straight presses on cells of every layer, 45-degree loads in X and in Y on every layer
        and, best, readings of all chips, some of them untouched. Without any reading K_sf, the
        sheet's stiffness and the chips' numbers stay nominal.
    date : str
        ISO date of the measurement.
    data_sha256 : str
        SHA-256 of the measured file.
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
    solved = _Problem(model, sigma).solve(values)
    measured = np.isfinite(sigma)
    freedom = int(measured.sum() - 3 * len(touches.force) - model.size + (_prior(model) > 0).sum())
    residual = np.where(measured, solved.residual, np.nan)
    evidence = Evidence(
        date=date,
        data_sha256=data_sha256,
        touches=len(touches.force),
        freedom=max(freedom, 1),
        uncertainty=_uncertainty(model, solved),
        residuals=tuple(_summaries(design, residual)),
    )
    field = float(levels[2] * chip_noise(design)[0]) if model.read.any() else np.nan
    return Fit(
        calibration=replace(model.calibration(values, nominal), evidence=evidence),
        touches=touches,
        noise=(*levels[:2].tolist(), field),
        depth=solved.own[:, 0],
        drag=solved.own[:, 1:],
        residual=residual,
    )


def _fitted(model: PressModel, nominal: Calibration) -> tuple[Floats, Floats, Floats]:
    """Fitted numbers (P,), noise levels (3,) and the noise of every value (T, V)."""
    from scipy.optimize import least_squares

    levels = np.array([_RELATIVE, _RELATIVE, 1.0])
    group, bounds = _groups(model), _bounds(model, nominal)
    sigma = _sigmas(model, levels, 0.0)
    values = _start(model, nominal, sigma)
    for _ in range(_ROUNDS):
        problem = _Problem(model, sigma)
        values = least_squares(
            problem.residuals,
            values,
            jac=problem.jacobian,
            bounds=(bounds[0], bounds[1]),
            x_scale="jac",
            xtol=1e-8,
            ftol=1e-8,
            max_nfev=60,
        ).x
        solved = problem.solve(values)
        _check_determined(model, solved.reduced)
        levels = _levels(levels, group, solved, merged=not model.read.any())
        # Noise as large as the modelled values say: the measured ones would weigh low values more.
        sigma = _sigmas(model, levels, solved.residual)
    _check_inside(model, values, bounds)
    return values, levels, sigma


class _Problem:
    """The least squares over the skin's numbers alone."""

    def __init__(self, model: PressModel, sigma: Floats) -> None:
        self._model = model
        self._weight = 1 / sigma
        self._prior = _prior(model)
        self._last: _Solved | None = None
        self._own = np.column_stack([model.depth, model.touches.force[:, :2]])

    def residuals(self, values: Floats) -> Floats:
        solved = self.solve(values)
        return np.concatenate([solved.scaled.ravel(), self._prior * self._pull(values)])

    def jacobian(self, values: Floats) -> Floats:
        return self.solve(values).reduced

    def solve(self, values: Floats) -> _Solved:
        """Every touch's own depth and drag for these numbers, and what is left."""
        if self._last is not None and np.array_equal(self._last.values, values):
            return self._last
        weight, own = self._weight, self._own
        for _ in range(_OWN_STEPS):
            at = self._model.predict(values, own)
            basis, triangle = np.linalg.qr(at.by_own * weight[..., None])
            scaled = at.residual * weight
            inside = np.einsum("tvk,tv->tk", basis, scaled)
            if np.abs(inside).max() < _OWN_SETTLED:
                break
            own = own - np.linalg.solve(triangle, inside[..., None])[..., 0]
        self._own = own
        by_skin = at.by_skin * weight[..., None]
        by_skin -= np.einsum("tvk,tkp->tvp", basis, np.einsum("tvk,tvp->tkp", basis, by_skin))
        by_data = by_skin.reshape(-1, self._model.size)
        reduced = np.concatenate([by_data, np.diag(self._prior)])
        self._last = _Solved(
            values=np.array(values),
            own=own,
            residual=at.residual,
            scaled=scaled,
            used=(basis**2).sum(axis=-1),
            reduced=reduced,
        )
        return self._last

    def _pull(self, values: Floats) -> Floats:
        """What the prior holds at zero: c_c alone."""
        return np.where(self._prior > 0, values, 0.0)


def _check_loads(model: PressModel) -> None:
    """Enough loads of each kind, counted."""
    press = -model.touches.force[:, 2]
    shear = np.abs(model.touches.force[:, :2])
    pressed = model.touched & (press > 0)
    straight = pressed & (shear.max(axis=1) <= _STRAIGHT * press)
    _require("stiffness_variation", int(straight.sum()), "straight presses")
    for layer in range(len(model.design.coefficients.folding_correction_x)):
        for axis, name in enumerate("xy"):
            mainly = shear[:, axis] > shear[:, 1 - axis]
            loads = pressed & mainly & (shear[:, axis] >= _SHEARED * press)
            _require(
                f"folding_correction_{name} of layer {layer + 1} (from the rim inwards)",
                int((loads & (model.layer == layer)).sum()),
                f"loads with a drag in {name.upper()} on its cells",
            )
    if model.touches.field.shape[1]:
        for s, site in enumerate(model.design.halls):
            _require(f"field_factor of chip {site.name}", int(model.read[:, s].sum()), "readings")


def _require(name: str, count: int, what: str) -> None:
    if count < _LEAST_LOADS:
        raise ModelError(
            f"the touches cannot determine {name}: it needs at least {_LEAST_LOADS} {what}; "
            f"got {count}"
        )


def _sigmas(model: PressModel, levels: Floats, residual: Floats | float) -> Floats:
    """Noise of every value, shape (T, V), SI; infinite where nothing was measured."""
    touches = model.touches
    measured = np.column_stack([touches.force, model.depth])
    size = np.abs(
        measured - np.broadcast_to(residual, (len(measured), 4 + 3 * touches.field.shape[1]))[:, :4]
    )
    force = np.hypot(levels[0] * size[:, :3], _FORCE_FLOOR)
    depth = np.hypot(levels[1] * size[:, 3], _DEPTH_FLOOR)
    untouched = ~model.touched
    force[untouched], depth[untouched] = _UNTOUCHED
    field = np.broadcast_to(levels[2] * chip_noise(model.design), touches.field.shape)
    field = np.where(model.read[..., None], field, np.inf)
    return np.concatenate([force, depth[:, None], field.reshape(len(depth), -1)], axis=1)


def _groups(model: PressModel) -> Ints:
    """Which noise level each value tells of, shape (T, V); -1: none."""
    touches = model.touches
    group = np.full((len(touches.force), 4 + 3 * touches.field.shape[1]), -1)
    group[:, :3][np.abs(touches.force) * _RELATIVE > _FORCE_FLOOR] = 0
    group[model.depth * _RELATIVE > _DEPTH_FLOOR, 3] = 1
    group[:, 4:] = np.where(np.repeat(model.read, 3, axis=1), 2, -1)
    return group


def _levels(levels: Floats, group: Ints, solved: _Solved, *, merged: bool) -> Floats:
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
    chips = model.touches.field.shape[1]
    weight[model.layout.offset] = np.tile(1 / np.array(_OFFSET_PRIOR), chips)
    return weight


def _bounds(model: PressModel, nominal: Calibration) -> Floats:
    """Least and largest of each number, shape (2, P)."""
    at = model.layout
    bounds = np.log(_RATIO) * np.array([[-1.0], [1.0]]) + model.start(nominal)
    for part, limits in (
        (at.attenuation, _ATTENUATIONS),
        (at.rotation, _TURNS),
        (at.factor, _FACTORS),
        (at.offset, _OFFSETS),
    ):
        bounds[:, part] = limits
    return np.asarray(bounds)


def _start(model: PressModel, nominal: Calibration, sigma: Floats) -> Floats:
    """Numbers to start from: the v_a of least residual, each with the v_s that fits the presses."""
    press = -model.touches.force[:, 2]
    straight = model.touched & (model.depth > 0) & (press > 0)
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


def _tolerances(model: PressModel) -> Iterator[tuple[str, int, float]]:
    """Name, place and largest standard uncertainty of each number."""
    at = model.layout
    wide = {"attenuation": 0.1, "rotation": 0.05, "factor": 0.1, "offset": 5e-3}
    full = {
        "folding_x": "folding_correction_x",
        "folding_y": "folding_correction_y",
        "board": "board_stiffness",
        "sheet": "sheet_stiffness",
        "rotation": "chip_rotation",
        "factor": "field_factor",
        "offset": "field_offset",
    }
    for part in at._fields:
        place = getattr(at, part)
        for k in range(place.start, place.stop):
            name = full.get(part, part)
            if place.stop - place.start > 1:
                name = f"{name}[{k - place.start}]"
            yield name, k, wide.get(part, 0.3)


def _check_determined(model: PressModel, reduced: Floats) -> None:
    """Raise on a number that the data leaves too wide."""
    names, _, limits = zip(*_tolerances(model), strict=True)
    _, size, rows = np.linalg.svd(reduced * np.array(limits), full_matrices=False)
    spread = np.sqrt(((rows / np.maximum(size, 1e-9)[:, None]) ** 2).sum(axis=0))
    worst = int(np.argmax(spread))
    if spread[worst] > 1:
        raise ModelError(
            f"the touches cannot determine {names[worst]}: its standard uncertainty would be "
            f"{spread[worst] * limits[worst]:.2g} and must be at most {limits[worst]:g} "
            "(relative for stiffnesses and v_f); measure more touches that it acts on"
        )


def _check_inside(model: PressModel, values: Floats, bounds: Floats) -> None:
    """Raise where the best number stands at the end of what it can be."""
    for name, k, _ in _tolerances(model):
        if not bounds[0, k] + 1e-6 < values[k] < bounds[1, k] - 1e-9:
            raise ModelError(
                f"the touches fit no {name} inside ({bounds[0, k]:g}, {bounds[1, k]:g}); check "
                "the cells, units and signs of the table and that it belongs to this design"
            )


def _uncertainty(model: PressModel, solved: _Solved) -> Uncertainty:
    """Standard uncertainties in the numbers' own units."""
    at = model.layout
    own = np.sqrt(np.diag(np.linalg.inv(solved.reduced.T @ solved.reduced)))
    for part in (at.stiffness_variation, at.folding_x, at.folding_y, at.board, at.sheet):
        own[part] *= np.exp(solved.values[part])
    v_a = own[at.attenuation].tolist()
    nothing = float("nan")
    chips = len(model.design.halls)
    read = at.factor.start < model.size
    return Uncertainty(
        attenuation=(v_a[0], v_a[-1]),
        stiffness_variation=float(own[at.stiffness_variation][0]),
        folding_correction_x=tuple(own[at.folding_x].tolist()),
        folding_correction_y=tuple(own[at.folding_y].tolist()),
        board_stiffness=float(own[at.board][0]) if read else nothing,
        sheet_stiffness=float(own[at.sheet][0]) if read else nothing,
        chip_rotation=triples(own[at.rotation]) if read else ((nothing,) * 3,) * chips,
        field_factor=tuple(own[at.factor].tolist()) if read else (nothing,) * chips,
        field_offset=triples(own[at.offset]) if read else ((nothing,) * 3,) * chips,
    )


def _summaries(design: SkinDesign, residual: Floats) -> Iterator[ResidualSummary]:
    """Root mean square of each group of residuals."""
    groups = [(f"force_{axis}", "N", residual[:, k]) for k, axis in enumerate("xyz")]
    groups.append(("depth", "mm", residual[:, 3]))
    for s in range((residual.shape[1] - 4) // 3):
        name = f"field of chip {design.halls[s].name}"
        groups.append((name, "uT", residual[:, 4 + 3 * s : 7 + 3 * s]))
    for name, unit, values in groups:
        known: Bools = np.isfinite(values)
        yield ResidualSummary(
            group=name,
            unit=unit,
            values=int(known.sum()),
            rms=float(np.sqrt(np.mean(values[known] ** 2))) if known.any() else float("nan"),
        )
