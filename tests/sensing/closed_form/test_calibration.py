"""Calibration of virtual skins that differ from the design, against what they really are."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t

from smoskin.commands.fit_paper import (
    CalibrationReport,
    fit_paper,
    residual_figure,
    write_virtual_bench,
)
from smoskin.errors import ArgumentError, ModelError
from smoskin.measurement import write_touches
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Reading, Status
from smoskin.sensing.closed_form.calibration import (
    Calibration,
    format_calibration,
    parse_calibration,
    read_calibration,
)
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.closed_form.fitting import fit_calibration, rough_fit
from smoskin.sensing.closed_form.press_model import PressModel, touched_cells
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.twin.bench import calibration_loads, made_skin, measure
from smoskin.twin.reduced import ReducedTwin

DATE = "2026-01-31"
SHA = "0" * 64


def bench(design, seed):
    """A made skin and its table."""
    rng = np.random.default_rng(seed)
    skin = made_skin(design, rng)
    return skin, measure(skin, calibration_loads(design), rng)


def fitted(design, table, **options):
    return fit_calibration(design, table, date=DATE, data_sha256=SHA, **options)


@pytest.fixture(scope="module")
def skin_and_fit(planar):
    skin, table = bench(planar, 7)
    return skin, fitted(planar, table)


def without_readings(table):
    rows = len(table.force)
    return replace(table, field=np.zeros((rows, 0, 3)), temperature=np.zeros((rows, 0)))


def on_cell(design, table, cell):
    """Touches on a cell's vertex, (T,)."""
    return table.touched & (touched_cells(design, table) == cell).all(axis=1)


def truth(design, skin):
    """The numbers of a skin in the order of `numbers_of`."""
    made, c = skin.design, skin.design.coefficients
    factor = [
        design.magnet(s.magnet).remanence / made.magnet(s.magnet).remanence for s in design.halls
    ]
    return {
        "v_a": np.array(c.attenuation),
        "v_s": np.array([c.stiffness_variation]),
        "v_f": np.array([*c.folding_correction_x, *c.folding_correction_y]),
        "K_sf": np.array([board_stiffness(made)]),
        "sheet": np.array([sheet_stiffness(made)]),
        "rotation": np.ravel(skin.deviations.chips.turn),
        "k_c": np.array(factor),
    }


def numbers_of(calibration):
    """Numbers and standard uncertainties of a calibration."""
    c, u = calibration.coefficients, calibration.evidence.uncertainty
    return {
        "v_a": (c.attenuation, u.attenuation),
        "v_s": ([c.stiffness_variation], [u.stiffness_variation]),
        "v_f": (
            [*c.folding_correction_x, *c.folding_correction_y],
            [*u.folding_correction_x, *u.folding_correction_y],
        ),
        "K_sf": ([calibration.board_stiffness], [u.board_stiffness]),
        "sheet": ([calibration.sheet_stiffness], [u.sheet_stiffness]),
        "rotation": (np.ravel(calibration.chip_rotation), np.ravel(u.chip_rotation)),
        "k_c": (calibration.field_factor, u.field_factor),
    }


def scores(true, calibration):
    """Errors over standard uncertainties, by number."""
    return {
        name: (np.array(values) - true[name]) / np.array(spread)
        for name, (values, spread) in numbers_of(calibration).items()
    }


def test_a_scattered_skin_is_found_within_its_own_uncertainty(planar, skin_and_fit):
    skin, fit = skin_and_fit
    for name, score in scores(truth(planar, skin), fit.calibration).items():
        assert np.abs(score).max() < 4, (name, score)
    force, depth, field = fit.noise
    assert force == pytest.approx(0.02, rel=0.2)
    # The stage shows micrometres, a hundredth of what stiff columns sink.
    assert depth == pytest.approx(0.02, rel=0.35)
    assert 1e-6 < field < 3e-6


