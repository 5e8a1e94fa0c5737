"""What the paper says of Figure S11, as rows."""

from collections.abc import Iterable, Sequence

import numpy as np

from paper.rows import Row, stated
from paper.shear_learning import (
    DRAGS,
    SHOWN,
    Jointly,
    Readings,
    Sheared,
    ShearLearning,
)
from smoskin.arrays import Floats


def shear_learning_rows(found: ShearLearning, jointly: tuple[Jointly, Jointly]) -> list[Row]:
    """What Text S7 says of Figure S11, beside what came out."""
    place, whole, theory = "Text S7, Figure S11", found.whole, found.theory
    both = whole.x, whole.y
    raw, preprocessed = ([getter(one) for one in both] for getter in (_raw, _preprocessed))
    joint = [one.readings for one in jointly]
    true = whole.x.true
    quiet = max(float(one.force_error(true)[0]) for one in raw)
    still = max(_distance(raw, 0))
    nearer = (whole.x.nearer, whole.y.nearer)
    ideal = [_raw(theory.x), _raw(theory.y)], [_preprocessed(theory.x), _preprocessed(theory.y)]
    printed = [one.printed for one in both]
    folding = "v_f is calibrated on this sheet"
    if not np.isfinite(whole.folding).any():
        folding = "this sheet does not stiffen under drag: its calibrated v_f is infinite"
    return [
        stated(
            "figure_s11.without",
            place,
            "without the preprocess the normal force estimation was quite inaccurate",
            f"off by {_percents(_force(raw, true))} with {DRAGS[SHOWN]:g} N of shear along X, Y; "
            f"without shear by {100 * quiet:.1f} %",
            min(_force(raw, true)) > max(0.05, 5 * quiet),
            "a learned model of the six upper signals, trained on 1650 presses of one made skin "
            "without shear; mean over 0.3 to 1 N on all 36 cells. By itself it would have refused "
            f"{100 * whole.refused:.0f} % of the sheared signals as unlike what it has seen",
        ),
        stated(
            "figure_s11.force",
            place,
            "with the shear-induced influence deducted it becomes more accurate (a, d)",
            f"off by {_percents(_force(preprocessed, true))}",
            all(np.less(_force(preprocessed, true), _force(raw, true))),
            f"{folding}; with the printed v_f it would be {_percents(_force(printed, true))}. On "
            f"theory's own sheet {_percents(_force(ideal[0], true))} fall to "
            f"{_percents(_force(ideal[1], true))} with them",
        ),
        stated(
            "figure_s11.place",
            place,
            "for most of the cells the localization error was reduced, but they were still large "
            "(b, c, e, f)",
            f"smaller on {_percents(nearer)} of the cells: {_millimetres(_distance(raw))} fall to "
            f"{_millimetres(_distance(preprocessed))}; without shear {1e3 * still:.1f} mm",
            min(nearer) > 0.5 and min(_distance(preprocessed)) > 5 * still,
            "not because of the learning: on theory's sheet the same model and correction come to "
            f"{_millimetres(_distance(ideal[1]))}. The whole sheet does not slide as a whole: "
            f"theory's slide leaves {100 * whole.left / whole.induced:.0f} % of what shear adds to "
            "the signals, the best multiple of the lower chip's "
            f"{100 * whole.fitted_left / whole.induced:.0f} %; and a finger that sticks pulls by "
            f"{whole.unasked:.2f} N without being dragged",
        ),
        stated(
            "figure_s11.open",
            place,
            "a more suitable correction or calibration method is to be found",
            f"{_millimetres(_distance(joint))}, force off by {_percents(_force(joint, true))}, the "
            f"drag itself by {1e3 * max(float(one.drag_error[SHOWN]) for one in jointly):.0f} "
            "mN",
            max(_distance(joint)) < 0.2 * min(_distance(preprocessed)),
            "all nine signals for five unknowns, on a response table of the design that 60 "
            "labelled touches fitted to the skin",
        ),
    ]  # fmt: skip


def _raw(one: Sheared) -> Readings:
    return one.raw


def _preprocessed(one: Sheared) -> Readings:
    return one.preprocessed


def _force(readings: Sequence[Readings], true: Floats, drag: int = SHOWN) -> list[float]:
    """Mean relative errors of the force, along X and Y."""
    return [float(one.force_error(true)[drag]) for one in readings]


def _distance(readings: Sequence[Readings], drag: int = SHOWN) -> list[float]:
    """Mean errors of the place, along X and Y, m."""
    return [float(one.distance[drag].mean()) for one in readings]


def _percents(values: Iterable[float]) -> str:
    return " and ".join(f"{100 * one:.1f}" for one in values) + " %"


def _millimetres(values: Iterable[float]) -> str:
    return " and ".join(f"{1e3 * one:.1f}" for one in values) + " mm"
