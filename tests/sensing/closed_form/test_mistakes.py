"""Judgement of a bench's sheet without a fit: which mistakes are tried, and when one is believed.

A stand-in explains a sheet that is what was meant, and nothing else.
"""

import re
import types
from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import CalibrationError, ModelError
from smoskin.measurement import TouchTable
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form import judgement
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.signals.signals import chip_noise

STATED = {"date": "2026-01-31", "data_sha256": "0" * 64}


@pytest.fixture
def sheet(planar):
    """Four readings untouched and 120 touches, no two alike."""
    rng = np.random.default_rng(3)
    tops = geometry(planar).tops.reshape(-1, 2)
    position = tops[rng.integers(len(tops), size=124)]
    force = np.column_stack([rng.uniform(-0.3, 0.3, (124, 2)), -rng.uniform(0.2, 1.0, 124)])
    depth = rng.uniform(1e-4, 4e-4, 124)
    position[:4], force[:4], depth[:4] = np.nan, 0.0, np.nan
    return TouchTable(
        position=position, force=force, depth=depth, field=rng.normal(0, 1e-3, (124, 3, 3))
    )


def same(one, other):
    return all(
        np.allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-15, equal_nan=True)
        for name in ("position", "force", "depth", "field")
    )


def spoilt(sheet, design):
    """Sheets with a mistake, by the sentence that names it."""
    extent = geometry(design).extent
    field, force, place = sheet.field, sheet.force, sheet.position
    for factor, words in (
        (1e-3, "1000 times too small: in mT"), (1e3, "1000 times too large: in nT"),
        (1e-6, "a million times too small: in T"), (1e6, "a million times too large"),
        (1e-2, "100 times too small: in gauss"), (1e2, "100 times too large"),
        (0.1, "10 times too small"), (10.0, "10 times too large: in mG"), (-1.0, "the wrong sign"),
    ):  # fmt: skip
        yield f"fields seem to (be|have) {words}", replace(sheet, field=factor * field)
    yield "chips 1 and 2 seem exchanged", replace(sheet, field=field[:, [1, 0, 2]])
    yield (
        "chips 1 to 3 seem to stand in the columns of chips 3, 1, 2",
        replace(sheet, field=field[:, [1, 2, 0]]),
    )
    for sign, words in (([-1, 1], "x"), ([1, -1], "y"), ([-1, -1], "x and y")):
        yield (
            f"forces along {words} seem to have the wrong sign",
            replace(sheet, force=force * [*sign, 1]),
        )
    yield "forces along x and y seem exchanged", replace(sheet, force=force[:, [1, 0, 2]])
    yield "x seems to run the other way", replace(sheet, position=place * [-1, 1] + extent * [1, 0])
    yield "y seems to run the other way", replace(sheet, position=place * [1, -1] + extent * [0, 1])
    yield "places seem to be turned by 180 degrees", replace(sheet, position=extent - place)
    yield "depths seem to be 1000 times too small", replace(sheet, depth=1e-3 * sheet.depth)
    yield "depths seem to be 1000 times too large", replace(sheet, depth=1e3 * sheet.depth)
    for words, order, signs in (
        ("By, Bx, Bz", [1, 0, 2], [1, 1, 1]), ("Bx, -By, Bz", [0, 1, 2], [1, -1, 1]),
        ("Bz, Bx, By", [1, 2, 0], [1, 1, 1]),
    ):  # fmt: skip
        yield (
            rf"stand in the columns \({words}\) of every chip",
            replace(sheet, field=field[..., order] * signs),
        )