def test_a_fit_comes_to_the_same_numbers_as_ever(skin_and_fit):
    fit = skin_and_fit[1]
    assert fit.noise == pytest.approx((1.9276473e-2, 1.3754434e-2, 1.9004266e-6), rel=1e-5)
    assert fit.calibration.coefficients.attenuation[0] == pytest.approx(0.3690968, rel=1e-6)
    assert fit.calibration.sheet_stiffness == pytest.approx(6719.1878, rel=1e-6)


def test_a_rough_fit_of_a_wrong_sheet_comes_as_far_as_ever(planar):
    table = bench(planar, 7)[1]
    twice = replace(table, depth=2 * table.depth)
    assert rough_fit(planar, twice).misfit.mean() == pytest.approx(5.2462655, rel=2e-4)


def test_the_paper_s_v_f_are_found_again(planar):
    rng = np.random.default_rng(3)
    design = replace(planar, coefficients=replace(planar.coefficients, stiffness_variation=1.3))
    assert design.coefficients.folding_correction_x == (0.6, 0.75, 0.9)
    assert design.coefficients.folding_correction_y == (0.9, 1.0, 1.1)
    skin = ReducedTwin(design, seed=None)
    guess = replace(
        planar,
        coefficients=replace(
            planar.coefficients,
            folding_correction_x=(1.0, 1.0, 1.0),
            folding_correction_y=(1.0, 1.0, 1.0),
        ),
    )
    c = fitted(guess, measure(skin, calibration_loads(planar), rng)).calibration.coefficients
    np.testing.assert_allclose(c.folding_correction_x, (0.6, 0.75, 0.9), rtol=0.06)
    np.testing.assert_allclose(c.folding_correction_y, (0.9, 1.0, 1.1), rtol=0.06)


def test_with_a_perfect_gauge_little_is_off(planar):
    skin = made_skin(planar, np.random.default_rng(11))
    quiet = measure(skin, calibration_loads(planar), np.random.default_rng(0), gauge_noise=0.0)
    c = fitted(planar, quiet).calibration
    for name, (values, _) in numbers_of(c).items():
        rtol, atol = (0, 1e-3) if name in ("rotation", "v_a") else (7e-3, 0)
        np.testing.assert_allclose(
            values, truth(planar, skin)[name], rtol=rtol, atol=atol, err_msg=name
        )


def test_separate_attenuations_are_told_apart(planar):
    skin = made_skin(planar, np.random.default_rng(2))
    design = replace(
        skin.design, coefficients=replace(skin.design.coefficients, attenuation=(0.3, 0.2))
    )
    made = ReducedTwin(design, seed=None, deviations=skin.deviations)
    table = measure(made, calibration_loads(planar), np.random.default_rng(4))
    fit = fitted(planar, table, attenuation="separate")
    np.testing.assert_allclose(fit.calibration.coefficients.attenuation, (0.3, 0.2), atol=2e-3)


def test_readings_tell_v_a_better_than_stiffness(planar):
    pytest.importorskip("matplotlib")
    skin, table = bench(planar, 5)
    gauge_fit = fitted(planar, without_readings(table))
    by_gauge = gauge_fit.calibration
    by_all = fitted(planar, table).calibration
    v_a = skin.design.coefficients.attenuation[0]
    spreads = [c.evidence.uncertainty.attenuation[0] for c in (by_gauge, by_all)]
    assert spreads[1] < spreads[0] / 10
    assert abs(by_gauge.coefficients.attenuation[0] - v_a) < 4 * spreads[0]
    assert math.isnan(by_gauge.evidence.uncertainty.board_stiffness)
    assert by_gauge.board_stiffness == board_stiffness(planar)
    assert "nan" in format_calibration(by_gauge)
    shown = CalibrationReport(design=planar, fit=gauge_fit).as_json()
    numbers = {line["name"]: line for line in shown["numbers"]}
    assert numbers["board_stiffness_N_per_mm"]["standard_uncertainty"] is None
    assert len(residual_figure(gauge_fit).axes) == 3


