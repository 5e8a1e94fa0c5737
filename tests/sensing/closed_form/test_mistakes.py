"""Which mistakes of a bench's sheet are tried, and when one is believed, refused or told.

A stand-in for the fit knows what was meant: it explains that, and forces in another unit by a
stiffer or softer skin, and nothing else.
"""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.errors import ArgumentError, CalibrationError, ModelError
from smoskin.measurement import TouchTable
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form import judgement
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.fitting import RoughFit
from smoskin.sensing.closed_form.judgement import judged_fit
from smoskin.sensing.signals.signals import chip_noise

STATED = {"date": "2026-01-31", "data_sha256": "0" * 64}
COLUMNS = ("position", "force", "depth", "field")


def sheet(design, touched=24, untouched=5):
    """Touches held from the second of their number, by which the stand-in knows them."""
    rng, rows = np.random.default_rng(3), touched + untouched
    pressed = (np.arange(rows) >= untouched)[:, None]
    place = rng.uniform(0.1, 0.9, (rows, 2)) * geometry(design).extent
    force = rng.uniform((-0.3, -0.3, -0.9), (0.3, 0.3, -0.2), (rows, 3))
    return TouchTable(
        position=np.where(pressed, place, np.nan),
        force=np.where(pressed, force, 0.0),
        depth=np.where(pressed[:, 0], rng.uniform(1e-4, 1e-3, rows), np.nan),
        field=rng.normal(0, 1e-4, (rows, 3, 3)),
        held=np.arange(rows)[:, None] + [0.0, 0.5],
    )


@pytest.fixture
def known(monkeypatch, planar):
    """What the stand-in knows; a test may change it."""
    nominal = Calibration.nominal(planar)
    known = SimpleNamespace(
        meant=sheet(planar), good=1.0, bad=1e3, stiffness=1.0, factor=(1.0, 1.0, 1.0),
        noise=(0.01, 0.01, 1e-6), oddness=np.zeros(29), error=None, rough_error=None, sizes=[],
    )  # fmt: skip

    def skin(stiffness):
        """A skin that is so many times as stiff sideways as its design."""
        return replace(
            nominal,
            board_stiffness=2 * stiffness * nominal.board_stiffness,
            sheet_stiffness=stiffness / 2 * nominal.sheet_stiffness,
            field_factor=known.factor,
        )

    def rough(design, touches):
        known.sizes.append(len(touches.force))
        meant = known.meant.rows(touches.held[:, 0].astype(int))
        stiffness = np.abs(touches.force).max() / np.abs(meant.force).max()
        if 0.05 < stiffness < 20:
            meant = replace(meant, force=stiffness * meant.force)
        else:
            stiffness = 1.0
        explained = np.full(len(touches.force), True)
        for name in COLUMNS:
            given, expected = (getattr(table, name).reshape(len(explained), -1) for table in (
                touches, meant
            ))  # fmt: skip
            same = np.isclose(given, expected, rtol=1e-6, atol=1e-15) | np.isnan(given)
            explained &= same.all(axis=1)
        if known.rough_error is not None and not explained.all():
            raise known.rough_error
        return RoughFit(np.where(explained, known.good, known.bad), skin(stiffness))

    def fit(design, touches, **stated):
        if known.error is not None:
            raise known.error
        return SimpleNamespace(
            noise=known.noise, oddness=known.oddness, calibration=skin(known.stiffness)
        )

    monkeypatch.setattr(judgement, "rough_fit", rough)
    monkeypatch.setattr(judgement, "fit_calibration", fit)
    return known


def turned(design, sign, shift):
    return lambda t: replace(t, position=t.position * sign + geometry(design).extent * shift)


def one_chip(table):
    field = np.array(table.field)
    field[:, 1] = field[:, 1][:, [1, 0, 2]]
    return replace(table, field=field)


def swapped(table, i, j):
    field = np.array(table.field)
    field[[i, j]] = field[[j, i]]
    return replace(table, field=field)


