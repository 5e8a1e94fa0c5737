"""The closed-form estimator on the twin, and on skins that are not what it believes."""

from dataclasses import replace

import numpy as np
import pytest

from skins import with_magnets
from smoskin.errors import ArgumentError, ModelError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Reading, Status
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import ambiguities
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.closed_form.measured import MeasuredSheet
from smoskin.twin.reduced import ReducedTwin
from tables import ideal_answers, solve_all
from tables_of_response import plain, reduced_table

SHEARS = [(0.0, 0.0), (0.5, 0.0), (0.0, -0.5), (-0.35, 0.35)]


def touches(design, force, shear):
    """One contact on each cell's vertex."""
    places = geometry(design).tops.reshape(-1, 2)
    return [Contact(position=place, force=(*shear, -force)) for place in places]


def estimates(twin, estimator, contacts):
    return [estimator.step(twin.read([c], time=0.01 * k)) for k, c in enumerate(contacts, 1)]


def by_table(design):
    """The estimator by the design's own table, zeroed."""
    estimator = ClosedFormEstimator(design, reduced_table(design))
    estimator.zero([ReducedTwin(design, seed=None).read()])
    return estimator


def located(estimate, contact) -> bool:
    return estimate.status is Status.CONTACT and np.allclose(
        estimate.contacts[0].position, contact.position, atol=1e-9
    )


