"""What the tests of the live page share: a skin, readings, and how it looks in a browser."""

import io
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from chromium import OpenPage
from smoskin.arrays import Floats
from smoskin.feasibility import load_design
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.service.page.scene import ESTIMATED, camera

TOUCH = Contact(position=(0.045, 0.080), force=(0.1, -0.05, -0.5))
NOTHING = Estimate(time=0.0, status=Status.NO_CONTACT)
PLANAR = load_design("planar")
SKIN = geometry(PLANAR)
SHEET = SKIN.sheet
TOUCHED = Estimate(
    time=0.0,
    status=Status.CONTACT,
    contacts=(TOUCH,),
    covariance=np.diag([2e-3, 1e-3, 0.02, 0.03, 0.04])[None] ** 2,
)

FAINT = """() => {
  const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
  const luminance = (color) => {
    const [r, g, b] = numbers(color).map(
      (x) => (x /= 255) <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const paper = (element) => {
    for (; element; element = element.parentElement) {
      const color = getComputedStyle(element).backgroundColor, opaque = numbers(color)[3] ?? 1;
      if (opaque > 0.5) return color;
    }
    return "rgb(255, 255, 255)";
  };
  const faint = {}, texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node; node = texts.nextNode();) {
    const text = node.textContent.trim(), element = node.parentElement;
    const own = !element.closest(".mantine-Notification-root, script, style, [data-disabled]");
    if (!text || !own || !element.checkVisibility()) continue;
    const pair = [getComputedStyle(element).color, paper(element)];
    const [dark, light] = pair.map(luminance).sort((a, b) => a - b);
    if ((light + 0.05) / (dark + 0.05) < 4.5) faint[text] = pair;
  }
  return faint;
}"""
"""Texts of a page with less contrast, with their colours; not the viewer's passing notices."""


def reading(time: float = 0.0, field: float = 0.0, flags: object = None) -> Reading:
    return Reading(time=time, field=np.full((3, 3), field), flags=flags)


@contextmanager
def feeding(moment: Callable[[int], None]) -> Iterator[None]:
    """Calls `moment` fifty times a second, with a running number, from a thread of its own."""
    stop = threading.Event()

    def feed() -> None:
        number = 0
        while not stop.wait(0.02):
            moment(number)
            number += 1

    thread = threading.Thread(target=feed)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(10.0)


def assert_gone(before: set[threading.Thread]) -> None:
    """Every thread that was not there before has ended, or does within five seconds."""
    for thread in set(threading.enumerate()) - before:
        thread.join(5.0)
        assert not thread.is_alive(), f"{thread.name} is still running"


def pixels(
    points: Floats,
    canvas: tuple[float, float, float, float],
    view: tuple[Floats, Floats, float] | None = None,
) -> Floats:
    """Where points, m, appear in the page, by a pinhole camera; shape (..., 2).

    The camera's place, what it looks at, m, and its field of view, rad; by default a skin's.
    """
    left, top, width, height = canvas
    eye, target, field_of_view = view or camera(PLANAR)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    scale = height / 2 / math.tan(field_of_view / 2)
    ray = points - eye
    depth = ray @ ahead
    return np.stack(
        [
            left + width / 2 + scale * (ray @ right) / depth,
            top + height / 2 - scale * (ray @ np.cross(right, ahead)) / depth,
        ],
        axis=-1,
    )


def picture(opened: OpenPage) -> Floats:
    """The 3-D picture, shape (H, W, 3), 0 to 255."""
    image = pytest.importorskip("PIL.Image")
    left, top, width, height = opened.canvas()
    png = opened.page.screenshot(clip={"x": left, "y": top, "width": width, "height": height})
    return np.asarray(image.open(io.BytesIO(png)).convert("RGB"), dtype=float)


def vermilion(colors: Floats) -> int:
    """How many pixels have about the colour of an estimated force in some light."""
    share = colors / np.maximum(colors.sum(axis=-1, keepdims=True), 1.0)
    wanted = np.array(ESTIMATED) / sum(ESTIMATED)
    vivid = np.ptp(colors, axis=-1) > 90
    return int((vivid & (np.linalg.norm(share - wanted, axis=-1) < 0.15)).sum())


def settle(opened: OpenPage) -> tuple[float, float, float, float]:
    """Waits until the panels stand; the place of the picture."""
    opened.page.get_by_text("Press the skin").wait_for()
    opened.page.wait_for_timeout(1500)  # the panels slide in and the canvas shrinks
    opened.dismiss_notices()
    return opened.canvas()