def test_derivatives_are_those_of_differences(planar):
    _, table = bench(planar, 1)
    model = PressModel(planar, table.rows(np.arange(0, len(table.force), 9)), 2)
    rng = np.random.default_rng(0)
    values = model.start(Calibration.nominal(planar))
    values[model.layout.attenuation] = (0.3, 0.25)
    values[model.layout.chip_rotation] = rng.normal(0, 0.01, 9)
    values[model.layout.field_factor] = (0.97, 1.02, 1.01)
    values[model.layout.field_offset] = rng.normal(0, 1e-4, 9)
    own = np.column_stack([model.depth, model.touches.force[:, :2]])
    own += np.array([1e-5, 0.02, 0.03])  # off the kink of |F_p| at zero
    _, by_own, by_skin = model.predict(values, own)
    for k in range(model.size):
        step = 1e-6 * np.eye(model.size)[k]
        up, down = (model.predict(values + side * step, own)[0] for side in (1, -1))
        slope = (up - down) / 2e-6
        off = np.abs(slope - by_skin[..., k]).max()
        assert off < 2e-3 * np.abs(slope).max(), (k, off, np.abs(slope).max())
    for k, size in enumerate((1e-9, 1e-6, 1e-6)):
        step = size * np.eye(3)[k]
        up, down = (model.predict(values, own + side * step)[0] for side in (1, -1))
        np.testing.assert_allclose((up - down) / (2 * size), by_own[..., k], rtol=1e-4, atol=1e-6)


def force_errors(skin, estimator, touches, seed):
    """Relative errors of the force vector on known touches, after zeroing."""
    twin = ReducedTwin(skin.design, seed=seed, deviations=skin.deviations)
    estimator.zero([twin.read(time=-1.0 + 0.01 * k) for k in range(20)])
    errors = []
    for k, touch in enumerate(touches):
        estimate = estimator.step(twin.read([touch], time=0.01 * (k + 1)))
        if estimate.status is Status.CONTACT:
            off = np.linalg.norm(estimate.contacts[0].force - touch.force)
            errors.append(off / np.linalg.norm(touch.force))
        else:
            errors.append(1.0)
    return np.array(errors)


def vertex_touches(skin):
    cells = [(n, m) for n in range(6) for m in range(6)]
    return [
        Contact(position=geometry(skin.design).tops[cell], force=force)
        for cell in cells
        for force in ((0.0, 0.0, -0.4), (0.25, -0.1, -0.7))
    ]


def test_the_fitted_estimator_beats_the_nominal_one_on_its_own_skin(planar, skin_and_fit):
    skin, fit = skin_and_fit
    touches = vertex_touches(skin)
    nominal = force_errors(skin, ClosedFormEstimator(planar), touches, 1)
    own = force_errors(skin, ClosedFormEstimator(planar, fit.calibration), touches, 1)
    assert np.median(own) < 0.02
    assert np.median(own) < np.median(nominal) / 5


def test_calibrating_from_a_file_to_a_file(planar, tmp_path):
    write_virtual_bench(planar, tmp_path / "table.csv", seed=1, sheet="reduced")
    result = fit_paper(planar, tmp_path / "table.csv", tmp_path / "skin.toml", date=DATE)
    again = read_calibration(tmp_path / "skin.toml", planar)
    assert again == result.fit.calibration
    assert again.evidence.date == DATE
    assert len(again.evidence.data_sha256) == 64
    names = {line["name"]: line for line in result.as_json()["numbers"]}
    board = names["board_stiffness_N_per_mm"]
    assert board["nominal"] == pytest.approx(1.6138, rel=1e-3)
    quantile = t.ppf(0.95, again.evidence.freedom)
    assert board["half_width_90_percent"] == pytest.approx(quantile * board["standard_uncertainty"])
    assert [table.title for table in result.tables()][1] == "What the model leaves"


