"""Stated confidence against how often noise misleads, on the twin and on the reduced model."""

import inspect
from dataclasses import replace

import numpy as np
import pytest

from skins import with_magnets
from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.inversion import FieldInverse, rest_cross_talk
from smoskin.mechanics.reduced.stiffness import stiffness_map
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Status
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import ambiguities, cones, readout_noise
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.closed_form.location import decide, ideal_rule, readout, unit_press
from smoskin.sensing.closed_form.measured import MeasuredSheet
from smoskin.sensing.closed_form.sheets import IdealSheet
from smoskin.twin.reduced import ReducedTwin
from tables import ideal_answers, solve_all

FAST = HallSetting(gain_selection=3, resolution=0, oversampling=0, digital_filter=0)


def read(design, fields, sheet):
    """What a sheet makes of fields of the chips' own magnets."""
    moved = FieldInverse(design).displacements(fields).moved
    return solve_all(sheet, moved.reshape(len(fields), -1))


def ideal(design):
    return IdealSheet(design, Calibration.nominal(design))


def solved(design, places, force, repeats, seed, sheet=None):
    """Noise-free cells of light presses at these places, and solutions under noise."""
    twin = ReducedTwin(design, seed=None)
    presses = touches_of([[Contact(position=p, force=(0, 0, -force))] for p in places])
    fields = twin.field(twin.motions(presses)) - rest_cross_talk(design)
    sheet = sheet or ideal(design)
    noisy = np.repeat(fields, repeats, axis=0)
    noisy += np.random.default_rng(seed).normal(size=noisy.shape) * mlx90393.noise(
        design.hall_setting
    )
    return np.repeat(read(design, fields, sheet).cell, repeats, axis=0), read(design, noisy, sheet)


@pytest.mark.parametrize("magnets", [[(4, 2), (2, 4)], [(4, 2), (2, 4), (1, 5)]])
@pytest.mark.parametrize("tabled", ["theory", "table"])
def test_stated_confidence_is_how_often_the_decision_stands(planar, magnets, tabled):
    design = replace(with_magnets(planar, magnets), hall_setting=FAST)
    places = np.random.default_rng(1).uniform((0, 0), (0.1199, 0.1599), (1000, 2))
    sheet = ideal(design) if tabled == "theory" else MeasuredSheet(design, ideal_answers(design))
    cell, noisy = solved(design, places, 0.125, 25, 2, sheet)
    stands = (noisy.cell == cell).all(axis=1)
    assert 0.5 < stands.mean() < 0.97
    assert noisy.confidence.mean() == pytest.approx(stands.mean(), abs=0.03)
    for least in np.arange(0.5, 1.0, 0.1):
        within = (noisy.confidence >= least) & (noisy.confidence < least + 0.1)
        assert within.sum() > 300
        # Where more than two faces of a cone are near, what is stated is a lower bound.
        above = stands[within].mean() - noisy.confidence[within].mean()
        assert -0.05 < above < (0.05 if tabled == "theory" else 0.08), least


def test_presses_on_vertices_are_right_more_often_than_stated(planar):
    design = replace(planar, hall_setting=FAST)
    cell, noisy = solved(design, geometry(design).tops.reshape(-1, 2), 0.05, 1000, 3)
    np.testing.assert_array_equal(cell[::1000], np.argwhere(np.ones((6, 6))))
    right = (noisy.cell == cell).all(axis=1)
    assert right.mean() < 0.98
    for least in np.arange(0.3, 1.0, 0.1):
        within = (noisy.confidence >= least) & (noisy.confidence < least + 0.1)
        assert right[within].mean() > noisy.confidence[within].mean() - 0.03, least


def test_rated_presses_are_sure_and_no_cell_has_none(planar):
    twin, sheet = ReducedTwin(planar, seed=None), ideal(planar)
    places = geometry(planar).tops.reshape(-1, 2)
    presses = touches_of([[Contact(position=p, force=(0, 0, -0.5))] for p in places])
    fields = twin.field(twin.motions(presses)) - rest_cross_talk(planar)
    solution = read(planar, fields, sheet)
    assert (solution.confidence > 0.9999).all()
    # Right of magnet 2 yet left of magnet 3: the chips' motions are the reverse of the magnets'.
    moved, charges = np.zeros((3, 3)), point_charges([planar.magnet(n) for n in ("M1", "M2", "M3")])
    moved[:, 2] = geometry(planar).rest[:, 2]
    moved[1:, 0] = 2e-4, -2e-4
    moved[1:, 1] = 1e-4
    unfit = FieldInverse(planar).displacements(charge_field_and_gradient(*charges, moved)[0][None])
    assert sheet.solve(unfit.moved.ravel()) is None


