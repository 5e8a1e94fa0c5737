"""The fit's noise, its prior, and what it asks of a table: each number at its edge.

Closed forms stand in for fits: a number with standard uncertainty s is determined where s is at
most what is allowed.
"""

import re
import types

import numpy as np
import pytest

from smoskin.errors import ModelError
from smoskin.measurement import TouchTable
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form import fitting
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.press_model import PressModel
from smoskin.sensing.signals.signals import chip_noise


def table(planar, force, *, depth=2e-4, touched=None, read=True, cell=None):
    """Touches with these forces, each on a cell of every layer in turn."""
    force = np.array(force, dtype=float)
    rows = len(force)
    touched = np.full(rows, True) if touched is None else np.array(touched)
    tops = geometry(planar).tops
    place = np.array([tops[(k % 3, k % 3) if cell is None else cell] for k in range(rows)])
    deep = np.broadcast_to(np.array(depth, dtype=float), rows).copy()
    place[~touched], deep[~touched] = np.nan, np.nan
    field = np.zeros((rows, 3 if read else 0, 3))
    return TouchTable(position=place, force=force, depth=deep, field=field)


def test_noise_is_a_share_of_what_was_measured_with_a_floor(planar):
    touches = table(
        planar,
        [[0.0, 0.0, 0.0], [0.3, 0.0, -0.5], [0.0, -0.02, -1.0]],
        depth=[0.0, 1e-4, 5e-4],
        touched=[False, True, True],
    )
    model = PressModel(planar, touches, 1)
    levels = np.array([0.02, 0.05, 3.0])
    sigma = fitting._sigmas(model, levels, 0.0)
    # 1 mN of the gauge and 0.5 um of the stage; untouched, 1 uN and 1 nm.
    np.testing.assert_allclose(sigma[0, :4], [1e-6, 1e-6, 1e-6, 1e-9])
    for row, (force, depth) in enumerate((([0.3, 0, 0.5], 1e-4), ([0, 0.02, 1.0], 5e-4)), 1):
        np.testing.assert_allclose(sigma[row, :3], np.hypot(0.02 * np.array(force), 1e-3))
        assert sigma[row, 3] == pytest.approx(np.hypot(0.05 * depth, 0.5e-6))
    np.testing.assert_allclose(sigma[:, 4:], np.tile(3 * chip_noise(planar), (3, 3)))
    # The noise is that of the modelled value: measured less residual.
    residual = np.zeros((3, 13))
    residual[1, 2], residual[1, 3] = 0.1, 0.2e-4
    modelled = fitting._sigmas(model, levels, residual)
    assert modelled[1, 2] == pytest.approx(np.hypot(0.02 * 0.6, 1e-3))
    assert modelled[1, 3] == pytest.approx(np.hypot(0.05 * 0.8e-4, 0.5e-6))


def test_a_chip_that_was_not_read_has_no_weight(planar):
    touches = table(planar, [[0.0, 0.0, -0.5]])
    field = np.array(touches.field)
    field[0, 1] = np.nan
    model = PressModel(planar, types.SimpleNamespace(
        position=touches.position, force=touches.force, depth=touches.depth, field=field,
        touched=touches.touched, temperature=touches.temperature,
    ), 1)  # fmt: skip
    sigma = fitting._sigmas(model, np.ones(3), 0.0)
    assert np.isinf(sigma[0, 4:]).tolist() == [False] * 3 + [True] * 3 + [False] * 3
    assert fitting._groups(model)[0, 4:].tolist() == [2] * 3 + [-1] * 3 + [2] * 3


def test_a_value_tells_of_a_noise_level_that_is_past_its_floor(planar):
    # 2 % of 50 mN are the gauge's 1 mN, 2 % of 25 um the stage's 0.5 um.
    touches = table(
        planar,
        [[0.049, -0.051, -0.5], [0.051, -0.049, -0.5]],
        depth=[24.9e-6, 25.1e-6],
    )
    groups = fitting._groups(PressModel(planar, touches, 1))
    assert groups[:, :4].tolist() == [[-1, 0, 0, -1], [0, -1, 0, 1]]