def test_residuals_can_be_drawn(skin_and_fit):
    pytest.importorskip("matplotlib")
    figure = residual_figure(skin_and_fit[1])
    assert [axes.get_ylabel().split(":")[0] for axes in figure.axes] == ["force", "depth", "field"]


number = st.floats(1e-3, 1e3)
small = st.floats(-1, 1)


@given(stiffness=number, folding=number, turn=small, offset=small)
def test_documents_keep_every_bit(planar, stiffness, folding, turn, offset):
    nominal = Calibration.nominal(planar)
    calibration = replace(
        nominal,
        board_stiffness=stiffness,
        coefficients=replace(nominal.coefficients, folding_correction_x=(folding, 1.0, 2.0)),
        chip_rotation=((turn, 0.0, -turn),) * 3,
        field_offset=((offset * 1e-3, 0.0, 1e-5),) * 3,
    )
    assert parse_calibration(format_calibration(calibration)) == calibration


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("board_stiffness_N_per_mm", "board_stifness_N_per_mm", "did you mean 'board_stiffness"),
        ("stiffness_variation = 1.0", "", "missing key 'stiffness_variation'"),
        ("stiffness_variation = 1.0", "stiffness_variation = -1.0", "must be positive"),
        ("stiffness_variation = 1.0", "stiffness_variation = 'a'", "must be a number; got 'a'"),
        ("design_hash", "]", "not a TOML document"),
        (
            "design_hash",
            "press_table = {}\ndesign_hash",
            "press_table is of an older version; touch",
        ),
    ],
)
def test_faulty_documents_are_refused(planar, old, new, message):
    text = format_calibration(Calibration.nominal(planar))
    assert old in text
    with pytest.raises(ModelError, match=message):
        parse_calibration(text.replace(old, new, 1))


def test_a_calibration_of_another_design_is_refused(planar, long_planar, tmp_path):
    path = tmp_path / "skin.toml"
    path.write_text(format_calibration(Calibration.nominal(planar)))
    with pytest.raises(ModelError, match="must be of the design '4x5'"):
        read_calibration(path, long_planar)


def test_what_the_data_cannot_determine_is_named(planar):
    _, table = bench(planar, 0)
    force = table.force
    no_y = ~((np.abs(force[:, 1]) > 0.1) & on_cell(planar, table, (1, 1)))
    with pytest.raises(ModelError, match="folding_correction_y of layer 2"):
        fitted(planar, table.rows(no_y))
    slanted = (np.abs(force[:, :2]) > 0.1).any(axis=1)
    with pytest.raises(ModelError, match=r"determine stiffness_variation.*straight presses; got 0"):
        fitted(planar, table.rows(slanted))
    one_cell = without_readings(table).rows(on_cell(planar, table, (0, 0)))
    with pytest.raises(ModelError, match="folding_correction_x of layer 2"):
        fitted(planar, one_cell)
    unread = np.array(table.field)
    unread[:, 1] = np.nan
    blind = replace(table, field=unread)
    with pytest.raises(ModelError, match=r"field_factor of chip S2.*readings; got 0"):
        fitted(planar, blind)


def test_stiffness_of_one_cell_cannot_tell_v_a(planar):
    """All layers have their slanted loads, but straight presses and stiffness say nothing."""
    _, table = bench(planar, 0)
    few = without_readings(table)
    straight = (np.abs(few.force[:, :2]) < 0.05).all(axis=1)
    layer_one = on_cell(planar, few, (0, 0))
    chosen = (~straight | layer_one) & few.touched
    noisy = few.rows(chosen)
    off = np.random.default_rng(0).uniform(0.6, 1.4, chosen.sum())
    noisy = replace(noisy, depth=noisy.depth * off)
    with pytest.raises(ModelError, match=r"the touches (cannot determine|fit no)"):
        fitted(planar, noisy)


