"""What a bench measures of a touch, as the reduced model predicts it, with derivatives.

Decides which numbers of a skin a calibration can see and how: force (S27), drag (S26), motion of
the magnets (S11) and their fields. Hides the order of the fitted numbers and the derivatives.
Each touch has three unknowns of its own, press depth and drag, as gauge and stage are noisy too.
"""

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.inversion import rest_cross_talk
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.attenuation import magnet_displacements, profiles
from smoskin.mechanics.reduced.stiffness import cell_layers, normal_force, shear_gain, stiffness_map
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration

LOGARITHMS: Final = (
    "stiffness_variation",
    "folding_correction_x",
    "folding_correction_y",
    "board_stiffness",
    "sheet_stiffness",
)
"""Parts of the fitted numbers that are logarithms."""
_STEP: Final = 1e-5
"""Step of a fitted number in central differences."""
_OWN_STEPS: Final = (1e-8, 1e-6, 1e-6)
"""m, N and N: steps of a touch's depth and drag in central differences."""
_ON_VERTEX: Final = 1e-3
"""m: a touch that lies no further from a top vertex is one on it."""


class Layout(NamedTuple):
    """Places of a calibration's numbers among the fitted ones."""

    attenuation: slice
    stiffness_variation: slice
    folding_correction_x: slice
    folding_correction_y: slice
    board_stiffness: slice
    sheet_stiffness: slice
    chip_rotation: slice
    field_factor: slice
    field_offset: slice

    @classmethod
    def of(cls, attenuations: int, layers: int, chips: int) -> "Layout":
        """The order for so many separate v_a, layers of v_f and chips."""
        ends = np.cumsum([attenuations, 1, layers, layers, 1, 1, 3 * chips, chips, 3 * chips])
        begins = [0, *ends[:-1].tolist()]
        return cls(*(slice(*ends) for ends in zip(begins, ends.tolist(), strict=True)))

    def fields(self, numbers: Floats) -> dict[str, Any]:
        """All the numbers by the names of a calibration's fields."""
        fields: dict[str, Any] = {}
        for name, place in self._asdict().items():
            values = tuple(numbers[place].tolist())
            if name == "attenuation":
                values = values[0], values[-1]
            elif name in ("chip_rotation", "field_offset"):
                values = tuple(zip(*(values[k::3] for k in range(3)), strict=True))
            alone = name.endswith(("variation", "stiffness"))
            fields[name] = values[0] if alone else values
        return fields