@pytest.mark.parametrize("magnets", [[(4, 2), (2, 4)], [(5, 1), (3, 3)], [(4, 2), (2, 4), (3, 3)]])
def test_at_the_force_of_an_ambiguity_noise_errs_at_the_stated_rate(planar, magnets):
    design = with_magnets(planar, magnets)
    unit = unit_press(design)
    rule = ideal_rule(unit)
    noise = readout_noise(design, readout(design, Calibration.nominal(design))[:, :-2])
    stiffness = stiffness_map(design, design.coefficients)
    rng = np.random.default_rng(0)
    listed = ambiguities(design, force=1e-4, error_rate=0.02)
    for ambiguity in listed[:6]:
        axis, rates = "xy".index(ambiguity.axis), []
        for own, other in (ambiguity.pair, ambiguity.pair[::-1]):
            moved = unit[own].ravel() * ambiguity.force / stiffness[own]
            seen = rng.multivariate_normal(moved, noise, 40000).reshape(-1, len(magnets), 2)
            rates.append((decide(rule, seen)[:, axis] == other[axis]).mean())
        assert max(rates) == pytest.approx(0.02, abs=0.004), str(ambiguity)
    assert listed[0].force > listed[-1].force > 1e-4


def test_magnets_in_one_line_give_candidates_and_say_so(planar):
    design = with_magnets(planar, [(3, 1), (3, 5)])
    listed = ambiguities(design)
    assert {ambiguity.axis for ambiguity in listed} == {"x"}
    assert all(
        ambiguity.force == np.inf and ambiguity.same_signs and ambiguity.ratio_gap < 1e-9
        for ambiguity in listed
    )
    assert str(listed[0]) == (
        "columns 1 and 2: the same signs and ratios 1 and 1, told apart never"
    )
    reading = ReducedTwin(design, seed=0).read(
        [Contact(position=(0.05, 0.0667), force=(0.2, 0, -0.5))]
    )
    estimate = ClosedFormEstimator(design).step(reading)
    assert estimate.status is Status.AMBIGUOUS
    np.testing.assert_allclose(estimate.contacts[0].force[:2], (0.2, 0.0), atol=0.01)
    spread = estimate.covariance[0]
    assert np.isfinite(spread[2:4, 2:4]).all()
    assert np.isnan(np.diag(spread)[[0, 1, 4]]).all()
    sure = ClosedFormEstimator(design, least_confidence=0.0).step(reading)
    assert sure.status is Status.CONTACT


def test_confidence_is_shared_among_cells_of_one_direction(planar):
    design = with_magnets(planar, [(3, 3)])
    unit = unit_press(design)
    noise = readout_noise(design, readout(design, Calibration.nominal(design))[:, :-2])
    regions = cones(ideal_rule(unit), unit, noise)
    np.testing.assert_allclose(regions.share, 1 / 9)
    assert 0 < regions.confidence((1, 4), unit[1, 4].ravel() * 1e-3) <= 1 / 9


def test_wrong_use_is_named(planar):
    with pytest.raises(ArgumentError, match="force must be positive; got 0"):
        ambiguities(planar, force=0.0)
    for rate in (0.0, 0.5, -1e-9):
        with pytest.raises(ArgumentError, match=rf"error_rate must lie in \(0, 0.5\); got {rate}"):
            ambiguities(planar, error_rate=rate)
    for least in (-1e-9, 1 + 1e-9):
        with pytest.raises(ArgumentError, match=r"least_confidence must lie in \[0, 1\]; got"):
            ClosedFormEstimator(planar, least_confidence=least)
    for least in (0.0, 1.0):
        ClosedFormEstimator(planar, least_confidence=least)


def test_by_default_pairs_that_half_a_newton_tells_apart_are_left_out(planar):
    assert ambiguities(planar, force=1e-3)
    assert ambiguities(planar) == ambiguities(planar, force=0.5)
    assert inspect.signature(ambiguities).parameters["force"].default == 0.5
