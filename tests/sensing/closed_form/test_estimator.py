"""The closed-form estimator on the twin, and on skins that are not what it believes."""

from dataclasses import replace

import numpy as np
import pytest
from smoskin.sensing.closed_form.press_table import PressTable, uniform_drag

from skins import with_magnets
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.inversion import FieldInverse
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Reading, Status
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import ambiguities
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.twin.reduced import ReducedTwin
from tables import ideal_table

SHEARS = [(0.0, 0.0), (0.5, 0.0), (0.0, -0.5), (-0.35, 0.35)]


def touches(design, force, shear):
    """One contact on each cell's vertex."""
    places = geometry(design).tops.reshape(-1, 2)
    return [Contact(position=place, force=(*shear, -force)) for place in places]


def estimates(twin, estimator, contacts):
    return estimator.batch([twin.read([c], time=0.01 * k) for k, c in enumerate(contacts, 1)])


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
        assert seen.normal_force == pytest.approx(force, rel=0.02)
        # Pressed straight, the lower chip still feels the upper magnets move: 0.2 % of the press.
        within = 0.02 * np.hypot(*shear) if any(shear) else 0.003 * force
        np.testing.assert_allclose(seen.force[:2], shear, atol=within)


def test_3600_noisy_touches_fall_on_the_right_cell(planar):
    twin, estimator = ReducedTwin(planar, seed=3), ClosedFormEstimator(planar)
    contacts = touches(planar, 0.5, (0.0, 0.0)) * 100
    found = [
        located(e, c) for e, c in zip(estimates(twin, estimator, contacts), contacts, strict=True)
    ]
    assert len(found) == 3600
    assert np.mean(found) >= 0.98


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
    found = []
    for seed in range(10):
        twin, estimator = (
            ReducedTwin(scattered(planar, rng), seed=seed),
            ClosedFormEstimator(planar),
        )
        estimator.zero([twin.read(time=-1.0 + 0.01 * k) for k in range(20)])
        contacts = touches(planar, 0.5, (0.0, 0.0))
        found += [
            located(e, c)
            for e, c in zip(estimates(twin, estimator, contacts), contacts, strict=True)
        ]
    assert np.mean(found) >= 0.98


