"""The documents say what the code does."""

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_equation_is_listed_and_tested():
    make = runpy.run_path(str(ROOT / "docs" / "make_equations.py"))
    entries = make["entries"]()
    assert len(entries) > 20
    assert [f"{e.module}.{e.name}" for e in entries if not e.tests] == []
    assert make["PAGE"].read_text() == make["page"](), "run python docs/make_equations.py"


def test_ci_runs_the_readmes_test_command():
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    commands = [line for block in blocks for line in block.splitlines() if "pytest" in line]
    assert len(commands) == 1
    assert commands[0] in (ROOT / ".ci" / "run").read_text().splitlines()


def test_errata_named_in_the_code_are_on_the_page():
    known = set(re.findall(r"^\| (E\d+) ", (ROOT / "docs" / "errata.md").read_text(), re.M))
    named = set()
    for path in (ROOT / "src").rglob("*.py"):
        named |= set(re.findall(r"errat(?:um|a) (E\d+)", path.read_text()))
    assert named
    assert named <= known


def test_tests_named_on_the_errata_page_exist():
    tests = (ROOT / "tests" / "paper" / "test_errata.py").read_text()
    page = (ROOT / "docs" / "errata.md").read_text()
    for number in re.findall(r"`(?:[\w/.]+::)?(test_e\d+)`", page):
        assert f"def {number}_" in tests
