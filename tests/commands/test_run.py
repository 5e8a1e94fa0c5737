"""Sources read by the estimator of any file: what `smoskin run` does."""

from dataclasses import replace

import numpy as np
import pytest

from networks import tiny_network
from smoskin.commands import run as running
from smoskin.commands.calibrate import calibrate
from smoskin.commands.run import watch
from smoskin.errors import ArgumentError, DesignError, ModelError
from smoskin.records import Contact, Reading, Status
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.service.source import TwinSource
from smoskin.twin.creep import Creep
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.rig import VirtualRig
from tables_of_response import plain, table_with_modes
from virtual_skins import MadeTwin

pytest.importorskip("safetensors")
REDUCED = "twin://planar?mechanics=reduced&speed=max"


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


@pytest.fixture(scope="module")
def twin(skin):
    return MadeTwin(skin, seed=3)


@pytest.fixture(scope="module")
def own_table(skin, twin, tmp_path_factory):
    rig = VirtualRig(twin, np.random.default_rng(0))
    path = tmp_path_factory.mktemp("run") / "skin.table"
    calibrate(table_with_modes(skin), rig, design=skin, count=20).table.save(path)
    return path


def watched(monkeypatch, source, touch, after, **options):
    """Estimates of a source that is touched after so many of them."""
    monkeypatch.setattr(running, "open_source", lambda url: source)
    estimates = []
    for estimate in watch("twin://planar", **options):
        estimates.append(estimate)
        if len(estimates) == after:
            source.touch([touch])
    return estimates


def test_a_touched_skin_is_read_by_its_own_table(skin, twin, own_table, monkeypatch):
    source = TwinSource(twin, speed=np.inf, creep=Creep(skin))
    touch = Contact(position=(0.043, 0.088), force=(0.1, -0.05, -0.6))
    estimates = watched(monkeypatch, source, touch, 40, calibration=own_table, seconds=1.0)
    assert [one.status for one in estimates[:20]] == [Status.NOT_CALIBRATED] * 20
    assert {one.status for one in estimates[20:40]} == {Status.NO_CONTACT}
    assert {one.status for one in estimates[45:]} == {Status.CONTACT}
    off = np.array([one.contacts[0].position for one in estimates[45:]]) - touch.position
    push = np.array([one.contacts[0].force for one in estimates[45:]]) - touch.force
    assert np.hypot(*off.T).mean() < 1.5e-3
    assert np.abs(push[:, 2]).mean() < 0.03 * 0.6


def test_a_skin_is_read_by_a_network(planar, tmp_path, monkeypatch):
    path = tmp_path / "skin.network"
    tiny_network(planar, drag=0.4).save(path)
    source = TwinSource(ReducedTwin(planar, seed=None), speed=np.inf)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    estimates = watched(monkeypatch, source, touch, 30, calibration=path, seconds=0.4)
    assert [one.status for one in estimates[:20]] == [Status.NOT_CALIBRATED] * 20
    assert {one.status for one in estimates[20:30]} == {Status.NO_CONTACT}
    assert {one.status for one in estimates[32:]} == {Status.CONTACT}
    assert estimates[-1].time == pytest.approx(0.4)


def test_a_made_skin_without_calibration_is_zeroed_first(skin, twin, monkeypatch):
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    for zero, first in ((True, {Status.NOT_CALIBRATED}), (False, {Status.CONTACT})):
        source = TwinSource(twin, speed=np.inf)
        estimates = watched(monkeypatch, source, touch, 999, seconds=0.3, zero=zero)
        assert {one.status for one in estimates[:20]} == first
        assert {one.status for one in estimates[20:]} == ({Status.NO_CONTACT} if zero else first)


@pytest.fixture
def recording(skin, tmp_path):
    """A recording of a skin whose design does not come with the package."""
    with Recorder(tmp_path / "own.mcap", skin) as recorder:
        for k in range(30):
            recorder.write(ReducedTwin(skin).read(time=0.01 * k))
    return f"replay:{tmp_path / 'own.mcap'}?speed=max"


def test_a_recording_is_read_as_its_own_design(planar, skin, recording, tmp_path):
    with pytest.raises(DesignError, match="design must be given"):
        next(watch(recording))
    with pytest.raises(ModelError, match=r"own\.mcap.* must be of the design 'planar'"):
        next(watch(recording, planar))
    kept = tmp_path / "kept.mcap"
    estimates = list(watch(recording, skin, record=kept))
    assert [one.status for one in estimates[20:]] == [Status.NO_CONTACT] * 10
    assert [one for _, one in open_recording(kept)] == estimates
    assert open_recording(kept).description.design_hash == skin.content_hash


def test_a_source_that_names_no_design_is_read_with_the_given_one(planar, monkeypatch):
    class Chips(TwinSource.__mro__[1]):
        chips = 2

        def read(self, timeout=1.0):
            return Reading(time=0.0, field=np.zeros((2, 3)))

        def close(self):
            closed.append(self)

    closed = []
    monkeypatch.setattr(running, "open_source", lambda url: Chips())
    with pytest.raises(ArgumentError, match="design must be given"):
        next(watch("usb:skin"))
    with pytest.raises(ArgumentError, match="source must have 3 chips, as design 'planar'; got 2"):
        next(watch("usb:skin", planar))
    assert len(closed) == 2


def test_a_table_of_another_design_does_not_run(planar, own_table):
    for design in (None, planar):
        with pytest.raises(ModelError, match=r"skin\.table must be of the design 'planar'"):
            next(watch(REDUCED, design, calibration=own_table))
    other = replace(planar, columns=replace(planar.columns, radius=1.4e-3))
    with pytest.raises(ModelError, match=r"source .* must be of the design"):
        next(watch(REDUCED, other))


def test_a_calibration_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ModelError, match=r"nowhere\.toml"):
        next(watch(REDUCED, calibration=tmp_path / "nowhere.toml"))
