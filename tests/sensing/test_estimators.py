"""Any file of the package becomes its estimator, and an estimator takes its own zero first."""

from dataclasses import replace

import numpy as np
import pytest

from networks import random_network
from smoskin.errors import ArgumentError, ModelError
from smoskin.records import ChipFlag, Contact, Reading, Status
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.calibration import Calibration, format_calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, LearnedModel, Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import reduced_table

pytest.importorskip("safetensors")
TOUCH = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))


def learned_model():
    """A model of random numbers for three chips."""
    rng = np.random.default_rng(0)
    encoding = Encoding(chips=(0, 1, 2), form=Form.DIRECTION, time_constants=())
    inputs = encoding.encode(np.arange(20.0), 1e-3 * rng.normal(size=(20, 3, 3)))
    count = inputs.shape[1]
    return LearnedModel(
        encoding=encoding, chips_in_reading=3, outputs=(Output.X, Output.Y), place=np.zeros(2),
        touch_field=30e-6, centre=np.zeros(count), scale=np.ones(count), support=inputs,
        weights=rng.normal(size=(20, 2)), slope=rng.normal(size=(count, 2)), intercept=np.zeros(2),
        residual=np.eye(2), noise=np.array([0.5, 1e-6]), gain=np.zeros(2), gain_after=1.0,
        reach=4.0, data_sha256="0" * 64, split="none", metrics=(),
    )  # fmt: skip


def save(kind, design, path):
    """A file of this kind."""
    if kind is ClosedFormEstimator:
        path.write_text(format_calibration(Calibration.nominal(design)), encoding="utf-8")
    elif kind is BayesEstimator:
        reduced_table(design).save(path)
    elif kind is NetworkEstimator:
        random_network(chips=(0, 1, 2), design_hash=design.content_hash).save(path)
    else:
        learned_model().save(path)
    return path


KINDS = [ClosedFormEstimator, BayesEstimator, NetworkEstimator, LearnedEstimator]


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_becomes_the_estimator_that_reads_it(kind, planar, tmp_path):
    path = save(kind, planar, tmp_path / "file")
    for given in (None, planar):
        estimator = load_estimator(path, given)
        assert type(estimator) is kind
        estimator.zero([ReducedTwin(planar).read()])
        assert estimator.step(ReducedTwin(planar).read()).status is Status.NO_CONTACT


@pytest.mark.parametrize("kind", KINDS[:3])
def test_a_file_of_another_design_is_refused(kind, planar, tmp_path):
    other = replace(planar, columns=replace(planar.columns, radius=1.4e-3))
    path = save(kind, other, tmp_path / "file")
    with pytest.raises(ModelError, match="file must be of the design 'planar'"):
        load_estimator(path, planar)
    with pytest.raises(
        ModelError, match=r"file: design must be given: .* \(curved, optimised, planar\)"
    ):
        load_estimator(path)
    assert load_estimator(path, other).design is other


@pytest.mark.parametrize("kind", KINDS[:3])
def test_a_skin_is_on_an_arm_where_that_is_said(kind, planar, tmp_path):
    path = save(kind, planar, tmp_path / "file")
    for arm in (False, True):
        assert load_estimator(path, arm=arm)._signals.followed.tracking.arm is arm


def test_a_learned_model_does_not_know_the_skins_weight(planar, tmp_path):
    path = save(LearnedEstimator, planar, tmp_path / "file")
    with pytest.raises(ArgumentError, match="arm must be False for a learned model"):
        load_estimator(path, arm=True)


@pytest.mark.parametrize("kind", [BayesEstimator, NetworkEstimator])
def test_drift_is_followed_by_what_files_make(kind, planar, tmp_path):
    """A slow drift of the untouched skin far beyond its noise is no touch."""
    rest = ReducedTwin(planar, seed=None).read()
    estimator = load_estimator(save(kind, planar, tmp_path / "file"))
    estimator.zero([rest])
    for k in range(800):
        drifted = Reading(
            time=0.02 * k, field=rest.field + 0.02e-6 * k, temperature=rest.temperature
        )
        assert estimator.step(drifted).status is Status.NO_CONTACT
    assert estimator.drift.max() > 10e-6


