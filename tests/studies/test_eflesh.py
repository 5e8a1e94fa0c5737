"""Recordings of both layouts: what is read, and that damage is never read as data."""

from pathlib import Path

import numpy as np
import pytest

from smoskin.errors import RecordingError
from studies.recordings.eflesh import EFLESH_SETS, read_eflesh, read_recordings, read_touches

ROWS = 40


def tables(chips=3, rows=ROWS, load=True):
    """The three files' numbers of one made-up run."""
    rng = np.random.default_rng(chips)
    time = 1.7e9 + 0.07 * np.arange(rows)
    raw = rng.normal(1000.0, 300.0, (rows, 3 * chips)).round(1)
    states = rng.uniform(-300.0, 300.0, (rows, 3)).round(3)
    loads = np.where(np.arange(rows) % 4 == 3, -1.0, np.arange(rows) * 10.0)
    columns = [time + 0.002, states] + ([loads] if load else [])
    return {
        "sensor": np.column_stack([time, raw]),
        "sensor_post_baselines": np.column_stack([time, raw - 250.0]),
        "states": np.column_stack(columns),
    }


def write(root: Path, files, set_name="normal_force", run="20250101_000000_probe") -> Path:
    folder = root / "datasets" / set_name / run
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in files.items():
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", fmt="%.6f")
    return folder


@pytest.mark.parametrize("chips", [1, 3, 10])
def test_numbers_come_back_in_si(tmp_path, chips):
    files = tables(chips)
    write(tmp_path, files)
    (run,) = read_eflesh(tmp_path)
    assert (run.set, run.name, run.unpaired) == ("normal_force", "20250101_000000_probe", 0)
    assert run.field.shape == (ROWS, chips, 3)
    np.testing.assert_allclose(run.field.reshape(ROWS, -1) * 1e6, files["sensor"][:, 1:])
    np.testing.assert_allclose(run.field - run.field_rezeroed, 250e-6, atol=1e-12)
    np.testing.assert_allclose(run.position * 1e3, files["states"][:, 1:4])
    unread = np.arange(ROWS) % 4 == 3
    assert np.array_equal(np.isnan(run.load), unread)
    np.testing.assert_allclose(run.load[~unread], 0.0981 * np.arange(ROWS)[~unread])


@pytest.mark.parametrize("below", ["", "datasets", "characterization", "characterization/datasets"])
def test_any_folder_of_the_repository_will_do(tmp_path, below):
    root = tmp_path / "characterization" if below.startswith("characterization") else tmp_path
    write(root, tables())
    named = tmp_path if below.startswith("characterization") else tmp_path / below
    assert len(read_eflesh(named)) == 1
    assert len(read_eflesh(tmp_path / below)) == 1


def test_sets_and_runs_come_in_order(tmp_path):
    for name in reversed(EFLESH_SETS):
        for run in ("2_probe", "1_probe"):
            write(tmp_path, tables(load=name != "spatial_resolution"), name, run)
    runs = [(run.set, run.name) for run in read_eflesh(str(tmp_path))]
    assert runs == [(name, run) for name in EFLESH_SETS for run in ("1_probe", "2_probe")]
    assert np.isnan(read_eflesh(tmp_path)[0].load).all()


@pytest.mark.parametrize("gone", [0, 17, ROWS - 1])
@pytest.mark.parametrize("file", ["sensor", "sensor_post_baselines", "states"])
def test_rows_pair_up_by_nearest_time_where_one_is_missing(tmp_path, file, gone):
    files = tables()
    whole = {name: table.copy() for name, table in files.items()}
    files[file] = np.delete(files[file], gone, axis=0)
    write(tmp_path, files)
    (run,) = read_eflesh(tmp_path)
    rows = np.searchsorted(whole["sensor"][:, 0], run.time - 1e-4)
    assert (len(run.time), run.unpaired) == (ROWS - 1, 1)
    np.testing.assert_allclose(run.field.reshape(len(rows), -1) * 1e6, whole["sensor"][rows, 1:])
    np.testing.assert_allclose(run.position * 1e3, whole["states"][rows, 1:4])
    np.testing.assert_allclose(run.field - run.field_rezeroed, 250e-6, atol=1e-12)


def damage(folder: Path, file: str, change) -> None:
    path = folder / f"{file}.csv"
    path.write_bytes(change(path.read_bytes()))


def replaced(line: int, text: str):
    def change(data: bytes) -> bytes:
        lines = data.split(b"\n")
        lines[line - 1] = text.encode()
        return b"\n".join(lines)

    return change


