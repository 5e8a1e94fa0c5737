"""What a bench measures of a touch, as the reduced model predicts it, with derivatives.

Decides which numbers of a skin a calibration can see and how: force (S27), drag (S26), motion of
the magnets (S11) and their fields. Hides the order of the fitted numbers and the derivatives.
Each touch has three unknowns of its own, press depth and drag, as gauge and stage are noisy too.
"""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393, sector
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.inversion import rest_cross_talk
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.attenuation import magnet_displacements, profiles
from smoskin.mechanics.reduced.stiffness import cell_layers, stiffness_map
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration, Triple

_STEP: Final = 1e-5
"""Step of v_a in its central differences."""


_ON_VERTEX: Final = 1e-3
"""m: a touch that lies no further from a top vertex is one on it."""


class Layout(NamedTuple):
    """Places of the numbers among the fitted ones; stiffnesses and v_f as logarithms."""

    attenuation: slice
    stiffness_variation: slice
    folding_x: slice
    folding_y: slice
    board: slice
    sheet: slice
    rotation: slice
    factor: slice
    offset: slice

    @classmethod
    def of(cls, attenuations: int, layers: int, chips: int) -> "Layout":
        """The order for so many separate v_a, layers of v_f and chips read."""
        some = 1 if chips else 0
        sizes = (attenuations, 1, layers, layers, some, some, 3 * chips, chips, 3 * chips)
        ends = np.cumsum(sizes).tolist()
        return cls(*(slice(end - size, end) for end, size in zip(ends, sizes, strict=True)))


class Predicted(NamedTuple):
    """Measured less modelled values, V = 3 + 1 + 3 S a touch, and their derivatives."""

    residual: Floats
    """(T, V): force, depth, fields turned into the skin's axes; in SI."""
    by_own: Floats
    """(T, V, 3): by the touch's own depth and drag."""
    by_skin: Floats
    """(T, V, P): by the skin's numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Sheet:
    """What follows from v_a, for each touch's cell."""

    stiffness: Floats
    """(T,), K_z with v_s = 1, N/m."""
    motion: Floats
    """(T, G, 2), of each magnet for a unit press."""


