"""Press tables learned of virtual skins: of the reduced model, whose answers are known, and of the
whole sheet, on which theory's rule fails."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.commands.fit_paper import calibrate, write_virtual_bench
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics import mlx90393
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness, stiffness_map
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Reading, Status
from smoskin.sensing.closed_form.calibration import Calibration, read_calibration
from smoskin.sensing.closed_form.confidence import ambiguities
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.closed_form.location import unit_press
from smoskin.sensing.closed_form.table_fit import (
    drags_every_cell,
    fit_press_table,
    learn_press_table,
    presses_every_cell,
)
from smoskin.twin.bench import TwinSkin, calibration_loads, made_skin, measure, table_loads

DATE, SHA = "2026-01-31", "0" * 64


def fitted(design, touches):
    return fit_press_table(design, touches, date=DATE, data_sha256=SHA)


def changed(touches, **columns):
    names = ("cell", "force", "depth", "field", "temperature")
    return TouchTable(**{name: columns.get(name, getattr(touches, name)) for name in names})


def straight(loads):
    """The loads of one straight press a cell."""
    return [load for load in loads if not any(load.force[:2])]


@pytest.fixture(scope="module")
def reduced(planar):
    """A made skin of the reduced model and a bench's touches of it."""
    skin = made_skin(planar, np.random.default_rng(7))
    loads = table_loads(planar)
    return skin, measure(skin, loads, np.random.default_rng(8), gauge_noise=0.005)


def test_a_skin_of_the_reduced_model_gives_theory_s_table(planar, reduced):
    skin, touches = reduced
    fit = fitted(planar, touches)
    calibration, made = fit.calibration, skin.design
    spread = calibration.evidence.uncertainty
    for name, true in (
        ("board_stiffness", board_stiffness(made)),
        ("sheet_stiffness", sheet_stiffness(made)),
    ):
        off = abs(getattr(calibration, name) - true)
        assert off < 4 * getattr(spread, name) + 0.01 * true, name
    for axis in "xy":
        name = f"folding_correction_{axis}"
        found = np.array(getattr(calibration.coefficients, name))
        true = np.array(getattr(made.coefficients, name))
        np.testing.assert_allclose(found, true, rtol=0.1)
        assert (np.abs(found - true) < 4 * np.array(getattr(spread, name))).all()
    factor = [
        planar.magnet(s.magnet).remanence / made.magnet(s.magnet).remanence for s in planar.halls
    ]
    np.testing.assert_allclose(calibration.field_factor, factor, rtol=5e-3)
    theory = -unit_press(made) / stiffness_map(made, made.coefficients)[..., None, None]
    press = calibration.press_table.press
    np.testing.assert_allclose(press[:, :, 1:, :2], theory, atol=0.04 * np.abs(theory).max())
    # Chips turned by up to two degrees see some of a motion across it.
    assert np.abs(press[:, :, 1:, 2]).max() < 0.05 * np.abs(theory).max()
    assert np.abs(press[:, :, 0]).max() < 0.05 * np.abs(theory).max()
    assert np.isnan(spread.attenuation).all()
    assert calibration.coefficients.attenuation == planar.coefficients.attenuation
    assert np.isnan(fit.noise).all()


def test_without_drags_the_sheet_is_taken_to_slide_as_a_whole(planar, reduced):
    _, touches = reduced
    alone = touches.rows(np.abs(touches.force[:, :2]).max(axis=1) < 0.05)
    assert drags_every_cell(planar, touches)
    assert not drags_every_cell(planar, alone)
    fit = fitted(planar, alone)
    assert fit.calibration.board_stiffness == board_stiffness(planar)
    assert np.isnan(fit.calibration.evidence.uncertainty.board_stiffness)
    assert fit.calibration.coefficients == planar.coefficients
    assert np.ptp(fit.calibration.press_table.drag, axis=(0, 1)).max() == 0