CASES = {
    "cut within a number": (lambda d: d[:-4], r"\.csv:40: the last line must end in a line break"),
    "cut at a line": (lambda d: b"\n".join(d.split(b"\n")[:20]) + b"\n", "rows must pair up in ti"),
    "a word": (replaced(7, "1700000000.42,abc,1,2"), r"\.csv:7: could not convert .*'abc'"),
    "a row cut short": (replaced(9, "1700000000.56,1,2"), r"\.csv:9: a row must have \d+ columns"),
    "an empty line": (replaced(3, ""), r"\.csv:3: could not convert"),
    "not finite": (
        lambda d: d.replace(d.split(b"\n")[4].split(b",")[1], b"nan", 1),
        r"\.csv:5: numbers must be finite",
    ),
    "time backwards": (
        lambda d: d.replace(b"1700000000.4", b"1600000000.4"),
        r"\.csv:\d+: time must not run backwards",
    ),
    "empty": (lambda d: b"", r"\.csv"),
    "binary": (lambda d: d[:50] + b"\xff\x00" + d[50:], r"\.csv:1: not a text file of numbers"),
}


@pytest.mark.parametrize("file", ["sensor", "sensor_post_baselines", "states"])
@pytest.mark.parametrize("case", CASES)
def test_damage_is_an_error_that_names_the_file(tmp_path, file, case):
    change, words = CASES[case]
    damage(write(tmp_path, tables()), file, change)
    with pytest.raises(RecordingError, match=words):
        read_eflesh(tmp_path)


def test_wrong_widths(tmp_path):
    files = tables()
    files["sensor"] = files["sensor"][:, :-1]
    write(tmp_path, files)
    with pytest.raises(RecordingError, match=r"sensor\.csv:1: .*three values a chip; got 9"):
        read_eflesh(tmp_path)
    files = tables() | {"sensor_post_baselines": tables(4)["sensor_post_baselines"]}
    write(tmp_path, files)
    with pytest.raises(RecordingError, match=r"must have 10 columns, as sensor\.csv has; got 13"):
        read_eflesh(tmp_path)
    files = tables()
    files["states"] = files["states"][:, :3]
    write(tmp_path, files)
    with pytest.raises(RecordingError, match=r"states\.csv:1: .* got 3 columns"):
        read_eflesh(tmp_path)


def test_files_of_different_runs_do_not_pair_up(tmp_path):
    files = tables()
    files["states"][:, 0] += 3600.0
    write(tmp_path, files)
    with pytest.raises(RecordingError, match="belongs to another run"):
        read_eflesh(tmp_path)


def test_missing_things_are_named(tmp_path):
    with pytest.raises(RecordingError, match="must hold one of spatial_resolution"):
        read_eflesh(tmp_path / "nowhere")
    (tmp_path / "normal_force").mkdir()
    with pytest.raises(RecordingError, match="folders named \\*_probe"):
        read_eflesh(tmp_path)
    (tmp_path / "normal_force").rmdir()
    (write(tmp_path, tables()) / "states.csv").unlink()
    with pytest.raises(RecordingError, match=r"states\.csv: a run must have this file"):
        read_eflesh(tmp_path)


@pytest.mark.recordings
def test_the_published_recordings(recordings):
    runs = read_eflesh(recordings)
    shapes = {(run.set, run.field.shape) for run in runs}
    assert shapes == {
        ("spatial_resolution", (4805, 5, 3)),
        ("normal_force", (3600, 5, 3)),
        ("shear_force", (7200, 10, 3)),
    }
    assert all(run.unpaired == 0 for run in runs)
    loads = [np.isfinite(run.load).sum() for run in runs]
    assert loads == [0, 1860, 1860, 3725]
    assert np.nanmax(runs[1].load) == pytest.approx(34.17, abs=0.01)


AXES = [f"mag{chip}_{axis}" for chip in range(5) for axis in "xyz"]
ONE = ["timestamp", "position", "x_pos", "y_pos", "fx", "fy", "fz", "tx", "ty", "tz", *AXES]
TWO = ["timestamp", "fz", "ty", "pos1_x", "pos1_y", "pos2_x", "pos2_y", *AXES]


def touch_table(names, rows=ROWS, dropped=()):
    """One file's columns: cells (3, 1) and (1, 2), a load that grows, all-zero rows."""
    rng = np.random.default_rng(len(names))
    fixed = {"position": 3, "x_pos": 3, "y_pos": 1, "pos1_x": 3, "pos1_y": 1, "pos2_x": 1,
             "pos2_y": 2}  # fmt: skip
    table = {name: rng.normal(size=rows) for name in names}
    table |= {name: np.full(rows, value) for name, value in fixed.items() if name in names}
    table["timestamp"] = 1.76e9 + np.cumsum(rng.exponential(0.1, rows))
    table["fz"] = 0.25 - 0.1 * np.arange(rows)
    for name in AXES:
        table[name] = rng.normal(0.0, 300.0, rows)
        table[name][list(dropped)] = 0.0
    return {name: table[name] for name in names}


