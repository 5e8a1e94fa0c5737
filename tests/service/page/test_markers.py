"""Shapes that mark touches on the page."""

import numpy as np
import pytest

from smoskin.service.page.markers import arrow


@pytest.mark.parametrize("force", [(0.0, 0.0, -1.0), (0.4, -0.2, -0.5), (-1.0, 0.0, 0.0)])
def test_an_arrow_is_one_closed_body_that_ends_at_the_contact(force):
    vertices, triangles = arrow(np.array(force), 1.0)
    assert 0 <= triangles.min() <= triangles.max() < len(vertices)
    # Rings of no radius are points: count their vertices as one.
    _, point = np.unique(vertices.round(9), axis=0, return_inverse=True)
    corners = point.ravel()[triangles]
    corners = corners[[len(set(row)) == 3 for row in corners.tolist()]]
    edges = np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)]).tolist()
    directed = set(map(tuple, edges))
    assert len(directed) == len(edges)
    assert {(end, start) for start, end in directed} == directed
    along = vertices @ np.array(force) / np.linalg.norm(force)
    assert along.max() == pytest.approx(0.0, abs=1e-9) or along.min() == pytest.approx(
        0.0, abs=1e-9
    )