def test_batch_and_step_give_the_same_numbers(planar):
    twin = ReducedTwin(planar, seed=1)
    contacts = touches(planar, 0.4, (0.1, -0.2))
    readings = []
    for k in range(400):
        touched = [contacts[k // 10 % 36]] if k // 10 % 2 else []
        readings.append(twin.read(touched, time=0.01 * k))
    readings[50] = Reading(time=readings[50].time, field=np.full((3, 3), np.nan))
    batch, steps = ClosedFormEstimator(planar), ClosedFormEstimator(planar)
    for together, alone in zip(batch.batch(readings), map(steps.step, readings), strict=True):
        assert together.status is alone.status
        assert len(together.contacts) == len(alone.contacts)
        for one, other in zip(together.contacts, alone.contacts, strict=True):
            np.testing.assert_array_equal(one.position, other.position)
            np.testing.assert_allclose(one.force, other.force, rtol=1e-9, atol=1e-12)


def with_table(design, table):
    """The nominal calibration with this press table."""
    return replace(Calibration.nominal(design), press_table=table)


def measured_table(design, skin):
    """One press of half a newton on each cell of a skin, as an estimator of the design sees it."""
    twin, inverse = ReducedTwin(skin, seed=None), FieldInverse(design)
    presses = touches_of([[c] for c in touches(design, 0.5, (0.0, 0.0))])
    fields = twin.field(twin.motions(presses)) - twin.field(twin.motion())
    press = inverse.displacements(fields + inverse.rest_field).moved / 0.5
    return PressTable(press=press.reshape(*design.cells, -1, 3), drag=uniform_drag(design))


def test_a_measured_table_finds_the_cells_of_a_skin_far_from_its_design(planar):
    rng = np.random.default_rng(4)
    right, forces = {"theory": [], "table": []}, []
    for seed in range(4):
        v_a = tuple(rng.uniform(0.35, 0.6, 2).tolist())
        coefficients = replace(planar.coefficients, attenuation=v_a)
        skin = scattered(replace(planar, coefficients=coefficients), rng)
        own = with_table(planar, measured_table(planar, skin))
        for name, calibration in (("theory", None), ("table", own)):
            twin = ReducedTwin(skin, seed=seed)
            estimator = ClosedFormEstimator(planar, calibration)
            estimator.zero([twin.read(time=-1.0 + 0.01 * k) for k in range(20)])
            contacts = touches(planar, 0.3, (0.0, 0.0))
            found = estimates(twin, estimator, contacts)
            right[name] += [located(e, c) for e, c in zip(found, contacts, strict=True)]
            if name == "table":
                forces += [e.contacts[0].normal_force for e in found]
    assert np.mean(right["table"]) == 1.0
    assert np.mean(right["theory"]) < 0.9
    np.testing.assert_allclose(forces, 0.3, rtol=0.03)


@pytest.mark.parametrize("shear", SHEARS)
def test_a_table_parts_press_and_drag_as_theory_does(planar, shear):
    """The two ways to read motions agree where the sheet is ideal."""
    contacts = touches(planar, 0.5, shear)
    readings = [ReducedTwin(planar, seed=0).read([c], time=k) for k, c in enumerate(contacts)]
    ways = (None, with_table(planar, ideal_table(planar)))
    for one, other, contact in zip(
        *(ClosedFormEstimator(planar, way).batch(readings) for way in ways), contacts, strict=True
    ):
        assert located(one, contact)
        assert located(other, contact)
        np.testing.assert_allclose(one.contacts[0].force, other.contacts[0].force, atol=0.01)
        np.testing.assert_allclose(other.contacts[0].force, contact.force, atol=0.02)


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
    design = with_magnets(planar, [(2, 4)])
    contacts = touches(design, 0.5, (0.0, 0.0))
    readings = [ReducedTwin(design, seed=0).read([c], time=k) for k, c in enumerate(contacts)]
    by_signs = ClosedFormEstimator(design).batch(readings)
    assert {e.status for e in by_signs} == {Status.AMBIGUOUS}
    own = with_table(design, ideal_table(design))
    by_table = ClosedFormEstimator(design, own).batch(readings)
    named = {cell for one in ambiguities(design, calibration=own) for cell in one.pair}
    for k, (estimate, contact) in enumerate(zip(by_table, contacts, strict=True)):
        if divmod(k, 6) not in named:
            assert located(estimate, contact), k
    assert 0 < len(named) < 36


def test_a_table_that_does_not_separate_is_judged_as_a_whole(planar):
    """Each cell its own direction, as on a real sheet; told apart with every cell's own press."""
    rng = np.random.default_rng(0)
    table = ideal_table(planar, rng.uniform(0.7, 1.3, (6, 6, 3, 3)))
    estimator = ClosedFormEstimator(planar, with_table(planar, table))
    places, charges = point_charges([planar.magnet(site.magnet) for site in planar.halls])
    for n, m in np.ndindex(6, 6):
        chips = np.zeros((3, 3))
        chips[:, 2] = geometry(planar).rest[:, 2]
        chips += 0.4 * table.press[n, m]
        field = charge_field_and_gradient(places, charges, chips)[0]
        solution = estimator.solve(field[None])
        assert solution.cell[0].tolist() == [n, m]
        np.testing.assert_allclose(solution.force[0], (0.0, 0.0, -0.4), atol=2e-3)


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
    with pytest.raises(ModelError, match="calibration must belong to design '4x5'"):
        ClosedFormEstimator(other, Calibration.nominal(planar))
    no_base = replace(planar, halls=planar.halls[1:])
    with pytest.raises(ArgumentError, match="one over a magnet of the base; got 2 and 0"):
        ClosedFormEstimator(no_base)
    with pytest.raises(ArgumentError, match="must come from 3 chips"):
        ClosedFormEstimator(planar).step(Reading(time=0.0, field=np.zeros((5, 3))))
    table = ideal_table(planar)
    with pytest.raises(ModelError, match=r"design's cells and chips, \(6, 6, 3\); got \(5, 6, 3\)"):
        ClosedFormEstimator(
            planar, with_table(planar, PressTable(press=table.press[:5], drag=table.drag[:5]))
        )
