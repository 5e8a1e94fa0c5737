"""Writes docs/equations.md from the `Source:` lines of the package's docstrings.

Run ``python docs/make_equations.py`` after adding an equation; a test fails while the page, or
the test of an equation, is missing.
"""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "equations.md"
HEADER = """# Equations

Every function that computes a published equation, from its docstring's `Source:` line. Written by
`docs/make_equations.py`.

| source | function | tested in |
|---|---|---|
"""


@dataclass(frozen=True)
class Entry:
    """One function that names its source."""

    source: str
    module: str
    name: str
    tests: tuple[str, ...]


def entries() -> list[Entry]:
    """All functions, classes and methods with a `Source:` line, in the order of the equations."""
    tests = {path: _imported(path) for path in sorted((ROOT / "tests").rglob("test_*.py"))}
    listed = []
    sources = [(ROOT / "src", path) for path in sorted((ROOT / "src").rglob("*.py"))]
    sources += [(ROOT, path) for path in sorted((ROOT / "paper").rglob("*.py"))]
    for root, path in sources:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        module = ".".join(path.relative_to(root).with_suffix("").parts)
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                match = re.search(r"Source: (SI .*?)(?:\n\s*\n|\Z|Valid for)",
                                  ast.get_docstring(node) or "", re.S)  # fmt: skip
                if match:
                    source = re.split(
                        r"(?<!Eq)(?<!Eqs)[.:;] ", " ".join(match[1].split()).rstrip(".")
                    )[0]
                    using = tuple(
                        str(test.relative_to(ROOT)) for test, names in tests.items()
                        if {(module, node.name), ("smoskin", node.name)} & names
                    )  # fmt: skip
                    listed.append(Entry(source, module, node.name, using))
    return sorted(listed, key=lambda entry: (_number(entry.source), entry.module, entry.name))


def _imported(path: Path) -> set[tuple[str, str]]:
    """Module and name of everything that a test imports by name."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {
        (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module is not None
        for alias in node.names
    }


def page() -> str:
    """The whole page."""
    rows = [
        f"| {entry.source} | `{entry.module}.{entry.name}` | {', '.join(entry.tests)} |"
        for entry in entries()
    ]
    return HEADER + "\n".join(rows) + "\n"


def _number(source: str) -> float:
    match = re.search(r"S(\d+)", source)
    return float(match[1]) if match else 1e3


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
