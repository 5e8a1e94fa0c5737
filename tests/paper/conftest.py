"""Figures that a test drew are closed after it."""

import pytest


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.close("all")
