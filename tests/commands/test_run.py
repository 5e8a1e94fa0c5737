"""Sources read by the estimator of any file: what `smoskin run` does."""

from dataclasses import replace

import numpy as np
import pytest

from boards import sending
from networks import tiny_network
from smoskin.commands import run as running
from smoskin.commands.calibrate import calibrate
from smoskin.commands.run import Watch
from smoskin.commands.run.lines import thinned
from smoskin.errors import ArgumentError, FileError, ModelError
from smoskin.records import Contact, Estimate, Reading, Status
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
    for estimate in Watch("twin://planar", **options):
        estimates.append(estimate)
        if len(estimates) == after:
            source.touch([touch])
    return estimates


def test_a_recording_takes_the_calibration_along(own_table, twin, skin, monkeypatch, tmp_path):
    from mcap.reader import make_reader

    source = TwinSource(twin, speed=np.inf)
    monkeypatch.setattr(running, "open_source", lambda url: source)
    record = tmp_path / "a.mcap"
    with Watch("twin://planar", calibration=own_table, record=record, seconds=0.1) as watch:
        assert list(watch)
    with open(record, "rb") as file:
        (kept,) = make_reader(file).iter_attachments()
    assert kept.name == "skin.table"
    assert kept.data == own_table.read_bytes()


def test_what_a_boards_line_did_is_told(planar):
    pytest.importorskip("serial")
    with (
        sending(TwinSource(ReducedTwin(planar), rate=400.0)) as port,
        Watch(f"serial://{port}", seconds=0.2) as watch,
    ):
        estimates = list(watch)
        summary = watch.summary
    assert summary.readings == len(estimates)
    assert summary.line["readings"] >= len(estimates)
    assert summary.lost == summary.line["lost"]
    text = str(replace(summary, line={"readings": 9, "lost": 0, "late": 2, "corrupt": 0}))
    assert text.endswith("2 late.")


def test_a_touched_skin_is_read_by_its_own_table(skin, twin, own_table, monkeypatch):
    source = TwinSource(twin, speed=np.inf, creep=Creep(skin))
    touch = Contact(position=(0.043, 0.088), force=(0.1, -0.05, -0.6))
    estimates = watched(monkeypatch, source, touch, 40, calibration=own_table, seconds=1.0)
    assert [estimate.status for estimate in estimates[:20]] == [Status.NOT_CALIBRATED] * 20
    assert {estimate.status for estimate in estimates[20:40]} == {Status.NO_CONTACT}
    assert {estimate.status for estimate in estimates[45:]} == {Status.CONTACT}
    off = np.array([estimate.contacts[0].position for estimate in estimates[45:]]) - touch.position
    push = np.array([estimate.contacts[0].force for estimate in estimates[45:]]) - touch.force
    assert np.hypot(*off.T).mean() < 1.5e-3
    assert np.abs(push[:, 2]).mean() < 0.03 * 0.6


def test_a_skin_is_read_by_a_network(planar, tmp_path, monkeypatch):
    path = tmp_path / "skin.network"
    tiny_network(planar, drag=0.4).save(path)
    source = TwinSource(ReducedTwin(planar, seed=None), speed=np.inf)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    estimates = watched(monkeypatch, source, touch, 30, calibration=path, seconds=0.4)
    assert [estimate.status for estimate in estimates[:20]] == [Status.NOT_CALIBRATED] * 20
    assert {estimate.status for estimate in estimates[20:30]} == {Status.NO_CONTACT}
    assert {estimate.status for estimate in estimates[32:]} == {Status.CONTACT}
    assert estimates[-1].time == pytest.approx(0.4)


def test_a_made_skin_without_calibration_is_zeroed_first(skin, twin, monkeypatch):
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    for zero, first in ((True, {Status.NOT_CALIBRATED}), (False, {Status.CONTACT})):
        source = TwinSource(twin, speed=np.inf)
        estimates = watched(monkeypatch, source, touch, 999, seconds=0.3, zero=zero)
        assert {estimate.status for estimate in estimates[:20]} == first
        assert {estimate.status for estimate in estimates[20:]} == (
            {Status.NO_CONTACT} if zero else first
        )


@pytest.fixture
def recording(skin, tmp_path):
    """A recording of a skin whose design does not come with the package."""
    with Recorder(tmp_path / "own.mcap", skin) as recorder:
        for k in range(30):
            recorder.write(ReducedTwin(skin).read(time=0.01 * k))
    return f"replay:{tmp_path / 'own.mcap'}?speed=max"


