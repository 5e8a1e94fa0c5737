"""Learned models at run time: statuses, files, and that history sees only the past."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors.numpy import load_file, save_file

from smoskin.errors import ArgumentError, ModelError
from smoskin.records import ChipFlag, Reading, Status
from smoskin.sensing.learned.gaussian_process import (
    LearnedEstimator,
    LearnedModel,
    Metric,
    Output,
    load_model,
)
from smoskin.sensing.learned.inputs import Encoding, Form, Past
from smoskin.sensing.signals.zero import ZeroTracking

CHIPS = 3


def model(outputs=(Output.X, Output.Y), form=Form.DIRECTION, memory=(), chips=(0, 2), seed=0):
    """A model of random numbers, believed near random examples."""
    rng = np.random.default_rng(seed)
    encoding = Encoding(chips=chips, form=form, time_constants=memory)
    inputs = encoding.encode(np.arange(30.0), 1e-3 * rng.normal(size=(30, CHIPS, 3)))
    centre, scale = inputs.mean(axis=0), inputs.std(axis=0)
    count, spread = len(outputs), rng.normal(size=(len(outputs), len(outputs)))
    return LearnedModel(
        encoding=encoding,
        chips_in_reading=CHIPS,
        outputs=outputs,
        place=np.array([0.01, 0.02]),
        touch_field=30e-6,
        centre=centre,
        scale=scale,
        support=(inputs - centre) / scale,
        weights=rng.normal(size=(30, count)),
        slope=rng.normal(size=(len(centre), count)),
        intercept=rng.normal(size=count),
        residual=spread @ spread.T,
        noise=np.array([0.5, 1e-6]),
        gain=np.linspace(0.0, 0.1, count),
        gain_after=1.0,
        reach=4.0,
        data_sha256="0" * 64,
        split="none",
        metrics=(Metric("mean_error", 1e-3, "m"),),
    )


def readings(count=8, seed=0):
    rng = np.random.default_rng(seed)
    fields = 1e-3 * rng.normal(size=(count, CHIPS, 3))
    return [Reading(time=0.1 * (k + 1), field=field) for k, field in enumerate(fields)]


ZERO = np.zeros((CHIPS, 3))


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [(2.5e-3, "m", ("2.5", "mm")), (3e-6, "m^2", ("3", "mm^2")), (0.905, "1", ("90.5", "%")),
     (0.01234, "N", ("0.0123", "N"))],
)  # fmt: skip
def test_figures_are_shown_in_the_units_of_people(value, unit, shown):
    assert Metric("error", value, unit).shown == shown


@pytest.mark.parametrize(("size", "taken"), [(14.9e-6, True), (15.1e-6, False)])
def test_a_zero_is_taken_of_readings_that_move_by_no_more_than_a_chips_noise(size, taken):
    still = [
        Reading(time=0.1 * k, field=np.full((CHIPS, 3), 1e-3) + size * (-1) ** k) for k in range(6)
    ]
    estimator = LearnedEstimator(model(chips=(0, 2)))
    if taken:
        estimator.zero(still)
        assert not estimator.drift.any()
        return
    with pytest.raises(ArgumentError, match=r"let go first; got readings that move by 15\.1 uT"):
        estimator.zero(still)
    estimator.zero(still, force=True)


def test_the_drift_is_that_of_the_chips_in_use():
    following = ZeroTracking(hold=0.0, time_constant=1.0)
    estimator = LearnedEstimator(model(chips=(0, 2)), zero=ZERO, tracking=following)
    assert estimator.drift.shape == (CHIPS, 3)
    for k in range(200):
        estimator.step(Reading(time=0.1 * k, field=np.full((CHIPS, 3), 5e-6)))
    assert (estimator.drift[[0, 2]] > 1e-6).all()
    assert not estimator.drift[1].any()
    with pytest.raises(ArgumentError, match="zero must have been set"):
        estimator.unzero()
    estimator.zero([Reading(time=21.0, field=np.full((CHIPS, 3), 20e-6))])
    assert not estimator.drift.any()
    estimator.unzero()
    assert (estimator.drift[[0, 2]] > 1e-6).all()


def test_a_zero_that_is_taken_back_leaves_no_past():
    used = LearnedEstimator(model(memory=(1.0,)), zero=ZERO)
    some = readings(count=6)
    for reading in some:
        used.step(reading)
    used.zero([Reading(time=0.65, field=np.full((CHIPS, 3), 3e-6))], force=True)
    used.step(replace(some[0], time=0.68))
    used.unzero()
    fresh = LearnedEstimator(model(memory=(1.0,)), zero=ZERO)
    for reading in readings(count=4, seed=3):
        later = replace(reading, time=reading.time + 1.0)
        estimate, expected = used.step(later), fresh.step(later)
        assert estimate.status is expected.status
        for contact, other in zip(estimate.contacts, expected.contacts, strict=True):
            np.testing.assert_array_equal(contact.position, other.position)


def test_outputs_have_the_units_of_places_forces_and_squares():
    units = {output.name: output.unit for output in Output}
    assert units == {
        "X": "m",
        "Y": "m",
        "FX": "N",
        "FY": "N",
        "FZ": "N",
        "XX": "m^2",
        "XY": "m^2",
        "YY": "m^2",
    }


def test_the_mean_is_that_of_its_kernel():
    this = model()
    inputs = this.encoding.encode(np.zeros(1), readings(1)[0].field[None])
    row = (inputs[0] - this.centre) / this.scale
    expected = this.intercept + this.slope.T @ row
    for example, weight in zip(this.support, this.weights, strict=True):
        r = np.sqrt(((row - example) ** 2).sum())
        expected = expected + weight * (1 + r) * np.exp(-r)
    np.testing.assert_allclose(this.predict(inputs).values[0], expected)


@pytest.mark.parametrize("memory", [(), (0.2, 3.0)])
@pytest.mark.parametrize("form", Form)
@pytest.mark.parametrize(
    "outputs", [(Output.X, Output.Y), (Output.FZ,), (Output.Y, Output.X, Output.FX, Output.FZ)]
)
def test_steps_give_what_the_model_predicts_and_only_the_outputs_are_numbers(outputs, form, memory):
    this = replace(model(outputs, form, memory), reach=1e3)
    estimator = LearnedEstimator(this, ZERO)
    stream = readings()
    stepped = [estimator.step(reading) for reading in stream]
    inputs = this.encoding.encode(
        np.array([r.time for r in stream]), np.stack([r.field for r in stream])
    )
    predicted = this.predict(inputs)
    known = sorted(output.value for output in outputs)
    for k, a in enumerate(stepped):
        assert a.status is Status.CONTACT
        rows = [output.value for output in outputs]
        spread = a.covariance[0][np.ix_(rows, rows)]
        np.testing.assert_array_equal(spread, predicted.covariance[k])
        whole = np.concatenate([a.contacts[0].position, a.contacts[0].force])
        np.testing.assert_array_equal(whole[[o.value for o in outputs]], predicted.values[k])
        if Output.X not in outputs:
            np.testing.assert_array_equal(whole[:2], this.place)
        finite = np.isfinite(a.covariance[0])
        assert np.flatnonzero(finite.any(axis=0)).tolist() == known
        assert finite.sum() == len(known) ** 2
        assert np.isnan(np.delete(whole, [*known, 0, 1])).all()


def test_memory_of_strength_is_the_same_at_once_and_live():
    memory = Encoding(
        chips=(0, 1),
        form=Form.DIRECTION,
        time_constants=(0.3, 2.0),
        past=Past.STRENGTH,
        floor=1e-4,
    )
    stream = readings()
    inputs = memory.encode(np.array([r.time for r in stream]), np.stack([r.field for r in stream]))
    this = replace(
        model(form=Form.DIRECTION, chips=(0, 1)),
        encoding=memory,
        centre=np.zeros(9),
        scale=np.ones(9),
        support=inputs,
        weights=np.ones((len(inputs), 2)),
        slope=np.ones((9, 2)),
        gain_after=1.0,
        reach=1e3,
    )
    places = [
        estimator.step(reading).contacts[0].position
        for estimator in [LearnedEstimator(this, ZERO)]
        for reading in stream
    ]
    np.testing.assert_array_equal(places, this.predict(inputs).values)


def test_a_zero_that_follows_takes_drift_out_and_a_still_one_does_not():
    rng = np.random.default_rng(3)
    touch = 1e-3 * rng.normal(size=(CHIPS, 3))
    this = replace(model(), reach=1e6)
    tracking = ZeroTracking(hold=0.5, time_constant=2.0)
    moving, still = LearnedEstimator(this, ZERO, tracking=tracking), LearnedEstimator(this, ZERO)
    (expected,) = LearnedEstimator(this, ZERO).step(Reading(time=0.0, field=touch)).contacts
    for k in range(900):  # 1 uT a second on every axis
        reading = Reading(time=0.1 * k, field=np.full((CHIPS, 3), 1e-7 * k))
        assert moving.step(reading).status is Status.NO_CONTACT
        still.step(reading)
    pressed = Reading(time=90.0, field=touch + 9e-5)
    errors = [
        np.linalg.norm(each.step(pressed).contacts[0].position - expected.position)
        for each in (moving, still)
    ]
    assert errors[0] < 0.1 * errors[1]
    moving.reset()
    (again,) = moving.step(Reading(time=0.0, field=touch)).contacts
    np.testing.assert_allclose(again.position, expected.position)


def test_a_zero_that_moved_too_far_is_not_believed():
    tracking = ZeroTracking(hold=0.0, time_constant=0.1, drift_bound=20e-6)
    estimator = LearnedEstimator(model(), ZERO, tracking=tracking)
    statuses = [
        estimator.step(Reading(time=0.1 * k, field=np.full((CHIPS, 3), 1e-6 * k))).status
        for k in range(1, 60)
    ]
    assert statuses[0] is Status.NO_CONTACT
    assert statuses[-1] is Status.NOT_CALIBRATED


def test_a_model_of_several_touches_is_not_for_this_estimator():
    with pytest.raises(ArgumentError, match="must give one touch; got one of X, Y, XX"):
        LearnedEstimator(model(outputs=(Output.X, Output.Y, Output.XX)))


def test_statuses():
    estimator = LearnedEstimator(model())
    good, *_ = readings(1)
    later = iter(np.arange(1.0, 100.0))

    def status(**changes):
        fields = {"field": good.field, "flags": None, "time": next(later)} | changes
        return estimator.step(Reading(**fields)).status

    assert status() is Status.NOT_CALIBRATED
    estimator.zero(
        [Reading(time=0.0, field=ZERO), Reading(time=0.1, field=np.full((3, 3), np.nan))]
    )
    assert status() is Status.CONTACT
    assert status(time=0.5) is Status.STALE
    for flag, expected in (
        (ChipFlag.MISSING, Status.CHIP_MISSING),
        (ChipFlag.INVALID, Status.CHIP_MISSING),
        (ChipFlag.SATURATED, Status.SATURATED),
        (ChipFlag.WRAPPED, Status.SATURATED),
        (ChipFlag.OLD, Status.STALE),
    ):
        assert status(flags=[0, 0, flag]) is expected
        assert status(flags=[0, flag, 0]) is Status.CONTACT  # not a chip of this model
    assert status(field=np.full((CHIPS, 3), np.inf)) is Status.CHIP_MISSING
    assert status(field=1e-6 * np.ones((CHIPS, 3))) is Status.NO_CONTACT
    assert status(field=1e6 * good.field) is Status.OUT_OF_RANGE
    assert status() is Status.CONTACT
    estimator.reset()
    assert status() is Status.NOT_CALIBRATED


def test_readings_are_believed_up_to_a_novelty_of_one():
    this = model()
    (reading,) = readings(1, seed=5)
    inputs = this.encoding.encode(np.zeros(1), reading.field[None])
    row = (inputs[0] - this.centre) / this.scale
    apart = (row - this.support) / this.support.std(axis=0)
    nearest = np.sqrt((apart**2).sum(axis=1)).min()
    assert this.predict(inputs).novelty[0] == pytest.approx(nearest / 4.0)
    for reach, status in ((1.001, Status.CONTACT), (0.999, Status.OUT_OF_RANGE)):
        estimator = LearnedEstimator(replace(this, reach=reach * nearest), ZERO)
        assert estimator.step(reading).status is status


def test_a_touch_begins_at_the_stated_length_of_the_used_field():
    this = replace(model(), reach=1e6)
    direction = np.zeros((CHIPS, 3))
    direction[[0, 2], [0, 1]] = 0.6, 0.8
    direction[1] = 100.0  # not a chip of this model
    for length, status in ((29.9e-6, Status.NO_CONTACT), (30.1e-6, Status.CONTACT)):
        estimate = LearnedEstimator(this, ZERO).step(Reading(time=0.0, field=length * direction))
        assert estimate.status is status


def test_the_noise_grows_as_the_field_gets_faint():
    this = model()
    field = readings(1)[0].field
    for factor in (1.0, 0.1):
        inputs = this.encoding.encode(np.zeros(1), factor * field[None])
        used = factor * field[[0, 2]]
        squared = (used**2).sum() + this.encoding.floor**2
        predicted = this.predict(inputs)
        expected = (0.5 + 1e-6 / squared) * this.residual + np.diag(
            (this.gain * predicted.values[0]) ** 2
        )
        np.testing.assert_allclose(predicted.covariance[0], expected, rtol=1e-9)


def test_the_zero_is_taken_off():
    offset = 5e-3 * np.arange(9.0).reshape(3, 3)
    plain, shifted = LearnedEstimator(model(), ZERO), LearnedEstimator(model())
    shifted.zero([Reading(time=0.0, field=offset), Reading(time=0.1, field=offset)])
    for reading in readings():
        moved = Reading(time=reading.time, field=reading.field + offset)
        a, b = plain.step(reading), shifted.step(moved)
        assert a.status is b.status
        if a.contacts:
            np.testing.assert_allclose(a.contacts[0].position, b.contacts[0].position, rtol=1e-9)


def test_reset_forgets_the_history():
    estimator = LearnedEstimator(replace(model(memory=(1.0,)), reach=1e3), ZERO)
    first = [estimator.step(reading) for reading in readings()]
    estimator.reset()
    assert [estimator.step(reading) for reading in readings()] == first


@given(cut=st.integers(1, 9), tau=st.floats(0.01, 100.0))
def test_history_sees_only_the_past(cut, tau):
    rng = np.random.default_rng(cut)
    time, field = np.cumsum(rng.uniform(0.01, 0.5, 10)), rng.normal(size=(10, 2, 3))
    encoding = Encoding(chips=(1,), time_constants=(tau,))
    whole = encoding.encode(time, field)
    np.testing.assert_array_equal(encoding.encode(time[:cut], field[:cut]), whole[:cut])


def test_a_held_field_loses_its_lag_with_the_time_constant():
    encoding = Encoding(chips=(0,), time_constants=(2.0,))
    field = np.concatenate([np.zeros((1, 1, 3)), np.ones((2, 1, 3))])
    lag = encoding.encode(np.array([0.0, 1.0, 4.0]), field)[:, 3:]
    np.testing.assert_allclose(lag[:, 0], [0.0, np.exp(-0.5), np.exp(-2.0)])


@given(strength=st.floats(0.1, 10.0))
def test_direction_tells_strength_apart(strength):
    encoding = Encoding(chips=(0, 1, 2), form=Form.DIRECTION)
    field = 1e-2 * np.random.default_rng(0).normal(size=(1, 3, 3))
    weak, strong = (encoding.encode(np.zeros(1), f)[0] for f in (field, strength * field))
    np.testing.assert_allclose(weak[:-1], strong[:-1], atol=1e-6)
    assert strong[-1] - weak[-1] == pytest.approx(np.log(strength), abs=1e-6)
    assert encoding.faintness(weak[None])[0] == pytest.approx(1 / (field**2).sum(), rel=1e-6)


def test_a_file_gives_the_model_back(tmp_path):
    this = model((Output.X, Output.Y, Output.FZ), memory=(1.0, 3.0))
    path = tmp_path / "model.safetensors"
    this.save(path)
    that = load_model(path)
    for name in ("encoding", "outputs", "reach", "split", "metrics", "data_sha256", "touch_field"):
        assert getattr(that, name) == getattr(this, name)
    inputs = np.random.default_rng(0).normal(size=(4, len(this.centre)))
    for a, b in zip(this.predict(inputs), that.predict(inputs), strict=True):
        np.testing.assert_array_equal(a, b)
    assert not that.weights.flags.writeable


def rewritten(path, change):
    """The file at `path` with its description changed."""
    model().save(path)
    arrays = load_file(path)
    size = int.from_bytes(path.read_bytes()[:8], "little")
    spec = json.loads(json.loads(path.read_bytes()[8 : 8 + size])["__metadata__"]["smoskin_model"])
    change(spec, arrays)
    spec.pop("sha256")  # as files of earlier versions
    save_file(arrays, path, metadata={"smoskin_model": json.dumps(spec)})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda spec, arrays: spec.update(format=5), "format must be 4; got 5"),
        (lambda spec, arrays: spec.pop("outputs"), "description is damaged: KeyError"),
        (lambda spec, arrays: spec["input"].update(form="MAGIC"), "description is damaged"),
        (lambda spec, arrays: spec["input"].pop("past"), "description is damaged"),
        (lambda spec, arrays: spec["input"].update(floor_T=0), "model.safetensors: floor must be"),
        (
            lambda spec, arrays: spec["input"].update(chips=[0]),
            r"centre must have shape \(..., 4\)",
        ),
        (lambda spec, arrays: spec["input"].update(chips_in_reading=2), r"uses the chips \(0, 2\)"),
        (lambda spec, arrays: arrays["weights"].fill(np.nan), "weights must be finite"),
        (lambda spec, arrays: arrays["scale"].fill(0.0), "model: scale must be positive"),
        (lambda spec, arrays: arrays.pop("slope"), "a model file of this package"),
        (lambda spec, arrays: spec.update(reach=-1), "reach must be positive"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, change, words):
    path = tmp_path / "model.safetensors"
    rewritten(path, change)
    with pytest.raises(ModelError, match=words):
        load_model(path)


def test_what_is_no_model_file_is_refused(tmp_path):
    path = tmp_path / "model.safetensors"
    with pytest.raises(ModelError, match="cannot be read as a model file"):
        load_model(path)
    path.write_bytes(b"not a model")
    with pytest.raises(ModelError, match="cannot be read as a model file"):
        load_model(path)
    model().save(path)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(ModelError, match="cannot be read as a model file"):
        load_model(path)
    save_file({"weights": np.zeros(3)}, path)
    with pytest.raises(ModelError, match="a model file of this package must be given"):
        load_model(path)


def test_a_model_of_no_examples_or_outputs_is_refused():
    good = model()
    none = {"support": good.support[:0], "weights": good.weights[:0]}
    with pytest.raises(ModelError, match="must have examples and outputs"):
        replace(good, **none)
    outputs = {"weights": good.weights[:, :0], "slope": good.slope[:, :0], "outputs": ()}
    outputs["gain"] = good.gain[:0]
    with pytest.raises(ModelError, match="must have examples and outputs"):
        replace(good, **outputs, intercept=good.intercept[:0], residual=good.residual[:0, :0])


def test_wrong_use_is_refused():
    estimator = LearnedEstimator(model(), ZERO)
    four = Reading(time=0.0, field=np.zeros((4, 3)))
    for act in (estimator.step, lambda r: estimator.zero([r])):
        with pytest.raises(ArgumentError, match=r"must come from 3 chips.*got 4"):
            act(four)
    with pytest.raises(ArgumentError, match="the used chips are good; got 0 readings"):
        estimator.zero([])
    with pytest.raises(ArgumentError, match=r"zero must have shape"):
        LearnedEstimator(model(), np.zeros((2, 3)))
    with pytest.raises(ArgumentError, match="zero must be finite"):
        LearnedEstimator(model(), np.full((3, 3), np.nan))
    with pytest.raises(ArgumentError, match="inputs must have shape"):
        model().predict(np.zeros((2, 3)))
    with pytest.raises(ArgumentError, match="distinct indices"):
        Encoding(chips=(1, 1))
    with pytest.raises(ArgumentError, match="time_constants must be positive"):
        Encoding(chips=(1,), time_constants=(0.0,))
