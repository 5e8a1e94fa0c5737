"""Seeded faults: which there are, how they are drawn, and what a project's tests make of them."""

import json
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from smoskin.errors import ArgumentError
from studies.mutation import __main__ as command
from studies.mutation.faults import draw, faults_in
from studies.mutation.trials import judge_all, judges_of, sources

HALF = '''"""Halves."""


def half(value: float, least: float = 0.0) -> float:
    """Half of it, 2.0 at most."""
    if value < least:
        raise ValueError(f"value must be at least {least + 1}")
    return max(value, least) / 2
'''
NOT_COLORS = ("(9, 3.0)", "(7, 3.0)", "(8, 6.0)", "(8, 1.5)")
TEST = """from smoskin.room.half import half


def test_half():
    assert half(4.0) == 2.0
"""


def changes(source: str, **options) -> dict[str, set[str]]:
    """Last line of each fault's difference, by kind."""
    by_kind: dict[str, set[str]] = {}
    for fault in faults_in("a.py", source, **options):
        line = fault.diff(source).splitlines()[-1].removeprefix("+").strip()
        by_kind.setdefault(fault.kind, set()).add(line)
    return by_kind


@pytest.mark.parametrize(
    ("source", "kind", "expected"),
    [
        ("y = a - b", "arithmetic", {"y = (a + b)"}),
        ("y = a - b", "exchange", {"y = (b - a)"}),
        ("y = a + b", "term", {"y = a", "y = b"}),
        ("y = a * b", "factor", {"y = (2 * (a * b))"}),
        ("y = -a", "sign", {"y = a"}),
        ("y = a < b", "comparison", {"y = (a <= b)", "y = (a > b)"}),
        ("y = not a", "not", {"y = a"}),
        ("y = a and b", "boolean", {"y = (a or b)", "y = a", "y = b"}),
        ("y = 3", "constant", {"y = 4", "y = 2"}),
        ("y = 0.5", "constant", {"y = 1.0", "y = 0.25"}),
        ("y = x.mean(axis=0)", "axis", {"y = x.mean(axis=1)"}),
        ("y = x.mean(axis=-1)", "axis", {"y = x.mean(axis=0)"}),
        ("y = x.mean()", "function", {"y = x.sum()"}),
        ("y = max(a, b)", "function", {"y = min(a, b)"}),
        ("y = sqrt(a)", "function", {"y = a"}),
        ("y = f(a, b)", "exchange", {"y = f(b, a)"}),
        ("y = f(a, of=b)", "argument", {"y = f(a)"}),
        ("f(a)", "statement", {"pass"}),
        ("a[0] = 1", "statement", {"pass"}),
        ("if a:\n    raise E", "guard", {"if False:"}),
        ("for a in b:\n    break", "loop", {"continue"}),
        ("y = a if c else b", "condition", {"y = a", "y = b", "y = (a if not c else b)"}),
        ("raise typer.Exit(1)", "exit", {"raise typer.Exit(0)"}),
        ("raise typer.Exit(1)", "constant", {"raise typer.Exit(0)", "raise typer.Exit(2)"}),
        ("y: Final = (8, 3.0)", "constant", {f"y: Final = {x}" for x in NOT_COLORS}),
        ("def f(a=3): pass", "constant", {"def f(a=4): pass", "def f(a=2): pass"}),
    ],
)
def test_every_kind_changes_its_place(source, kind, expected):
    assert changes(source)[kind] == expected


@pytest.mark.parametrize(
    "source",
    [
        '"""Of 2 words."""',
        "y: Annotated[int, 3]",
        "def f(a: Literal[1]) -> Literal[2]: ...",
        'raise ValueError(f"must be {a + 1}", 2)',
        "@dataclass(frozen=True)\nclass A: ...",
        "if TYPE_CHECKING:\n    import a",
        '__all__ = ["a"] + ["b"]',
        "y = zip(strict=True)",
        "y = slider(hint='drag me')",
        "y = lru_cache(maxsize=8)",
        "y = Record(a=b)",
        "y = maximum(a, b)",
        "with suppress(OSError, ValueError): ...",
        "y: Final = (213, 94, 0)",
        "y = add_line(thickness=0.1)",
    ],
)
def test_places_that_cannot_matter_are_left_alone(source):
    assert set(changes(source)) <= {"function"}


