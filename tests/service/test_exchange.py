"""Recordings as tables and back, to the last bit, and read by other programs."""

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.errors import ArgumentError, FileError, RecordingError
from smoskin.records import ChipFlag, Reading
from smoskin.service.exchange import columns_of, export_recording, import_readings
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
