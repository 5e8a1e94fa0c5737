"""Docstrings speak plain English: each opens with its subject or with a verb."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WITHOUT_SUBJECT = re.compile(
    r"(Of|By which|That|Whose|In which|From which|With which|Where|Of the)\b"
)


def openings(path: Path) -> list[tuple[int, str]]:
    """Line and first line of every string that stands as a statement."""
    return [
        (node.lineno, node.value.value.strip().split("\n")[0])
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    ]


@pytest.mark.parametrize("folder", ["src", "paper", "studies"])
def test_docstrings_open_with_a_subject_or_a_verb(folder):
    bare = [
        f"{path.relative_to(ROOT)}:{line}: {opening}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, opening in openings(path)
        if WITHOUT_SUBJECT.match(opening)
    ]
    assert bare == []


SAY_NOTHING = {"said", "told", "one", "found"}
WIRE = {
    "src/smoskin/commands/demo/__init__.py": {"found"},
    "src/smoskin/commands/demo/hand.py": {"found"},
}
"""Fields whose names are those of the demo's JSON."""


def bound(path: Path) -> list[tuple[int, str]]:
    """Line and name of all that a file binds: variables, arguments, attributes and functions."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                names.append((node.lineno, name))
            case ast.arg(arg=name):
                names.append((node.lineno, name))
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                names.append((node.lineno, name))
    return names


@pytest.mark.parametrize(
    "folder", ["src", "paper", "studies", "benchmarks", "docs", "examples", "tests"]
)
def test_names_say_what_they_hold(folder):
    empty = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, name in bound(path)
        if name.strip("_") in SAY_NOTHING - WIRE.get(str(path.relative_to(ROOT)), set())
    ]
    assert empty == []
