"""The documentation site builds without a warning, and every page opens without the network."""

import functools
import http.server
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from chromium import open_page

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html",
         str(ROOT / "docs"), str(out)],
        capture_output=True, text=True, timeout=840.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
    return out


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.timeout(1200)
def test_every_page_opens_offline(site):
    pages = [path.relative_to(site) for path in sorted(site.rglob("*.html"))]
    assert Path("quickstart.html") in pages
    assert sum(path.parts[0] == "recipes" for path in pages) > 20
    handler = functools.partial(_Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        with open_page(f"{address}/index.html") as opened:
            for path in pages:
                answer = opened.page.goto(f"{address}/{path}", wait_until="load")
                assert answer is not None
                assert answer.ok, path
                assert opened.page.title(), path
                assert opened.page.locator("article").count() == 1, path
        server.shutdown()


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Say nothing."""