WRONG = {
    **{
        f"fields seem to {text}": (lambda t, c=c: replace(t, field=t.field / c))
        for c, text in (
            (1e3, "be 1000 times too small: in mT"), (1e-3, "be 1000 times too large: in nT"),
            (1e6, "be a million times too small: in T"), (1e-6, "be a million times too large"),
            (100.0, "be 100 times too small: in gauss"), (0.01, "be 100 times too large"),
            (10.0, "be 10 times too small"), (0.1, "be 10 times too large: in mG"),
            (-1.0, "have the wrong sign"),
        )
    },
    **{
        f"forces seem to be {text}": (lambda t, c=c: replace(t, force=c * t.force))
        for c, text in (
            (1e-3, "1000 times too small: in kN"), (1e3, "1000 times too large: in mN"),
            (1 / 9.80665e-3, "102 times too large: in gf"), (200.0, r"2e\+02 times too large"),
            (1 / 300, r"3e\+02 times too small"), (50.0, "50 times too large"),
            (1 / 30, "30 times too small"),
        )
    },
    "chips 1 and 3 seem exchanged": lambda t: replace(t, field=t.field[:, [2, 1, 0]]),
    "chips 1 to 3 seem to stand in the columns of chips 3, 1, 2": lambda t: replace(
        t, field=t.field[:, [1, 2, 0]]
    ),
    r"columns \(By, Bx, Bz\) of every chip": lambda t: replace(t, field=t.field[..., [1, 0, 2]]),
    r"columns \(Bz, Bx, By\) of every chip": lambda t: replace(t, field=t.field[..., [1, 2, 0]]),
    "chip S2 does not fit the others: are its axes or signs exchanged": one_chip,
    "forces along x seem to have the wrong sign": lambda t: replace(t, force=t.force * [-1, 1, 1]),
    "forces along y seem to have the wrong sign": lambda t: replace(t, force=t.force * [1, -1, 1]),
    "along x and y seem to have the wrong": lambda t: replace(t, force=t.force * [-1, -1, 1]),
    "forces along x and y seem exchanged": lambda t: replace(t, force=t.force[:, [1, 0, 2]]),
    "depths seem to be 1000 times too small": lambda t: replace(t, depth=1e-3 * t.depth),
    "depths seem to be 1000 times too large": lambda t: replace(t, depth=1e3 * t.depth),
    "rows 10 and 21 seem to have exchanged their readings": lambda t: swapped(t, 9, 20),
}  # fmt: skip


@pytest.mark.parametrize("sentence", WRONG)
def test_a_mistake_is_named(planar, known, sentence):
    with pytest.raises(CalibrationError, match=f"skin of the design: .*{sentence}"):
        judged_fit(planar, WRONG[sentence](known.meant), **STATED)


@pytest.mark.parametrize(
    ("sentence", "sign", "shift"),
    [
        ("x seems to run the other way", [-1, 1], [1, 0]),
        ("y seems to run the other way", [1, -1], [0, 1]),
        ("places seem to be turned by 180 degrees", [-1, -1], [1, 1]),
    ],
)
def test_turned_places_are_named(planar, known, sentence, sign, shift):
    with pytest.raises(CalibrationError, match=sentence):
        judged_fit(planar, turned(planar, sign, shift)(known.meant), **STATED)


def test_a_sheet_without_readings_is_judged_by_its_labels(planar, known):
    nothing = {"field": np.zeros((29, 0, 3)), "temperature": np.zeros((29, 0))}
    known.meant, known.noise = replace(known.meant, **nothing), (0.01, 0.01, np.nan)
    assert judged_fit(planar, known.meant, **STATED)[1] == ()
    with pytest.raises(CalibrationError, match="depths seem to be 1000 times too large"):
        judged_fit(planar, replace(known.meant, depth=1e3 * known.meant.depth), **STATED)


@pytest.mark.parametrize(
    ("bad", "good", "named"),
    [
        (11.9, 0.1, False),  # a skin explains the sheet as it stands
        (12.1, 0.1, True),
        (50.0, 6.2, True),  # eight times better than it stands
        (50.0, 6.3, False),
        (200.0, 11.9, True),  # well
        (200.0, 12.1, False),
    ],
)
def test_a_mistake_is_believed_that_explains_a_bad_sheet_well_and_far_better(
    planar, known, bad, good, named
):
    known.bad, known.good = bad, good
    wrong = replace(known.meant, field=-known.meant.field)
    if named:
        with pytest.raises(CalibrationError, match="wrong sign"):
            judged_fit(planar, wrong, **STATED)
    else:
        assert judged_fit(planar, wrong, **STATED)[1] == ()


