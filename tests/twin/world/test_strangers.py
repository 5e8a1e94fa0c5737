"""Laws outside the family: what each does between vertices and past the rim."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Touches, patch_shares
from smoskin.origami.geometry import geometry
from smoskin.twin.world.strangers import STRANGERS, Gaussian, Warped


def shares(law, design, place, radius=1e-6):
    touches = Touches(position=[[place]], force=[[(0.0, 0.0, -0.5)]], radius=radius)
    return law.shares(design, touches)[0, 0]


def along(law, design, way):
    """Share of the second of two neighbours along x, a way from the first."""
    tops = geometry(design).tops
    place = (1 - way) * tops[2, 3] + way * tops[3, 3]
    both = shares(law, design, place)[2:4, 3]
    assert both.sum() == pytest.approx(1.0, abs=1e-4)
    return both[1]


def test_an_unwarped_law_is_bilinear(planar):
    rng = np.random.default_rng(0)
    place = rng.uniform(0, geometry(planar).extent, (20, 1, 2))
    touches = Touches(position=place, force=np.broadcast_to([0.0, 0.0, -0.5], (20, 1, 3)))
    assert_allclose(Warped().shares(planar, touches), patch_shares(planar, touches), atol=1e-12)


def test_between_vertices_shares_go_as_they_are_warped(planar):
    for way in (0.1, 0.3, 0.5, 0.8):
        step = 3 * way**2 - 2 * way**3
        assert along(STRANGERS["smoothstep"], planar, way) == pytest.approx(step, abs=1e-3)
        half = along(STRANGERS["smoothstep-half"], planar, way)
        assert half == pytest.approx((way + step) / 2, abs=1e-3)
        tight = along(STRANGERS["tight"], planar, way)
        assert tight == pytest.approx(np.clip((way - 0.15) / 0.7, 0, 1), abs=1e-3)


def test_past_the_rim_the_lever_is_as_long_as_told(planar):
    tops = geometry(planar).tops
    for name, lever in (("half-lever", 0.5), ("no-lever", 0.0), ("smoothstep", 1.0)):
        weights = shares(STRANGERS[name], planar, (0.0, tops[0, 3, 1]))
        middle = np.einsum("nm,nmd->d", weights, tops)
        assert middle[0] == pytest.approx(tops[0, 0, 0] * (1 - lever), abs=1e-5)


def test_a_gaussian_falls_with_the_distance(planar):
    tops = geometry(planar).tops
    near, far = Gaussian(width=1e-3), Gaussian(width=10e-3)
    assert shares(near, planar, tops[2, 2] + 1e-3)[2, 2] == pytest.approx(1.0)
    weights = shares(far, planar, tops[2, 3])
    ratio = np.exp(-((tops[3, 3, 0] - tops[2, 3, 0]) ** 2) / 2e-4)
    assert weights[3, 3] / weights[2, 3] == pytest.approx(ratio, rel=1e-3)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"smooth": 1.1}, r"smooth must lie in \[0, 1.0\]; got 1.1"),
     ({"cut": 0.5}, "cut must lie"), ({"lever": -0.1}, "lever must lie"),
     ({"lever": np.nan}, "lever must lie")],
)  # fmt: skip
def test_warps_that_cannot_be_are_refused(wrong, message):
    with pytest.raises(ArgumentError, match=message):
        Warped(**wrong)


def test_a_width_is_positive():
    with pytest.raises(ArgumentError, match="width must be positive and finite; got 0"):
        Gaussian(width=0)
