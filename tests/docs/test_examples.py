"""Recipes are short, assert their own number and draw a picture; the quick ones run here."""

import ast
import runpy
import statistics
from pathlib import Path

import matplotlib as mpl
import pytest

mpl.use("agg")
RECIPES = sorted((Path(__file__).parents[2] / "examples").glob("[0-9]*.py"))
LONG = ("01_", "02_", "06_", "12_", "14_", "18_", "20_", "22_")
"""Recipes that press the whole sheet, which run with the slow tests."""


def code_lines(path: Path) -> int:
    """Lines of a recipe without docstrings, imports and blanks."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    lines: set[int] = set()
    for node in tree.body:
        plain = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if not plain and not isinstance(node, ast.Import | ast.ImportFrom):
            lines |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=pytest.mark.slow)
        if path.name.startswith(LONG)
        else pytest.param(path, id=path.stem)
        for path in RECIPES
    ],
)
def test_a_recipe_asserts_its_number_and_draws(path, capsys):
    from matplotlib import pyplot as plt

    assert "\nassert " in path.read_text() or "    assert " in path.read_text()
    runpy.run_path(str(path))
    assert capsys.readouterr().out
    assert plt.get_fignums()
    plt.close("all")


def test_there_are_twenty_recipes_and_they_are_short():
    assert len(RECIPES) >= 20
    assert statistics.median(code_lines(path) for path in RECIPES) <= 12