def touch_file(path, table, *, comma=",", line="\r\n", mark="", zeros="0.0"):
    """The bytes of such a file as a logger writes it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [
        comma.join(zeros if name in AXES and not value else repr(float(value))
                   for name, value in zip(table, row, strict=True))
        for row in zip(*table.values(), strict=True)
    ]  # fmt: skip
    path.write_bytes((mark + line.join([comma.join(table), *rows]) + line).encode())


WRITTEN = {
    "as a spreadsheet": {},
    "as on Linux": {"line": "\n"},
    "a space after commas": {"comma": ", "},
    "a byte order mark": {"mark": "\ufeff"},
    "whole zeros": {"zeros": "0"},
}


@pytest.mark.parametrize("style", WRITTEN)
@pytest.mark.parametrize(
    ("names", "file"), [(ONE, "position_3_a.csv"), (TWO, "multi_touch_3_4.csv")]
)
def test_touches_come_back_in_si_without_dropouts(tmp_path, names, file, style):
    table = touch_table(names, dropped=(4, 17, ROWS - 1))
    touch_file(tmp_path / "data" / file, table, **WRITTEN[style])
    (run,) = read_touches(tmp_path)
    kept = np.delete(np.arange(ROWS), [4, 17, ROWS - 1])
    assert (run.name, run.dropouts) == (file.removesuffix(".csv"), 3)
    assert run.field.shape == (ROWS - 3, 5, 3)
    field = np.column_stack([table[name] for name in AXES])
    np.testing.assert_allclose(run.field.reshape(-1, 15) * 1e6, field[kept])
    np.testing.assert_allclose(run.load, -table["fz"][kept])
    np.testing.assert_array_equal(run.time, table["timestamp"][kept])
    cells = [[3, 1]] if names is ONE else [[3, 1], [1, 2]]
    np.testing.assert_array_equal(run.cells, np.tile(cells, (ROWS - 3, 1, 1)))


def test_columns_may_stand_in_any_order_and_be_more(tmp_path):
    table = touch_table(TWO)
    touch_file(tmp_path / "multi_touch_1.csv", table)
    touch_file(
        tmp_path / "multi_touch_2.csv", dict(reversed(table.items())) | {"note": table["ty"]}
    )
    first, second = read_touches(str(tmp_path))
    for name in ("time", "field", "load", "cells"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def without(names, *gone):
    return [name for name in names if name not in gone]


def header_of(names):
    def change(data):
        return b"\r\n".join([",".join(names).encode(), *data.split(b"\r\n")[1:]])

    return change


TOUCH_CASES = {
    "no force": (header_of([*without(TWO, "fz"), "f"]), ":1: the header must name fz"),
    "no place": (
        header_of([name.replace("pos", "at") for name in TWO]),
        ":1: the header must name x_pos, y_pos",
    ),
    "half a place": (header_of([*without(TWO, "pos2_y"), "y2"]), "must name pos2_y"),
    "a chip's axis gone": (header_of([*without(TWO, "mag2_y"), "m"]), "must name mag2_y"),
    "no chip": (header_of([name.replace("mag", "b") for name in TWO]), "must name mag0_x"),
    "a name twice": (header_of([*without(TWO, "ty"), "fz"]), "the names of columns must differ"),
    "a header alone": (lambda d: d[: d.index(b"\n") + 1], "must hold rows of numbers; it has none"),
    "cut within a row": (lambda d: d[:-9], "the last line must end in a line break"),
    "a row cut short": (
        lambda d: b"\r\n".join([*d.split(b"\r\n")[:9], b"1.7e9,1", b""]),
        r":10: a row must have 22 columns, as line 1 has; got 2",
    ),
    "a word": (lambda d: d.replace(b"\r\n17", b"\r\nx7", 1), ":2: could not convert .*'x"),
    "time backwards": (
        lambda d: b"\r\n".join([*(d.split(b"\r\n")[k] for k in (0, 2, 1)), b""]),
        ":3: time must not run backwards",
    ),
    "no file of text": (lambda d: b"\xff\xfe" + d, ":1: not a text file of numbers"),
}


@pytest.mark.parametrize("case", TOUCH_CASES)
def test_a_damaged_file_of_touches_is_an_error_that_names_it(tmp_path, case):
    change, words = TOUCH_CASES[case]
    touch_file(tmp_path / "multi_touch_3_4.csv", touch_table(TWO))
    path = tmp_path / "multi_touch_3_4.csv"
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(RecordingError, match=rf"multi_touch_3_4\.csv.*{words}"):
        read_touches(tmp_path)


def test_a_file_of_dropouts_alone_is_an_error(tmp_path):
    touch_file(tmp_path / "position_1.csv", touch_table(ONE, dropped=range(ROWS)))
    with pytest.raises(RecordingError, match="every row is zeros"):
        read_touches(tmp_path)


def test_each_layout_is_found_wherever_it_is(tmp_path):
    touch_file(tmp_path / "touches" / "position_1.csv", touch_table(ONE))
    probed, touched = read_recordings(tmp_path)
    assert (probed, len(touched)) == ((), 1)
    write(tmp_path, tables())
    probed, touched = read_recordings(tmp_path)
    assert (len(probed), len(touched)) == (1, 1)
    assert read_touches(tmp_path / "datasets") == ()
    with pytest.raises(RecordingError, match=r"or hold files of touches \(position_\*\.csv"):
        read_recordings(tmp_path / "nowhere")
