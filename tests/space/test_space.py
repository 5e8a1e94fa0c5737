"""Pages that show bodies in space: what they carry, and what their slider does in a browser."""

import base64
import json
import re

import numpy as np
import pytest

from chromium import open_file
from smoskin.space import Body, Shade, page


def bodies(groups):
    """Bodies as a page carries them."""
    match = re.search(r"^const groups = (.*);$", groups.decode(), re.MULTILINE)
    return json.loads(match[1])


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


@pytest.fixture
def rising():
    """A triangle that rises by 10 mm and grows hot."""
    flat = np.array([[0, 0, 0], [0.03, 0, 0], [0, 0.03, 0]], float)
    shade = Shade(name="heat", unit="K", top=2.0, values=np.array([[0.0] * 3, [2.0] * 3]))
    return Body(
        name="triangle",
        colour="#ff0000",
        frames=np.stack([flat, flat + np.array([0, 0, 0.01])]),
        triangles=np.array([[0, 1, 2]]),
        shades=[shade],
    )


def test_a_page_carries_its_bodies_and_asks_for_nothing_outside(rising):
    made = page([rising], "START of <GROUPS>", "fold", start=1.0)
    text = made.decode()
    assert "<title>START of &lt;GROUPS&gt;</title>" in text
    assert '<input id="fold" type="range" min="0" max="1" step="0.01" value="1">' in text
    assert "http" not in text
    (group,) = bodies(made)
    np.testing.assert_allclose(
        numbers(group["vertices"], "<f4").reshape(2, 3, 3), 1e3 * rising.frames
    )
    np.testing.assert_array_equal(numbers(group["triangles"], "<u4"), [0, 1, 2])
    np.testing.assert_array_equal(numbers(group["shades"][0]["values"], "<f4"), [0] * 3 + [2] * 3)


@pytest.mark.slow
@pytest.mark.browser
def test_the_slider_leads_bodies_from_frame_to_frame(rising, tmp_path):
    (tmp_path / "page.html").write_bytes(page([rising], "a triangle", "fold"))
    with open_file(tmp_path / "page.html") as opened:
        for share in (0.0, 0.25, 1.0):
            opened.page.locator("#fold").fill(str(share))
            now = opened.page.evaluate("Array.from(groups[0].now)")
            np.testing.assert_allclose(now[2::3], 10 * share, atol=1e-5)
        np.testing.assert_allclose(ink(opened), [1, 0, 0], atol=0.02)
        opened.page.locator("input[value=heat]").check()
        np.testing.assert_allclose(ink(opened), [1, 0xE7 / 0xFD, 0x25 / 0xFD], atol=0.02)
        assert "yellow: 2 K; most now: 2 K" in opened.page.locator("form").text_content()
        opened.page.locator("#fold").fill("0")
        np.testing.assert_allclose(ink(opened), [0x44 / 0x54, 0x01 / 0x54, 1], atol=0.02)
        assert not opened.errors
        assert opened.outside == []


def ink(opened):
    """The commonest colour on the canvas but for its ground, each channel over the largest one."""
    seen = opened.page.evaluate(
        """() => {
          const gl = document.querySelector("canvas").getContext("webgl2");
          const all = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
          gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA,
            gl.UNSIGNED_BYTE, all);
          return Array.from(all);
        }"""
    )
    colours, counts = np.unique(np.reshape(seen, (-1, 4))[:, :3], axis=0, return_counts=True)
    common = colours[np.argsort(counts)[-2]]
    return common / common.max()