@pytest.mark.parametrize("shear", SHEARS)
@pytest.mark.parametrize("force", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("skin", ["planar", "long_planar"])
def test_every_cell_is_found_without_noise(request, skin, force, shear):
    design = request.getfixturevalue(skin)
    contacts = touches(design, force, shear)
    for contact, estimate in zip(
        contacts,
        estimates(ReducedTwin(design, seed=None), ClosedFormEstimator(design), contacts),
        strict=True,
    ):
        assert located(estimate, contact), (contact, estimate)
        seen = estimate.contacts[0]
        assert seen.normal_force == pytest.approx(force, rel=0.025)
        # Pressed straight, the lower chip still feels the upper magnets move: 0.2 % of the press.
        within = 0.025 * np.hypot(*shear) if any(shear) else 0.003 * force
        np.testing.assert_allclose(seen.force[:2], shear, atol=within)


@pytest.mark.slow
def test_3600_noisy_touches_fall_on_the_right_cell(planar):
    twin, estimator = ReducedTwin(planar, seed=3), ClosedFormEstimator(planar)
    contacts = touches(planar, 0.5, (0.0, 0.0)) * 100
    hits = [
        located(e, c) for e, c in zip(estimates(twin, estimator, contacts), contacts, strict=True)
    ]
    assert len(hits) == 3600
    assert np.mean(hits) >= 0.98


def scattered(design, rng):
    """A skin near the design: other attenuation, magnets, gaps and folding corrections."""
    coefficients = design.coefficients
    v_a = tuple(float(v * rng.uniform(0.95, 1.05)) for v in coefficients.attenuation)
    magnets = tuple(
        replace(m, remanence=m.remanence * rng.uniform(0.98, 1.02)) for m in design.magnets
    )
    halls = tuple(replace(s, gap=s.gap * rng.uniform(0.99, 1.01)) for s in design.halls)
    return replace(
        design, magnets=magnets, halls=halls, coefficients=replace(coefficients, attenuation=v_a)
    )


def test_cells_are_found_on_skins_that_are_not_as_designed(planar):
    rng = np.random.default_rng(0)
    hits = []
    for seed in range(10):
        twin, estimator = (
            ReducedTwin(scattered(planar, rng), seed=seed),
            ClosedFormEstimator(planar),
        )
        estimator.zero([twin.read(time=-1.0 + 0.01 * k) for k in range(20)])
        contacts = touches(planar, 0.5, (0.0, 0.0))
        hits += [
            located(e, c)
            for e, c in zip(estimates(twin, estimator, contacts), contacts, strict=True)
        ]
    assert np.mean(hits) >= 0.98


def test_a_skin_far_from_its_design_is_read_by_its_own_table(planar):
    rng = np.random.default_rng(4)
    right, forces = {"theory": [], "table": []}, []
    for seed in range(2):
        v_a = tuple(rng.uniform(0.35, 0.6, 2).tolist())
        coefficients = replace(planar.coefficients, attenuation=v_a)
        skin = plain(scattered(replace(planar, coefficients=coefficients), rng))
        own = replace(reduced_table(skin), design_hash=planar.content_hash)
        for name, known in (("theory", None), ("table", own)):
            twin = ReducedTwin(skin, seed=seed)
            estimator = ClosedFormEstimator(planar, known)
            estimator.zero([twin.read(time=-1.0 + 0.01 * k) for k in range(20)])
            contacts = touches(planar, 0.3, (0.0, 0.0))
            answers = estimates(twin, estimator, contacts)
            right[name] += [located(e, c) for e, c in zip(answers, contacts, strict=True)]
            if name == "table":
                forces += [e.contacts[0].normal_force for e in answers]
    assert np.mean(right["table"]) == 1.0
    assert np.mean(right["theory"]) < 0.9
    np.testing.assert_allclose(forces, 0.3, rtol=0.03)


@pytest.mark.parametrize("shear", SHEARS)
def test_a_table_parts_press_and_drag_as_theory_does(planar, shear):
    """The two ways to read motions agree where the sheet is ideal."""
    skin = plain(planar)
    contacts = touches(skin, 0.5, shear)
    twin = ReducedTwin(skin, seed=0)  # one whose noise goes on: a chip that repeats itself is stuck
    readings = [twin.read([c], time=k) for k, c in enumerate(contacts)]
    theory, table = ClosedFormEstimator(skin), by_table(skin)
    for reading, contact in zip(readings, contacts, strict=True):
        ideal, measured = theory.step(reading), table.step(reading)
        assert located(ideal, contact)
        assert located(measured, contact)
        np.testing.assert_allclose(ideal.contacts[0].force, measured.contacts[0].force, atol=0.015)
        np.testing.assert_allclose(measured.contacts[0].force, contact.force, atol=0.02)


@pytest.mark.parametrize("corners", [[(4, 2), (2, 4), (1, 5)], [(4, 2), (2, 4), (1, 1), (5, 5)]])
@pytest.mark.parametrize("shear", SHEARS[:2])
def test_more_magnets_find_every_cell(planar, corners, shear):
    design = with_magnets(planar, corners)
    assert ambiguities(design) == ()
    contacts = touches(design, 0.5, shear)
    for contact, estimate in zip(
        contacts,
        estimates(ReducedTwin(design, seed=0), ClosedFormEstimator(design), contacts),
        strict=True,
    ):
        assert located(estimate, contact)
        assert estimate.contacts[0].normal_force == pytest.approx(0.5, rel=0.03)


def test_one_magnet_finds_by_a_table_what_its_signs_do_not(planar):
    design = plain(with_magnets(planar, [(2, 4)]))
    contacts = touches(design, 0.5, (0.0, 0.0))
    twin = ReducedTwin(design, seed=0)
    by_signs = estimates(twin, ClosedFormEstimator(design), contacts)
    assert {e.status for e in by_signs} == {Status.AMBIGUOUS}
    with_table = estimates(twin, by_table(design), contacts)
    sure = [
        located(e, c)
        for e, c in zip(with_table, contacts, strict=True)
        if e.status is Status.CONTACT
    ]
    assert 5 < len(sure) < 36
    assert np.mean(sure) > 0.8


def test_cells_that_do_not_separate_are_judged_as_a_whole(planar):
    """Each cell its own direction, as on a real sheet; told apart with every cell's own press."""
    rng = np.random.default_rng(0)
    answers = ideal_answers(planar, rng.uniform(0.7, 1.3, (6, 6, 3, 3)))
    motions = 0.4 * answers.motions[..., 0].reshape(36, -1)
    solution = solve_all(MeasuredSheet(planar, answers), motions)
    np.testing.assert_array_equal(solution.cell, list(np.ndindex(6, 6)))
    np.testing.assert_allclose(solution.force, np.tile((0.0, 0.0, -0.4), (36, 1)), atol=1e-9)


def test_covariance_is_the_cells_size_and_the_chips_noise(planar):
    twin, estimator = ReducedTwin(planar, seed=0), ClosedFormEstimator(planar)
    contact = touches(planar, 0.5, (0.2, 0.0))[14]
    many = estimates(twin, estimator, [contact] * 400)
    deviation = np.sqrt(np.diag(many[0].covariance[0]))
    np.testing.assert_allclose(deviation[:2], [5.77e-3, 7.70e-3], rtol=1e-2)
    shear = np.array([e.contacts[0].force[:2] for e in many])
    ratio = shear.std(axis=0) / deviation[2:4]
    assert np.all((ratio > 0.5) & (ratio < 2.0)), ratio


def test_presses_anywhere_in_the_cells_scatter_as_stated(planar):
    rng = np.random.default_rng(5)
    twin, estimator = ReducedTwin(planar, seed=5), ClosedFormEstimator(planar)
    contacts = [
        Contact(position=rng.uniform((0, 0), (0.1199, 0.1599)), force=(0.0, 0.0, -0.6))
        for _ in range(600)
    ]
    scores = []
    for contact, estimate in zip(contacts, estimates(twin, estimator, contacts), strict=True):
        assert estimate.status is Status.CONTACT
        seen = estimate.contacts[0]
        off = np.array([*(seen.position - contact.position), seen.force[2] + 0.6])
        scores.append(off / np.sqrt(np.diag(estimate.covariance[0])[[0, 1, 4]]))
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    assert np.all((rms > 0.7) & (rms < 1.4)), rms


def test_a_field_of_no_place_is_out_of_range(planar):
    reading = Reading(time=0.0, field=np.full((3, 3), 0.02))
    assert ClosedFormEstimator(planar).step(reading).status is Status.OUT_OF_RANGE


def test_wrong_use_is_named(planar):
    other = replace(planar, name="4x5", cells=(5, 6))
    with pytest.raises(ModelError, match="calibration must be of the design '4x5'"):
        ClosedFormEstimator(other, Calibration.nominal(planar))
    no_base = replace(planar, halls=planar.halls[1:])
    with pytest.raises(ArgumentError, match="one over a magnet of the base; got 2 and 0"):
        ClosedFormEstimator(no_base)
    with pytest.raises(ArgumentError, match="must come from 3 chips"):
        ClosedFormEstimator(planar).step(Reading(time=0.0, field=np.zeros((5, 3))))
    with pytest.raises(ModelError, match="table must be of the design"):
        ClosedFormEstimator(planar, reduced_table(plain(planar)))
