"""Which mistakes of labelled touches are tried, and when one is believed, refused or told.

A stand-in for the evidence knows what was meant: it explains that and nothing else.
"""

import re
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.errors import CalibrationError
from smoskin.sensing.response import judgement
from smoskin.sensing.response.calibrate import LabelledTouches
from smoskin.sensing.response.evidence import STRETCHES, LeftOut
from smoskin.sensing.response.judgement import judge_touches

EXTENT = np.array([0.12, 0.16])
NOISE = 1e-12 * np.eye(9)
FAR, BEYOND = 1e5, 1e7
"""How much less likely, as a logarithm, is all that was not meant, and what is in another unit."""


def touches(count=24, seed=2, drag=0.3):
    rng = np.random.default_rng(seed)
    return LabelledTouches(
        position=rng.uniform(0.05, 0.95, (count, 2)) * EXTENT,
        force=np.column_stack(
            [rng.uniform(-drag, drag, (count, 2)), -rng.uniform(0.3, 0.8, count)]
        ),
        signals=rng.normal(0, 1e-4, (count, 3, 3)),
        place_spread=20e-6,
    )


@pytest.fixture
def known(monkeypatch):
    """What the stand-in knows; a test may change it."""
    known = SimpleNamespace(
        meant=touches(), stretch=0, far=FAR, squared=None, odd=None, counts=[],
        wrong=lambda place, force: None,
    )  # fmt: skip

    class Knowing:
        """Explains touches that are those meant, with the misfit's stretch of that number."""

        def __init__(self, table, given, noise):
            self._given = given
            known.counts.append(len(given))

        @classmethod
        def of_sets(cls, table, given, noise):
            return [cls(table, chosen, noise) for chosen in given]

        def of(self, sets):
            given, meant = self._given, known.meant
            off = known.wrong(given.position, given.force)
            if off is None:
                labels = len(given) == len(meant) and all(
                    np.allclose(getattr(given, name), getattr(meant, name), rtol=1e-6, atol=1e-9)
                    for name in ("position", "force")
                )
                off = 0.0 if labels else known.far
            values = []
            for read in sets:
                flat, wanted = read.ravel(), meant.signals.ravel()
                some = len(flat) != len(wanted)  # whose labels alone are asked about
                if some or np.allclose(flat, wanted, rtol=1e-6, atol=1e-15):
                    values.append(-off)
                else:
                    scaled = not np.isclose(np.linalg.norm(flat), np.linalg.norm(wanted), rtol=1e-6)
                    values.append(-BEYOND if scaled else -known.far)
            return np.array(values)[:, None] - 1.0 * (np.arange(len(STRETCHES)) != known.stretch)

        def left_out(self, signals, stretch):
            assert stretch == known.stretch
            squared = np.full(len(signals), 9.0) if known.squared is None else known.squared
            return LeftOut(
                residual=known.__dict__.get("residual", np.zeros_like(signals)),
                covariance=np.tile(1e-10 * np.eye(9), (len(signals), 1, 1)),
                squared=squared,
            )

        def without_label(self, signals):
            odd = np.full(len(signals), -np.inf) if known.odd is None else known.odd
            return np.tile(odd[:, None], (1, len(STRETCHES)))

    monkeypatch.setattr(judgement, "Evidence", Knowing)
    monkeypatch.setattr(
        judgement, "label_noise", lambda table, places, forces, spreads: np.zeros((1, 9, 9))
    )
    return known


TABLE = SimpleNamespace(
    chips=(0, 1, 2),
    count=9,
    forces=(0.05, 1.15),
    basis=SimpleNamespace(extent=EXTENT),
    slopes=lambda places, forces: np.tile(
        np.eye(9, 5) * [1e-2, 1e-2, 1e-4, 1e-4, 1e-4], (len(places), 1, 1)
    ),
)


def columns(signals, order, signs=(1, 1, 1), chip=slice(None)):
    moved = np.array(signals)
    moved[:, chip] = (moved[:, chip])[..., order] * signs
    return moved