def test_what_is_no_such_file_is_named(planar, tmp_path):
    with pytest.raises(ModelError, match=r"nowhere\.toml"):
        load_estimator(tmp_path / "nowhere.toml")
    (tmp_path / "other.toml").write_text("a = 1\n", encoding="utf-8")
    with pytest.raises(ModelError, match=r"other\.toml"):
        load_estimator(tmp_path / "other.toml", planar)
    (tmp_path / "noise").write_bytes(bytes(range(256)))
    with pytest.raises(ModelError, match="noise"):
        load_estimator(tmp_path / "noise", planar)


def shifted(reading, **changes):
    """A reading of chips that are all a millitesla off."""
    values = {
        "time": reading.time,
        "field": reading.field + 1e-3,
        "temperature": reading.temperature,
        "flags": reading.flags,
    }
    return Reading(**(values | changes))


def test_the_first_good_readings_are_the_zero(planar):
    twin = ReducedTwin(planar)
    estimator = ZeroFirst(ClosedFormEstimator(planar), count=5)
    assert ClosedFormEstimator(planar).step(shifted(twin.read())).status is not Status.NO_CONTACT
    for k in range(5):
        estimate = estimator.step(shifted(twin.read(time=0.1 * k)))
        assert (estimate.time, estimate.status) == (0.1 * k, Status.NOT_CALIBRATED)
    assert estimator.step(shifted(twin.read(time=0.5))).status is Status.NO_CONTACT
    touched = estimator.step(shifted(twin.read([TOUCH], time=0.6)))
    assert touched.status is Status.CONTACT
    assert touched.contacts[0].normal_force == pytest.approx(0.5, abs=0.02)
    estimator.reset()
    assert estimator.step(shifted(twin.read(time=0.0))).status is Status.NOT_CALIBRATED


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"flags": [0, ChipFlag.MISSING, 0]}, Status.CHIP_MISSING),
        ({"flags": [ChipFlag.SATURATED, 0, 0]}, Status.SATURATED),
        ({"flags": [0, 0, ChipFlag.OLD]}, Status.STALE),
        ({"field": np.full((3, 3), np.nan)}, Status.CHIP_MISSING),
    ],
)
def test_bad_readings_are_named_and_are_no_zero(planar, changes, status):
    twin = ReducedTwin(planar)
    estimator = ZeroFirst(ClosedFormEstimator(planar), count=2)
    statuses = [
        estimator.step(shifted(twin.read(time=0.1 * k), **(changes if k % 2 else {}))).status
        for k in range(5)
    ]
    waiting, zeroed = Status.NOT_CALIBRATED, Status.NO_CONTACT
    assert statuses == [waiting, status, waiting, status, zeroed]


def test_fields_that_no_chip_can_say_are_no_zero(planar):
    twin = ReducedTwin(planar)
    estimator = ZeroFirst(ClosedFormEstimator(planar), count=3)
    estimator.step(twin.read(time=0.0))
    beyond = np.full((3, 3), 10.0)
    for k in range(1, 4):
        reading = shifted(twin.read(time=0.1 * k), field=beyond)
        assert estimator.step(reading).status is Status.SATURATED
    for k in range(4, 6):
        assert estimator.step(twin.read(time=0.1 * k)).status is Status.NOT_CALIBRATED
    assert estimator.step(twin.read(time=0.6)).status is Status.NO_CONTACT


def test_a_zero_of_ones_own_ends_the_waiting(planar):
    twin = ReducedTwin(planar)
    estimator = ZeroFirst(ClosedFormEstimator(planar))
    assert estimator.step(twin.read()).status is Status.NOT_CALIBRATED
    estimator.zero([shifted(twin.read())])
    assert estimator.step(shifted(twin.read(time=1.0))).status is Status.NO_CONTACT


def test_wrong_use_raises_at_once(planar):
    with pytest.raises(ArgumentError, match="count must be at least 1; got 0"):
        ZeroFirst(ClosedFormEstimator(planar), count=0)
    with pytest.raises(ArgumentError, match="got 2"):
        ZeroFirst(ClosedFormEstimator(planar)).step(Reading(time=0.0, field=np.zeros((2, 3))))
