"""The documentation site builds without a warning, and every page opens without the network."""

import functools
import http.server
import subprocess
import sys
import threading
from html.parser import HTMLParser
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
    every = [path.relative_to(site) for path in sorted(site.rglob("*.html"))]
    assert Path("quickstart.html") in every
    assert sum(path.parts[0] == "recipes" for path in every) > 20
    # Modules' pages are alike: what they load is read, and some are opened.
    modules = [path for path in every if path.parts[0] == "api"]
    assert len(modules) > 100
    for path in modules:
        loads = _Loads()
        loads.feed((site / path).read_text(encoding="utf-8"))
        assert loads.title, path
        assert loads.names, path
        for name in loads.names:
            assert (site / path.parent / name.partition("?")[0]).resolve().is_file(), (path, name)
    pages = [path for path in every if path not in modules[3:]]
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


class _Loads(HTMLParser):
    """What a page loads, and whether it has a title."""

    def __init__(self) -> None:
        super().__init__()
        self.names: list[str] = []
        self.title = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        self.title |= tag == "title"
        if tag in ("script", "img") or (tag == "link" and attributes.get("rel") == "stylesheet"):
            name = attributes.get("src") or attributes.get("href")
            self.names += [name] if name and not name.startswith("data:") else []


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Say nothing."""