def test_a_change_that_changes_nothing_is_no_fault():
    assert "exchange" not in changes("def square(rows):\n    return outer(rows, rows)\n")
    assert "exchange" in changes("def grid(rows, columns):\n    return outer(rows, columns)\n")


@pytest.mark.parametrize(
    "source",
    ["y = norm(a - b)", "y = np.linalg.norm(a - b, axis=1)", "y = (a - b) ** 2", "y = abs(a - b)"],
)
def test_a_sign_of_what_only_its_size_counts_is_no_fault(source):
    every = {line for lines in changes(source).values() for line in lines}
    assert not any("b - a" in line or "(-(a - b)))" in line for line in every)
    assert any("a + b" in line for line in every)
    for odd in ("norm(a, b - c)", "(a - b) ** 3", "(a - b) ** n", "sin(a - b)", "sum(a - b)"):
        assert {"sign", "exchange"} <= set(changes(f"y = {odd}"))
    assert "exchange" in changes("y = abs(a / b)")


def test_messages_are_changed_where_asked():
    source = 'raise ValueError(f"must be {a}")'
    assert changes(source, messages=True)["message"] == {"raise ValueError('')"}


def test_a_fault_leaves_the_rest_of_the_file_as_it_was():
    source = "µ = 'é'; y = a + b  # why\nz = 1\n"
    (fault,) = [
        candidate for candidate in faults_in("a.py", source) if candidate.kind == "arithmetic"
    ]
    assert fault.applied(source) == "µ = 'é'; y = (a - b)  # why\nz = 1\n"
    assert fault.line == 1
    assert fault.key_in(source) != fault.key_in(source.replace("why", "that"))


