"""Every example runs, and asserts its own number."""

import runpy
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("[0-9]*.py"))


LONG = {"06_a_skin_by_thirty_touches"}
CASES = [
    pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem in LONG else [])
    for path in EXAMPLES
]


@pytest.mark.parametrize("path", CASES)
def test_example(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "assert " in path.read_text()
    runpy.run_path(str(path))
    assert capsys.readouterr().out


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 6