def test_every_mistake_is_mended_under_its_name(planar, sheet):
    for sentence, wrong in spoilt(sheet, planar):
        mended = [text for text, meant in judgement._mistakes(planar, wrong) if same(meant, sheet)]
        assert re.search(sentence, mended[0]), (sentence, mended)
    # Forces in another unit have no sentence of their own: the stiffness found tells it.
    for factor in (1e-3, 1e3, 0.1, 10.0):
        wrong = replace(sheet, force=factor * sheet.force)
        mended = [text for text, meant in judgement._mistakes(planar, wrong) if same(meant, sheet)]
        assert mended == [""]
    # One chip that fits nothing is left out.
    for chip in range(3):
        (text,) = [
            text
            for text, meant in judgement._mistakes(planar, sheet)
            if np.isnan(meant.field[:, chip]).all()
        ]
        assert text.startswith(f"chip S{chip + 1} does not fit the others")
    names = [text for text, _ in judgement._mistakes(planar, sheet) if text]
    assert len(set(names)) == len(names)
    # Without readings nothing of the chips is tried.
    unread = replace(sheet, field=np.zeros((124, 0, 3)), temperature=np.zeros((124, 0)))
    left = [text for text, _ in judgement._mistakes(planar, unread) if text]
    assert left == [text for text in names if not re.search("[Cc]hip|Bx|field", text)]


def explaining(monkeypatch, planar, meant, misfit=1.0, otherwise=500.0, factor=1.0, stiffer=1.0):
    """Lets a rough fit explain a sheet that is part of what was meant."""
    nominal = Calibration.nominal(planar)
    skin = replace(
        nominal,
        field_factor=(factor,) * 3,
        board_stiffness=stiffer * nominal.board_stiffness,
        sheet_stiffness=stiffer * nominal.sheet_stiffness,
    )

    def rough(design, touches):
        rows = {row.tobytes() for row in meant.field.round(9)}
        good = [row.tobytes() in rows for row in touches.field.round(9)]
        return types.SimpleNamespace(misfit=np.where(good, misfit, otherwise), calibration=skin)

    monkeypatch.setattr(judgement, "rough_fit", rough)


@pytest.mark.parametrize(
    ("given", "mended", "named"),
    [
        (1000.0, 11.9, True), (1000.0, 12.1, False),  # 12: a rough fit explains the touches
        (80.0, 9.9, True), (80.0, 10.1, False),  # and eight times better than as they stand
    ],
)  # fmt: skip
def test_a_mistake_is_believed_that_explains_the_sheet_well_and_far_better(
    monkeypatch, planar, sheet, given, mended, named
):
    explaining(monkeypatch, planar, sheet, mended)
    found = judgement._mistake(planar, replace(sheet, field=1e-3 * sheet.field), given)
    assert found == (judgement.FIELDS[1e3] if named else None)


@pytest.mark.parametrize(("factor", "named"), [(0.49, 0), (0.51, 1), (1.99, 1), (2.01, 0)])
def test_magnets_half_or_twice_as_strong_are_no_skin_of_the_design(
    monkeypatch, planar, sheet, factor, named
):
    explaining(monkeypatch, planar, sheet, factor=factor)
    found = judgement._mistake(planar, replace(sheet, field=1e-3 * sheet.field), 1e6)
    assert (found is not None) == named


