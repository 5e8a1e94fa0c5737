"""The crease pattern in a browser's origami simulator, which others wrote."""

import json
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from chromium import open_page
from published_patterns import DATA
from smoskin.origami.surface.analytic import Cone
from smoskin.origami.tessellation import documents
from smoskin.origami.tessellation.tessellate import tessellate


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@pytest.fixture
def simulator():
    """The simulator's address."""
    folder = DATA / "origami" / "simulator"
    if not folder.is_dir():
        pytest.skip(f"no {folder}; set SMOSKIN_DATA to the data's folder")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/index.html"
    server.shutdown()
    server.server_close()


def missed(places, aim):
    """Root mean square between two shapes, m, one moved and scaled on to the other."""
    places, aim = places - places.mean(axis=0), aim - aim.mean(axis=0)
    left, size, right = np.linalg.svd(places.T @ aim)
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    scale = np.trace(np.diag(size) @ mirror) / (places**2).sum()
    return float(np.sqrt(((scale * places @ left @ mirror @ right - aim) ** 2).sum(1).mean()))


@pytest.mark.slow
@pytest.mark.browser
def test_it_folds_to_the_sheet_that_was_attached(planar, simulator):
    made = tessellate(Cone(0.06, 0.08, 0.15), planar.cell, (3, 3))
    pattern = json.loads(documents.crease_pattern(made, "a skin"))
    off = []

    def lands(opened):
        told = opened.page.evaluate("Array.from(globals.model.getPositionsArray())")
        places = np.array(told).reshape(-1, 3)[: len(made.pattern)]
        off.append(missed(places, made.sheet.vertices))
        return off[-1] < 0.2e-3

    with open_page(simulator) as opened:
        opened.wait_until(lambda: opened.page.evaluate("typeof globals.model == 'object'"))
        opened.page.evaluate(
            "fold => { globals.numSteps = 1000; globals.creasePercent = 0.3;"
            " globals.shouldChangeCreasePercent = true; globals.pattern.setFoldData(fold) }",
            pattern,
        )
        opened.page.wait_for_timeout(3000)
        assert not lands(opened)
        opened.page.evaluate(
            "() => { globals.creasePercent = 1; globals.shouldChangeCreasePercent = true }"
        )
        opened.wait_until(lambda: lands(opened), 90.0)
        strain = float(opened.page.inner_text("#globalError").split()[0])
        opened.outside.clear()  # the page asks for fonts and statistics, and is refused
    assert strain < 0.5