def test_a_recording_is_read_as_its_own_design(planar, skin, recording, tmp_path):
    with pytest.raises(ModelError, match=r"own\.mcap.* must be of the design 'planar'"):
        Watch(recording, planar)
    kept = tmp_path / "kept.mcap"
    estimates = list(Watch(recording, record=kept))
    assert [estimate.status for estimate in estimates[20:]] == [Status.NO_CONTACT] * 10
    assert [estimate for _, estimate in open_recording(kept)] == estimates
    assert open_recording(kept).design == skin
    again = f"replay:{kept}?speed=max"
    with pytest.raises(FileError, match=r"kept\.mcap exists"):
        Watch(again, record=kept)
    with pytest.raises(ArgumentError, match="another file than the one that is played"):
        Watch(again, record=kept, force=True)
    assert list(Watch(recording, record=kept, force=True)) == estimates


def test_damage_is_told_before_and_after(recording):
    path = recording.removeprefix("replay:").partition("?")[0]
    spans = open_recording(path).spans
    with open(path, "r+b") as file:
        file.seek(spans[1].offset + spans[1].length // 2)
        file.write(b"\0\0")
    messages = []
    with Watch(recording, say=messages.append) as watch:
        given = list(watch)
    assert messages == [watch.summary.damage]
    assert f"{30 - len(given)} of 30 readings are lost" in messages[0]
    assert watch.summary.lost == 30 - len(given)
    assert watch.summary.readings == len(given)


def test_a_recorder_that_fails_does_not_end_the_estimation(tmp_path):
    messages = []
    with Watch(REDUCED, record=tmp_path / "a.mcap", seconds=0.4, say=messages.append) as watch:
        for number, _ in enumerate(watch):
            if number == 5:
                (tmp_path / "a.mcap").unlink()
    assert number == 40
    assert watch.summary.readings == 41
    assert watch.summary.not_recorded > 0
    assert "a.mcap cannot be written" in watch.summary.failure
    assert messages == [f"Making the skin of {REDUCED}.", watch.summary.failure]
    assert "not recorded" in str(watch.summary)


def test_the_summary_counts_touches(monkeypatch, planar):
    source = TwinSource(ReducedTwin(planar, seed=None), speed=np.inf)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    monkeypatch.setattr(running, "open_source", lambda url: source)
    with Watch("twin://planar", seconds=0.99) as watch:
        for number, _ in enumerate(watch):
            source.touch([touch] if 30 <= number < 50 else [])
    summary = watch.summary
    assert summary.readings == 100
    assert summary.touches == 1
    assert summary.statuses["NOT_CALIBRATED"] == 20
    assert sum(summary.statuses.values()) == 100
    assert summary.latency_ms_median > 0
    assert str(summary).startswith("100 readings: ")
    assert summary.as_json()["damage"] == ""


def test_lines_are_thinned_by_time_and_by_changes():
    touch = Contact(position=(0.05, 0.07), force=(0.0, 0.0, -0.5))
    states = [()] * 4 + [(touch,)] * 4 + [()] * 3
    estimates = [
        Estimate(
            time=0.1 * k if k < 10 else -5.0,  # the source's clock began anew
            status=Status.CONTACT if contacts else Status.NO_CONTACT,
            contacts=contacts,
            covariance=np.zeros((len(contacts), 5, 5)),
        )
        for k, contacts in enumerate(states)
    ]

    def shown(**options):
        worth = thinned(iter(estimates), **options)
        return [k for k, (_, due) in enumerate(worth) if due]

    assert shown() == list(range(11))
    assert shown(changes=True) == [0, 4, 8]
    assert shown(every=0.29) == [0, 3, 6, 9, 10]
    assert shown(every=0.29, changes=True) == [0, 3, 4, 6, 8, 9, 10]


@pytest.fixture
def pages(monkeypatch):
    """Pages that are made, each a stand-in that keeps what it is given."""

    class Page:
        url = "http://127.0.0.1:1"

        def __init__(self, design, **options):
            self.options, self.shown, self.closed = options, [], False
            pages.append(self)

        def write(self, reading, estimate, *, truth=(), vertices=None):
            self.shown.append((estimate, truth, vertices))

        def show_drift(self, drift):
            assert drift.shape == (3, 3)

        def show_recording(self, goes_on, sentence, finished):
            self.recording = goes_on, sentence

        def show_bound(self, bound):
            self.bound = bound

        def close(self):
            self.closed = True

    pages = []
    for place in ("page.view.View", "apart.page.PageApart"):
        monkeypatch.setattr(f"smoskin.service.{place}", Page)
    return pages


def test_the_page_shows_and_presses_a_virtual_skin(pages):
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    with Watch(f"{REDUCED}&creep=no", view=True, port=7, seconds=0.8) as watch:
        (page,) = pages
        assert watch.url == page.url
        assert page.options["port"] == 7
        statuses = []
        for number, estimate in enumerate(watch):
            statuses.append(estimate.status)
            if number == 24:
                page.options["on_press"]((touch,))
            if number == 40:
                page.options["on_zero"]()  # waits until the finger lifts
            if number == 50:
                page.options["on_press"](())
    assert all(truth == (touch,) for _, truth, _ in page.shown[26:50])
    assert page.shown[-1][1] == ()
    assert page.shown[30][2].shape[1] == 3
    assert Status.NOT_CALIBRATED not in statuses[20:51]
    assert statuses.count(Status.NOT_CALIBRATED) == 40
    assert page.closed


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
        next(iter(Watch("usb:skin")))
    with pytest.raises(ArgumentError, match="source must have 3 chips, as design 'planar'; got 2"):
        next(iter(Watch("usb:skin", planar)))
    assert len(closed) == 2


def test_a_table_of_another_design_does_not_run(planar, own_table):
    for design in (None, planar):
        with pytest.raises(ModelError, match=r"skin\.table must be of the design 'planar'"):
            next(iter(Watch(REDUCED, design, calibration=own_table)))
    other = replace(planar, columns=replace(planar.columns, radius=1.4e-3))
    with pytest.raises(ModelError, match=r"source .* must be of the design"):
        next(iter(Watch(REDUCED, other)))


def test_a_calibration_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ModelError, match=r"nowhere\.toml"):
        next(iter(Watch(REDUCED, calibration=tmp_path / "nowhere.toml")))


