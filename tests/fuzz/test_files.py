"""Data sets as disks spoil them, and what `check` says of files of all kinds."""

import json
import shutil
from functools import partial
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from fuzzing import (
    broken,
    cases,
    changed_toml,
    check_answer,
    check_error,
    command,
    mutated,
    strict_json,
    working_folder,
)
from networks import random_network
from smoskin.commands.check import check_file
from smoskin.datasets.patterns import Random, Sweep
from smoskin.datasets.simulation import COLUMNS
from smoskin.datasets.store import Dataset, open_dataset, write_dataset
from smoskin.datasets.workers import Engine
from smoskin.design.document import read_design
from smoskin.errors import RecordingError
from smoskin.sensing.closed_form.calibration import Calibration, format_calibration
from tables_of_response import random_table
from touch_recordings import record

SWEEP = Sweep(presses=Random(count=6), mechanics="reduced", presses_per_chunk=3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Dataset:
    """A data set of two chunks."""
    folder = tmp_path_factory.mktemp("whole")
    return write_dataset(folder / "s", read_design("planar"), SWEEP, engine=Engine(1))


def columns(data: Dataset) -> dict[str, bytes]:
    return {c.name: data.column(c.name).tobytes() for c in COLUMNS.values()}


def same_or_told(file: str, content: bytes, good: Dataset) -> None:
    """A spoilt data set holds the same rows, or is refused, or tells which are damaged."""
    shutil.rmtree("s", ignore_errors=True)
    shutil.copytree(good.path, "s")
    (Path("s") / file).write_bytes(content)
    sound = False
    try:
        data = open_dataset("s")
        sound = not data.damaged()
        rows = columns(data)
    except RecordingError as error:
        check_error(error, "s")
    else:
        assert data.manifest.identity == good.manifest.identity
        assert not sound or rows == columns(good), "other rows, and said to be sound"
    answer = command("sweep", "--summary", "s", "--json")
    check_answer(answer, as_json=True, names="s")
    assert sound or answer.code == 1


@cases(6, 250)
def test_a_spoilt_data_set_is_the_same_or_tells(count, whole, tmp_path):
    def drawn():
        rng = np.random.default_rng(10)
        files = sorted(file.name for file in whole.path.iterdir() if file.stat().st_size)
        for k in range(count):
            file = files[k % len(files)]
            what, content = mutated((whole.path / file).read_bytes(), rng)
            yield f"{k}: {file} {what}", partial(same_or_told, file, content, whole)

    with working_folder(tmp_path):
        assert broken(drawn()) == []


def verdict(content: bytes) -> None:
    """What is said of a file can be read, by machines too."""
    Path("f").write_bytes(content)
    report = check_file(Path("f"))
    assert len(report.problem) <= 300
    assert report.problem.isprintable()
    strict_json(json.dumps(report.as_json()))
    assert report.lines()


@cases(10, 600)
def test_check_says_what_a_spoilt_file_is(count, tmp_path):
    with working_folder(tmp_path):
        record(Path("r.mcap"), 12)
        random_table(modes=1, chips=(0,)).save("t")
        random_network().save("n")
        calibration = format_calibration(Calibration.nominal(read_design("planar")))
        design = (resources.files("smoskin.design") / "planar.toml").read_text(encoding="utf-8")
        assert command("virtual-bench", "b.csv", "--sheet", "reduced").code == 0
        binary = [Path(name).read_bytes() for name in ("r.mcap", "t", "n", "b.csv")]

        def drawn():
            rng = np.random.default_rng(11)
            for k in range(count):
                if k % 3:
                    what, content = mutated(binary[k % len(binary)], rng)
                else:
                    what, text = changed_toml((calibration, design)[k % 2], rng)
                    content = text.encode()
                yield f"{k}: {what}", partial(verdict, content)

        assert broken(drawn()) == []