class PressModel:
    """The measured values of a table of touches on top vertices as functions of a skin's numbers.

    `attenuations` is 1 for a v_a alike in X and Y, 2 for separate ones. It raises an
    `ArgumentError` if a touch lies on no top vertex or has no depth, or there is another number of
    chips.

    Notes
    -----
    Source: SI Text S5 with Eqs. (S6), (S11), (S24), (S26) and (S27).
    Valid for touches on top vertices.
    """

    def __init__(self, design: SkinDesign, touches: TouchTable, attenuations: int) -> None:
        _check_touches(design, touches)
        self.design = design
        self.touches = touches
        layers = len(design.coefficients.folding_correction_x)
        self.layout = Layout.of(attenuations, layers, len(design.halls))
        # Readings alone tell of what comes from the board's stiffness on.
        fitted = (
            self.layout.field_offset if touches.field.size else self.layout.folding_correction_y
        )
        self.size = int(fitted.stop)
        self.read: Bools = np.asarray(np.isfinite(touches.field).all(axis=-1))
        self.touched: Bools = touches.touched
        self.depth = np.where(self.touched, touches.depth, 0.0)
        self._cells = tuple(touched_cells(design, touches).T)
        self.layer: Ints = np.minimum(cell_layers(design.cells), layers - 1)[self._cells]
        self._sheet = functools.lru_cache(maxsize=8)(self._sheet_of)
        if touches.field.size:
            self._prepare_fields()

    def start(self, calibration: Calibration) -> Floats:
        """The fitted numbers that stand for a calibration, shape (P,)."""
        values = np.zeros(self.layout.field_offset.stop)
        for name, place in self.layout._asdict().items():
            owner = calibration if hasattr(calibration, name) else calibration.coefficients
            given = np.ravel(getattr(owner, name))[: place.stop - place.start]
            values[place] = np.log(given) if name in LOGARITHMS else given
        return values[: self.size]

    def calibration(self, values: Floats, nominal: Calibration) -> Calibration:
        """The calibration that fitted numbers stand for; what was not read stays nominal."""
        numbers = values.copy()
        for name in LOGARITHMS:
            place = getattr(self.layout, name)
            numbers[place] = np.exp(values[place])
        fields = self.fields(numbers)
        names = [part.name for part in dataclasses.fields(Coefficients)]
        coefficients = Coefficients(**{name: fields.pop(name) for name in names})
        read = fields if self.size > self.layout.board_stiffness.start else {}
        return replace(nominal, coefficients=coefficients, **read)

    def fields(self, numbers: Floats) -> dict[str, Any]:
        """Fitted numbers (P,) by the names of a calibration's fields; NaN where not fitted."""
        unread = np.full(self.layout.field_offset.stop - self.size, np.nan)
        return self.layout.fields(np.append(numbers, unread))

    def press_stiffness(self, values: Floats) -> Floats:
        """K_z of each touch's cell with v_s = 1, shape (T,), N/m."""
        return self._sheet(tuple(values[self.layout.attenuation].tolist()))[0]

    def predict(
        self, values: Floats, own: Floats, *, by_own_alone: bool = False
    ) -> tuple[Floats, Floats, Floats]:
        """Measured less modelled values, V = 3 + 1 + 3S a touch, and their derivatives.

        The skin's numbers (P,) are ordered as `start` does; each touch's own are its press depth,
        m, and drag in x and y, N. Residuals (T, V) are force, depth, and fields turned into the
        skin's axes, SI; then come derivatives by the touch's own numbers, (T, V, 3), and by the
        skin's, (T, V, P), which are left at zero `by_own_alone`, in a sixth of the time.
        """
        state = self._state(values, own)
        measured = np.column_stack([self.touches.force, self.depth])
        steps = np.append(np.full(self.size, _STEP), _OWN_STEPS)
        chip = np.arange(self.layout.chip_rotation.start, self.size)
        is_read = len(chip) > 0
        sheet = np.setdiff1d(np.arange(len(steps)), chip)
        if by_own_alone:
            chip, sheet = chip[:0], sheet[-len(_OWN_STEPS) :]
        by_state = _differences(
            lambda change: self._state(values + change[:-3], own + change[-3:]), steps, sheet
        )
        residual, slopes = measured - state[:, :4], np.zeros((*measured.shape, len(steps)))
        slopes[..., sheet] = -by_state[:, :4]
        if is_read:
            field, slope = self._fields(state[:, 4:])
            misread = self._misread(values, field)
            by_field = np.zeros((*misread.shape, len(steps)))
            share = np.where(self.read, -1 / values[self.layout.field_factor], 0.0)
            by_field[..., sheet] = share.repeat(3, axis=1)[..., None] * (slope @ by_state[:, 4:])
            if len(chip):
                by_field[..., chip] = _differences(
                    lambda change: self._misread(values + change[:-3], field), steps, chip
                )
            residual = np.concatenate([residual, misread], axis=1)
            slopes = np.concatenate([slopes, by_field], axis=1)
        return residual, slopes[..., -3:], slopes[..., :-3]

    def _state(self, values: Floats, own: Floats) -> Floats:
        """Force, depth and motion of each chip against each magnet in x and y, (T, 4 + 2G)."""
        at = self.layout
        press, drag = own[:, 0], own[:, 1:]
        stiffness, per_press = self._sheet(tuple(values[at.attenuation].tolist()))
        folding = np.stack([values[at.folding_correction_x], values[at.folding_correction_y]])
        gain = shear_gain(drag, np.exp(folding)[:, self.layer].T)
        push = normal_force(press, np.exp(values[at.stiffness_variation]) * stiffness, gain)
        # The board carries chips and the sheet; a magnet on the base stays behind by the board's
        # motion, one on the sheet moves ahead.
        on = np.array([float(magnet.mount == "sheet") for magnet in self.design.magnets])
        soft = np.exp(-values[at.board_stiffness]), np.exp(-values[at.sheet_stiffness])
        motion = -per_press * press[:, None, None]
        if len(soft[0]):
            motion += ((1 - on) * soft[0] - on * soft[1])[:, None] * drag[:, None, :]
        return np.column_stack([drag, -push, press, motion.reshape(len(press), -1)])

    def _prepare_fields(self) -> None:
        """What of the fields does not change while fitting."""
        design, touches, places = self.design, self.touches, geometry(self.design)
        self._charges = point_charges([design.magnet(site.magnet) for site in design.halls])
        reported = np.isfinite(touches.temperature)
        degrees = np.where(reported, touches.temperature, REFERENCE_TEMPERATURE)
        seen = np.where(self.read[..., None], touches.field, 0.0)
        turned = np.einsum("sij,tsj->tsi", mlx90393.rotations(design.halls), seen)
        self._seen = turned / temperature_factor(degrees)[..., None]
        self._cross_rest = rest_cross_talk(design)
        names = [magnet.name for magnet in design.magnets]
        self._watched = [names.index(site.magnet) for site in design.halls]
        # d(field of magnet g at chip s)/d(chip s against magnet g) in the plane.
        apart = places.chips[:, None] - places.magnets
        gradient = charge_field_and_gradient(*point_charges(design.magnets), apart)[1][..., :2]
        gradient[np.arange(len(apart)), self._watched] = 0.0
        self._cross_slope = gradient.swapaxes(1, 2).reshape(3 * len(apart), -1)

    def _fields(self, motion: Floats) -> tuple[Floats, Floats]:
        """Fields at the chips, (T, 3S), and their slopes by every motion, (T, 3S, 2G)."""
        count, chips = self.read.shape
        own_motion = np.zeros((count, chips, 3))
        own_motion[..., :2] = motion.reshape(count, -1, 2)[:, self._watched]
        places = geometry(self.design).rest + own_motion
        field, gradient = charge_field_and_gradient(*self._charges, places)
        field = (field + self._cross_rest).reshape(count, -1) + motion @ self._cross_slope.T
        slope = np.repeat(self._cross_slope[None], count, axis=0)
        for s, g in enumerate(self._watched):
            slope[:, 3 * s : 3 * s + 3, 2 * g : 2 * g + 2] += gradient[:, s, :, :2]
        return field, slope

    def _misread(self, values: Floats, field: Floats) -> Floats:
        """Fields that the chips read, turned, less those expected, (T, 3S); 0 where not read."""
        at = self.layout
        turns = Rotation.from_rotvec(values[at.chip_rotation].reshape(-1, 3)).as_matrix()
        turned = (turns @ self._seen[..., None]).reshape(field.shape)
        # Measured less modelled, not corrected less designed: a factor on the noise would pull
        # the factor down.
        expected = (field - values[at.field_offset]) / values[at.field_factor].repeat(3)
        return np.where(self.read.repeat(3, axis=1), turned - expected, 0.0)

    def _sheet_of(self, attenuation: tuple[float, ...]) -> tuple[Floats, Floats]:
        """K_z of each touch with v_s = 1, (T,), and each magnet's motion a press, (T, G, 2)."""
        design, v_a = self.design, (attenuation[0], attenuation[-1])
        unvaried = replace(design.coefficients, attenuation=v_a, stiffness_variation=1.0)
        parts = profiles(design.cell, design.cells, v_a, -1.0)
        motion = [
            magnet_displacements(parts, magnet.corner)[self._cells] * (magnet.mount == "sheet")
            for magnet in design.magnets
        ]
        return stiffness_map(design, unvaried)[self._cells], np.stack(motion, axis=1)