def test_tables_of_other_skins_are_refused(planar, long_planar):
    _, table = bench(planar, 0)
    with pytest.raises(ArgumentError, match="touches must lie on the cells' top vertices"):
        fitted(long_planar, table)
    vertex = table.position[60]
    for off, refused in ((0.99e-3, False), (1.01e-3, True)):
        position = np.array(table.position)
        position[60] = vertex[0] + off, vertex[1]
        moved = replace(table, position=position)
        if refused:
            with pytest.raises(ArgumentError, match=r"top vertices .* in row 61"):
                touched_cells(planar, moved)
        else:
            assert (touched_cells(planar, moved) == touched_cells(planar, table)).all()
    unmeasured = np.array(table.depth)
    unmeasured[30] = np.nan
    with pytest.raises(ArgumentError, match=r"displacement_z_mm.* row 31 does not"):
        fitted(planar, replace(table, depth=unmeasured))
    two = replace(table, field=table.field[:, :2], temperature=table.temperature[:, :2])
    with pytest.raises(ArgumentError, match="all 3 chips or of none; got 2"):
        fitted(planar, two)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_200_skins_are_found_as_well_as_stated(planar):
    errors, inside = {}, {}
    for seed in range(200):
        skin, table = bench(planar, seed)
        calibration = fitted(planar, table).calibration
        true = truth(planar, skin)
        factor = calibration.evidence.coverage_factor(0.9)
        for name, (values, spread) in numbers_of(calibration).items():
            off = np.array(values) - true[name]
            absolute = name in ("v_a", "rotation")
            errors.setdefault(name, []).append(np.abs(off / (1 if absolute else true[name])))
            inside.setdefault(name, []).append(np.abs(off) < factor * np.array(spread))
    ninetieth = {name: np.quantile(np.stack(e), 0.9, axis=0) for name, e in errors.items()}
    assert np.all(ninetieth["v_a"] < 0.02)
    assert np.all(ninetieth["v_s"] < 0.03)
    assert np.all(ninetieth["v_f"] < 0.08)
    covered = {name: float(np.mean(hits)) for name, hits in inside.items()}
    assert all(0.85 <= share <= 0.97 for share in covered.values()), covered


def test_readings_come_from_a_recording_too(planar, tmp_path):
    """A table that says when touches were held, and a recording, are the table with readings."""
    skin = made_skin(planar, np.random.default_rng(3))
    whole = measure(skin, calibration_loads(planar), np.random.default_rng(4))
    rows = len(whole.depth)
    held = np.stack([np.arange(rows) + 0.2, np.arange(rows) + 0.8], axis=1)
    with Recorder(tmp_path / "bench.mcap", planar) as recorder:
        for row in range(rows):
            for step, swing in ((0.0, 1e-3), (0.3, 2e-6), (0.5, 0.0), (0.7, -2e-6)):
                recorder.write(
                    Reading(
                        time=row + step,
                        field=whole.field[row] + swing,
                        temperature=np.full(3, whole.temperature[row]),
                    )
                )
    bare = replace(without_readings(whole), held=held)
    filled = bare.with_readings(open_recording(tmp_path / "bench.mcap").readings())
    np.testing.assert_allclose(filled.field, whole.field, atol=1e-12)
    np.testing.assert_allclose(filled.temperature, whole.temperature)
    late = replace(bare, held=held + 1e6)
    with pytest.raises(ArgumentError, match=r"when row 1 was held; got none"):
        late.with_readings(open_recording(tmp_path / "bench.mcap").readings())

    write_touches(tmp_path / "bench.csv", bare)
    result = fit_paper(
        planar, tmp_path / "bench.csv", tmp_path / "skin.toml",
        date="2026-01-31", recording=tmp_path / "bench.mcap",
    )  # fmt: skip
    direct = fit_calibration(planar, whole, date="2026-01-31", data_sha256="0" * 64)
    assert result.fit.calibration.coefficients.attenuation == pytest.approx(
        direct.calibration.coefficients.attenuation, rel=1e-6
    )