@pytest.fixture
def project(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # for the time it takes
    root = tmp_path / "project"
    for name, text in {
        "pyproject.toml": '[tool.pytest.ini_options]\naddopts = ["--import-mode=importlib"]\n',
        "src/smoskin/__init__.py": "",
        "src/smoskin/room/__init__.py": "",
        "src/smoskin/room/half.py": HALF,
        "tests/room/test_half.py": TEST,
        "tests/test_other.py": "import smoskin.room.half\n\n\ndef test_other():\n    assert True\n",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root


def test_faults_are_drawn_at_one_line_each_and_again_with_the_same_seed(project):
    files = list(sources(project, ["room"]))
    assert files == ["src/smoskin/room/__init__.py", "src/smoskin/room/half.py"]
    drawn = draw(project, files, 2, seed=1)
    assert drawn == draw(project, files, 2, seed=1)
    assert len(drawn) == len({fault.line for fault in drawn}) == 2
    many = {fault for seed in range(60) for fault in draw(project, files, 9, seed=seed)}
    assert {fault.line for fault in many} == {4, 6, 8}
    assert {fault.kind for fault in many} == {fault.kind for fault in faults_in(files[1], HALF)}


def test_the_nearest_tests_come_first(project):
    path = "src/smoskin/room/half.py"
    assert judges_of(project, path, "mirror") == [path, "tests/room/test_half.py", "tests/room"]
    assert judges_of(project, path, "importers") == ["tests/test_other.py"]
    (project / "tests/test_usual.py").write_text('USUAL = {"room.half.half": 0.0}\n')
    both = ["tests/test_other.py", "tests/test_usual.py"]
    assert judges_of(project, path, "importers") == both
    assert judges_of(project, path, "default") == ["src", "tests"]


def wanted(kind: str, line: int):
    path = "src/smoskin/room/half.py"
    return next(
        fault for fault in faults_in(path, HALF) if (fault.kind, fault.line) == (kind, line)
    )


def test_a_fault_is_killed_by_the_test_that_notices_it(project):
    faults = [wanted("arithmetic", 8), wanted("guard", 6)]
    killed, survived = judge_all(project, faults, last="importers", workers=2)
    assert (killed.outcome, killed.tier) == ("killed", "mirror")
    assert killed.by == "tests/room/test_half.py::test_half"
    assert (survived.outcome, survived.tier, survived.by) == ("survived", "importers", "")
    assert survived.diff == "-    if value < least:\n+    if False:"
    assert survived.text.endswith(survived.diff)
    assert (project / "src/smoskin/room/half.py").read_text("utf-8") == HALF


def test_tests_that_fail_on_the_sound_code_kill_nothing(project):
    test = project / "tests/room/test_half.py"
    test.write_text(TEST + "\n\ndef test_always():\n    assert False\n", encoding="utf-8")
    (judgement,) = judge_all(project, [wanted("guard", 6)], last="mirror")
    assert judgement.outcome == "survived"


def test_tests_that_cannot_be_collected_on_the_sound_code_kill_nothing(project):
    test = project / "tests/room/test_half.py"
    test.write_text("import absent\n" + TEST, encoding="utf-8")
    (judgement,) = judge_all(project, [wanted("arithmetic", 8)], last="mirror")
    assert judgement.outcome == "survived"


def test_what_cannot_be_imported_is_killed(project):
    (project / "tests/conftest.py").write_text("from smoskin.room.half import half\n\nhalf(4.0)\n")
    (project / "src/smoskin/room/half.py").write_text(HALF + "\n\nassert half(1.0) == 0.5\n")
    (judgement,) = judge_all(project, [wanted("arithmetic", 8)], last="mirror")
    assert judgement.outcome == "killed"


@pytest.mark.slow
def test_tests_that_do_not_end_are_ended(project):
    slow = "import time\n\n\ndef test_half():\n    time.sleep(60)\n"
    (project / "tests/room/test_half.py").write_text(slow, encoding="utf-8")
    start = time.monotonic()
    (judgement,) = judge_all(project, [wanted("guard", 6)], deadline=3.0)
    assert judgement.outcome == "timed out"
    assert time.monotonic() - start < 30


def test_a_fault_that_lets_tests_run_for_ever_is_killed(project):
    waits = TEST.replace("assert half(4.0) == 2.0", "while half(4.0) != 2.0:\n        pass")
    (project / "tests/room/test_half.py").write_text(waits, encoding="utf-8")
    (judgement,) = judge_all(project, [wanted("arithmetic", 8)], deadline=3.0)
    assert (judgement.outcome, judgement.by) == ("killed", "the tests do not end")


def test_only_the_package_has_faults(project):
    with pytest.raises(ArgumentError, match=r"below src/smoskin; got a\.py"):
        judge_all(project, faults_in("a.py", "y = 1"))
    with pytest.raises(ArgumentError, match="room must be a folder or module of"):
        list(sources(project, ["attic"]))


def test_a_run_is_taken_up_where_it_ended(project, tmp_path, monkeypatch):
    import typer

    monkeypatch.setattr(command, "_ROOT", project)
    app = typer.Typer()
    app.command()(command.main)
    out = tmp_path / "faults.json"
    options = ["--room", "room", "--count", "2", "--tier", "mirror"]
    listed = CliRunner().invoke(app, [*options, "--list"])
    assert listed.output.count("src/smoskin/room/half.py:") == 2
    first = CliRunner().invoke(app, [*options, "--out", str(out)])
    assert first.exit_code == 1, "guards of this project have no test"
    written = json.loads(out.read_text("utf-8"))
    assert len(written) == 2
    assert {"killed", "survived"} == {judgement["outcome"] for judgement in written.values()}
    monkeypatch.setattr(command, "judge_all", lambda root, faults, **rest: faults == [] or 1 / 0)
    again = CliRunner().invoke(app, [*options, "--out", str(out)])
    assert again.output.splitlines()[-1] == first.output.splitlines()[-1]
