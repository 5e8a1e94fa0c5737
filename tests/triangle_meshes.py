"""Meshes of known surfaces: triangles of about 4 mm, with noise along the normal."""

import numpy as np

from smoskin.origami.surface.mesh import Mesh
from smoskin.origami.surface.surface import forms


def meshed(surface, half, *, edge=4e-3, noise=0.0, seed=0, drop=None):
    """A mesh of a chart's rectangle; `drop` tells which triangles to leave out by their middles."""
    rng = np.random.default_rng(seed)
    counts = [round(2 * h / edge) + 1 for h in half]
    u = np.stack(
        np.meshgrid(*(np.linspace(-h, h, n) for h, n in zip(half, counts, strict=True)),
                    indexing="ij"), axis=-1).reshape(-1, 2)  # fmt: skip
    inner = (np.abs(u) < np.array(half) - 1e-9).all(axis=1)
    u[inner] += rng.uniform(-0.25, 0.25, (inner.sum(), 2)) * edge
    index = np.arange(len(u)).reshape(counts)
    p, q, r, s = (
        part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    )
    triangles = np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)])
    if drop is not None:
        triangles = triangles[~drop(u[triangles].mean(axis=1))]
    at = forms(surface, u)
    return Mesh(at.places + noise * rng.normal(size=(len(u), 1)) * at.normals, triangles)
