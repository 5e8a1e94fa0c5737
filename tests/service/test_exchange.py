"""Recordings as tables and back, to the last bit, and read by other programs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.errors import ArgumentError, FileError, RecordingError
from smoskin.records import ChipFlag, Reading
from smoskin.service.exchange import (
    columns_of,
    export_lerobot,
    export_recording,
    import_readings,
)
from smoskin.service.recording import open_recording
from touch_recordings import CHIPS, DESIGN, moments, record, recorder

pytest.importorskip("mcap")


def test_a_table_has_every_bit_of_the_readings(tmp_path: Path) -> None:
    assert export_recording(record(tmp_path / "a.mcap", 30), tmp_path / "a.csv") == 30
    with open(tmp_path / "a.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row, (reading, estimate) in zip(rows, moments(30), strict=True):
        assert float(row["time_s"]) == reading.time
        field = [[float(row[f"chip{k}_{axis}_T"]) for axis in "xyz"] for k in range(CHIPS)]
        assert_array_equal(field, reading.field)
        assert row["chip2_flags"] == "0"
        assert row["status"] == "CONTACT"
        assert float(row["contact0_Fz_N"]) == estimate.contacts[0].force[2]
    assert import_readings(tmp_path / "a.csv", DESIGN, tmp_path / "b.mcap") == 30
    back = open_recording(tmp_path / "b.mcap")
    assert list(back.readings()) == [reading for reading, _ in moments(30)]
    assert back.damage == ""
    assert back.estimate_count == 0


def test_hdf5_is_read_by_its_own_library(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    export_recording(record(tmp_path / "a.mcap", 30), tmp_path / "a.h5")
    columns = columns_of(open_recording(tmp_path / "a.mcap"))
    with h5py.File(tmp_path / "a.h5") as file:
        assert set(file) == set(columns)
        assert_array_equal(file["field_T"], [reading.field for reading, _ in moments(30)])
        assert_array_equal(file["covariance"], [e.covariance for _, e in moments(30)])
        assert file["status"].asstr()[0] == "CONTACT"
        assert file.attrs["design_hash"] == DESIGN.content_hash
        assert file.attrs["document"].startswith("name = ")


def test_readings_without_estimates_and_chips_without_fields_are_kept(tmp_path: Path) -> None:
    field = np.full((CHIPS, 3), 1e-3)
    field[1] = np.nan
    flags = [0, int(ChipFlag.MISSING), 0]
    reading = Reading(time=0.5, field=field, temperature=[25.0, np.nan, 25.0], flags=flags)
    with recorder(tmp_path / "a.mcap") as sink:
        sink.write(reading)
    export_recording(tmp_path / "a.mcap", tmp_path / "a.csv")
    import_readings(tmp_path / "a.csv", DESIGN, tmp_path / "b.mcap")
    assert list(open_recording(tmp_path / "b.mcap").readings()) == [reading]


def test_the_command_converts_both_ways_and_replaces_only_when_told(tmp_path: Path) -> None:
    source, table, back = (str(tmp_path / name) for name in ("a.mcap", "a.csv", "b.mcap"))
    record(Path(source), 5)
    done = CliRunner().invoke(app, ["convert", source, table])
    assert done.exit_code == 0, done.output
    assert done.stdout == f"5 readings in {table}\n"
    assert CliRunner().invoke(app, ["convert", table, back]).exit_code == 0
    again = CliRunner().invoke(app, ["convert", table, back])
    assert again.exit_code != 0
    assert CliRunner().invoke(app, ["convert", table, back, "--force"]).exit_code == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("chip2_z_T", "chip3_z_T"), r"line 1: there must be a column chip2_z_T for the design"),
        (("5.01", "soon"), r"line 3: could not convert string to float: 'soon'"),
        (("5.01", "nan"), r"line 3: time must be finite"),
        (("5.02,", "5.02\n"), r"line 4: it must have as many columns as the first line"),
    ],
)
def test_damaged_tables_are_named_by_their_line(tmp_path: Path, change, message: str) -> None:
    export_recording(record(tmp_path / "a.mcap", 5), tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text(encoding="utf-8").replace(*change)
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        import_readings(tmp_path / "a.csv", DESIGN, tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()


def test_wrong_use_is_named(tmp_path: Path) -> None:
    source = record(tmp_path / "a.mcap", 5)
    with pytest.raises(ArgumentError, match=r"out must end in \.csv or \.h5; got 'a\.xls'"):
        export_recording(source, tmp_path / "a.xls")
    with pytest.raises(FileError, match="exists; choose another name"):
        export_recording(source, source)
    with pytest.raises(RecordingError, match="must be a file; got a folder"):
        import_readings(tmp_path, DESIGN, tmp_path / "b.mcap")


def test_an_episode_for_robot_learning_has_frames_of_one_rate(tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    record(tmp_path / "a.mcap", 30)
    out = tmp_path / "set"
    count = export_lerobot(tmp_path / "a.mcap", out, rate=30, window=3, task="press it")
    info = json.loads((out / "meta/info.json").read_text())
    features = info["features"]
    assert (info["codebase_version"], info["fps"], info["total_frames"]) == ("v3.0", 30, count)
    data = pq.read_table(out / "data/chunk-000/file-000.parquet")
    assert data.column_names == list(features)
    readings = [reading for reading, _ in moments(30)]
    time = np.array([reading.time for reading in readings])
    assert count == int((time[-1] - time[2]) * 30 + 1e-6) + 1
    for k in range(count):
        latest = max(n for n in range(30) if time[n] <= time[2] + k / 30 + 1e-9)
        field = np.concatenate([r.field.ravel() for r in readings[latest - 2 : latest + 1]])
        assert_array_equal(data["observation.tactile.field"][k].as_py(), field.astype(np.float32))
        force = moments(30)[latest][1].contacts[0].force
        given = data["observation.tactile.force"][k].as_py()
        assert_array_equal(given[:3], np.asarray(force, np.float32))
    assert data["timestamp"].to_pylist() == [float(np.float32(k / 30)) for k in range(count)]
    for name, feature in features.items():
        width = feature["shape"][0]
        first = data[name][0].as_py()
        assert (1 if not isinstance(first, list) else len(first)) == width
        assert feature["names"] is None or len(feature["names"]) == width
    stats = json.loads((out / "meta/stats.json").read_text())
    field = np.array(data["observation.tactile.field"].to_pylist())
    assert_array_equal(stats["observation.tactile.field"]["mean"], field.mean(axis=0))
    (episode,) = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert (episode["length"], episode["tasks"]) == (count, ["press it"])
    assert episode["stats/observation.tactile.field/max"] == field.max(axis=0).tolist()


def test_the_task_is_the_index_of_its_table(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    pandas = pytest.importorskip("pandas")
    export_lerobot(record(tmp_path / "a.mcap", 9), tmp_path / "set", task="press it")
    tasks = pandas.read_parquet(tmp_path / "set/meta/tasks.parquet")
    assert list(tasks.index) == ["press it"]
    assert tasks.loc["press it"].to_dict() == {"task_index": 0}


def test_frames_hold_what_a_chip_gave_last_and_say_so(tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    with recorder(tmp_path / "a.mcap") as sink:
        for n in range(12):
            field = np.full((CHIPS, 3), n * 1e-3)
            if n in (0, 5, 6):
                field[1] = np.nan
            missing = [0, int(ChipFlag.MISSING) * int(n in (0, 5, 6)), 0]
            degrees = [25.0] * CHIPS
            sink.write(Reading(time=n / 10, field=field, temperature=degrees, flags=missing))
    count = export_lerobot(tmp_path / "a.mcap", tmp_path / "set", rate=20, window=1)
    data = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet").to_pylist()
    assert count == 21  # from the first reading of all chips, at 0.1 s, to 1.1 s
    for k, frame in enumerate(data):
        latest = 1 + k // 2
        held = 4 if latest in (5, 6) else latest
        chips = np.reshape(frame["observation.tactile.field"], (CHIPS, 3))
        assert_allclose(chips[:, 0], [latest * 1e-3, held * 1e-3, latest * 1e-3], rtol=1e-6)
        assert frame["observation.tactile.missing"] == [0, latest in (5, 6), 0]
        assert_allclose(frame["observation.tactile.age"], 0.05 * (k % 2), atol=1e-6)


def test_a_data_set_is_replaced_only_when_told_and_nothing_else_is(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    source, out = record(tmp_path / "a.mcap", 9), tmp_path / "set"
    command = ["convert", str(source), str(out), "--to", "lerobot"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert done.stdout.endswith(f" frames in {out}\n")
    with pytest.raises(FileError, match="is not empty"):
        export_lerobot(source, out)
    assert CliRunner().invoke(app, [*command, "--force"]).exit_code == 0
    (out / "mine.txt").write_text("mine")
    with pytest.raises(FileError, match=r"not replaced: mine\.txt"):
        export_lerobot(source, out, force=True)
    for wrong in ({"rate": 0}, {"window": 0}, {"task": " "}):
        with pytest.raises(ArgumentError, match=next(iter(wrong))):
            export_lerobot(source, tmp_path / "other", **wrong)
    with pytest.raises(RecordingError, match="none has"):
        export_lerobot(source, tmp_path / "other", window=10)
    assert not (tmp_path / "other").exists()


def test_what_goes_with_a_folder_for_robot_learning_is_refused_without_it(tmp_path):
    answer = CliRunner().invoke(app, ["convert", "a.mcap", str(tmp_path / "a.csv"), "--rate", "10"])
    assert "must go with --to lerobot" in str(answer.exception or answer.output)