def solved(scaled, size):
    """A least squares of no numbers worth speaking of, whose values are all left over."""
    scaled = np.array(scaled)
    return types.SimpleNamespace(
        scaled=scaled, used=np.zeros_like(scaled), reduced=np.zeros((scaled.size + 1, size))
    )


def test_noise_is_found_from_a_group_of_which_enough_is_left_over():
    rng = np.random.default_rng(0)
    group = np.tile([0, 1, 2, 2], (200, 1))
    scaled = rng.normal(size=group.shape) * [2.0, 3.0, 0.5, 0.5]
    problem = solved(scaled, 3)
    levels = fitting._levels(np.array([0.02, 0.03, 1.0]), group, problem, merged=False)
    root = [np.sqrt((scaled[group == k] ** 2).mean()) for k in range(3)]
    np.testing.assert_allclose(levels, np.array([0.02, 0.03, 1.0]) * root)
    # What the numbers have used up does not count, and without a tenth left nothing is found.
    for left, learned in ((0.11, True), (0.09, False)):
        problem.used = np.full(scaled.shape, 1 - left)
        levels = fitting._levels(np.array([0.02, 0.03, 1.0]), group, problem, merged=False)
        assert (levels[0] != 0.02) == learned
        if learned:
            assert levels[0] == pytest.approx(0.02 * root[0] / np.sqrt(left))
    # Nor with three values or fewer.
    for rows, learned in ((3, False), (4, True)):
        few = solved(scaled[:rows], 3)
        levels = fitting._levels(np.array([0.02, 0.03, 1.0]), group[:rows], few, merged=False)
        assert (levels[0] != 0.02) == learned
    # Without readings, force and depth share one factor.
    problem.used = np.zeros_like(scaled)
    levels = fitting._levels(np.array([0.02, 0.03, 1.0]), group, problem, merged=True)
    both = np.sqrt((scaled[group < 2] ** 2).mean())
    np.testing.assert_allclose(levels, [0.02 * both, 0.03 * both, root[2]])


def test_what_the_fit_itself_uses_up_is_not_left_over():
    rng = np.random.default_rng(1)
    problem = solved(rng.normal(size=(30, 1)), 5)
    problem.reduced[:30] = rng.normal(size=(30, 5))
    levels = fitting._levels(np.ones(3), np.zeros((30, 1), dtype=int), problem, merged=False)
    assert levels[0] == pytest.approx(np.sqrt((problem.scaled**2).sum() / (30 - 5)))


def test_only_what_is_added_to_a_chips_field_has_a_prior(planar):
    # A magnet hung 0.2 mm off changes by 2 mT sideways; the Earth's field is 0.1 mT at most.
    model = PressModel(planar, table(planar, [[0.0, 0.0, -0.5]]), 1)
    weight = fitting._prior(model)
    place = model.layout.field_offset
    np.testing.assert_allclose(weight[place], np.tile(1 / np.array([2e-3, 2e-3, 1e-4]), 3))
    assert not weight[: place.start].any()
    # One datum d of noise s with a prior of width p: shrunk to d p^2 / (p^2 + s^2).
    for width, noise in ((2e-3, 1e-3), (1e-4, 3e-4)):
        w, datum = 1 / width, 5e-4
        solution = np.linalg.lstsq([[1 / noise], [w]], [datum / noise, 0.0])[0]
        assert solution[0] == pytest.approx(datum * width**2 / (width**2 + noise**2))


