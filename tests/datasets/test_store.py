"""Data sets on disk: the same bits however they came about, and nothing foreign among them."""

import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import chunk_work as work
from chunk_work import contents
from smoskin.datasets.patterns import Grid, Random, Sweep
from smoskin.datasets.simulation import COLUMNS, Rows, Simulation
from smoskin.datasets.store import open_dataset, write_dataset
from smoskin.datasets.workers import Engine
from smoskin.design.document import parse_design
from smoskin.errors import ArgumentError, EngineError, FileError, MissingExtraError, RecordingError

pytest.importorskip("h5py")

SMALL = Sweep(
    presses=Random(count=90, touches_at_once=(1, 2)),
    temperatures=(25.0, 40.0),
    skins=(3, 5),
    presses_per_chunk=40,
    seed=11,
)


def made_up(planar, tmp_path, sweep=SMALL, seconds=0.0):
    log = tmp_path / "begun"
    log.mkdir(exist_ok=True)
    return work.MadeUp(planar, sweep, str(log), seconds)


def write(folder, planar, tmp_path, sweep=SMALL, engine=None, seconds=0.0):
    return write_dataset(
        folder,
        planar,
        sweep,
        simulation=made_up(planar, tmp_path, sweep, seconds),
        engine=engine or Engine(2),
    )


@pytest.fixture(scope="module")
def unbroken(planar, tmp_path_factory):
    """A data set made in one go by one worker."""
    folder = tmp_path_factory.mktemp("unbroken")
    return write(folder / "set", planar, folder, engine=Engine(1))


def test_two_workers_write_what_one_writes(planar, tmp_path, unbroken):
    both = write(tmp_path / "set", planar, tmp_path)
    assert contents(both.path) == contents(unbroken.path)
    assert len(contents(both.path)) == SMALL.chunks == 12


