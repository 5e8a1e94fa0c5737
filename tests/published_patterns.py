"""Crease patterns that others published, read from the data beside the project."""

import os
from pathlib import Path

import numpy as np
import pytest

DATA = Path(os.environ.get("SMOSKIN_DATA") or Path(__file__).parents[2] / "shared" / "data")


def published(name):
    """Vertices (V, 3) and panels (F, 4) of a folded pattern; skips where there is none."""
    path = DATA / "origami" / "additive" / f"{name}_fold.obj"
    if not path.exists():
        pytest.skip(f"no {path}; set SMOSKIN_DATA to the data's folder")
    rows = [line.split() for line in path.read_text().splitlines() if line[:2] in ("v ", "f ")]
    vertices = [[float(x) for x in row[1:]] for row in rows if row[0] == "v"]
    facets = [[int(x.split("/")[0]) - 1 for x in row[1:]] for row in rows if row[0] == "f"]
    return np.array(vertices), np.array(facets)
