"""The paper's device as an inverse problem: what is read off a sheet, and the search."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError, DesignError

pytest.importorskip("jax")
from paper.models import device as search
from paper.models import observations
from paper.models.device import NEAR, UNKNOWNS, Study, Trials, cost, device, seek, study
from paper.models.observations import OBSERVATIONS, misses, press_all


def read(design) -> dict[str, tuple[float, ...]]:
    """What a design's sheet shows, by observation."""
    pressing = press_all(design)
    return {item.name: item.read(pressing) for item in OBSERVATIONS}


@pytest.fixture(scope="module")
def slender(planar):
    """Columns of 1.5 by 10 mm, panels of 1 mm, film of 50 um over 1 mm, no frame."""
    values = (1.5e-3, 10e-3, 50e-6, 1e-3, 1e-3, 1.0, 0.0, 0.5, 0.5)
    return device(planar, values)


def test_a_sheet_shows_what_an_independent_linear_model_found(slender):
    """That dense model printed these numbers; its columns are 4 % stiffer sideways."""
    shown = read(slender)
    assert shown["signs"] == (36, 36)
    assert min(shown["cells named"]) >= 35
    np.testing.assert_allclose(
        shown["v_f by layer, X then Y (N)"], (0.62, 1.05, 4.8, 0.45, 0.79, 5.3), rtol=0.03
    )
    np.testing.assert_allclose(
        shown["K11 : K22 : K33"], np.array([0.67, 1.46, 2.33]) / 0.67, rtol=0.03
    )
    np.testing.assert_allclose(
        shown["motions at (1,1)"], np.array([449, 342, 225, 524]) * 0.67e-3, rtol=0.06
    )
    assert shown["centre stiffer than edge"][0] > 3
    assert shown["1 N at 45 deg on any cell"][0] < 1  # columns this slender buckle


def test_soft_creases_and_thick_panels_bring_the_printed_motions(planar):
    """The dense model's design of the most folding, with 48 % of a press in it."""
    shown = read(device(planar, (2.15e-3, 20e-3, 12.7e-6, 3e-3, 2e-3, 1.0, 0.0, 0.9, 0.5)))
    np.testing.assert_allclose(shown["motions at (1,1)"][::3], (0.75, 0.99), rtol=0.06)
    np.testing.assert_allclose(shown["K11 : K22 : K33"][1:], (1.32, 1.36), rtol=0.04)
    creases, panels = shown["creases, panels negligible"]
    assert creases < 0.01
    assert panels == pytest.approx(0.02, abs=0.01)


def test_a_design_that_shows_what_is_asked_misses_nothing():
    asked = {
        "signs": (36, 36), "cells named": (36, 36), "motion ratios at (1,1)": (0.919, 0.919),
        "motions at (1,1)": (0.7313, 0.8709, 0.6721, 0.9476),
        "K11 : K22 : K33": (1.0, 0.985, 1.004), "centre stiffer than edge": (1.1,),
        "edge softens at large press": (1.4,), "edge vertices slip most": (1.1,),
        "v_f by layer, X then Y (N)": (0.6, 0.75, 0.9, 0.9, 1.0, 1.1),
        "creases, panels negligible": (0.0, 0.0), "1 N at 45 deg on any cell": (1.2,),
    }  # fmt: skip
    assert list(asked) == [item.name for item in OBSERVATIONS]
    for item in OBSERVATIONS:
        assert item.miss(asked[item.name]) == pytest.approx(0.0, abs=1e-12)
        assert item.miss(tuple(np.multiply(asked[item.name], 1e-3) - 0.1)) > 1 or (
            item.name == "creases, panels negligible"
        )


@pytest.mark.parametrize(
    ("name", "met", "missed"),
    [
        ("signs", (36, 36), (36, 35)),
        ("cells named", (34, 36), (36, 33)),
        ("motion ratios at (1,1)", (0.919 * 1.09, 0.919), (0.919, 0.919 / 1.11)),
        ("centre stiffer than edge", (1.0,), (0.99,)),
        ("edge softens at large press", (1.3,), (1.29,)),
        ("creases, panels negligible", (0.1, 0.0), (0.0, 0.11)),
        ("1 N at 45 deg on any cell", (1.0,), (0.99,)),
        ("v_f by layer, X then Y (N)", (0.6, 0.75, 0.9, 0.9, 1.0, 1.37),
         (0.6, 0.75, np.nan, 0.9, 1.0, 1.1)),
    ],
)  # fmt: skip
def test_an_observation_is_met_up_to_its_tolerance(name, met, missed):
    item = next(item for item in OBSERVATIONS if item.name == name)
    assert item.miss(met) <= 1.0 + 1e-12 < item.miss(missed)


