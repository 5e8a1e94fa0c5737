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