def test_a_killed_worker_changes_nothing(planar, tmp_path, unbroken):
    def kill():
        until(lambda: len(work.begun(tmp_path / "begun")) >= 4)
        os.kill(work.begun(tmp_path / "begun")[-1][1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    done = write(tmp_path / "set", planar, tmp_path, seconds=0.1)
    killer.join()
    assert contents(done.path) == contents(unbroken.path)
    assert len(work.begun(tmp_path / "begun")) == SMALL.chunks + 1


@pytest.mark.slow
def test_a_cluster_with_a_killed_worker_writes_the_same(planar, tmp_path, unbroken):
    pytest.importorskip("distributed")

    def kill():
        until(lambda: len(work.begun(tmp_path / "begun")) >= 3)
        os.kill(work.begun(tmp_path / "begun")[-1][1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    done = write(tmp_path / "set", planar, tmp_path, engine=Engine(2, "local"), seconds=0.1)
    killer.join()
    assert contents(done.path) == contents(unbroken.path)
    assert len(work.begun(tmp_path / "begun")) > SMALL.chunks


PROGRAM = """
import pickle, sys
from pathlib import Path
import chunk_work
from smoskin.datasets.store import write_dataset
from smoskin.datasets.workers import Engine
folder, made_up = Path(sys.argv[1]), pickle.loads(Path(sys.argv[2]).read_bytes())
write_dataset(folder, made_up.design, made_up.sweep, simulation=made_up, engine=Engine(2))
"""


@pytest.mark.slow
def test_a_sweep_killed_at_random_moments_equals_an_unbroken_one(planar, tmp_path, unbroken):
    """The whole process dies, twice, at a random moment, and a chunk in the middle is lost."""
    draw = np.random.default_rng(0)
    given = tmp_path / "work"
    given.write_bytes(pickle.dumps(made_up(planar, tmp_path, seconds=0.05)))
    folder = tmp_path / "set"
    path = os.pathsep.join([os.path.dirname(work.__file__), *sys.path])
    for enough in (3, 7):
        parent = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(folder), str(given)],
            env=os.environ | {"PYTHONPATH": path},
        )
        try:
            until(lambda least=enough: len(list(folder.glob("chunk-*.h5"))) >= least)
            time.sleep(draw.uniform(0.0, 0.1))
        finally:
            parent.kill()
            parent.wait()
    time.sleep(0.5)  # an orphaned worker may still begin a chunk before it notices
    before = len(work.begun(tmp_path / "begun"))
    (folder / "chunk-000001.h5").unlink()
    missing = open_dataset(folder).missing
    assert missing[0] == 1
    assert missing[1] > 2  # so that a gap is before chunks that are there
    done = write(folder, planar, tmp_path)
    assert contents(done.path) == contents(unbroken.path)
    assert len(work.begun(tmp_path / "begun")) == before + len(missing)
    assert not list(folder.glob("*.part"))


def test_a_complete_set_is_not_computed_again(planar, tmp_path, unbroken):
    heard = []
    again = write_dataset(
        unbroken.path,
        planar,
        SMALL,
        simulation=made_up(planar, tmp_path),
        progress=lambda *step: heard.append(step),
    )
    assert work.begun(tmp_path / "begun") == []
    assert again == unbroken
    assert heard == [("360/360 rows", 1.0)]


def test_columns_are_the_rows_of_the_chunks(planar, tmp_path, unbroken):
    expected = [made_up(planar, tmp_path)(chunk) for chunk in range(SMALL.chunks)]
    assert set(COLUMNS) == {attribute.name for attribute in fields(Rows)}
    for field, column in COLUMNS.items():
        whole = np.concatenate([getattr(rows, field) for rows in expected])
        read = unbroken.column(column.name)
        assert read.dtype == column.kind
        assert np.array_equal(read, whole, equal_nan=column.kind == "float64")
    assert unbroken.column("skin_seed").tolist() == [3] * 180 + [5] * 180
    assert [len(rows) for rows in unbroken.chunks()] == [40, 40, 10] * 4
    assert unbroken.invalid == (~unbroken.column("valid")).sum() > 0
    assert unbroken.flagged == unbroken.column("flags").any(axis=1).sum() > unbroken.invalid


def test_a_set_goes_into_one_file(unbroken, tmp_path):
    import h5py

    unbroken.export(tmp_path / "one.h5")
    with h5py.File(tmp_path / "one.h5") as file:
        assert set(file) == {column.name for column in COLUMNS.values()}
        for column in COLUMNS.values():
            whole = unbroken.column(column.name)
            assert np.array_equal(file[column.name][...], whole, equal_nan=whole.dtype == float)
        manifest = json.loads(file.attrs["manifest"])
    assert parse_design(manifest["design"]) == unbroken.design
    assert manifest["rows"] == SMALL.rows
    with pytest.raises(FileError, match=r"one\.h5 exists"):
        unbroken.export(tmp_path / "one.h5")


def test_the_manifest_tells_what_the_rows_are_of(planar, unbroken):
    manifest = json.loads((unbroken.path / "manifest.json").read_text())
    assert manifest["design_hash"] == planar.content_hash
    assert unbroken.design == planar
    assert unbroken.design.provenance == planar.provenance
    assert manifest["sweep"]["temperatures_degC"] == [25.0, 40.0]
    assert manifest["chunks"] == 12
    (run,) = manifest["runs"]
    assert run["engine"] == "local, 1 worker"
    assert run["chunks"] == 12
    assert run["seconds"] > 0
    assert unbroken.sweep == SMALL
    assert unbroken.complete


def test_another_design_sweep_or_version_is_refused(planar, tmp_path, unbroken, monkeypatch):
    softer = replace(planar, columns=replace(planar.columns, radius=1.4e-3))
    with pytest.raises(
        RecordingError,
        match=r"another design: columns.radius_mm is 3.5 there and 1.4 here; use another folder",
    ):
        write(unbroken.path, softer, tmp_path)
    with pytest.raises(RecordingError, match=r"another sweep: seed is 11 there and 12 here"):
        write(unbroken.path, planar, tmp_path, replace(SMALL, seed=12))
    more = replace(SMALL, presses=replace(SMALL.presses, count=91))
    with pytest.raises(RecordingError, match=r"sweep: presses.count is 90 there and 91 here"):
        write(unbroken.path, planar, tmp_path, more)
    monkeypatch.setattr("smoskin.datasets.manifest.version", lambda name: "9.9")
    with pytest.raises(RecordingError, match=r"another version .* and '9.9' here"):
        write(unbroken.path, planar, tmp_path)
    renamed = replace(planar, name="other")
    monkeypatch.undo()
    assert write(unbroken.path, renamed, tmp_path) == unbroken


def test_a_middle_chunk_that_is_gone_is_computed_again(planar, tmp_path, unbroken):
    folder = tmp_path / "set"
    shutil.copytree(unbroken.path, folder)
    for chunk in (4, 7):
        (folder / f"chunk-{chunk:06d}.h5").unlink()
    (folder / "chunk-000007.h5.part").write_bytes(b"half")
    gone = open_dataset(folder)
    assert gone.missing == (4, 7)
    # Of 12 chunks every third ends a skin at a temperature with ten rows.
    assert gone.missing_rows.tolist() == [*range(130, 170), *range(220, 260)]
    with pytest.raises(RecordingError, match="2 of 12 chunks are missing; repeat the sweep"):
        gone.column("field_T")
    there = np.delete(unbroken.column("field_T"), gone.missing_rows, axis=0)
    assert np.array_equal(gone.column("field_T", partial=True), there, equal_nan=True)
    assert gone.invalid == (~gone.column("valid", partial=True)).sum() < unbroken.invalid
    done = write(folder, planar, tmp_path)
    assert {item for item, _ in work.begun(tmp_path / "begun")} == {4, 7}
    assert contents(done.path) == contents(unbroken.path)
    assert [run.chunks for run in done.manifest.runs] == [12, 2]
    assert [run.damaged for run in done.manifest.runs] == [0, 0]
    assert not list(folder.glob("*.part"))


@pytest.mark.parametrize("seed", range(4))
def test_a_flipped_bit_anywhere_is_noticed_and_mended(planar, tmp_path, unbroken, seed):
    folder = tmp_path / "set"
    shutil.copytree(unbroken.path, folder)
    file, draw = folder / "chunk-000003.h5", np.random.default_rng(seed)
    image = bytearray(file.read_bytes())
    image[draw.integers(len(image))] ^= 1 << draw.integers(8)
    file.write_bytes(image)
    assert unbroken.damaged() == ()
    assert open_dataset(folder).damaged() == (3,)
    done = write(folder, planar, tmp_path, engine=Engine(1))
    assert [item for item, _ in work.begun(tmp_path / "begun")] == [3]
    assert contents(done.path) == contents(unbroken.path)
    assert done.damaged() == ()
    assert done.manifest.runs[-1].damaged == 1


def test_a_chunk_cut_short_or_of_elsewhere_is_damaged(planar, tmp_path, unbroken):
    folder = tmp_path / "set"
    shutil.copytree(unbroken.path, folder)
    first, third = folder / "chunk-000000.h5", folder / "chunk-000002.h5"
    first.write_bytes(first.read_bytes()[: first.stat().st_size // 2])
    with pytest.raises(RecordingError, match=r"chunk-000000.h5 is damaged"):
        open_dataset(folder).column("field_T")
    first.write_bytes(third.read_bytes())
    with pytest.raises(RecordingError, match=r"chunk-000000.h5 is damaged: field_T has 10 rows"):
        open_dataset(folder).column("field_T")
    first.write_bytes((folder / "chunk-000001.h5").read_bytes())
    assert open_dataset(folder).damaged() == (0,)
    # Nor is a chunk believed whose sum is not known, or whose sum's line was cut by a kill.
    sums = folder / "checksums.sha256"
    sums.write_text(sums.read_text()[:-10])
    assert len(open_dataset(folder).damaged()) == 2
    done = write(folder, planar, tmp_path)
    assert contents(done.path) == contents(unbroken.path)
    assert done.damaged() == ()


def test_a_damaged_column_is_never_read(tmp_path, unbroken):
    import h5py

    folder = tmp_path / "set"
    shutil.copytree(unbroken.path, folder)
    first = folder / "chunk-000000.h5"
    with h5py.File(first) as file:
        at = file["field_T"].id.get_chunk_info(0).byte_offset + 20
    image = bytearray(first.read_bytes())
    image[at] ^= 1
    first.write_bytes(image)
    with pytest.raises(RecordingError, match=r"chunk-000000.h5 is damaged"):
        for _ in open_dataset(folder).chunks():
            pass


def test_an_empty_set_has_no_columns(planar, tmp_path):
    folder = tmp_path / "set"
    failing = work.FailsAt(made_up(planar, tmp_path), 0)
    with pytest.raises(EngineError, match="item 0"):
        write_dataset(folder, planar, SMALL, simulation=failing, engine=Engine(1))
    begun = open_dataset(folder)
    assert (begun.present, begun.invalid, begun.flagged) == ((), 0, 0)
    assert len(begun.missing_rows) == SMALL.rows
    with pytest.raises(RecordingError, match="holds no rows yet"):
        begun.column("valid", partial=True)


def test_a_folder_of_something_else_is_left_alone(planar, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("all I have")
    with pytest.raises(RecordingError, match=r"must be empty or hold this data set; got thesis"):
        write(mine, planar, tmp_path)
    with pytest.raises(RecordingError, match="holds no data set"):
        open_dataset(mine)
    (mine / "manifest.json").write_text("{}")
    with pytest.raises(RecordingError, match=r"manifest.json is damaged"):
        open_dataset(mine)
    (mine / "manifest.json").write_text('{"format": "smoskin data set 1"}')
    with pytest.raises(RecordingError, match=r"must be of format .* repeat the sweep in another"):
        open_dataset(mine)
    with pytest.raises(RecordingError, match="cannot be written"):
        write(mine / "thesis.tex", planar, tmp_path)


def test_a_changed_manifest_is_noticed(tmp_path, unbroken):
    folder = tmp_path / "set"
    shutil.copytree(unbroken.path, folder)
    file = folder / "manifest.json"
    file.write_text(file.read_text().replace('"seed": 11', '"seed": 12'))
    with pytest.raises(RecordingError, match="has been changed"):
        open_dataset(folder)


def test_two_writers_keep_out_of_each_others_way(planar, tmp_path):
    folder = tmp_path / "set"
    refusals = []

    def intrude(what, share):
        if share > 0.2 and not refusals:
            with pytest.raises(RecordingError, match="being written by another process") as refused:
                write(folder, planar, tmp_path)
            refusals.append(refused)

    write_dataset(folder, planar, SMALL, simulation=made_up(planar, tmp_path), progress=intrude)
    assert len(refusals) == 1


def test_progress_tells_rows_and_rate_of_what_is_computed_now(planar, tmp_path, monkeypatch):
    ticks = iter(range(1000))
    clock = SimpleNamespace(monotonic=lambda: float(next(ticks)))
    monkeypatch.setattr("smoskin.datasets.store.time", clock)

    def reported():
        heard = []
        write_dataset(
            tmp_path / "set",
            planar,
            SMALL,
            simulation=made_up(planar, tmp_path),
            engine=Engine(1),
            progress=lambda *what: heard.append(what),
        )
        return heard

    first = reported()
    assert first[:3] == [
        ("0/360 rows", 0.0), ("40/360 rows, 40/s", 40 / 360), ("80/360 rows, 40/s", 80 / 360)
    ]  # fmt: skip
    assert len(first) == 1 + SMALL.chunks
    assert first[-1][1] == 1.0
    (tmp_path / "set" / "chunk-000001.h5").unlink()
    assert reported() == [("320/360 rows", 320 / 360), ("360/360 rows, 40/s", 1.0)]


def test_failing_work_leaves_what_is_done(planar, tmp_path):
    folder = tmp_path / "set"
    failing = work.FailsAt(made_up(planar, tmp_path), 5)
    with pytest.raises(EngineError, match="item 5: RuntimeError: out of luck"):
        write_dataset(folder, planar, SMALL, simulation=failing, engine=Engine(1))
    assert open_dataset(folder).present == (0, 1, 2, 3, 4)


def test_no_such_column(unbroken):
    with pytest.raises(RecordingError, match=r"column must be one of skin_seed, .*; got 'field'"):
        unbroken.column("field")


def test_a_sweep_off_the_skin_is_refused_before_anything_is_written(planar, tmp_path):
    sweep = Sweep(presses=Random(count=5, margin=0.07))
    with pytest.raises(ArgumentError, match="margin must be at most half the skin"):
        write_dataset(tmp_path / "set", planar, sweep)
    assert not (tmp_path / "set").exists()


def test_what_is_not_installed_is_named(planar, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"data sets needs the extra 'data'"):
        write_dataset(tmp_path / "set", planar, REDUCED)
    assert not (tmp_path / "set").exists()
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"a cluster needs the extra 'cluster'"):
        list(Engine(scheduler="local").run(abs, (1,)))


def test_a_design_travels_to_other_processes(planar):
    arrived = pickle.loads(pickle.dumps(planar))
    assert arrived == planar
    assert arrived.content_hash == planar.content_hash
    assert arrived.provenance == planar.provenance


REDUCED = Sweep(
    presses=Grid(places=(4, 5), forces=(0.3, 0.6), drags=((0.0, 0.0), (0.1, 0.0))),
    temperatures=(25.0, 45.0),
    mechanics="reduced",
    presses_per_chunk=30,
)


def test_the_reduced_model_fills_a_set_bit_for_bit(planar, tmp_path):
    from smoskin.magnetics.temperature import chip_factor
    from smoskin.records import Contact
    from smoskin.twin.reduced import ReducedTwin

    serial, parallel = (
        write_dataset(tmp_path / str(workers), planar, REDUCED, engine=Engine(workers))
        for workers in (1, 2)
    )
    assert contents(serial.path) == contents(parallel.path)
    field, valid = serial.column("field_T"), serial.column("valid")
    assert valid.all()
    twin = ReducedTwin(planar, seed=None)
    for row in (0, 37, 95, 159):
        contact = Contact(
            position=serial.column("position_m")[row, 0], force=serial.column("force_N")[row, 0]
        )
        degrees = float(serial.column("temperature_degC")[row])
        expected = twin.field(twin.motion([contact], temperature=degrees), degrees)
        assert field[row] == pytest.approx(expected, rel=1e-12)
    seen = np.einsum("sij,rsi->rsj", [rotation(site) for site in planar.halls], field)
    sensitivity = chip_factor(serial.column("temperature_degC"))[:, None, None]
    noise = serial.column("reading_T") - seen * sensitivity
    assert 1e-6 < np.abs(noise).max() < 30e-6


def test_presses_of_another_chunk_do_not_reach_a_chunk(planar):
    """A simulation that has computed other chunks gives the same rows as a fresh one."""
    used = Simulation(planar, REDUCED)
    used(0)
    for chunk in (2, 1):
        late, fresh = used(chunk), Simulation(planar, REDUCED)(chunk)
        for field in fields(Rows):
            assert np.array_equal(getattr(late, field.name), getattr(fresh, field.name))


def rotation(site):
    from smoskin.magnetics import mlx90393

    return mlx90393.rotation(site)


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)