def test_a_sheet_that_cannot_rest_is_far_from_everything(planar, monkeypatch):
    def refuse(design):
        raise DesignError("the sheet cannot rest")

    monkeypatch.setattr(observations, "press_all", refuse)
    assert min(misses(planar)) == max(misses(planar)) > 10
    assert cost(np.array(misses(planar))) > len(OBSERVATIONS) - 0.1


def test_the_search_finds_what_it_is_given_to_find(planar, monkeypatch):
    """Misses that are distances from one point, so that the point is the answer."""
    aim = np.array([np.sqrt(u.low * u.high) for u in UNKNOWNS])

    def off(design):
        columns, creases, panels, frame = (
            design.columns, design.creases, design.panels, design.frame,
        )  # fmt: skip
        values = (
            columns.radius, columns.height, creases.thickness, creases.gap, panels.thickness,
            panels.bonding, creases.strip_shift, frame.clearance,
            frame.held_height / columns.height,
        )  # fmt: skip
        return (*(3 * np.abs(np.log(np.divide(values, aim)))), 0.0, 5.0)

    monkeypatch.setattr(search, "misses", off)
    trials = seek(planar, drawn=64, population=32, rounds=40, seed=3)
    assert trials.random == 64
    assert len(trials.values) == 64 + 32 * 39
    assert len(np.unique(trials.values, axis=0)) == len(trials.values)
    best = trials.values[trials.best]
    assert trials.cost.min() < trials.cost[:64].min()
    assert np.abs(np.log(best / aim)).max() < 1.0
    again = seek(planar, drawn=64, population=32, rounds=2, seed=3)
    np.testing.assert_allclose(again.values[:64], trials.values[:64], rtol=1e-12)
    low, high = trials.spread(0.2).T
    assert ((low <= best) & (best <= high)).all()
    for values in trials.values[:64]:
        assert all(u.low <= v <= u.high for u, v in zip(UNKNOWNS, values, strict=True))
    with pytest.raises(ArgumentError, match="population must be 5 to drawn = 10; got 20"):
        seek(planar, drawn=10, population=20)


def test_what_excludes_what_is_told_by_the_nearest_design():
    missed = np.array([[0.0, 0.5, 3.0], [0.9, 2.0, 0.0], [1.0, 1.0, 9.0], [1.4, 9.0, 9.0]])
    trials = Trials(values=np.ones((4, 9)), misses=missed, random=4)
    np.testing.assert_array_equal(trials.nearest, [[0, 0.5, 0.9], [0.5, 0.5, 2], [0.9, 2, 0]])
    assert trials.best == 0
    assert trials.telling().tolist() == [0, 1]
    assert cost(np.zeros(3)) == 0.0
    assert cost(np.ones(3)) == pytest.approx(1.5)


def test_a_study_keeps_what_the_figure_draws(tmp_path):
    rng = np.random.default_rng(2)
    trials = Trials(
        values=rng.uniform(1, 2, (300, 9)), misses=rng.uniform(0, 4, (300, 11)), random=100
    )
    kept = study(trials, population=5, rounds=41, seed=7)
    kept.write(tmp_path / "study.json")
    again = Study.read(tmp_path / "study.json")
    assert again == kept
    assert (again.drawn, again.tried, again.seed) == (100, 300, 7)
    assert again.most_met == trials.met.sum(axis=1).max()
    few = again.trials
    assert len(few.values) < 200
    np.testing.assert_allclose(few.nearest, trials.nearest, rtol=1e-3)
    np.testing.assert_allclose(few.spread(NEAR), trials.spread(NEAR), rtol=1e-5)
    np.testing.assert_allclose(few.values[few.best], trials.values[trials.best], rtol=1e-5)


@pytest.mark.slow
def test_designs_of_the_kept_study_show_what_it_says(planar):
    """The closest design, those nearest to each observation, and those drawn first."""
    kept = Study.read()
    trials = kept.trials
    first = {trials.best, *trials.misses.argmin(axis=0).tolist()}
    for number in sorted(first):
        shown = misses(device(planar, trials.values[number]))
        np.testing.assert_allclose(shown, trials.misses[number], rtol=0.02, atol=0.02)
    assert trials.met[trials.best].sum() == kept.most_met
    assert kept.drawn < kept.tried


def test_a_device_is_the_design_with_other_sizes(planar):
    values = [u.low for u in UNKNOWNS]
    made = device(planar, values)
    assert made.frame.held_height == pytest.approx(0.2 * 5e-3)
    assert made.creases.strip_shift == 1e-3
    back = replace(
        made, columns=planar.columns, creases=planar.creases, panels=planar.panels,
        frame=planar.frame,
    )  # fmt: skip
    assert back == planar