def _differences(function: Callable[[Floats], Floats], steps: Floats, chosen: Ints) -> Floats:
    """Central differences of a function of changes (K,) by the chosen of them, in the last axis."""
    slopes = []
    for k in chosen.tolist():
        change = np.zeros(len(steps))
        change[k] = steps[k]
        slopes.append((function(change) - function(-change)) / (2 * steps[k]))
    return np.stack(slopes, axis=-1)


def _check_touches(design: SkinDesign, touches: TouchTable) -> None:
    """Raise unless every touch has a depth and readings come from all chips or none."""
    unknown = touches.touched & ~np.isfinite(touches.depth)
    if unknown.any():
        raise ArgumentError(
            "touches must say how far the stage pushed (displacement_z_mm) for the paper's model; "
            f"row {int(np.argmax(unknown)) + 1} does not"
        )
    chips = touches.field.shape[1]
    if chips not in (0, len(design.halls)):
        raise ArgumentError(
            f"touches must hold readings of all {len(design.halls)} chips or of none; got {chips}"
        )


def touched_cells(design: SkinDesign, touches: TouchTable) -> Ints:
    """Cell (n, m) whose top vertex each touch lies on, (T, 2); the first for an untouched row."""
    places = geometry(design).tops.reshape(-1, 2)
    where = np.where(touches.touched[:, None], touches.position, places[0])
    apart = np.linalg.norm(where[:, None] - places, axis=-1)
    off = apart.min(axis=1) > _ON_VERTEX
    if off.any():
        row = int(np.argmax(off))
        raise ArgumentError(
            "touches must lie on the cells' top vertices for the paper's model; got "
            f"({1e3 * where[row, 0]:.2f}, {1e3 * where[row, 1]:.2f}) mm in row {row + 1}"
        )
    return np.stack(np.divmod(apart.argmin(axis=1), design.cells[1]), axis=-1)