def swapped(array, i, j):
    array = np.array(array)
    array[[i, j]] = array[[j, i]]
    return array


SIGNALS = {
    **{
        text: (lambda s, c=c: s / c) for c, text in (
            (1e3, "1000 times too small: in mT"), (1e-3, "1000 times too large: in nT"),
            (1e6, "a million times too small: in T"), (1e-6, "a million times too large"),
            (100.0, "100 times too small: in gauss"), (0.01, "100 times too large"),
            (10.0, "fields seem to be 10 times too small"), (0.1, "10 times too large: in mG"),
            (-1.0, "fields seem to have the wrong sign"),
        )
    },
    "chips 1 and 3 seem exchanged": lambda s: s[:, [2, 1, 0]],
    "chips 1 to 3 seem to stand in the columns of chips 3, 1, 2": lambda s: s[:, [1, 2, 0]],
    r"stand in the columns \(By, Bx, Bz\) of every chip": lambda s: columns(s, [1, 0, 2]),
    r"stand in the columns \(Bx, By, -Bz\) of every chip": lambda s: columns(
        s, [0, 1, 2], (1, 1, -1)
    ),
    r"stand in the columns \(Bz, Bx, By\) of chip 2": lambda s: columns(s, [1, 2, 0], chip=1),
    "touches 4 and 8 seem to have exchanged their labels": lambda s: swapped(s, 3, 7),
}  # fmt: skip


@pytest.mark.parametrize("sentence", SIGNALS)
def test_a_mistake_of_the_signals_is_named(known, sentence):
    known.squared = np.where(np.isin(np.arange(24), (3, 7, *range(12, 22))), 90.0, 9.0)
    wrong = SIGNALS[sentence](known.meant.signals)
    judged = judge_touches(TABLE, replace(known.meant, signals=wrong), NOISE)
    assert re.search(sentence, judged.refusal)
    # In other units each of the 24 times 9 signals has another density.
    factor = np.abs(wrong).sum() / np.abs(known.meant.signals).sum()
    apart = FAR if np.isclose(factor, 1) else BEYOND
    assert judged.suspicion.gain == pytest.approx(apart - 24 * 9 * np.log(factor), rel=1e-9)


def test_signals_are_turned_from_each_chips_own_axes(known):
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = np.stack([np.eye(3), quarter, quarter @ quarter])
    own = np.einsum("sji,nsj->nsi", turns, known.meant.signals)
    for sentence, moved in (
        ("chips 1 and 2 seem exchanged", own[:, [1, 0, 2]]),
        (r"columns \(By, Bx, Bz\) of every chip", own[..., [1, 0, 2]]),
        (r"columns \(Bx, Bz, By\) of chip 2", columns(own, [0, 2, 1], chip=1)),
    ):
        wrong = replace(known.meant, signals=np.einsum("sij,nsj->nsi", turns, moved))
        judged = judge_touches(TABLE, wrong, NOISE, turns=turns)
        assert re.search(sentence, judged.refusal)


def test_labels_are_exchanged_among_the_twelve_that_fit_worst(known):
    for worse, named in ((10, True), (11, False)):
        known.squared = np.full(24, 9.0)
        known.squared[[3, 7]] = 50.0
        known.squared[12 : 12 + worse] = 90.0
        wrong = replace(known.meant, signals=swapped(known.meant.signals, 3, 7))
        judged = judge_touches(TABLE, wrong, NOISE, rows=range(2, 26))
        named_so = "rows 5 and 9 seem to have exchanged their labels"
        assert judged.refusal == (named_so if named else None)


