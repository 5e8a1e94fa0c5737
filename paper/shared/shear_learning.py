"""A model trained without shear, under shear: Figure S11 on the twin, as arrays.

As in the paper one skin is pressed at 25 x 33 places without shear, a model learns place and
normal force from the six signals of its upper chips, and then every cell is pressed and dragged.
Decides the loads and the three readings of each: the model's on signals as they come, the same on
the SI's preprocessed ones (`paper.models.preprocessing`), and the joint estimator's, which
takes drags for unknowns. Done on a made skin of the whole sheet and on theory's own sheet.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from paper.models.preprocessing import (
    Preprocessed,
    corrected_force,
    folding_corrections,
    without_shear,
)
from paper.shared.setting import TrialSkin, bench_signals
from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.inversion import FieldInverse
from smoskin.mechanics.reduced.stiffness import cell_layers, folding_correction_map
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.records import Motion
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.learned.gaussian_process import LearnedModel, Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.learned.training import Examples, FittingEffort, train_model
from smoskin.twin.readout import Readout
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

DRAGS: Final = (0.0, 0.1, 0.3, 0.5)
"""N."""
SHOWN: Final = 2
"""Index of the drag that panels a to f show."""
FORCES: Final = (0.3, 0.5, 0.7, 1.0)
"""N, normal, on every cell."""
PLACES: Final = (25, 33)
"""Places along x and y at which the skin is pressed for the model, as the SI does."""
_FORCE: Final = (0.1, 1.0)
"""N, from and to, of those presses; two a place."""
_EFFORT: Final = FittingEffort(rows=1650, evidence_rows=400, iterations=30)
_SLANTED: Final = (0.3, 0.4, 0.5)
"""N: normal and shear force of the loads at 45 degrees that tell v_f."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """What one way of reading says of R presses dragged along one axis by each of D drags."""

    place: Floats
    """(D, R, 2), m: error in x and y."""
    force: Floats
    """(D, R), N: the normal force that it says."""

    @property
    def distance(self) -> Floats:
        """(D, R), m: of the place said from the true one."""
        return np.asarray(np.hypot(self.place[..., 0], self.place[..., 1]))

    def force_error(self, true: Floats) -> Floats:
        """(D,): mean relative error of the force."""
        return np.asarray(np.abs(self.force / true - 1).mean(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sheared:
    """All ways of reading presses on all cells with shear along one axis."""

    cell: Ints
    """(R,): of each press, counted along x first, from 0."""
    true: Floats
    """(R,), N: its normal force."""
    raw: Readings
    """By the model on signals as they come."""
    deducted: Readings
    """By the model on the SI's preprocessed signals, the force as the model says it."""
    preprocessed: Readings
    """The same with the force times 1 + |F_p| / v_f."""
    printed: Readings
    """The same with the design's v_f, whatever the sheet's is."""
    signals: Floats
    """(D, R, S, 3), T: what was read."""

    @property
    def nearer(self) -> float:
        """Share of the cells whose mean place error preprocessing lowers, at the drag shown."""
        before, after = (
            self.by_cell(item.distance[SHOWN]) for item in (self.raw, self.preprocessed)
        )
        return float((after < before).mean())

    def by_cell(self, values: Floats) -> Floats:
        """Mean over the presses on each cell."""
        return np.array([values[self.cell == k].mean() for k in np.unique(self.cell)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Jointly:
    """What the estimator that takes drags for unknowns says of the same presses."""

    readings: Readings
    drag_error: Floats
    """(D,), N: mean distance of the drag that it says from the true one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SheetTrial:
    """One sheet under shear."""

    x: Sheared
    y: Sheared
    induced: float
    """T, root mean square: what a drag of `DRAGS[SHOWN]` adds to a signal of the upper chips."""
    left: float
    """T, likewise: what deducting the SI's part leaves of that."""
    fitted_left: float
    """T, likewise: what the best multiple of the lower chip's signals would leave."""
    unasked: float
    """N: drag that preprocessing finds in presses without any, mean."""
    refused: float
    """Share of the raw signals at that drag that are too new to the model to be believed."""
    folding: Floats
    """(N, M, 2), N: v_f of each cell for shear in X and Y."""
    answers: Floats
    """(N M, U), T: what that drag along X adds to B_x of each of U upper chips, by cell."""
    slide: Floats
    """(U,), T: what theory's slide makes of it, wherever the drag acts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShearLearning:
    """The comparison on both sheets."""

    whole: SheetTrial
    """A made skin of the whole sheet."""
    theory: SheetTrial
    """The SI's own theory, as designed."""


def shear_learning(twin: Twin) -> ShearLearning:
    """Train on presses without shear, and read presses with it.

    Parameters
    ----------
    twin : Twin
        The made skin; theory's sheet is that of its design.
    """
    design, reduced = twin.design, ReducedTwin(twin.design, seed=None)

    def held(where: Floats, push: Floats) -> Motion:
        return twin.motions(Touches(position=where[:, None], force=push[:, None]))

    whole = _Bench(design, Readout(design, twin.deviations), held)
    theory = _Bench(design, Readout(design), lambda where, push: _theory(reduced, where, push))
    return ShearLearning(
        whole=_trial(whole, None),
        theory=_trial(theory, folding_correction_map(design.cells, design.coefficients)),
    )


def read_jointly(skin: TrialSkin, trial: SheetTrial) -> tuple[Jointly, Jointly]:
    """The trial's signals with shear along X and along Y, read with drags for unknowns.

    Parameters
    ----------
    skin : TrialSkin
        The trial's, with its calibrated table.
    trial : SheetTrial
    """
    joint = TouchSolver(skin.table, skin.noise, TouchPriors())
    x, y = (
        _jointly(skin.twin.design, joint, axis, item.signals)
        for axis, item in enumerate((trial.x, trial.y))
    )
    return x, y


class _Bench:
    """A sheet that can be pressed, and the SI's preprocessing for it.

    Parameters
    ----------
    design : SkinDesign
    readout : Readout
        Of the skin.
    held : callable
        Motions under touches at places (B, 2) with forces (B, 3).
    """

    def __init__(
        self, design: SkinDesign, readout: Readout, held: Callable[[Floats, Floats], Motion]
    ) -> None:
        self.design = design
        mounts = [design.magnet(site.magnet).mount for site in design.halls]
        self.upper = [s for s, mount in enumerate(mounts) if mount == "sheet"]
        self.lower = [s for s, mount in enumerate(mounts) if mount == "base"]
        self._readout, self._held = readout, held
        self._rng = np.random.default_rng(0)
        self._calibration, self._inverse = Calibration.nominal(design), FieldInverse(design)

    def press(self, where: Floats, push: Floats) -> Floats:
        """Signals, (B, S, 3), T."""
        return bench_signals(self.design, self._readout, self._held(where, push), self._rng)

    def without_shear(self, signals: Floats) -> Preprocessed:
        """The same without what the lower chip's drag makes of them."""
        return without_shear(signals, self.design, self._calibration, inverse=self._inverse)


def _theory(reduced: ReducedTwin, where: Floats, push: Floats) -> Motion:
    """Motions under many touches, one at a time."""
    return reduced.motions(Touches(position=where[:, None], force=push[:, None]))


def _loads(design: SkinDesign, axis: int) -> tuple[Ints, Floats, Floats]:
    """Cells (R,), their places (R, 2) and the forces of the presses with each drag (D, R, 3)."""
    places = np.asarray(geometry(design).tops.swapaxes(0, 1).reshape(-1, 2))
    step, cell = np.indices((len(FORCES), len(places))).reshape(2, -1)
    push = np.zeros((len(DRAGS), len(cell), 3))
    push[..., 2] = -np.array(FORCES)[step]
    # Each cell is dragged both ways.
    push[..., axis] = np.multiply.outer(DRAGS, np.where((step + cell) % 2, 1.0, -1.0))
    return cell, places[cell], push


def _trial(bench: _Bench, folding: Floats | None) -> SheetTrial:
    """One sheet; v_f is found from loads at 45 degrees where it is not given."""
    design, upper = bench.design, bench.upper
    model = _learn(bench)
    folding_map = _fitted_folding(bench, model) if folding is None else folding
    sheared = []
    for axis in range(2):
        cell, where, push = _loads(design, axis)
        rows = bench.press(np.tile(where, (len(DRAGS), 1)), push.reshape(-1, 3))
        signals_read = rows.reshape(*push.shape[:2], *rows.shape[1:])
        sheared.append(_read(bench, model, folding_map, cell, where, push, signals_read))
    shown, straight = (np.concatenate([item.signals[k] for item in sheared]) for k in (SHOWN, 0))
    parted, without = (bench.without_shear(item) for item in (shown, straight))
    added = shown - straight
    sensed, flat = (added[:, chips].reshape(len(added), -1) for chips in (bench.lower, upper))
    fitted = sensed @ np.linalg.lstsq(sensed, flat, rcond=None)[0]
    novelty = model.predict(_inputs(model, shown)).novelty
    cell, _, push = _loads(design, 0)
    sign = np.sign(push[SHOWN, :, 0, None])
    answers = sign * added[: len(cell), upper, 0]
    slid = sign * (shown - parted.signals)[: len(cell), upper, 0]
    return SheetTrial(
        x=sheared[0],
        y=sheared[1],
        induced=_rms(flat),
        left=_rms((parted.signals - straight)[:, upper]),
        fitted_left=_rms(flat - fitted),
        unasked=float(np.hypot(*without.shear.T).mean()),
        refused=float((novelty > 1).mean()),
        folding=folding_map,
        answers=np.stack([answers[cell == k].mean(axis=0) for k in np.unique(cell)]),
        slide=slid.mean(axis=0),
    )


def _learn(bench: _Bench) -> LearnedModel:
    """A model of place and normal force from presses without shear."""
    extent = geometry(bench.design).extent
    rng = np.random.default_rng(1)
    grid = places_to_the_rim(extent, PLACES)
    where = np.concatenate([grid, grid])
    push = np.zeros((len(where), 3))
    push[:, 2] = -rng.uniform(*_FORCE, len(where))
    examples = Examples(
        time=np.arange(len(where), dtype=np.float64),
        field=bench.press(where, push),
        targets=np.column_stack([where, push[:, 2]]),
        outputs=(Output.X, Output.Y, Output.FZ),
        group=np.tile(np.arange(len(grid)), 2),
        run=np.zeros(len(where), dtype=np.int64),
    )
    return train_model(
        examples, Encoding(chips=tuple(bench.upper), form=Form.DIRECTION), effort=_EFFORT
    )


def _inputs(model: LearnedModel, signals: Floats) -> Floats:
    """Inputs of the model, (T, D)."""
    return model.encoding.encode(np.arange(len(signals), dtype=np.float64), signals)


def _say(model: LearnedModel, signals: Floats) -> Floats:
    """x, y and the normal force of each reading, (T, 3), m and N."""
    return model.predict(_inputs(model, signals)).values * (1.0, 1.0, -1.0)


def _fitted_folding(bench: _Bench, model: LearnedModel) -> Floats:
    """v_f of each cell by the SI's procedure: what makes the forces of slanted loads come out best.

    Infinite where the force found is not too small at all.
    """
    layers = cell_layers(bench.design.cells)
    count = int(layers.max()) + 1
    places = geometry(bench.design).tops[range(count), range(count)]
    loads = np.array([(force, sign) for force in _SLANTED for sign in (-1, 1)])
    push = np.zeros((2, count, len(loads), 3))
    push[..., 2] = -loads[:, 0]
    for axis in range(2):
        push[axis, ..., axis] = loads.prod(axis=1)
    where = np.tile(np.repeat(places, len(loads), axis=0), (2, 1))
    parted = bench.without_shear(bench.press(where, push.reshape(-1, 3)))
    force = _say(model, parted.signals)[:, 2].reshape(push.shape[:3])
    drawn = force * np.hypot(*parted.shear.T).reshape(push.shape[:3])
    share = ((-push[..., 2] - force) * drawn).sum(axis=2) / (drawn**2).sum(axis=2)
    result = np.divide(1.0, share, out=np.full(share.shape, np.inf), where=share > 0)
    return np.asarray(result.T[layers])


def _read(
    bench: _Bench,
    model: LearnedModel,
    folding: Floats,
    cell: Ints,
    where: Floats,
    push: Floats,
    signals_read: Floats,
) -> Sheared:
    """Signals (D, R, S, 3) of presses (D, R, 3) on cells (R,), read by the model."""
    flat = signals_read.reshape(-1, *signals_read.shape[2:])
    design, parted = bench.design, bench.without_shear(flat)
    raw, deducted = _say(model, flat), _say(model, parted.signals)

    def corrected(folding: Floats) -> Readings:
        share = folding_corrections(deducted[:, :2], design, folding)
        force = corrected_force(deducted[:, 2], parted.shear, share)
        return _readings(np.column_stack([deducted[:, :2], force]), where)

    return Sheared(
        cell=cell,
        true=-push[0, :, 2],
        raw=_readings(raw, where),
        deducted=_readings(deducted, where),
        preprocessed=corrected(folding),
        printed=corrected(folding_correction_map(design.cells, design.coefficients)),
        signals=signals_read,
    )


def _jointly(design: SkinDesign, joint: TouchSolver, axis: int, signals_read: Floats) -> Jointly:
    """The same signals read by the joint estimator."""
    _, where, push = _loads(design, axis)
    flat = signals_read.reshape(push.shape[0] * push.shape[1], -1)
    solved = np.stack([joint.single(item).values[0] for item in flat])
    missed = solved[:, 2:4].reshape(*push.shape[:2], 2) - push[..., :2]
    return Jointly(
        readings=_readings(solved[:, [0, 1, 4]] * (1.0, 1.0, -1.0), where),
        drag_error=np.hypot(missed[..., 0], missed[..., 1]).mean(axis=1),
    )


def _readings(values: Floats, where: Floats) -> Readings:
    """Readings of x, y and the normal force (D R, 3) at places (R, 2)."""
    shaped = values.reshape(-1, len(where), 3)
    return Readings(place=shaped[..., :2] - where, force=shaped[..., 2])


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
