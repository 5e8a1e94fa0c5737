"""Opens pages in the system's Chromium with the network off."""

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page, Route

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
WIDTH, HEIGHT = 1400, 900
_ARGUMENTS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    # Whatever slips past the route handler finds no address.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


@dataclass
class OpenPage:
    """A page and everything that it asked for or complained about."""

    page: "Page"
    outside: list[str] = field(default_factory=list)
    """Addresses outside this machine; each was refused."""
    errors: list[str] = field(default_factory=list)
    """Exceptions in the page."""

    def text(self, name: str) -> str:
        """What the first element marked `data-name` with this name says; waits for it."""
        return self.page.locator(f'[data-name="{name}"]').first.text_content() or ""

    def wait_until(self, holds: Callable[[], object], deadline: float = 30.0) -> None:
        """Let the page run until something holds; fails after `deadline` seconds."""
        end = time.monotonic() + deadline
        while time.monotonic() < end:
            if holds():
                return
            self.page.wait_for_timeout(50)
        pytest.fail(f"did not come true within {deadline} s")

    def click(self, element: "Locator") -> None:
        """Click an element, without waiting for it to stand still: a busy page draws too seldom."""
        element.dispatch_event("click")

    def canvas(self) -> tuple[float, float, float, float]:
        """Left, top, width and height of the 3-D picture, in pixels of the page."""
        box = self.page.locator("canvas").first.bounding_box()
        assert box is not None
        return box["x"], box["y"], box["width"], box["height"]

    def dismiss_notices(self) -> None:
        """Close what the viewer says about drawing without a graphics card."""
        # In one go: a notice also goes by itself, and a click would then wait for it.
        close = ".mantine-Notification-closeButton"
        self.page.evaluate(f"document.querySelectorAll('{close}').forEach((each) => each.click())")
        self.wait_until(lambda: not self.page.locator(close).count())


def _is_here(url: str) -> bool:
    parts = urlsplit(url)
    return parts.scheme in ("data", "blob") or parts.hostname == "127.0.0.1"


@contextmanager
def open_page(url: str, *, deadline: float = 60.0) -> Iterator[OpenPage]:
    """The page at `url`, of 1400 x 900 pixels; skips the test where there is no Chromium.

    Leaving fails the test if the page asked for anything outside 127.0.0.1 or raised.
    Every wait in the page ends after `deadline` seconds.
    """
    if CHROMIUM is None:
        pytest.skip("no chromium on the path")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(_ARGUMENTS))
        try:
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
            page.set_default_timeout(deadline * 1e3)
            opened = OpenPage(page)

            def admit(route: "Route") -> None:
                if _is_here(route.request.url):
                    route.continue_()
                else:
                    opened.outside.append(route.request.url)
                    route.abort()

            def note_socket(address: str) -> None:
                if not _is_here(address):
                    opened.outside.append(address)

            page.route("**/*", admit)
            page.on("websocket", lambda socket: note_socket(socket.url))
            page.on("pageerror", lambda error: opened.errors.append(str(error)))
            page.goto(url)
            yield opened
        finally:
            browser.close()
    assert not opened.outside, f"the page asked for {opened.outside}"
    assert not opened.errors, f"the page raised {opened.errors}"


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        pass


@contextmanager
def open_file(path: Path) -> Iterator[OpenPage]:
    """A page on the disk, as `open_page` opens one."""
    serve = partial(_Quiet, directory=str(path.parent))
    server = ThreadingHTTPServer(("127.0.0.1", 0), serve)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with open_page(f"http://127.0.0.1:{server.server_port}/{path.name}") as opened:
            yield opened
    finally:
        server.shutdown()
        server.server_close()