class PressModel:
    """The measured values of a table of touches as functions of a skin's numbers.

    Parameters
    ----------
    design : SkinDesign
    touches : TouchTable
        Touches on top vertices with their depths, and readings of all the design's chips or of
        none.
    attenuations : int
        1: v_a alike in X and Y; 2: separate.

    Raises
    ------
    ArgumentError
        If a touch lies on no top vertex or has no depth, or there is another number of chips.

    Notes
    -----
    Source: SI Text S5 with Eqs. (S6), (S11), (S24), (S26) and (S27).
    Valid for touches on top vertices.
    """

    def __init__(self, design: SkinDesign, touches: TouchTable, attenuations: int) -> None:
        _check_touches(design, touches)
        self.design = design
        self.touches = touches
        chips = touches.field.shape[1]
        layers = len(design.coefficients.folding_correction_x)
        self.layout = Layout.of(attenuations, layers, chips)
        self.size = self.layout.offset.stop
        self.read: Bools = np.asarray(np.isfinite(touches.field).all(axis=-1))
        self.touched: Bools = touches.touched
        self.depth = np.where(self.touched, touches.depth, 0.0)
        self._n, self._m = touched_cells(design, touches).T
        self.layer: Ints = np.minimum(cell_layers(design.cells), layers - 1)[self._n, self._m]
        self._known: tuple[tuple[float, ...], _Sheet, list[_Sheet]] | None = None
        if chips:
            self._prepare_fields()

    def start(self, calibration: Calibration) -> Floats:
        """The fitted numbers that stand for a calibration, shape (P,)."""
        values = np.zeros(self.size)
        at, coefficients = self.layout, calibration.coefficients
        values[at.attenuation] = coefficients.attenuation[: at.attenuation.stop]
        values[at.stiffness_variation] = np.log(coefficients.stiffness_variation)
        values[at.folding_x] = np.log(coefficients.folding_correction_x)
        values[at.folding_y] = np.log(coefficients.folding_correction_y)
        values[at.board] = np.log(calibration.board_stiffness)
        values[at.sheet] = np.log(calibration.sheet_stiffness)
        if at.factor.start < self.size:
            values[at.rotation] = np.ravel(calibration.chip_rotation)
            values[at.factor] = calibration.field_factor
            values[at.offset] = np.ravel(calibration.field_offset)
        return values

    def calibration(self, values: Floats, nominal: Calibration) -> Calibration:
        """The calibration that fitted numbers stand for; what was not read stays nominal."""
        at = self.layout
        v_a = values[at.attenuation].tolist()
        coefficients = Coefficients(
            attenuation=(v_a[0], v_a[-1]),
            stiffness_variation=float(np.exp(values[at.stiffness_variation][0])),
            folding_correction_x=tuple(np.exp(values[at.folding_x]).tolist()),
            folding_correction_y=tuple(np.exp(values[at.folding_y]).tolist()),
        )
        made = replace(nominal, coefficients=coefficients)
        if at.factor.start == self.size:
            return made
        return replace(
            made,
            board_stiffness=float(np.exp(values[at.board][0])),
            sheet_stiffness=float(np.exp(values[at.sheet][0])),
            chip_rotation=triples(values[at.rotation]),
            field_factor=tuple(values[at.factor].tolist()),
            field_offset=triples(values[at.offset]),
        )

    def press_stiffness(self, values: Floats) -> Floats:
        """K_z of each touch's cell with v_s = 1, shape (T,), N/m."""
        return self._sheet(values[self.layout.attenuation]).stiffness

    def predict(self, values: Floats, own: Floats) -> Predicted:
        """Residuals and derivatives.

        Parameters
        ----------
        values : Floats, shape (P,)
            The skin's numbers, as `start` orders them.
        own : Floats, shape (T, 3)
            Press depth, m, and drag in x and y, N, of each touch.
        """
        at, touches = self.layout, self.touches
        chips = touches.field.shape[1]
        count = len(own)
        by_own = np.zeros((count, 4 + 3 * chips, 3))
        by_skin = np.zeros((count, 4 + 3 * chips, self.size))
        press, drag = own[:, 0], own[:, 1:]
        v_a = values[at.attenuation]
        sheet, slopes = self._sheet_and_slopes(tuple(v_a.tolist()))

        scale = np.exp(values[at.stiffness_variation][0])
        folding = np.exp(
            np.stack([values[at.folding_x][self.layer], values[at.folding_y][self.layer]], axis=-1)
        )
        share = drag / folding
        length = np.hypot(share[:, 0], share[:, 1])
        along = share / np.maximum(length, 1e-12)[:, None]
        stiff = scale * sheet.stiffness
        push = (1 + length) * stiff * press
        by_drag = (stiff * press)[:, None] * along / folding

        # Pressing is negative z.
        force = np.column_stack([drag, -push])
        residual = np.zeros((count, 4 + 3 * chips))
        residual[:, :3] = touches.force - force
        residual[:, 3] = self.depth - press
        by_own[:, 0, 1] = by_own[:, 1, 2] = by_own[:, 3, 0] = -1.0
        by_own[:, 2, 0] = (1 + length) * stiff
        by_own[:, 2, 1:] = by_drag
        for k, slope in enumerate(slopes):
            by_skin[:, 2, k] = (1 + length) * scale * slope.stiffness * press
        by_skin[:, 2, at.stiffness_variation] = push[:, None]
        rows = np.arange(count)
        for axis, part in enumerate((at.folding_x, at.folding_y)):
            by_skin[rows, 2, part.start + self.layer] = -by_drag[:, axis] * drag[:, axis]
        if chips:
            self._predict_fields(values, own, sheet, slopes, residual, by_own, by_skin)
        return Predicted(residual, by_own, by_skin)

    def _prepare_fields(self) -> None:
        """What of the fields does not change while fitting."""
        design, touches = self.design, self.touches
        magnets = [design.magnet(site.magnet) for site in design.halls]
        self._places, self._charges = point_charges(magnets)
        self._rest = geometry(design).rest
        mounts = mlx90393.rotations(design.halls)
        reported = np.isfinite(touches.temperature)
        degrees = np.where(reported, touches.temperature, REFERENCE_TEMPERATURE)
        warmth = temperature_factor(degrees)[..., None]
        seen = np.where(self.read[..., None], touches.field, 0.0)
        self._seen = np.einsum("sij,tsj->tsi", mounts, seen) / warmth
        self._cross_rest = rest_cross_talk(design)
        self._on_sheet = np.array([float(m.mount == "sheet") for m in design.magnets])
        names = [magnet.name for magnet in design.magnets]
        self._watched = np.array([names.index(site.magnet) for site in design.halls])
        # d(field of magnet g at chip s)/d(chip s against magnet g) in the plane, (S, G, 3, 2).
        self._cross_slope = np.zeros((len(magnets), len(names), 3, 2))
        step = 1e-4
        for s, chip in enumerate(geometry(design).chips):
            for g, place in enumerate(geometry(design).magnets):
                if g != self._watched[s]:
                    around = chip - place + step * np.eye(3)[:2, None] * [[1.0], [-1.0]]
                    near = sector.field(design.magnets[g], around.reshape(2, 2, 3))
                    self._cross_slope[s, g] = ((near[:, 0] - near[:, 1]) / (2 * step)).T

    def _predict_fields(
        self,
        values: Floats,
        own: Floats,
        sheet: _Sheet,
        slopes: list[_Sheet],
        residual: Floats,
        by_own: Floats,
        by_skin: Floats,
    ) -> None:
        """Fill in the rows of the fields."""
        at = self.layout
        count, chips = self.read.shape
        factor = values[at.factor]
        rotation, offset = (values[part].reshape(chips, 3) for part in (at.rotation, at.offset))
        soft = np.exp(-np.array([values[at.board][0], values[at.sheet][0]]))  # 1/K

        # Chip s against magnet g, (T, S, G, 2): the board carries chips and the sheet; a magnet
        # on the base stays behind by the board's motion, one on the sheet moves ahead.
        press, drag = own[:, 0], own[:, 1:]
        on = self._on_sheet
        by_drag = (1 - on) * soft[0] - on * soft[1]  # (G,)
        per_press = -sheet.motion  # (T, G, 2)
        against = by_drag[:, None] * drag[:, None, :] + per_press * press[:, None, None]
        own_motion = np.zeros((count, chips, 3))
        own_motion[..., :2] = against[:, self._watched]
        field, gradient = charge_field_and_gradient(
            self._places, self._charges, self._rest + own_motion
        )
        field = field + self._cross_rest
        field = field + np.einsum("sgij,tgj->tsi", self._cross_slope, against)

        turned = np.einsum("sij,tsj->tsi", Rotation.from_rotvec(rotation).as_matrix(), self._seen)
        read = self.read[..., None]
        # Measured less modelled, not corrected less designed: a factor on the noise would pull
        # the factor down.
        expected = (field - offset) / factor[:, None]
        residual[:, 4:] = np.where(read, turned - expected, 0.0).reshape(count, -1)

        # d(field)/d(motion of every magnet), (T, S, G, 3, 2).
        slope = np.broadcast_to(self._cross_slope, (count, *self._cross_slope.shape)).copy()
        slope[:, np.arange(chips), self._watched] += gradient[..., :2]
        slope *= np.where(read, -1.0 / factor[:, None], 0.0)[..., None, None]
        by_own[:, 4:, 0] = np.einsum("tsgij,tgj->tsi", slope, per_press).reshape(count, -1)
        by_own[:, 4:, 1:] = np.einsum("tsgij,g->tsij", slope, by_drag).reshape(count, -1, 2)
        moves = [(k, -one.motion * press[:, None, None]) for k, one in enumerate(slopes)]
        for part, weight in ((at.board, -(1 - on) * soft[0]), (at.sheet, on * soft[1])):
            moves.append((part.start, weight[:, None] * drag[:, None, :]))
        for place, moved in moves:
            by_skin[:, 4:, place] = np.einsum("tsgij,tgj->tsi", slope, moved).reshape(count, -1)
        self._slopes_by_chips(values, turned, expected, by_skin)

    def _slopes_by_chips(
        self, values: Floats, turned: Floats, expected: Floats, by_skin: Floats
    ) -> None:
        """Fill in the fields' derivatives by each chip's rotation, factor and offset."""
        at, read = self.layout, self.read[..., None]
        rotation, factor = values[at.rotation].reshape(-1, 3), values[at.factor]
        for s in range(len(factor)):
            rows = slice(4 + 3 * s, 7 + 3 * s)
            by_skin[:, rows, at.factor.start + s] = expected[:, s] / factor[s] * read[:, s]
            for axis, unit in enumerate(np.eye(3)):
                turn = np.cross(unit + np.cross(rotation[s], unit) / 2, turned[:, s])
                by_skin[:, rows, at.rotation.start + 3 * s + axis] = turn * read[:, s]
                by_skin[:, 4 + 3 * s + axis, at.offset.start + 3 * s + axis] = (
                    read[:, s, 0] / factor[s]
                )

    def _sheet_and_slopes(self, attenuation: tuple[float, ...]) -> "tuple[_Sheet, list[_Sheet]]":
        """Stiffness and motion under v_a, and their derivatives by each of v_a."""
        if self._known is not None and self._known[0] == attenuation:
            return self._known[1], self._known[2]
        v_a, slopes = np.array(attenuation), []
        for step in _STEP * np.eye(len(v_a)):
            up, down = self._sheet(v_a + step), self._sheet(v_a - step)
            slopes.append(
                _Sheet(
                    stiffness=(up.stiffness - down.stiffness) / (2 * _STEP),
                    motion=(up.motion - down.motion) / (2 * _STEP),
                )
            )
        self._known = attenuation, self._sheet(v_a), slopes
        return self._known[1], slopes

    def _sheet(self, attenuation: Floats) -> _Sheet:
        """Stiffness and magnets' motion of each touch under v_a."""
        design = self.design
        v_a = (float(attenuation[0]), float(attenuation[-1]))
        unvaried = replace(design.coefficients, attenuation=v_a, stiffness_variation=1.0)
        stiffness = stiffness_map(design, unvaried)
        parts = profiles(design.cell, design.cells, v_a, -1.0)
        motion = [
            magnet_displacements(parts, magnet.corner)[self._n, self._m]
            if magnet.mount == "sheet"
            else np.zeros((len(self._n), 2))
            for magnet in design.magnets
        ]
        return _Sheet(stiffness=stiffness[self._n, self._m], motion=np.stack(motion, axis=1))


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
    """Cell (n, m) whose top vertex each touch lies on, (T, 2); the first for an untouched row.

    Raises
    ------
    ArgumentError
        If a touch lies further than a millimetre from every top vertex.
    """
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


def triples(values: Floats) -> tuple[Triple, ...]:
    """Numbers in threes."""
    return tuple((x, y, z) for x, y, z in values.reshape(-1, 3).tolist())