@pytest.mark.parametrize(
    ("factors", "named"),
    [((9.0, 0.51, 0.1), True), ((9.0, 0.49, 0.1), False),
     ((9.0, 1.9, 0.1), True), ((9.0, 2.1, 0.1), False)],
)  # fmt: skip
def test_a_mistake_is_none_that_leaves_chips_half_or_twice_as_sensitive(
    planar, known, factors, named
):
    known.factor, wrong = factors, replace(known.meant, field=-known.meant.field)
    if named:
        with pytest.raises(CalibrationError, match="wrong sign"):
            judged_fit(planar, wrong, **STATED)
    else:
        assert judged_fit(planar, wrong, **STATED)[1] == ()


@pytest.mark.parametrize(("touched", "tried"), [(100, 50), (102, 34), (40, 40)])
def test_mistakes_of_all_are_tried_with_fifty_touches_and_three_of_nothing(
    planar, known, touched, tried
):
    known.meant, known.oddness = sheet(planar, touched), np.zeros(touched + 5)
    with pytest.raises(CalibrationError, match="wrong sign"):
        judged_fit(planar, replace(known.meant, field=-known.meant.field), **STATED)
    assert known.sizes[0] == tried + 3
    assert set(known.sizes) == {tried + 3, touched + 5}


@pytest.mark.parametrize("error", [ModelError, ArgumentError, np.linalg.LinAlgError])
def test_what_no_skin_can_have_is_a_mistake_too(planar, known, error):
    known.rough_error = error("no skin")
    with pytest.raises(CalibrationError, match="wrong sign"):
        judged_fit(planar, replace(known.meant, field=-known.meant.field), **STATED)
    rng = np.random.default_rng(0)
    nonsense = replace(known.meant, field=rng.normal(size=(29, 3, 3)))
    assert judged_fit(planar, nonsense, **STATED)[1] == ()


@pytest.mark.parametrize(
    ("bad", "good", "others", "named"),
    [
        (7.9, 0.1, 0.1, False),  # eight times what the median misfits, or what noise does
        (8.1, 0.1, 0.1, True),
        (23.0, 0.1, 3.0, False),
        (25.0, 0.1, 3.0, True),
    ],
)
def test_rows_are_exchanged_that_misfit_far_more_than_the_others(
    planar, known, monkeypatch, bad, good, others, named
):
    """A fit that fails asks for them, however well the sheet is explained as a whole."""
    wrong, known.error = swapped(known.meant, 9, 20), ModelError("the fit failed")

    def rough(design, touches):
        explained = np.array_equal(touches.field, known.meant.field)
        misfit = np.full(29, others)
        misfit[[9, 20]] = bad
        return RoughFit(np.full(29, good) if explained else misfit, Calibration.nominal(design))

    monkeypatch.setattr(judgement, "rough_fit", rough)
    sentence = "rows 10 and 21 seem to have exchanged" if named else "the fit failed"
    with pytest.raises(CalibrationError if named else ModelError, match=sentence):
        judged_fit(planar, wrong, **STATED)


@pytest.mark.parametrize(
    ("bad", "good", "named"), [(100.0, 3.4, True), (100.0, 3.9, False), (900.0, 11.9, True),
                               (900.0, 12.1, False)],
)  # fmt: skip
def test_rows_are_exchanged_that_then_fit_well_and_twice_as_well(
    planar, known, monkeypatch, bad, good, named
):
    """Two of 29 rows misfit by `bad` and the others by 0.5: 7.4 on average for 100, 63 for 900."""
    wrong, known.error = swapped(known.meant, 9, 20), ModelError("the fit failed")

    def rough(design, touches):
        explained = np.array_equal(touches.field, known.meant.field)
        misfit = np.full(29, 0.5)
        misfit[[9, 20]] = bad
        return RoughFit(np.full(29, good) if explained else misfit, Calibration.nominal(design))

    monkeypatch.setattr(judgement, "rough_fit", rough)
    with pytest.raises(CalibrationError if named else ModelError):
        judged_fit(planar, wrong, **STATED)