def test_presses_of_one_cell_are_weighed_by_their_force(planar, reduced):
    skin, touches = reduced
    calibration = fitted(planar, touches).calibration
    loads = straight(table_loads(planar))
    many = loads + [replace(load, force=(0.0, 0.0, -1.0)) for load in loads if load.cell]
    quiet = measure(skin, loads, np.random.default_rng(0), gauge_noise=0.0)
    twice = measure(skin, many, np.random.default_rng(0), gauge_noise=0.0)
    one = learn_press_table(planar, calibration, quiet)
    other = learn_press_table(planar, calibration, twice)
    size = np.abs(one.press).max()
    np.testing.assert_allclose(one.press, other.press, atol=0.05 * size)


def test_touches_to_spare_tell_the_noise(planar, reduced):
    skin, _ = reduced
    loads = table_loads(planar) + tuple(straight(table_loads(planar))) * 3
    touches = measure(skin, loads, np.random.default_rng(3), gauge_noise=0.03)
    force, depth, field = fitted(planar, touches).noise
    assert force == pytest.approx(0.03, rel=0.25)
    assert np.isnan(depth)
    assert 0 < field < 1e-4


def test_the_bench_decides_how_a_skin_is_calibrated(planar, reduced, tmp_path):
    _, touches = reduced
    assert presses_every_cell(planar, touches)
    skin = made_skin(planar, np.random.default_rng(1))
    paper = measure(skin, calibration_loads(planar), np.random.default_rng(1))
    assert not presses_every_cell(planar, paper)
    assert not presses_every_cell(planar, changed(touches, field=touches.field[:, :0]))


def test_what_was_not_measured_is_named(planar, reduced):
    _, touches = reduced
    left = ~(touches.cell == (2, 4)).all(axis=1) | (np.abs(touches.force[:, 0]) > 0.1)
    left &= ~(touches.cell == (5, 0)).all(axis=1)
    with pytest.raises(ModelError, match=r"every cell straight .* missing: \(3, 5\), \(6, 1\)$"):
        fitted(planar, touches.rows(left))
    with pytest.raises(ModelError, match=r"two readings of the untouched skin.*; got 0"):
        fitted(planar, touches.rows(touches.touched))
    field = touches.field.copy()
    field[touches.touched, 1, 2] = 1.0
    with pytest.raises(ModelError, match=r"within their range .*; missing: \(1, 1\), \(1, 2\)"):
        fitted(planar, changed(touches, field=field))
    field = touches.field * np.array([1.0, -1.0, 1.0])[:, None]
    with pytest.raises(ModelError, match=r"chip S2 must see its magnet.*axes and polarity"):
        fitted(planar, changed(touches, field=field))
    force = touches.force * (-1.0, -1.0, 1.0)
    with pytest.raises(ModelError, match=r"fit no board_stiffness.*signs of the forces"):
        fitted(planar, changed(touches, force=force))
    with pytest.raises(ArgumentError, match="all 3 chips or of none; got 2"):
        fitted(
            planar,
            changed(touches, field=touches.field[:, :2], temperature=touches.temperature[:, :2]),
        )


def readings(twin, motion, rng, start):
    """One reading of each state."""
    setting = twin.design.hall_setting
    sample = twin.sample(motion, rng)
    field, warmth = (
        mlx90393.tesla(sample.counts, setting),
        mlx90393.degrees(sample.temperature_counts),
    )
    return [
        Reading(time=start + 0.01 * k, field=field[k], temperature=warmth[k], flags=sample.flags[k])
        for k in range(len(field))
    ]


def states(motion, repeats):
    return motion[np.repeat(np.arange(len(motion.board)), repeats)]


def right_cells(twin, calibrations, motion, repeats, rng):
    """Share of readings, for each calibration, that name the cell pressed, and their forces."""
    design = twin.design
    cells = geometry(design).tops.reshape(-1, 2).repeat(repeats, axis=0)
    untouched = twin.motions(Touches(position=np.full((1, 1, 2), 0.05), force=np.zeros((1, 1, 3))))
    zero = readings(twin, states(untouched, 20), rng, -10.0)
    seen = readings(twin, states(motion, repeats), rng, 0.0)
    shares, forces = [], []
    for calibration in calibrations:
        estimator = ClosedFormEstimator(design, calibration)
        estimator.zero(zero)
        found = [
            estimate.contacts[0].force
            for estimate, cell in zip(estimator.batch(seen), cells, strict=True)
            if estimate.status is Status.CONTACT
            and np.allclose(estimate.contacts[0].position, cell, atol=1e-6)
        ]
        shares.append(len(found) / len(seen))
        forces.append(np.array(found))
    return shares, forces