def test_what_is_sought_again_on_the_page_counts_once(planar, tmp_path):
    twin = ReducedTwin(planar, seed=1)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    with Recorder(tmp_path / "a.mcap", planar) as recorder:
        for k in range(60):
            recorder.write(twin.read([touch] * (30 <= k < 50), time=0.02 * k))
    with Watch(f"replay:{tmp_path / 'a.mcap'}?speed=max", view=True) as watch:
        for number, _ in enumerate(watch):
            if number in (40, 60):
                watch._played.seek(0.5)
            if number == 90:
                break
    summary = watch.summary
    assert summary.touches == 1
    assert summary.readings == sum(summary.statuses.values()) == 55  # and 36 again


def test_the_page_begins_and_ends_recordings(pages, tmp_path):
    estimates = []
    with Watch(REDUCED, view=True, record=tmp_path, seconds=0.8) as watch:
        (page,) = pages
        for number, estimate in enumerate(watch):
            if number in (10, 60):
                page.options["on_record"](number == 10)
            estimates.append(estimate)
            if number == 30:
                assert page.recording[0]
                assert page.recording[1].endswith(" readings, 0 lost.")
    (file,) = tmp_path.iterdir()
    assert page.recording == (False, f"Recorded {file.name}: 50 readings, 0 lost.")
    assert [estimate for _, estimate in open_recording(file)] == estimates[11:61]


def test_an_estimator_is_chosen_and_reads_what_is_played_anew(pages, planar, tmp_path):
    twin = ReducedTwin(planar, seed=1)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    with Recorder(tmp_path / "a.mcap", planar) as recorder:
        for k in range(60):
            recorder.write(twin.read([touch] * (k >= 30), time=0.02 * k))
    url = f"replay:{tmp_path / 'a.mcap'}?speed=max"
    alone = list(Watch(url))
    with Watch(url, view=True) as watch:
        (page,) = pages
        assert page.options["on_record"] is None  # it would hold what nobody did
        first, second = watch.estimators
        assert page.options["estimators"] == (first, second)
        given = []
        for number, estimate in enumerate(watch):
            given.append(estimate)
            if number == 40:
                page.options["on_choose"](second)
            if number == 50:
                page.options["on_choose"](first)
            if estimate.time > 1.1:
                break
    assert given[:41] == alone[:41]
    assert given[41].time == given[40].time
    assert given[41].covariance.tolist() != given[40].covariance.tolist()
    assert given[-1] == alone[56]
    with pytest.raises(ArgumentError, match="name must be one of"):
        watch.choose("guess")