def test_numbers_are_looked_for_where_skins_can_be(planar):
    model = PressModel(planar, table(planar, [[0.0, 0.0, -0.5]]), 2)
    nominal = Calibration.nominal(planar)
    names, least, most, tolerance = fitting._limits(model, nominal)
    limits = dict(zip(names, zip(least, most, tolerance, strict=True), strict=True))
    assert limits["attenuation[0]"] == limits["attenuation[1]"] == (0.02, 0.9999, 0.1)
    for chip in range(3):
        assert limits[f"field_factor[{chip}]"] == (0.1, 10.0, 0.1)
    for axis in range(9):
        assert limits[f"chip_rotation[{axis}]"] == (-0.5, 0.5, 0.05)
        assert limits[f"field_offset[{axis}]"] == (-0.02, 0.02, 5e-3)
    # Stiffnesses lie within a factor of 50 of the design's and are told to 30 %.
    for name, value in (
        ("board_stiffness", nominal.board_stiffness),
        ("sheet_stiffness", nominal.sheet_stiffness),
        ("stiffness_variation", nominal.coefficients.stiffness_variation),
        ("folding_correction_x[0]", nominal.coefficients.folding_correction_x[0]),
        ("folding_correction_y[2]", nominal.coefficients.folding_correction_y[2]),
    ):
        low, high, allowed = limits[name]
        np.testing.assert_allclose(np.exp([low, high]), [value / 50, value * 50])
        assert allowed == 0.3
    assert len(names) == model.size
    single = PressModel(planar, table(planar, [[0.0, 0.0, -0.5]]), 1)
    assert fitting._limits(single, nominal)[0][0] == "attenuation"


@pytest.mark.parametrize(
    ("end", "inside", "kept"),
    [(0, 0.9e-6, False), (0, 1.1e-6, True), (1, 0.0, False), (1, 1.1e-9, True), (1, 0.9e-9, False)],
)
@pytest.mark.parametrize("name", ["attenuation", "field_factor[2]"])
def test_a_number_at_its_end_is_no_fit(planar, monkeypatch, name, end, inside, kept):
    model, nominal = PressModel(planar, table(planar, LOADS), 1), Calibration.nominal(planar)
    names, *ends, _ = fitting._limits(model, nominal)
    which = names.index(name)

    def least_squares(residuals, start, **_):
        values = np.clip(start, ends[0] + 1e-3, ends[1] - 1e-3)
        values[which] = ends[end][which] + (-inside if end else inside)
        return types.SimpleNamespace(x=values)

    monkeypatch.setattr("scipy.optimize.least_squares", least_squares)
    monkeypatch.setattr(fitting, "_check_determined", lambda *_: None)
    monkeypatch.setattr(fitting, "_levels", lambda levels, *_, **__: levels)
    if kept:
        fitting._fitted(model, nominal)
        return
    message = rf"fit no {re.escape(name)} inside \({ends[0][which]:g}, {ends[1][which]:g}\); check"
    with pytest.raises(ModelError, match=message):
        fitting._fitted(model, nominal)


@pytest.mark.parametrize(("share", "determined"), [(0.99, True), (1.01, False)])
def test_a_number_is_told_up_to_its_largest_uncertainty(share, determined):
    tolerance = np.array([0.1, 0.3, 5e-3])
    spread = tolerance * [0.2, share, 0.5]
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    problem = turn @ np.diag(1 / spread)
    if determined:
        fitting._check_determined(["a", "b", "c"], tolerance, problem)
        return
    with pytest.raises(
        ModelError, match=r"determine b: its .* would be 0\.3 and must be at most 0\.3"
    ):
        fitting._check_determined(["a", "b", "c"], tolerance, problem)


LOADS = [
    *[(0.0, 0.0, -0.5)] * 9,
    *[(x, y, -0.4) for x, y in ((0.21, 0.0), (0.0, 0.21)) for _ in range(9)],
]
"""Three straight presses, and three loads with a drag each way, on each of three layers."""


def test_three_loads_of_each_kind_on_each_layer_are_enough(planar):
    fitting._check_loads(PressModel(planar, table(planar, LOADS), 1))