def pressed(twin, force):
    """The same touch on every cell."""
    places = geometry(twin.design).tops.reshape(-1, 1, 2)
    return twin.motions(Touches(position=places, force=np.broadcast_to(force, (len(places), 1, 3))))


@pytest.fixture(scope="module")
def whole(planar):
    """A manufactured whole-sheet skin, and calibrations by one and by three touches a cell."""
    pytest.importorskip("jax")
    from smoskin.twin.whole import Twin

    twin = Twin(planar, seed=0, manufactured=True)
    touches = measure(TwinSkin(twin), table_loads(planar), np.random.default_rng(0))
    alone = touches.rows(np.abs(touches.force[:, :2]).max(axis=1) < 0.05)
    return twin, fitted(planar, alone).calibration, fitted(planar, touches).calibration


def test_a_whole_sheet_is_read_by_its_table_and_not_by_theory(whole):
    twin, one_press, three = whole
    nominal = Calibration.nominal(twin.design)
    motion = pressed(twin, (0.0, 0.0, -0.5))
    rng = np.random.default_rng(1)
    shares, forces = right_cells(twin, (nominal, one_press, three), motion, 10, rng)
    assert shares[0] < 0.5
    assert shares[1] >= 0.95
    assert shares[2] >= 0.95
    for force in forces[1:]:
        np.testing.assert_allclose(force[:, 2], -0.5, rtol=0.08)
        assert np.abs(force[:, :2]).max() < 0.01


def test_cells_that_were_dragged_are_found_under_drag(whole):
    twin, one_press, three = whole
    motion = pressed(twin, (0.2, -0.25, -0.5))
    shares, forces = right_cells(twin, (one_press, three), motion, 1, np.random.default_rng(2))
    assert shares[0] < 0.9 < 0.97 < shares[1]
    off = forces[1] - (0.2, -0.25, -0.5)
    np.testing.assert_array_less(np.sqrt(np.mean(off**2, axis=0)), (0.02, 0.02, 0.03))


def test_hardly_any_cells_of_a_whole_sheet_are_confused(whole):
    _, _, three = whole
    listed = ambiguities(whole[0].design, calibration=three, force=1e-6)
    assert len(listed) == 36 * 35 / 2
    assert listed[0].force < 0.2
    assert listed[0].axis == "both"
    assert "told apart from" in str(listed[0])


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_3600_presses_on_ten_manufactured_skins_fall_on_the_right_cell(planar):
    pytest.importorskip("jax")
    from smoskin.twin.whole import Twin

    shares = []
    for seed in range(10):
        twin = Twin(planar, seed=seed, manufactured=True)
        rng = np.random.default_rng(100 + seed)
        table = fitted(planar, measure(TwinSkin(twin), straight(table_loads(planar)), rng))
        both = (Calibration.nominal(planar), table.calibration)
        motion = pressed(twin, (0.0, 0.0, -0.5))
        shares.append(right_cells(twin, both, motion, 10, rng)[0])
    theory, measured = np.mean(shares, axis=0)
    assert measured >= 0.95
    assert theory < 0.5


def test_a_whole_sheet_goes_from_bench_to_file_to_estimator(planar, tmp_path):
    pytest.importorskip("jax")
    write_virtual_bench(planar, tmp_path / "touches.csv", seed=3)
    result = calibrate(planar, tmp_path / "touches.csv", tmp_path / "skin.toml", date=DATE)
    assert read_calibration(tmp_path / "skin.toml", planar).press_table is not None
    shown = result.as_json()["press_table"]
    assert shown["cells"] == 36
    assert shown["drags_measured"] is True
    assert shown["pairs_confused_at_0.5_N"] == 0
    assert [table.title for table in result.tables()][-1] == "Press table"
    with pytest.raises(ModelError, match=r"the touches (cannot determine|fit no)"):
        calibrate(
            planar, tmp_path / "touches.csv", tmp_path / "no.toml", date=DATE, method="reduced"
        )
