"""Sheets of a bench that the paper's model cannot explain: refused by what is wrong with them."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import CalibrationError
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.fitting import fit_calibration
from smoskin.sensing.closed_form.judgement import judged_fit
from smoskin.twin.bench import calibration_loads, made_skin, measure

STATED = {"date": "2026-01-31", "data_sha256": "0" * 64}


@pytest.fixture(scope="module")
def sheets(planar):
    """What benches measure on made skins."""

    def sheet(seed):
        rng = np.random.default_rng(seed)
        return measure(made_skin(planar, rng), calibration_loads(planar), rng)

    return [sheet(seed) for seed in (1, 2, 3)]


def columns(table, chip, order):
    field = np.array(table.field)
    field[:, chip] = field[:, chip][..., order]
    return replace(table, field=field)


def exchanged(table, i, j):
    field = np.array(table.field)
    field[[i, j]] = field[[j, i]]
    return replace(table, field=field)


def places(table, design, sign, shift):
    extent = geometry(design).extent
    return replace(table, position=table.position * sign + extent * shift)


WRONG = {
    "millitesla": (
        lambda t, d: replace(t, field=1e-3 * t.field),
        "fields seem to be 1000 times too small: in mT",
    ),
    "ten times the field": (
        lambda t, d: replace(t, field=10 * t.field),
        "fields seem to be 10 times too large",
    ),
    "sign of the field": (
        lambda t, d: replace(t, field=-t.field),
        "fields seem to have the wrong sign",
    ),
    "millinewton": (
        lambda t, d: replace(t, force=1e3 * t.force),
        "forces seem to be 1000 times too large: in mN",
    ),
    "grams": (
        lambda t, d: replace(t, force=102 * t.force),
        "forces seem to be 102 times too large: in gf",
    ),
    "tens": (
        lambda t, d: replace(t, force=10 * t.force),
        "forces seem to be 1?[0-9] times too large",
    ),
    "kilograms": (
        lambda t, d: replace(t, force=t.force / 9.8),
        "forces seem to be 9.8 times too small: in kgf",
    ),
    "chips": (
        lambda t, d: replace(t, field=t.field[:, [0, 2, 1]]),
        "chips 2 and 3 seem exchanged",
    ),
    "all chips": (
        lambda t, d: replace(t, field=t.field[:, [1, 2, 0]]),
        "chips 1 to 3 seem to stand in the columns of chips 3, 1, 2",
    ),
    "axes": (
        lambda t, d: replace(t, field=t.field[:, :, [1, 0, 2]]),
        r"the columns \(By, Bx, Bz\) of every chip",
    ),
    "axes of one chip": (
        lambda t, d: columns(t, 1, [1, 0, 2]),
        "chip S2 does not fit the others: are its axes",
    ),
    "rows": (
        lambda t, d: exchanged(t, 30, 120),
        "rows 31 and 121 seem to have exchanged their readings",
    ),
    "drag": (
        lambda t, d: replace(t, force=t.force * [-1, 1, 1]),
        "forces along x seem to have the wrong sign",
    ),
    "drags": (
        lambda t, d: replace(t, force=t.force[:, [1, 0, 2]]),
        "forces along x and y seem exchanged",
    ),
    "depths": (
        lambda t, d: replace(t, depth=1e3 * t.depth),
        "depths seem to be 1000 times too large",
    ),
    "turned": (lambda t, d: places(t, d, [-1, -1], [1, 1]), "turned by 180 degrees"),
    "mirrored": (lambda t, d: places(t, d, [-1, 1], [1, 0]), "x seems to run the other way"),
}
FAST = ("millitesla",)


@pytest.mark.parametrize(
    "kind", [kind if kind in FAST else pytest.param(kind, marks=pytest.mark.slow) for kind in WRONG]
)
def test_a_wrong_sheet_is_refused_by_what_is_wrong(planar, sheets, kind):
    spoil, sentence = WRONG[kind]
    sheet = sheets[list(WRONG).index(kind) % 3]
    with pytest.raises(CalibrationError, match=sentence) as refused:
        judged_fit(planar, spoil(sheet, planar), **STATED)
    assert len(str(refused.value)) <= 300


def test_halved_forces_are_a_warning(planar, sheets):
    table = replace(sheets[0], force=sheets[0].force / 2)
    fit, warnings = judged_fit(planar, table, **STATED)
    (warning,) = warnings
    assert "times the design's: forces seem to be half as large as they were" in warning
    # Each touch by the others is a little worse than by all, itself among them.
    for own, left in zip(fit.evidence.residuals, fit.left_out, strict=True):
        assert own.group == left.group
        assert own.rms < left.rms < 1.1 * own.rms
    assert 0.8 < np.sqrt(np.mean(fit.oddness**2)) < 1.1


@pytest.mark.slow
def test_good_sheets_pass_without_a_word(planar, sheets):
    for sheet in sheets:
        assert judged_fit(planar, sheet, **STATED)[1] == ()


@pytest.mark.slow
def test_a_row_whose_force_is_wrong_is_named_and_the_others_fit_better_without_it(planar, sheets):
    whole, odd = sheets[0], 60
    force = np.array(whole.force)
    force[odd] *= 3.0
    fit, warnings = judged_fit(planar, replace(whole, force=force), **STATED)
    assert warnings[-1] == (
        f"row {odd + 1} does not fit the others: {fit.oddness[odd]:.0f} deviations off"
    )
    assert fit.oddness.argmax() == odd
    others = fit_calibration(planar, whole.rows(np.arange(len(force)) != odd), **STATED)
    assert others.noise[0] < fit.noise[0] / 2


@pytest.mark.slow
def test_a_sheet_that_nothing_explains_is_refused_as_before(planar, sheets):
    rng = np.random.default_rng(0)
    table = replace(sheets[0], field=rng.permutation(sheets[0].field))
    with pytest.raises(ValueError, match="touches"):
        judged_fit(planar, table, **STATED)