@pytest.mark.parametrize(
    ("row", "force", "missed"),
    [
        (0, (0.0, 0.024, -0.5), None),  # straight up to a twentieth
        (9, (0.19, 0.0, -0.4), "folding_correction_x of layer 1"),  # dragged from a half on
        (9, (0.2, 0.0, -0.4), None),
        (10, (0.21, 0.22, -0.4), "folding_correction_x of layer 2"),  # mainly the other way
        (20, (0.0, -0.1, -0.4), "folding_correction_y of layer 3"),
    ],
)
def test_a_load_counts_for_what_it_acts_on(planar, row, force, missed):
    loads = list(LOADS)
    loads[row] = force
    model = PressModel(planar, table(planar, loads), 1)
    if missed is None:
        fitting._check_loads(model)
    else:
        with pytest.raises(ModelError, match=f"{missed}.*at least 3 .*; got 2"):
            fitting._check_loads(model)


@pytest.mark.parametrize(("attenuation", "odd"), [(0.12, 1.0), (0.3, 1.05), (0.7, 1.0)])
def test_a_fit_starts_from_what_most_presses_say(planar, attenuation, odd):
    """Nobody knows how stiff the rubber is; one of nine presses is odd."""
    model = PressModel(planar, table(planar, LOADS[:9], read=False), 1)
    nominal = Calibration.nominal(planar)
    numbers = model.start(nominal)
    numbers[model.layout.attenuation] = attenuation
    press = 1.7 * model.press_stiffness(numbers) * 2e-4 * np.where(np.arange(9) == 3, odd, 1.0)
    made = table(planar, np.multiply.outer(press, [0.0, 0.0, -1.0]), read=False)
    given = PressModel(planar, made, 1)
    start = fitting._start(given, nominal, fitting._sigmas(given, np.full(3, 0.02), 0.0))
    assert start[model.layout.attenuation] == attenuation
    assert np.exp(start[model.layout.stiffness_variation]) == pytest.approx(1.7)


def test_straight_presses_are_counted(planar):
    loads = [(0.0, 0.026, -0.5)] * 7 + LOADS[7:]
    with pytest.raises(
        ModelError, match=r"stiffness_variation: .* at least 3 straight presses; got 2"
    ):
        fitting._check_loads(PressModel(planar, table(planar, loads), 1))


def test_a_touch_left_out_is_judged_by_all_others():
    # A straight line through the origin: leave-one-out has a closed form.
    rng = np.random.default_rng(2)
    x, y = rng.uniform(1, 2, 8), rng.normal(size=8)
    slope = (x @ y) / (x @ x)
    problem = types.SimpleNamespace(
        scaled=(y - slope * x)[:, None], reduced=np.append(-x, 0.0)[:, None]
    )
    left = fitting._left_out(problem)[:, 0]
    for k in range(8):
        others = np.arange(8) != k
        own = (x[others] @ y[others]) / (x[others] @ x[others])
        assert left[k] == pytest.approx(y[k] - own * x[k])


def test_groups_of_residuals_are_summed_up_in_their_units(planar):
    residual = np.full((2, 13), np.nan)
    residual[:, 0], residual[0, 3] = (3.0, -4.0), 2e-3
    residual[:, 7:10] = 5e-6
    groups = {line.group: line for line in fitting._summaries(planar, residual)}
    assert list(groups) == ["force_x", "force_y", "force_z", "depth"] + [
        f"field of chip S{k}" for k in (1, 2, 3)
    ]
    assert (groups["force_x"].unit, groups["force_x"].values) == ("N", 2)
    assert groups["force_x"].rms == pytest.approx(np.sqrt(12.5))
    assert (groups["depth"].unit, groups["depth"].values, groups["depth"].rms) == ("mm", 1, 2e-3)
    assert (groups["field of chip S2"].values, groups["field of chip S2"].unit) == (6, "uT")
    assert groups["field of chip S2"].rms == pytest.approx(5e-6)
    assert groups["force_y"].values == 0
    assert np.isnan(groups["force_y"].rms)


def test_even_the_fewest_loads_leave_freedom(planar):
    # 4 values of the gauge a touch, of which its depth and drags take 3.
    model = PressModel(planar, table(planar, LOADS, read=False), 2)
    fitting._check_loads(model)
    assert len(LOADS) - model.size >= 4
