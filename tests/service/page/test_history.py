"""Forces beside a threshold, the chips' lamps, and the map of the bound."""

import numpy as np
import pytest

from pages import NOTHING, PLANAR, SKIN, TOUCHED, reading
from smoskin.records import ChipFlag
from smoskin.service.page.history import lamps

pytest.importorskip("viser")
from smoskin.service.page.carpet import Bound
from smoskin.service.page.scene import Moment
from smoskin.service.page.view import View

NAMES = ("S1", "S2", "S3")
GOOD = np.zeros(3, dtype=int)


def moment(time, estimate):
    return Moment(reading(time), estimate, (), None, 0.0, 0.0)


def test_a_lamp_says_in_words_how_its_chip_is_and_how_far_its_zero_has_gone():
    drift = np.array([[3e-6, 4e-6, 0.0], [0.0, 0.0, 2e-4], [np.nan] * 3])
    flags = np.array([0, 0, ChipFlag.SATURATED | ChipFlag.INVALID])
    first, second, third = lamps(NAMES, flags, drift).split("<tr>")[1:]
    assert "S1" in first
    assert "good" in first
    assert "5 µT" in first
    assert "drifted: zero it untouched" in second
    assert "200 µT" in second
    assert "saturated" in third
    assert "invalid" in third
    assert "zero drifted –" in third
    assert lamps(NAMES, None, None).count("no reading yet") == 3


def test_forces_are_kept_for_ten_seconds_and_held_to_the_threshold():
    with View(PLANAR) as view:
        panel = view._panel
        forces = panel._forces
        assert forces.sentence() == ""
        for k in range(200):
            panel.record(moment(0.1 * k, TOUCHED if k > 150 else NOTHING))
        forces.write()
        since, first, second, threshold = forces._plot.data
        np.testing.assert_allclose((since.min(), since.max()), (-10, 0), atol=1e-9)
        assert (np.diff(since) >= 0).all()
        size = np.linalg.norm(TOUCHED.contacts[0].force)
        np.testing.assert_allclose(first[-49:], size)
        assert not first[:-49].any()
        assert not second.any()
        assert (threshold == 0.5).all()
        assert forces.sentence() == "above the threshold of 0.50 N"
        forces._threshold.value = 0.6
        assert forces.sentence() == "below the threshold of 0.60 N"
        panel.record(moment(3.0, NOTHING))  # the clock goes back
        forces.write()
        assert len(forces._plot.data[0]) == 2


def test_the_map_lies_over_the_sheet_and_is_darkest_where_it_is_finest():
    x, y = (np.linspace(0, end, n) for end, n in zip(SKIN.extent, (4, 5), strict=True))
    location = 1e-3 * np.linspace(0.2, 1.0, 20).reshape(4, 5)
    bound = Bound(x, y, location, 0.5)
    with View(PLANAR) as view:
        carpet = view._scene.carpet
        assert not view._panel._mapped.visible
        view.show_bound(bound)
        assert view._panel._mapped.visible
        assert not carpet.node.visible
        view._panel._mapped.value = True
        carpet.show(view._panel.mapped)
        assert carpet.node.visible
        points = carpet.node.points.reshape(4, 5, 3) / 100
        np.testing.assert_allclose(points[..., 0], np.broadcast_to(x[:, None], (4, 5)), atol=1e-4)
        np.testing.assert_allclose(points[..., 1], np.broadcast_to(y, (4, 5)), atol=1e-4)
        assert points[..., 2].min() > SKIN.sheet.vertices[:, 2].max()
        light = carpet.node.colors.reshape(-1, 3) @ (0.299, 0.587, 0.114)
        assert (np.diff(light) >= 0).all()
        assert light[-1] - light[0] > 100  # told apart in grey too
        low, high = bound.scale
        assert f"{1e3 * low:.2f} mm" in view._panel._map.content
        assert f"{1e3 * high:.2f} mm" in view._panel._map.content