FORCES = {
    "1000 times too small: in kN": 1e3, "1000 times too large: in mN": 1e-3,
    "half as large as they were": 2.0, "twice as large as they were": 0.5,
    "9.8 times too small: in kgf": 9.80665, "102 times too large: in gf": 9.80665e-3,
}  # fmt: skip
LABELS = {
    **{text: (lambda t, c=c: replace(t, force=t.force / c)) for text, c in FORCES.items()},
    "forces along x seem to have the wrong sign": lambda t: replace(t, force=t.force * [-1, 1, 1]),
    "forces along y seem to have the wrong sign": lambda t: replace(t, force=t.force * [1, -1, 1]),
    "x and y seem to have the wrong sign": lambda t: replace(t, force=t.force * [-1, -1, 1]),
    "forces along x and y seem exchanged": lambda t: replace(t, force=t.force[:, [1, 0, 2]]),
    "x seems to run the other way": lambda t: replace(
        t, position=t.position * [-1, 1] + EXTENT * [1, 0]
    ),
    "y seems to run the other way": lambda t: replace(
        t, position=t.position * [1, -1] + EXTENT * [0, 1]
    ),
    "turned by 180 degrees": lambda t: replace(t, position=EXTENT - t.position),
    "x and y of the places seem exchanged": lambda t: replace(t, position=t.position[:, ::-1]),
    "10 times too small: in cm where mm": lambda t: replace(t, position=t.position / 10),
    "touches 4 and 8 seem to have exchanged places": lambda t: replace(
        t, position=swapped(t.position, 3, 7)
    ),
}


@pytest.mark.parametrize("sentence", LABELS)
def test_a_mistake_of_the_labels_is_named(known, sentence):
    known.squared = np.where(np.isin(np.arange(24), (3, 7, 9, 20)), 90.0, 9.0)
    wrong = LABELS[sentence](known.meant)
    for known.stretch in (0, 1):  # once and twice the misfit's deviation
        judged = judge_touches(TABLE, wrong, NOISE)
        assert re.search(sentence, judged.refusal)
        assert judged.suspicion.gain == pytest.approx(FAR)
        assert judged.suspicion.stretch == STRETCHES[known.stretch]


@pytest.mark.parametrize(
    ("far", "stretch", "ends"), [(31, 0, True), (29, 0, False), (31, 1, False)]
)
def test_a_mistake_that_leaves_nothing_open_ends_the_search(known, far, stretch, ends):
    known.far, known.stretch = far, stretch
    judge_touches(TABLE, replace(known.meant, signals=-known.meant.signals), NOISE)
    assert (len(known.counts) == 1) is ends


def test_places_are_exchanged_among_the_four_that_fit_worst(known):
    known.stretch = 1
    for worse, named in ((2, True), (3, False)):
        known.squared = np.full(24, 9.0)
        known.squared[[3, 7]] = 50.0
        known.squared[12 : 12 + worse] = 90.0
        wrong = replace(known.meant, position=swapped(known.meant.position, 3, 7))
        judged = judge_touches(TABLE, wrong, NOISE)
        assert (judged.refusal is not None) is named


@pytest.mark.parametrize(("drag", "named"), [(0.049, False), (0.051, True)])
def test_signs_are_told_of_drags_past_50_mn(known, drag, named):
    meant = touches(drag=0.04)
    force = np.array(meant.force)
    force[0, :2] = drag, 0.01
    known.meant, known.stretch = replace(meant, force=force), 1
    judged = judge_touches(TABLE, replace(known.meant, force=force * [-1, 1, 1]), NOISE)
    assert (judged.refusal is not None) is named


@pytest.mark.parametrize(("past", "named"), [(4.9e-3, True), (5.1e-3, False)])
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("axis", [0, 1])
def test_places_may_lie_5_mm_off_the_skin(known, past, named, end, axis):
    position = np.array(known.meant.position)
    position[5, axis] = EXTENT[axis] + past if end else -past
    known.meant, known.stretch = replace(known.meant, position=position), 1
    judged = judge_touches(TABLE, replace(known.meant, force=2 * known.meant.force), NOISE)
    assert (judged.refusal is not None) is named