def test_a_unit_of_force_is_told_by_the_stiffness_that_it_leaves(monkeypatch, planar, sheet):
    def rough(design, touches):
        good = np.abs(touches.force).max() < 20
        return types.SimpleNamespace(
            misfit=np.full(len(touches.force), 1.0 if good else 1e3),
            calibration=Calibration.nominal(design),
        )

    monkeypatch.setattr(judgement, "rough_fit", rough)
    wrong = replace(sheet, force=1e3 * sheet.force)
    assert judgement._mistake(planar, wrong, 1e3) == judgement.FORCES[1e-3]
    monkeypatch.setattr(judgement, "rough_fit", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        judgement._mistake(planar, wrong, 1e3)

    def fails(design, touches):
        raise ModelError("no")

    monkeypatch.setattr(judgement, "rough_fit", fails)
    assert judgement._mistake(planar, wrong, 1e3) is None
    assert judgement._misfit(planar, wrong) == np.inf
    assert judgement._exchanged_rows(planar, wrong) is None


@pytest.mark.parametrize(
    ("stiffness", "sentence"),
    [
        (2.0, "forces seem to be twice as large as they were"),
        (2.9, "forces seem to be twice as large as they were"),
        (3.1, "forces seem to be 3.1 times too large"),
        (1.3, "forces seem to be 1.3 times too large"),
        (0.5, "forces seem to be half as large as they were"),
        (0.3, "forces seem to be 3.3 times too small"),
        (1000.0, "forces seem to be 1000 times too large: in mN where N must stand?"),
        (0.001, "forces seem to be 1000 times too small: in kN where N must stand?"),
        (102.0, "forces seem to be 102 times too large: in gf where N must stand?"),
        (1 / 9.8, "forces seem to be 9.8 times too small: in kgf where N must stand?"),
        (1 / 9.8 / 1.45, "forces seem to be 9.8 times too small: in kgf where N must stand?"),
        (1 / 9.8 / 1.55, "forces seem to be 15 times too small"),
    ],
)
def test_the_factor_of_a_force_is_named_where_it_is_known(stiffness, sentence):
    assert judgement._force_scale(stiffness) == sentence


def test_two_rows_are_exchanged_that_explain_each_others_readings(monkeypatch, planar, sheet):
    def exchanged(i, j):
        field = np.array(sheet.field)
        field[[i, j]] = field[[j, i]]
        return replace(sheet, field=field)

    def rough(misfit):
        """Rows that are not as meant misfit so; all others by 1."""

        def fit(design, touches):
            good = (touches.field == sheet.field).all(axis=(1, 2))
            return types.SimpleNamespace(misfit=np.where(good, 1.0, misfit))

        monkeypatch.setattr(judgement, "rough_fit", fit)

    wrong = exchanged(30, 120)
    rough(200.0)
    sentence = "rows 31 and 121 seem to have exchanged their readings"
    assert judgement._exchanged_rows(planar, wrong) == sentence
    assert judgement._exchanged_rows(planar, sheet) is None
    # From eight times the median on, and where it mends the sheet by half.
    rough(7.9)
    assert judgement._exchanged_rows(planar, wrong) is None
    rough(8.1)
    assert judgement._exchanged_rows(planar, wrong) is None
    rough(124.0 / 2 + 2.0)
    assert judgement._exchanged_rows(planar, wrong) == sentence
    rough(124.0 / 2 - 2.0)
    assert judgement._exchanged_rows(planar, wrong) is None

    # It is looked for among the four that fit worst.
    def fit(place):
        def found(design, touches):
            good = (touches.field == sheet.field).all(axis=(1, 2))
            misfit = np.where(good, 1.0, 300.0)
            misfit[place] = 900.0
            return types.SimpleNamespace(misfit=misfit if not good.all() else np.ones(124))

        return found

    for others, named in (([5, 6], True), ([5, 6, 7], False)):
        monkeypatch.setattr(judgement, "rough_fit", fit(others))
        assert (judgement._exchanged_rows(planar, wrong) is not None) is named


def test_a_mistake_of_all_is_tried_with_some_fifty_touches_of_all_over(sheet):
    few = judgement._few(sheet)
    assert (~few.touched).sum() == 3
    assert few.touched.sum() == 40  # every third of 120
    assert judgement._few(sheet.rows(slice(0, 54))).touched.sum() == 50
    assert judgement._few(sheet.rows(slice(0, 55))).touched.sum() == 26
    rows = [int(np.flatnonzero((sheet.field == one).all(axis=(1, 2)))[0]) for one in few.field]
    assert rows == [0, 1, 2, *range(4, 124, 3)]


def stated(monkeypatch, planar, *, misfit=1.0, noise=(0.02, 0.02, 2e-6), stiffness=1.0, odd=None):
    """Lets the fit of a sheet come out so."""
    nominal = Calibration.nominal(planar)
    skin = replace(
        nominal,
        board_stiffness=stiffness * nominal.board_stiffness,
        sheet_stiffness=stiffness * nominal.sheet_stiffness,
    )
    oddness = np.ones(124)
    for row, size in (odd or {}).items():
        oddness[row] = size
    fit = types.SimpleNamespace(noise=noise, calibration=skin, oddness=oddness)
    monkeypatch.setattr(judgement, "_misfit", lambda design, touches: misfit)
    monkeypatch.setattr(judgement, "fit_calibration", lambda design, touches, **given: fit)
    monkeypatch.setattr(judgement, "_exchanged_rows", lambda design, touches: None)
    monkeypatch.setattr(judgement, "_mistake", lambda design, touches, misfit: f"off by {misfit}")


def test_a_sheet_is_refused_whose_rough_fit_is_bad_for_a_reason(monkeypatch, planar, sheet):
    stated(monkeypatch, planar, misfit=11.9)
    assert judgement.judged_fit(planar, sheet, **STATED)[1] == ()
    stated(monkeypatch, planar, misfit=12.1)
    with pytest.raises(
        CalibrationError, match=r"touches must fit a skin of the design: off by 12.1"
    ):
        judgement.judged_fit(planar, sheet, **STATED)
    monkeypatch.setattr(judgement, "_exchanged_rows", lambda design, touches: "rows 1 and 2")
    with pytest.raises(CalibrationError, match="rows 1 and 2"):
        judgement.judged_fit(planar, sheet, **STATED)


@pytest.mark.parametrize("force", [0.09, 0.11])
@pytest.mark.parametrize("fields", [29.0, 31.0])
def test_a_fit_is_doubted_from_10_percent_of_force_or_30_times_the_chips_noise(
    monkeypatch, planar, sheet, force, fields
):
    noise = force, 0.02, fields * chip_noise(planar)[0]
    stated(monkeypatch, planar, noise=noise)
    warnings = judgement.judged_fit(planar, sheet, **STATED)[1]
    doubt = (
        f"the touches fit the paper's model badly: forces to {100 * force:.0f} %, fields to "
        f"{fields:.0f} times the chips' noise"
    )
    assert warnings == ((doubt,) if force > 0.1 or fields > 30 else ())
    stated(monkeypatch, planar, noise=(force, 0.02, np.nan))
    assert len(judgement.judged_fit(planar, sheet, **STATED)[1]) == (force > 0.1)


@pytest.mark.parametrize("ratio", [1.49, 1.51, 3.99, 4.01])
@pytest.mark.parametrize("softer", [False, True])
def test_stiffnesses_are_doubted_from_15_and_refused_from_4_times(
    monkeypatch, planar, sheet, ratio, softer
):
    stiffness = 1 / ratio if softer else ratio
    stated(monkeypatch, planar, stiffness=stiffness)
    if ratio > 4:
        with pytest.raises(CalibrationError, match="forces seem to be 4 times"):
            judgement.judged_fit(planar, sheet, **STATED)
        return
    warnings = judgement.judged_fit(planar, sheet, **STATED)[1]
    assert len(warnings) == (ratio > 1.5)
    if warnings:
        assert warnings[0].startswith(f"stiffnesses are {stiffness:.2g} times the design's: forces")


def test_rows_five_deviations_off_are_named_but_at_most_four(monkeypatch, planar, sheet):
    stated(monkeypatch, planar, odd={7: 4.9, 9: 5.1})
    assert judgement.judged_fit(planar, sheet, **STATED)[1] == (
        "row 10 does not fit the others: 5 deviations off",
    )
    stated(monkeypatch, planar, odd=dict.fromkeys(range(10, 16), 12.3))
    assert judgement.judged_fit(planar, sheet, **STATED)[1] == tuple(
        f"row {row} does not fit the others: 12 deviations off" for row in (11, 12, 13, 14)
    )
    monkeypatch.setattr(judgement, "_exchanged_rows", lambda design, touches: "rows 1 and 2")
    with pytest.raises(CalibrationError, match="rows 1 and 2"):
        judgement.judged_fit(planar, sheet, **STATED)
    stated(monkeypatch, planar, odd={9: 5.1})
    monkeypatch.setattr(judgement, "_exchanged_rows", lambda design, touches: "rows 1 and 2")
    assert len(judgement.judged_fit(planar, sheet, **STATED)[1]) == 1


def test_a_sheet_without_a_fit_is_refused_by_its_rows_or_as_the_fit_says(
    monkeypatch, planar, sheet
):
    def fails(design, touches, **given):
        raise ModelError("the touches cannot determine v_s")

    stated(monkeypatch, planar)
    monkeypatch.setattr(judgement, "fit_calibration", fails)
    with pytest.raises(ModelError, match="cannot determine v_s"):
        judgement.judged_fit(planar, sheet, **STATED)
    monkeypatch.setattr(judgement, "_exchanged_rows", lambda design, touches: "rows 1 and 2")
    with pytest.raises(CalibrationError, match="rows 1 and 2"):
        judgement.judged_fit(planar, sheet, **STATED)
