"""What the report asks of the whole-sheet twin, asked once for its rows and its figures."""

from collections.abc import Callable
from dataclasses import dataclass

from paper.assumptions import Assumptions, assumptions
from paper.environment import Recovery, Warmth, recovery, warmth
from paper.models.soft_magnet import watched_everywhere
from paper.models.touch_curve import CurveEffort, TouchCurve, touch_curve
from paper.rows import Row, stated
from paper.shear_learning import (
    Jointly,
    ShearLearning,
    read_jointly,
    shear_learning,
)
from paper.shear_learning_rows import shear_learning_rows
from paper.sheet_presses import Covers, PressField, covers, press_field
from paper.soft_magnet_figure import Comparison, compare, comparison_rows
from paper.touch_errors import (
    PairErrors,
    TouchErrors,
    pair_errors,
    touch_error_rows,
    touch_errors,
)
from paper.trial_skins import SEEDS, trial_skins, trial_table
from smoskin.design.skin import SkinDesign
from smoskin.sensing.response.table import ResponseTable
from smoskin.twin.whole import Twin

_CURVE = CurveEffort(seeds=SEEDS, counts=(2, 6, 20, 60), forces=(0.5,), places=20)
"""How much is judged for the figure of calibration touches."""

Progress = Callable[[str, float], None]
"""Called with what is being done and the share of the whole that is done."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiments:
    """All that was pressed, held, let go and warmed."""

    recovery: Recovery
    comparison: Comparison
    warmth: Warmth
    covers: Covers
    field: PressField
    assumptions: Assumptions
    shear: ShearLearning
    jointly: tuple[Jointly, Jointly]
    touches: TouchErrors
    pairs: PairErrors
    curve: TouchCurve


def experiment(
    design: SkinDesign, progress: Progress, table: ResponseTable | None = None
) -> Experiments:
    """Do all of it; estimators read by this response table, or by a small one made here.

    Raises
    ------
    MissingExtraError
        Without JAX or FElupe.
    ModelError
        If the table belongs to another design or lacks chips.
    """
    progress("response table", 0.0)
    known = trial_table(design, table)
    progress("calibration", 0.27)
    skins = trial_skins(design, known)
    curve = touch_curve(design, known.of_chips(_upper(design)), _CURVE)
    progress("shear", 0.32)
    sheared = shear_learning(skins[0].twin)
    jointly = read_jointly(skins[0], sheared.whole)
    progress("bounds and errors", 0.4)
    touched = touch_errors(design, skins)
    progress("two touches", 0.45)
    paired = pair_errors(design, skins[0])
    progress("recovery", 0.5)
    recovered = recovery(design)
    progress("soft magnet", 0.55)
    compared = compare(design, Twin(watched_everywhere(design), seed=None))
    progress("covers", 0.9)
    covered = covers(design)
    progress("displacement field", 0.92)
    field = press_field(design)
    progress("attenuation", 0.95)
    granted = assumptions(design)
    progress("warmth", 1.0)
    return Experiments(
        recovery=recovered,
        comparison=compared,
        warmth=warmth(design),
        covers=covered,
        field=field,
        assumptions=granted,
        shear=sheared,
        jointly=jointly,
        touches=touched,
        pairs=paired,
        curve=curve,
    )


def _upper(design: SkinDesign) -> tuple[int, ...]:
    """The chips under the sheet's magnets, which the paper's models are fed."""
    return tuple(
        s for s, site in enumerate(design.halls) if design.magnet(site.magnet).mount == "sheet"
    )


def experiment_rows(found: Experiments) -> list[Row]:
    """What the paper says of Figures S10, S11, S15, S16 and two touches, beside what came out."""
    return [
        *comparison_rows(found.comparison),
        *_warmth_rows(found.warmth),
        *_cover_rows(found.covers),
        *shear_learning_rows(found.shear, found.jointly),
        *touch_error_rows(found.touches, found.pairs),
    ]


def _warmth_rows(found: Warmth) -> list[Row]:
    place = "Text S11, Figure S15"
    losses = ", ".join(f"{100 * loss:.2f}" for loss in found.loss)
    return [
        stated(
            "figure_s15.loss",
            place,
            "the field falls in all three directions, almost linearly, by about 5 % per 10 degC",
            f"{losses} % in x, y, z; readings off their line by up to {100 * found.bend:.2f} %",
            bool((abs(found.loss - 0.05) < 1e-3).all()) and found.bend < 1e-2,
            "readings of a noisy chip from 25 to 75 degC; the model takes the 5 % in",
        ),
        stated(
            "figure_s15.corrected",
            place,
            "the MLX90393 tells the temperature, with which the signal can be corrected",
            f"right to {100 * found.left:.2f} % of the field up to 75 degC",
            found.left < 1e-2,
            "each reading over the magnet's factor at the temperature that the chip reads; the "
            "factor is the same that weakened the magnet",
        ),
    ]


def _cover_rows(found: Covers) -> list[Row]:
    place, bare, covered = "text on Figure S16", found.bare, found.covered
    return [
        stated(
            "figure_s16.place",
            place,
            "a force anywhere above a cell becomes a displacement of its top vertex along z",
            f"the magnets' motion spreads by {100 * covered.spread.mean():.0f} % over the places "
            f"of a cell, by {100 * bare.spread.mean():.0f} % without covers",
            bool(covered.spread.max() < 1e-6 < bare.spread.min()),
            "0.5 N at 25 places of each cell of the whole sheet; a cover is taken as guided "
            "without play",
        ),
        stated(
            "figure_s16.resolution",
            place,
            "it does not increase the resolution, only the sensing points from the top vertices "
            "to anywhere above the cell",
            f"{100 * covered.found.mean():.0f} % of the places are named right "
            f"({100 * bare.found.mean():.0f} % without covers), "
            f"{1e3 * covered.place_error.mean():.1f} mm from the cell's middle in the mean "
            f"({1e3 * bare.place_error.mean():.1f} mm)",
            bool(covered.found.min() == 1.0 > bare.found.mean()),
            "the nearest direction of both magnets' motion among 36 presses on the vertices, "
            "without noise; by theory's table instead of a measured one it fails (U5)",
        ),
    ]