@pytest.mark.parametrize(
    ("most", "named"), [(0.019, False), (0.021, True), (5.9, True), (6.1, False)]
)
def test_the_largest_press_of_a_sheet_is_one_that_a_person_can_make(known, most, named):
    force = np.array(known.meant.force)
    force *= most / -force[:, 2].min()
    known.meant, known.stretch = replace(known.meant, force=force), 1
    judged = judge_touches(TABLE, replace(known.meant, force=2 * force), NOISE)
    assert (judged.refusal is not None) is named


def test_a_shifted_origin_is_found_to_04_mm(known):
    known.stretch = 1
    true = known.meant.position
    rng = np.random.default_rng(0)

    def wrong(place, force):
        rows = slice(None) if len(place) == len(true) else slice(None, None, 2)
        away = place - true[rows]
        if np.ptp(away, axis=0).max() > 1e-9 or not np.allclose(force, known.meant.force[rows]):
            return FAR
        return 1e9 * float((away[0] ** 2).sum())

    known.wrong = wrong
    for shift in rng.uniform(-20e-3, 20e-3, (12, 2)):
        known.counts.clear()
        given = replace(known.meant, position=true + shift)
        judged = judge_touches(TABLE, given, NOISE)
        match = re.fullmatch(
            r"the origin of the places seems shifted by \((.*), (.*)\) mm",
            judged.suspicion.sentence,
        )
        off = np.array([float(part) for part in match.groups()]) * 1e-3 - shift
        assert np.abs(off).max() < 0.47e-3  # 0.4 mm, and the rounding of the sentence
        # Searched with at most twenty of the touches.
        assert set(known.counts) == {24, 12}


@pytest.mark.parametrize(("far", "warned", "named"), [
    (7.0, False, False), (9.0, True, False), (29.0, True, False), (31.0, False, True),
])  # fmt: skip
def test_a_mistake_is_told_from_e8_and_refused_from_e30(known, far, warned, named):
    known.far = far
    wrong = replace(known.meant, signals=-known.meant.signals)
    judged = judge_touches(TABLE, wrong, NOISE)
    assert (judged.suspicion is not None) is named
    assert ("perhaps fields seem to have the wrong sign" in judged.warnings) is warned
    if named:
        assert judged.suspicion.gain == pytest.approx(far)
        with pytest.raises(CalibrationError, match=r"wrong sign \(mend them, or accept"):
            judged.check()
    else:
        judged.check()


@pytest.mark.parametrize(
    ("gain", "warned", "refused"),
    [(29.0, 0, 0), (31.0, 1, 0), (99.0, 1, 0), (101.0, 0, 1)],
)
def test_one_odd_touch_is_told_from_e30_and_refused_from_e100(known, gain, warned, refused):
    known.odd = np.full(24, -50.0)
    known.odd[6] = gain
    judged = judge_touches(TABLE, known.meant, NOISE)
    sentence = "touch 7 does not fit the others"
    assert (sentence in judged.warnings) == warned
    assert (judged.refusal == sentence) == refused
    few = known.meant = touches(count=4)
    known.odd = np.full(4, 1e4)
    judged = judge_touches(TABLE, few, NOISE)  # too few to tell which is odd
    assert judged.refusal is None
    assert not any("does not fit" in warning for warning in judged.warnings)
    known.meant, known.odd = touches(count=5), np.full(5, 1e4)
    assert judge_touches(TABLE, known.meant, NOISE).refusal == "touch 1 does not fit the others"


def test_a_bad_fit_is_doubted_from_8_and_refused_from_16_times_the_misfit(known):
    known.meant, known.wrong = touches(), lambda place, force: 0.0
    for number, stretch in enumerate(STRETCHES):
        known.stretch = number
        judged = judge_touches(TABLE, known.meant, NOISE)
        assert judged.stretch == stretch == 2.0**number
        doubt = f"the touches fit {stretch:.0f} times worse than skins of this design should"
        assert (doubt in judged.warnings) == (stretch >= 8)
        refusal = f"they miss what a skin of this design reads by {stretch:.0f} times its scatter"
        assert judged.refusal == (refusal if stretch >= 16 else None)


