"""Where touches load the sheet: warps, what undoes them, and what a few touches tell of them."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPosterior
from smoskin.sensing.response import calibrate
from smoskin.sensing.response.calibrate import LabelledTouches, TouchPlanner, calibrate_touches
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.response.warp import LineWarp, PlaceWarp, Unwarp
from smoskin.sensing.signals.signals import signal_noise

VERTICES = 0.01 + 0.02 * np.arange(6)
END = 0.12


@pytest.fixture
def warp():
    return LineWarp(VERTICES)


@pytest.fixture
def coefficients(warp):
    return np.random.default_rng(0).normal(size=len(warp.spread)) * warp.spread / 2


def test_slopes_are_those_of_the_functions(warp):
    x = np.random.default_rng(1).uniform(0, END, 200)
    step = 1e-7
    more, less = (warp.functions(x + away)[0] for away in (step, -step))
    smooth = np.abs(x[:, None] - VERTICES).min(axis=1) > step
    slope = warp.functions(x)[1]
    np.testing.assert_allclose(slope[smooth], ((more - less) / (2 * step))[smooth], atol=1e-5)


def test_one_place_at_a_time_is_the_same(warp, coefficients):
    x = np.linspace(0, END, 97)
    value, slope = warp.functions(x)
    points = np.array([warp.point(place, coefficients.tolist()) for place in x.tolist()])
    away = np.abs(x[:, None] - VERTICES).min(axis=1) > 1e-9
    np.testing.assert_allclose(points[:, 0], x + value @ coefficients, atol=1e-15)
    np.testing.assert_allclose(points[away, 1], (1 + slope @ coefficients)[away], atol=1e-9)


def test_vertices_stay_where_they_are_but_for_a_shift(warp, coefficients):
    value = warp.functions(VERTICES)[0] @ coefficients
    np.testing.assert_allclose(value, coefficients[0], atol=1e-15)


@pytest.mark.parametrize("lever", [0.0, 0.5, 1.0])
def test_a_lever_is_as_long_as_its_coefficient_says(warp, lever):
    coefficients = np.zeros(len(warp.spread))
    coefficients[1:3] = 1 - lever
    x = np.array([0.002, 0.05, 0.118])
    load = x + warp.functions(x)[0] @ coefficients
    np.testing.assert_allclose(load, [0.01 - 0.008 * lever, 0.05, 0.11 + 0.008 * lever])


def test_a_smoothstep_is_written_to_a_fiftieth_of_a_pitch(warp):
    x = np.linspace(VERTICES[0], VERTICES[-1], 501)[1:-1]
    t = (x - VERTICES[0]) / 0.02 % 1
    wanted = 0.02 * (3 * t**2 - 2 * t**3 - t)
    functions = warp.functions(x)[0]
    fitted = functions @ np.linalg.lstsq(functions, wanted, rcond=None)[0]
    assert np.abs(fitted - wanted).max() < 0.02 / 50


@pytest.mark.parametrize("pitch", [0.02, 0.013])
def test_skins_are_believed_to_warp_by_tenths_of_a_millimetre_and_half_a_lever(pitch):
    """Spreads of loads among skins: 0.2 mm at vertices; a lever past them is half as sure as long;
    between them harmonics of 8, 4 and 2 % of the pitch, and of each interval 2 % and a bow of 3 %.
    """
    vertices = 0.01 + pitch * np.arange(5)
    warp = LineWarp(vertices)

    def spread(x):
        return np.sqrt(warp.functions(np.atleast_1d(x))[0] ** 2 @ warp.spread**2)

    np.testing.assert_allclose(spread(vertices), 0.2e-3)
    past = np.array([1e-3, 4e-3, 8e-3])
    expected = np.hypot(0.2e-3, 0.5 * past)
    np.testing.assert_allclose(spread(vertices[0] - past), expected)
    np.testing.assert_allclose(spread(vertices[-1] + past), expected)
    for t in (0.1, 0.25, 0.5, 0.7):
        first, second, third = (np.sin(2 * np.pi * k * t) for k in (1, 2, 3))
        shares = [0.08 * first, 0.04 * second, 0.02 * third, 0.02 * first, 0.03 * 4 * t * (1 - t)]
        expected = np.hypot(0.2e-3, pitch * np.linalg.norm(shares))
        np.testing.assert_allclose(spread(vertices[:-1] + t * pitch), expected)


def test_a_skin_of_one_row_has_nothing_to_warp_between():
    single = PlaceWarp(np.array([0.013]), VERTICES)
    loads, slopes = single.loads(np.array([[0.02, 0.05]]), np.zeros(len(single.spread)))
    np.testing.assert_array_equal(loads, [[0.02, 0.05]])
    np.testing.assert_array_equal(slopes, [[1.0, 1.0]])


def test_places_come_back_from_their_loads(warp, coefficients):
    undo = Unwarp(warp, coefficients, END)
    for x in np.linspace(0.001, END - 0.001, 41):
        load, slope = warp.point(x, coefficients.tolist())
        place, variance = undo.place(load, 1e-10)
        if slope > 0.5:
            assert place == pytest.approx(x, abs=1e-8)
            assert variance == pytest.approx(1e-10 / slope**2, rel=1e-3)


def test_on_a_level_stretch_the_middle_is_answered_with_its_spread(warp):
    coefficients = np.zeros(len(warp.spread))
    coefficients[1] = 1.0
    place, variance = Unwarp(warp, coefficients, END).place(0.01, 1e-10)
    # Anywhere within 10 mm, and some of a grid's step beyond.
    assert place == pytest.approx(5e-3, abs=0.3e-3)
    assert np.sqrt(variance) == pytest.approx(10e-3 / np.sqrt(12), rel=0.1)
    # As ever, also where the load itself is little known.
    for known, middle, spread in (
        (1e-10, 5.058627e-3, 3.064052e-3),
        (1e-6, 5.548246e-3, 3.369381e-3),
    ):
        place, variance = Unwarp(warp, coefficients, END).place(0.01, known)
        assert (place, np.sqrt(variance)) == pytest.approx((middle, spread), rel=1e-6)


@pytest.mark.parametrize(("slope", "level"), [(0.36, False), (0.34, True)])
def test_a_warp_is_level_where_it_rises_by_less_than_a_third(warp, slope, level):
    coefficients = np.zeros(len(warp.spread))
    coefficients[1] = 1 - slope  # past the first vertex
    load = warp.point(0.004, coefficients.tolist())[0]
    place, variance = Unwarp(warp, coefficients, END).place(load, 1e-10)
    if level:  # to some of a grid's step
        assert place == pytest.approx(0.004, abs=1e-3)
        assert np.sqrt(variance) > 0.4e-3
    else:
        assert place == pytest.approx(0.004, abs=1e-9)
        assert variance == pytest.approx(1e-10 / slope**2)


@pytest.fixture(scope="module")
def table():
    pytest.importorskip("safetensors")
    return load_response_table("planar")


@pytest.fixture(scope="module")
def drawn(table, planar):
    """A skin as the table draws skins, with its law of contact, and thirty touches of it."""
    rng, noise = np.random.default_rng(5), signal_noise(planar, table.chips)
    skin = table.moved(0.7 * rng.normal(size=len(table.modes)))
    plan = TouchPlanner(table, noise).plan(30)
    place = np.array([target.position for target in plan])
    force = np.array([target.force for target in plan])
    signals = skin.signals(place, force) + rng.multivariate_normal(np.zeros(9), noise, 30)
    touches = LabelledTouches(position=place, force=force, signals=signals.reshape(30, 3, 3))
    return skin, touches, noise


def test_an_open_table_has_the_warps_among_its_modes(table):
    count = len(table.contact.spread)
    np.testing.assert_array_equal(table.warp_modes[-count:], np.diag(table.contact.spread))
    assert not table.warp_modes[:-count].any()
    assert not np.any(table.warp)


def test_signals_of_warp_modes_are_the_derivative_by_them(table):
    place, force = np.array([[0.004, 0.07], [0.033, 0.155]]), np.array([[0.1, 0.0, -0.6]] * 2)
    modes = table.mode_signals(place, force)
    step = 1e-4
    for k in range(len(table.modes) - len(table.contact.spread), len(table.modes), 5):
        weights = step * (np.arange(len(table.modes)) == k)
        more, less = (table.moved(sign * weights).signals(place, force) for sign in (1, -1))
        np.testing.assert_allclose(modes[:, k], (more - less) / (2 * step), rtol=1e-3, atol=1e-9)


def test_slopes_of_a_warped_table_are_those_by_touches(drawn):
    skin, _, _ = drawn
    place, force = np.array([[0.033, 0.071], [0.004, 0.152]]), np.array([[0.1, 0.0, -0.6]] * 2)
    slopes = skin.slopes(place, force)
    for axis in range(2):
        step = 1e-7 * (np.arange(2) == axis)
        change = skin.signals(place + step, force) - skin.signals(place - step, force)
        np.testing.assert_allclose(slopes[..., axis], change / 2e-7, rtol=1e-4, atol=1e-6)


def test_a_few_touches_tell_the_law_of_contact(table, drawn):
    skin, touches, noise = drawn
    known = calibrate_touches(table, touches, noise)
    rng = np.random.default_rng(6)
    place = rng.uniform(0.0, 1.0, (200, 2)) * table.basis.extent
    before = np.linalg.norm(skin.contact.loads(place, skin.warps[0])[0] - place, axis=1)
    off = skin.contact.loads(place, skin.warps[0])[0] - skin.contact.loads(place, known.warps[0])[0]
    assert np.sqrt((off**2).sum(axis=1).mean()) < 0.35 * np.sqrt((before**2).mean())
    moved = np.einsum("kw,bwd->bkd", known.warp_modes, known.contact.functions(place)[0])
    stated = (moved**2).sum(axis=1)
    # No misfit spoils these signals, which what is stated allows for.
    assert 0.3 < np.sqrt((off**2).mean() / stated.mean()) < 1.5


@pytest.mark.parametrize(("much", "factor"), [(0.0, 0.25), (0.5, 0.5), (1.2, 1.0)])
def test_how_far_laws_are_off_is_learned(table, drawn, much, factor):
    """As far as the skin's law is off from the table's, so much is left open of it."""
    _, touches, noise = drawn
    rng = np.random.default_rng(8)
    weights = np.sqrt(0.5) * rng.choice([-1.0, 1.0], len(table.modes))
    weights[-len(table.contact.spread) :] *= much * np.sqrt(2)
    signals = table.moved(weights).signals(touches.position, touches.force)
    signals += rng.multivariate_normal(np.zeros(9), noise, 30)
    pressed = replace(touches, signals=signals.reshape(30, 3, 3))
    known = calibrate_touches(table, pressed, noise)
    assumed = replace(table, warp_modes=factor * table.warp_modes)
    alone = calibrate._posterior_weights(assumed, pressed, noise)
    np.testing.assert_allclose(known.warps[0], alone.weights @ assumed.warp_modes, rtol=1e-9)


def test_the_estimator_answers_places_not_loads(table, drawn, planar):
    skin, touches, noise = drawn
    known = calibrate_touches(table, touches, noise)
    estimator = BayesEstimator(planar, known)
    plain = BayesEstimator(planar, replace(known, warp=None))
    rng, errors = np.random.default_rng(7), []
    for place in rng.uniform(0.1, 0.9, (40, 2)) * table.basis.extent:
        signals = skin.signals(place[None], np.array([[0.0, 0.0, -0.6]]))[0]
        contacts = [each._read(0.0, signals, 25.0).contacts[0] for each in (estimator, plain)]
        errors.append([np.linalg.norm(contact.position - place) for contact in contacts])
    with_law, without = np.mean(errors, axis=0)
    assert with_law < 0.7e-3  # skins are drawn with covers of their own
    assert with_law < without / 2


def test_files_keep_the_law_of_contact(table, drawn, tmp_path):
    _, touches, noise = drawn
    known = calibrate_touches(table, touches, noise)
    known.save(tmp_path / "skin.table")
    read = load_response_table(tmp_path / "skin.table")
    np.testing.assert_array_equal(read.warp, known.warp)
    np.testing.assert_array_equal(read.warp_modes, known.warp_modes)
    assert read.calibrated


@pytest.mark.parametrize("axis", [0, 1])
def test_a_warp_along_one_axis_is_undone_along_that_axis(table, planar, axis):
    coefficients = np.zeros(len(table.contact.spread))
    coefficients[axis * len(table.contact._lines[0].spread)] = 1e-3  # all loads 1 mm further on
    estimator = BayesEstimator(planar, replace(table, warp=coefficients))
    values = np.array([[0.05, 0.07, 0.0, 0.0, -0.5]])
    posterior = TouchPosterior(values, 1e-8 * np.eye(5)[None], 0.0, 0.0)
    touches, covariance = estimator._touches(posterior)
    np.testing.assert_allclose(touches[0] - values[0], -1e-3 * (np.arange(5) == axis), atol=1e-9)
    np.testing.assert_allclose(covariance, posterior.covariance)