@pytest.mark.parametrize(("worse", "named"), [(2, True), (3, False)])
def test_exchanged_rows_are_looked_for_among_the_four_worst(
    planar, known, monkeypatch, worse, named
):
    wrong, known.error = swapped(known.meant, 9, 20), ModelError("the fit failed")

    def rough(design, touches):
        misfit = np.full(29, 0.5)
        if not np.array_equal(touches.field, known.meant.field):
            misfit[[9, 20]] = 100.0
            misfit[22 : 22 + worse] = 200.0
        return RoughFit(misfit, Calibration.nominal(design))

    monkeypatch.setattr(judgement, "rough_fit", rough)
    with pytest.raises(CalibrationError if named else ModelError):
        judged_fit(planar, wrong, **STATED)


@pytest.mark.parametrize(
    ("force", "field", "warned"),
    [(0.099, 29.0, False), (0.101, 1.0, True), (0.01, 29.9, False), (0.01, 30.1, True),
     (0.09, np.nan, False), (0.11, np.nan, True)],
)  # fmt: skip
def test_a_fit_is_doubted_from_a_tenth_of_the_force_and_thirty_times_the_chips_noise(
    planar, known, force, field, warned
):
    known.noise = (force, np.nan, field * float(chip_noise(planar)[0]))
    warnings = judged_fit(planar, known.meant, **STATED)[1]
    worse = 0 if np.isnan(field) else field
    expected = (
        f"the touches fit the paper's model badly: forces to {100 * force:.0f} %, fields to "
        f"{worse:.0f} times the chips' noise"
    )
    assert warnings == ((expected,) if warned else ())


@pytest.mark.parametrize(
    ("stiffness", "cause", "refused"),
    [
        (1.49, "", False), (1 / 1.49, "", False),
        (1.51, "twice as large as they were", False), (1 / 1.51, "half as large as they", False),
        (2.0, "twice as large as they were", False), (0.5, "half as large as they were", False),
        (3.2, "3.2 times too large", False), (1 / 3.2, "3.2 times too small", False),
        (3.9, "3.9 times too large", False), (1 / 3.9, "3.9 times too small", False),
        (4.1, "4.1 times too large", True), (1 / 4.1, "4.1 times too small", True),
        (1 / 9.8, "9.8 times too small: in kgf", True), (1e3, "1000 times too large", True),
    ],
)  # fmt: skip
def test_stiffness_is_told_from_one_and_a_half_and_refused_from_four_times_the_designs(
    planar, known, stiffness, cause, refused
):
    known.stiffness = stiffness
    if refused:
        with pytest.raises(CalibrationError, match=f"forces seem to be {cause}"):
            judged_fit(planar, known.meant, **STATED)
        return
    warnings = judged_fit(planar, known.meant, **STATED)[1]
    message = f"stiffnesses are {stiffness:.2g} times the design's: forces seem to be {cause}"
    assert len(warnings) == bool(cause)
    assert all(warning.startswith(message) for warning in warnings)


def test_rows_that_do_not_fit_are_told_from_five_deviations_up_to_four_of_them(planar, known):
    known.oddness[[3, 8]] = 4.9, 5.1
    warnings = judged_fit(planar, known.meant, **STATED)[1]
    assert warnings == ("row 9 does not fit the others: 5 deviations off",)
    known.oddness[8] = 4.9
    assert judged_fit(planar, known.meant, **STATED)[1] == ()
    known.oddness[5:11] = 7.2
    rows = [re.findall("row (.*) does", text)[0] for text in judged_fit(
        planar, known.meant, **STATED)[1]]  # fmt: skip
    assert rows == ["6", "7", "8", "9"]


@pytest.mark.parametrize(("odd", "refused"), [(1, False), (2, True)])
def test_two_odd_rows_of_a_sheet_that_fits_may_be_exchanged(planar, known, odd, refused):
    known.meant, known.oddness = sheet(planar, 240), np.zeros(245)
    known.bad, known.oddness[[30, 90][:odd]] = 150.0, 50.0
    wrong = swapped(known.meant, 30, 90)
    known.good = 0.1
    if refused:
        with pytest.raises(CalibrationError, match="rows 31 and 91 seem to have exchanged"):
            judged_fit(planar, wrong, **STATED)
    else:
        assert len(judged_fit(planar, wrong, **STATED)[1]) == 1