@pytest.mark.parametrize(("size", "warned"), [(2.9, False), (3.1, True)])
def test_a_chip_that_fits_three_times_worse_than_the_others_is_told(known, size, warned):
    factor = np.repeat([1.0, size, 1.0], 3)
    known.residual = 1.5e-5 * np.tile(factor, (24, 1))
    known.residual[::2] *= -1
    judged = judge_touches(TABLE, known.meant, NOISE)
    np.testing.assert_allclose(np.abs(judged.residual), 1.5 * np.tile(factor, (24, 1)))
    sentence = f"chip 2 fits {size:.1f} times worse than the others"
    assert (sentence in judged.warnings) is warned
    everything, known.meant = known.residual, touches(count=4)
    known.residual = everything[:4]  # too few to tell a chip from a touch
    assert sentence not in judge_touches(TABLE, known.meant, NOISE).warnings
    known.meant, known.residual = touches(), everything
    # What is within the noise is no chip's fault.
    known.residual = known.residual * 0.9 / (1.5 * size) * 3
    assert judge_touches(TABLE, known.meant, NOISE).warnings == ()


def test_four_touches_are_too_few(known):
    for count, few in ((4, True), (5, False)):
        known.meant = touches(count=count)
        warnings = judge_touches(TABLE, known.meant, NOISE).warnings
        sentence = f"{count} touches are too few to be judged by each other; 5 would do"
        assert (sentence in warnings) is few


@pytest.mark.parametrize("x", [0, 1])
@pytest.mark.parametrize("y", [0, 1])
def test_a_quarter_without_a_touch_is_told(known, x, y):
    position = np.array(known.meant.position)
    there = ((position > EXTENT / 2) == [x, y]).all(axis=1)
    position[there, 0] = EXTENT[0] - position[there, 0]
    known.meant = replace(known.meant, position=position)
    (warning,) = judge_touches(TABLE, known.meant, NOISE).warnings
    words = ("small", "large")
    assert warning == f"no touch lies in the quarter of {words[x]} x and {words[y]} y"


def test_touches_are_located_by_one_step_from_what_the_others_foretell(known):
    place, drag, press = 1e-3, 0.02, -0.05
    foretold = np.array([place * 1e-2, -place * 1e-2, drag * 1e-4, 0.0, press * 1e-4, 0, 0, 0, 0])
    known.residual = np.tile(foretold, (24, 1))
    judged = judge_touches(TABLE, known.meant, NOISE)
    # Normal priors: anywhere on the skin, drags of 0.3 N, presses unknown; noise (1e-5)^2.
    noise = 1e-10
    of_place = 1e-4 / (1e-4 + noise * 12 / EXTENT**2)
    of_drag = 1e-8 / (1e-8 + noise / 0.3**2)
    expected = [place * of_place[0], -place * of_place[1], drag * of_drag, 0.0, press]
    np.testing.assert_allclose(judged.errors, np.tile(expected, (24, 1)), rtol=1e-9, atol=1e-15)
    assert judged.place_error == pytest.approx(np.hypot(*expected[:2]))
    assert judged.force_error == pytest.approx(0.05)
    plain = judged.as_json()
    assert plain["cross_validated_place_error_mm"] == round(1e3 * judged.place_error, 4)
    assert plain["cross_validated_force_error_N"] == 0.05
    assert (plain["misfit_over_design"], plain["refusal"], plain["warnings"]) == (1.0, None, [])


def test_forces_from_nowhere_are_refused(monkeypatch):
    def fails(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(judgement, "Evidence", fails)
    far = touches()
    judged = judge_touches(TABLE, replace(far, force=far.force * 1e9), NOISE)
    assert judged.refusal.endswith("N, where the table knows 1.15 N")
    assert judged.stretch == np.inf


def test_stretches_are_powers_of_two():
    assert STRETCHES[0] == 1
    assert all(after == 2 * before for before, after in pairwise(STRETCHES))
    assert STRETCHES[-1] == 128
