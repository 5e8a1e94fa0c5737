"""Who may come in to the live page, and what junk brings about."""

import gzip
import logging
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from http.client import HTTPConnection
from urllib.parse import parse_qs, urlsplit

import pytest

from smoskin.errors import SmoskinError
from smoskin.feasibility import load_design
from smoskin.service.page import server
from smoskin.service.page.view import View

sockets = pytest.importorskip("websockets.sync.client")
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402
from websockets.sync.client import ClientConnection  # noqa: E402

LOG = "smoskin.service.page.server"


@pytest.fixture(scope="module")
def view() -> Iterator[View]:
    with View(load_design("planar")) as view:
        yield view


@pytest.fixture
def port(view: View) -> int:
    port = urlsplit(view.url).port
    assert port is not None
    return port


@pytest.fixture
def token(view: View) -> str:
    return parse_qs(urlsplit(view.url).query)["token"][0]


def get(port: int, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    """What the server answers to a GET."""
    connection = HTTPConnection("127.0.0.1", port, timeout=10.0)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in ({"Host": f"127.0.0.1:{port}"} | headers).items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    given, body = dict(answer.getheaders()), answer.read()
    connection.close()
    return answer.status, given, body


def last_message(connection: ClientConnection) -> None:
    """Reads until the server ends the connection, which raises."""
    while True:
        connection.recv(timeout=10.0)


def test_the_page_comes_to_who_has_the_token(port: int, token: str) -> None:
    status, headers, body = get(port, f"/?token={token}")
    page = gzip.decompress(body).decode()
    assert status == 200
    assert headers["Referrer-Policy"] == "no-referrer"
    assert "<title>smoskin: planar</title>" in page
    assert "Three magnetic chips under a folded sheet feel where" in page
    assert token not in page
    cookie = headers["Set-Cookie"]
    assert cookie.startswith(f"smoskin-{port}={token};")
    assert "HttpOnly; SameSite=Strict" in cookie
    assert get(port, "/", Cookie=cookie.split(";")[0])[0] == 200
    assert get(port, f"/?token={token}", Host=f"localhost:{port}")[0] == 200


@pytest.mark.parametrize(
    ("path", "headers", "reason"),
    [
        ("/", {}, "lacks its token"),
        ("/?token=guessed", {}, "lacks its token"),
        ("/?token=%ff%fe", {}, "lacks its token"),
        ("/", {"Cookie": "smoskin-1=x; ;=; smoskin-PORT=guessed"}, "lacks its token"),
        ("/TOKEN", {"Host": "evil.example"}, "another machine's name"),
        ("/TOKEN", {"Host": "evil.example:PORT"}, "another machine's name"),
        ("/TOKEN", {"Host": "127.0.0.1:1"}, "another machine's name"),
        ("/TOKEN", {"Origin": "http://localhost:9200"}, "another page asks"),
        ("/TOKEN", {"Origin": "null"}, "another page asks"),
        ("/TOKEN", {"Origin": "https://127.0.0.1:PORT"}, "another page asks"),
    ],
)
def test_strangers_are_refused(
    path: str,
    headers: dict[str, str],
    reason: str,
    port: int,
    token: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    path = path.replace("TOKEN", f"?token={token}")
    headers = {name: value.replace("PORT", str(port)) for name, value in headers.items()}
    status, _, body = get(port, path, **headers)
    assert status == 403
    assert reason in body.decode()
    assert token not in body.decode() + caplog.text
    if "Host" in headers:  # the client writes its own
        return
    cookies = {name: value for name, value in headers.items() if name == "Cookie"}
    address = f"ws://127.0.0.1:{port}{path}"
    with pytest.raises(InvalidStatus, match="403"):
        sockets.connect(address, origin=headers.get("Origin"), additional_headers=cookies)


def test_junk_is_one_line_of_the_log_each(
    view: View, port: int, token: str, caplog: pytest.LogCaptureFixture
) -> None:
    import viser

    caplog.set_level(logging.WARNING)
    for junk in (b"\xff\x00junk", "text", b"\x81\xa4type\xa4None"):
        with sockets.connect(
            f"ws://127.0.0.1:{port}/?token={token}",
            origin=f"http://127.0.0.1:{port}",
            subprotocols=[f"viser-v{viser.__version__}"],
        ) as connection:
            connection.send(junk)
            with pytest.raises(ConnectionClosed, match="1003"):
                last_message(connection)
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.sendall(b"\x16\x03\x01 no HTTP\r\n\r\n")
        connection.recv(1000)
    records = [record for record in caplog.records if record.name.startswith(LOG)]
    assert len(records) >= 3
    assert all(record.exc_info is None and "\n" not in record.getMessage() for record in records)
    assert get(port, f"/?token={token}")[0] == 200


def test_a_message_that_is_too_large_is_refused(port: int, token: str) -> None:
    import viser

    with sockets.connect(
        f"ws://127.0.0.1:{port}/?token={token}",
        origin=f"http://127.0.0.1:{port}",
        subprotocols=[f"viser-v{viser.__version__}"],
    ) as connection:
        connection.send(bytes(server._LARGEST + 1))
        with pytest.raises(ConnectionClosed, match="1009"):
            last_message(connection)
    assert get(port, f"/?token={token}")[0] == 200


def test_a_message_sets_values_of_what_is_offered_and_nothing_else(
    view: View, port: int, token: str, caplog: pytest.LogCaptureFixture
) -> None:
    import msgspec
    import viser

    still, push = view._panel.still, view._panel._push
    assert not still.visible
    caplog.set_level(logging.WARNING)
    refused = [(push, {"disabled": True}), (push, {"update_cb": []}), (still, {"value": True})]
    refused.append((push, {"value": 0.7, "max": 9.0}))
    callbacks = list(push._impl.update_cb)
    with sockets.connect(
        f"ws://127.0.0.1:{port}/?token={token}",
        origin=f"http://127.0.0.1:{port}",
        subprotocols=[f"viser-v{viser.__version__}"],
    ) as connection:
        for control, updates in (*refused, (push, {"value": 0.8})):
            message = {"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": updates}
            connection.send(msgspec.msgpack.encode(message))
        end = time.monotonic() + 10.0
        while push.value != 0.8 and time.monotonic() < end:
            time.sleep(0.01)
    assert (push.value, push.disabled, push.max, still.value) == (0.8, False, 1.0, False)
    assert push._impl.update_cb == callbacks
    logged = [record.getMessage() for record in caplog.records if "refused" in record.getMessage()]
    assert logged == [
        "refused to set disabled of a control",
        "refused to set update_cb of a control",
        "refused to set value, max of a control",
    ]


def test_ten_visitors_come_and_go_and_leave_nothing(view: View, port: int, token: str) -> None:
    import viser

    def visit() -> None:
        connections = [
            sockets.connect(
                f"ws://127.0.0.1:{port}/?token={token}",
                origin=f"http://127.0.0.1:{port}",
                subprotocols=[f"viser-v{viser.__version__}"],
            )
            for _ in range(10)
        ]
        for connection in connections:
            connection.recv(timeout=10.0)
        assert len(view._server.get_clients()) <= 10
        for connection in connections:
            connection.close()
        end = time.monotonic() + 10.0
        while view._server.get_clients() and time.monotonic() < end:
            time.sleep(0.02)
        assert not view._server.get_clients()

    def left() -> tuple[int, int]:
        return threading.active_count(), len(os.listdir("/proc/self/fd"))

    visit()  # pools of threads are made once
    before = left()
    visit()
    visit()
    end = time.monotonic() + 10.0
    while left() > before and time.monotonic() < end:
        time.sleep(0.05)
    threads, files = left()
    assert threads <= before[0]
    assert files <= before[1]


def test_a_viewer_that_passes_the_guard_by_is_not_served(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_asked", lambda door: nullcontext())
    with pytest.raises(SmoskinError, match="the page must be guarded"):
        View(load_design("planar"))
