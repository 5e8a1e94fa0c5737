"""The page that takes an assembled skin apart, in a browser."""

from dataclasses import replace

import numpy as np
import pytest

from chromium import open_file
from smoskin.fabrication.moulds.assembly import whole_skin
from smoskin.fabrication.moulds.solids import joined_mesh, triangles_of
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.process.view import view
from smoskin.fabrication.workshop import Workshop


@pytest.fixture(scope="module")
def parts(planar):
    corners = {"M1": (1, 2), "M2": (2, 1), "M3": (1, 1)}
    magnets = tuple(replace(m, corner=corners[m.name]) for m in planar.magnets)
    small = replace(planar, cells=(3, 3), magnets=magnets)
    return whole_skin(small, flat_sheet(small, Workshop()), Workshop())


def test_parts_are_joined_one_after_another(parts):
    vertices, triangles = joined_mesh(parts[:3])
    counts = [len(triangles_of(part.solid)[0]) for part in parts[:3]]
    assert len(vertices) == sum(counts)
    assert triangles.max() == len(vertices) - 1
    first = triangles_of(parts[0].solid)[1]
    assert np.array_equal(triangles[: len(first)], first)


def test_the_page_asks_for_nothing_outside(parts):
    page = view(parts, "a <skin>", ["M1"]).decode()
    assert "a &lt;skin&gt;" in page
    assert "http" not in page
    assert page.count('"name"') == 12


@pytest.mark.slow
@pytest.mark.browser
def test_the_slider_takes_the_skin_apart(parts, tmp_path):
    (tmp_path / "assembly.html").write_bytes(view(parts, "a skin", ["M1"]))

    def inked(opened):
        """Share of the canvas that is not background, and its rows."""
        return opened.page.evaluate(
            """() => {
              const gl = document.querySelector("canvas").getContext("webgl2");
              const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
              const all = new Uint8Array(4 * w * h);
              gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, all);
              let count = 0, low = h, high = 0;
              for (let k = 0; k < w * h; k++)
                if (Math.abs(all[4 * k] - 247) + Math.abs(all[4 * k + 1] - 247) > 8) {
                  count++; const y = Math.floor(k / w);
                  low = Math.min(low, y); high = Math.max(high, y);
                }
              return [count / (w * h), (high - low) / h];
            }"""
        )

    with open_file(tmp_path / "assembly.html") as opened:
        closed = inked(opened)
        assert 0.05 < closed[0] < 0.9
        opened.page.locator("#apart").fill("1")
        apart = inked(opened)
        assert apart[1] > closed[1]
        boxes = opened.page.locator("input[type=checkbox]")
        assert boxes.count() == 12
        for k in range(12):
            boxes.nth(k).uncheck()
        assert inked(opened)[0] == 0
        assert not opened.errors
        assert [a for a in opened.outside if "favicon" not in a] == []
