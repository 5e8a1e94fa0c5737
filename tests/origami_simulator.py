"""The browser's origami simulator, which others wrote, served from the data beside the project."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from chromium import OpenPage, open_page
from published_patterns import DATA


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@contextmanager
def open_simulator() -> Iterator[OpenPage]:
    """The simulator's page; skips the test where it is not there."""
    folder = DATA / "origami" / "simulator"
    if not folder.is_dir():
        pytest.skip(f"no {folder}; set SMOSKIN_DATA to the data's folder")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with open_page(f"http://127.0.0.1:{server.server_port}/index.html") as opened:
            opened.wait_until(lambda: opened.page.evaluate("typeof globals.model == 'object'"))
            yield opened
            opened.outside.clear()  # the page asks for fonts and statistics, and is refused
    finally:
        server.shutdown()
        server.server_close()


def missed(places, aim):
    """Root mean square between two shapes, m, one moved and scaled on to the other."""
    places, aim = places - places.mean(axis=0), aim - aim.mean(axis=0)
    left, size, right = np.linalg.svd(places.T @ aim)
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    scale = np.trace(np.diag(size) @ mirror) / (places**2).sum()
    return float(np.sqrt(((scale * places @ left @ mirror @ right - aim) ** 2).sum(1).mean()))


def folds_to(opened: OpenPage, aim, within: float, deadline: float = 150.0) -> float:
    """Fold what is loaded until it lies within so many m of a shape; its strain, per cent."""
    count = len(aim)

    def lands():
        positions = opened.page.evaluate("Array.from(globals.model.getPositionsArray())")
        return missed(np.array(positions).reshape(-1, 3)[:count], aim) < within

    opened.page.evaluate(
        "() => { globals.numSteps = 1000; globals.creasePercent = 0.3;"
        " globals.shouldChangeCreasePercent = true }"
    )
    opened.page.wait_for_timeout(3000)
    assert not lands()
    opened.page.evaluate(
        "() => { globals.creasePercent = 1; globals.shouldChangeCreasePercent = true }"
    )
    opened.wait_until(lands, deadline)
    return float(opened.page.inner_text("#globalError").split()[0])
