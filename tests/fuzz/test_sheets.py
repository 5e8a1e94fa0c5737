"""Sheets of touches as people and programs spoil them: numbers that are touches, or refused."""

import csv
import io
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from fuzzing import (
    NUMBERS,
    broken,
    cases,
    check_answer,
    check_error,
    command,
    mutated,
    working_folder,
)
from smoskin.errors import ArgumentError, RecordingError
from smoskin.measurement import read_touches

NAME = "t.csv"
CELLS = (
    *NUMBERS,
    *("", " ", "1,5", "1 000", "1_0", "٣", "½", "0x10", "1e999999999", "1" * 5000, "true", "None"),
    *("=1+1", "'", '"', '"a\nb"', "x" * 100_000, "\x00", "\x1b[2J", "−1", "1.0.0", "12:30", "-"),
)
"""What people and spreadsheets write in a cell."""


@pytest.fixture(scope="module")
def sheets(tmp_path_factory) -> list[str]:
    """A plan to fill in, and a sheet that a bench has filled in."""
    with working_folder(tmp_path_factory.mktemp("sheets")):
        for words in (
            ("virtual-bench", "full.csv", "--sheet", "reduced"),
            ("touches", "plan", "--out", "plan.csv", "--count", "3"),
        ):
            assert command(*words).code == 0
        return [Path(name).read_text(encoding="utf-8") for name in ("full.csv", "plan.csv")]


def changed(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """A sheet in which a cell, a row or a column is another."""
    rows = list(csv.reader(io.StringIO(text)))
    way, at = int(rng.integers(10)), int(rng.integers(1, len(rows)))
    column = int(rng.integers(len(rows[0])))
    cell = str(rng.choice(np.array(CELLS, dtype=object)))
    what = f"{rows[0][column]} of line {at + 1}"
    match way:
        case 0:
            rows = [row[:column] + row[column + 1 :] for row in rows]
            what = f"column {column + 1} lost"
        case 1:
            rows[at] = rows[at][:column]
            what = f"line {at + 1} ends early"
        case 2:
            rows[at].append(cell)
            what = f"line {at + 1} has a cell more"
        case 3:
            rows[0][column] = cell
            what = f"column {column + 1} is called {cell[:40]!r}"
        case 4:
            return f"other separator after {at}", text.replace(",", ";")
        case _:
            rows[at][column] = cell
            what = f"{what} = {cell[:40]!r}"
    out = io.StringIO()
    csv.writer(out, quoting=csv.QUOTE_MINIMAL).writerows(rows)
    return what, out.getvalue()


def read(content: bytes) -> None:
    """A sheet that is read holds touches; what becomes of them is refused by name or works."""
    Path(NAME).write_bytes(content)
    try:
        table, _ = read_touches(NAME)
    except RecordingError as error:
        check_error(error, NAME)
        return
    assert np.isfinite(table.force).all()
    assert not np.isinf(table.field).any()
    assert (np.isfinite(table.position).all(axis=1) == table.touched).all()
    try:
        table.held_touches()
    except ArgumentError as error:
        check_error(error)


def drawn(sheets: list[str], count: int, seed: int):
    rng = np.random.default_rng(seed)
    for k in range(count):
        text = sheets[k % len(sheets)]
        if k % 4 == 3:
            what, content = mutated(text.encode(), rng)
        else:
            what, text = changed(text, rng)
            content = text.encode("utf-8", "surrogatepass")
        yield f"{k}: {what}", content


@cases(8, 700)
def test_a_spoilt_sheet_holds_touches_or_is_refused(count, sheets, tmp_path):
    with working_folder(tmp_path):
        assert (
            broken((label, partial(read, content)) for label, content in drawn(sheets, count, 6))
            == []
        )


@cases(1, 40)
def test_programs_take_a_spoilt_sheet_or_refuse_it(count, sheets, tmp_path):
    """What has been touched already is read before more is planned."""

    def plan(content: bytes) -> None:
        Path(NAME).write_bytes(content)
        words = ("touches", "plan", "--count", "1", "--out", "p.csv", "--after", NAME, "--json")
        Path("p.csv").unlink(missing_ok=True)
        check_answer(command(*words), as_json=True)

    with working_folder(tmp_path):
        assert (
            broken(
                (label, partial(plan, content)) for label, content in drawn(sheets[:1], count, 7)
            )
            == []
        )
