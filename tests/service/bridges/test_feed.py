"""The JSON feed: what clients are told, who may be one, and that none of them holds the loop up."""

import contextlib
import gc
import io
import json
import re
import socket
import threading
import time
import weakref
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.service.bridges.feed import Feed

pytest.importorskip("websockets")
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

PLANAR = load_design("planar")
PAGE = Path(__file__).parents[3] / "docs" / "feed.md"
COVARIANCE = np.diag([1e-6, 4e-6, 0.01, 0.04, 0.09])


@pytest.fixture
def feed() -> Iterator[Feed]:
    with Feed() as feed:
        yield feed


def bare(feed: Feed) -> str:
    """The feed's address without its token."""
    return feed.url.partition("/?")[0]


def received(client: ClientConnection) -> dict[str, Any]:
    """The next message to a client."""
    return json.loads(client.recv(timeout=10.0))


@contextlib.contextmanager
def listening(feed: Feed, query: str = "") -> Iterator[ClientConnection]:
    """A client that has its hello and is let in."""
    with connect(f"{bare(feed)}/{query}", open_timeout=10.0) as client:
        assert received(client)["type"] == "hello"
        before = time.monotonic()
        while not feed.clients:
            assert time.monotonic() < before + 10.0
        yield client


def reading(time: float = 0.0, chips: int = 3) -> Reading:
    field = np.arange(3.0 * chips).reshape(chips, 3) * 1e-6
    return Reading(time=time, field=field, temperature=np.full(chips, 25.0))


def test_a_client_is_told_every_estimate_in_units_that_names_say(feed):
    sink = feed.add("left", 3, PLANAR)
    touch = Contact(position=(0.045, 0.080), force=(0.1, -0.05, -0.5))
    with connect(bare(feed), open_timeout=10.0) as client:
        hello = received(client)
        assert hello["protocol"] == "smoskin.feed.v1"
        assert hello["skins"] == [
            {
                "skin": "left",
                "chips": 3,
                "design": "planar",
                "design_hash": PLANAR.content_hash,
                "size_mm": [120.0, 160.0],
            }
        ]
        while not feed.clients:
            time.sleep(0.001)
        for k in range(20):
            covariance = COVARIANCE[None]
            estimate = Estimate(
                time=0.1 * k, status=Status.CONTACT, contacts=(touch,), covariance=covariance
            )
            sink.write(reading(0.1 * k), estimate)
        messages = [received(client) for _ in range(20)]
    assert [message["sequence"] for message in messages] == list(range(20))
    last = messages[-1]
    assert last["skin"] == "left"
    assert last["time_s"] == pytest.approx(1.9)
    assert last["unix_s"] == pytest.approx(time.time(), abs=30.0)
    assert (last["status"], last["means"]) == ("CONTACT", Status.CONTACT.value)
    assert last["contacts"] == [{"x_mm": 45.0, "y_mm": 80.0, "force_N": [0.1, -0.05, -0.5]}]
    assert_allclose(last["covariance"], [np.diag([1.0, 4.0, 0.01, 0.04, 0.09])])
    assert [chip["field_uT"] for chip in last["chips"]] == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]


def test_what_is_not_known_is_null_and_faults_have_names(feed):
    sink = feed.add("skin", 2)
    bad = Reading(
        time=1.0,
        field=[[np.nan, 1e-6, np.inf], [0.0, 0.0, 0.0]],
        flags=[ChipFlag.SATURATED | ChipFlag.OLD, ChipFlag.GOOD],
    )
    with listening(feed) as client:
        sink.write(bad, Estimate(time=1.0, status=Status.CHIP_MISSING))
        message = received(client)
    assert message["contacts"] == []
    assert message["chips"] == [
        {
            "field_uT": [None, 1.0, None],
            "temperature_degC": None,
            "faults": ["SATURATED", "OLD"],
        },
        {"field_uT": [0.0, 0.0, 0.0], "temperature_degC": None, "faults": []},
    ]


def test_a_client_that_asks_for_fewer_gets_fewer_of_each_skin(feed):
    sinks = [feed.add(name, 3) for name in ("left", "right")]
    with listening(feed, "?rate_hz=0.001") as client:
        for _ in range(5):
            for sink in sinks:
                sink.write(reading())
        assert {received(client)["skin"] for _ in sinks} == {"left", "right"}
        with pytest.raises(TimeoutError):
            client.recv(timeout=0.2)


def test_a_client_that_does_not_read_loses_what_is_old_and_delays_nobody(feed):
    sink, count = feed.add("skin", 3, counters=dict), 6_000
    narrow = socket.socket()
    narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
    narrow.connect(("127.0.0.1", urlsplit(feed.url).port))
    with (
        connect(bare(feed), sock=narrow, max_queue=1) as slow,
        listening(feed) as client,
    ):
        while feed.clients < 2:
            time.sleep(0.001)
        for k in range(count):
            sink.write(reading(float(k)))
            if k % 20 == 19:  # the quick client keeps up
                numbers = [received(client)["sequence"] for _ in range(20)]
                assert numbers == list(range(k - 19, k + 1))
        client.send('{"type": "counters", "skin": "skin"}')
        assert received(client)["skipped_for_you"] == 0
        assert received(slow)["type"] == "hello"
        seen = []
        while not seen or seen[-1] < count - 1:
            seen.append(received(slow)["sequence"])
        slow.send('{"type": "counters", "skin": "skin"}')
        assert received(slow)["skipped_for_you"] == count - len(seen) > 0
    assert seen == sorted(set(seen))


def test_what_comes_faster_than_it_can_be_told_is_not_kept(feed):
    """A recording that is read as fast as possible must not fill the memory."""
    sink, count = feed.add("skin", 3, counters=dict), 3_000
    began, go = threading.Event(), threading.Event()

    def hold() -> None:
        began.set()
        go.wait(10.0)

    feed.add("busy", 3, zero=hold)
    with listening(feed) as client:
        client.send('{"type": "zero", "skin": "busy"}')
        assert began.wait(10.0)  # the feed's thread stands
        gc.collect()
        before = len(gc.get_objects())
        for k in range(count):
            sink.write(reading(float(k)))
        assert len(gc.get_objects()) - before < count
        go.set()
        messages = [received(client)]
        while messages[-1].get("sequence") != count - 1:
            messages.append(received(client))
        client.send('{"type": "counters", "skin": "skin"}')
        heard = sum(message["type"] == "estimate" for message in messages)
        assert received(client)["skipped_for_you"] == count - heard > 0


def test_zero_and_counters_are_asked_for_by_a_skins_name(feed):
    asked = threading.Event()
    feed.add("left", 3, zero=asked.set, counters=lambda: {"readings": 7})
    feed.add("right", 3)
    with listening(feed) as client:
        client.send('{"type": "zero", "skin": "left"}')
        assert received(client) == {"type": "done", "command": "zero", "skin": "left"}
        assert asked.is_set()
        client.send('{"type": "counters", "skin": "left"}')
        assert received(client) == {
            "type": "counters",
            "skin": "left",
            "readings": 7,
            "skipped_for_you": 0,
        }
        client.send('{"type": "zero", "skin": "right"}')
        assert "this skin takes no commands" in received(client)["sentence"]


@pytest.mark.parametrize(
    "message",
    [
        *("", "zero", "[]", "3", "{}", "[" * 2000, b"\xff\xfe"),
        *('{"type": "zero"}', '{"type": "zero", "skin": ["a"]}', '{"type": "arm", "skin": "left"}'),
    ],
)
def test_what_is_not_understood_is_refused_in_a_sentence(feed, message):
    feed.add("left", 3, zero=lambda: None)
    with listening(feed) as client:
        client.send(message)
        answer = received(client)
        assert answer["type"] == "error"
        assert re.search("left|zero", answer["sentence"])
        client.send('{"type": "zero", "skin": "left"}')
        assert received(client)["type"] == "done"


def test_a_skin_that_is_closed_is_gone_and_let_go(feed):
    class Loop:
        def zero(self) -> None: ...

    loop = Loop()
    held = weakref.ref(loop)
    sink = feed.add("left", 3, zero=loop.zero)
    feed.add("right", 3, zero=lambda: None)
    del loop
    sink.close()
    gc.collect()
    assert held() is None
    with connect(bare(feed), open_timeout=10.0) as client:
        assert [skin["skin"] for skin in received(client)["skins"]] == ["right"]
        client.send('{"type": "zero", "skin": "left"}')
        assert received(client)["sentence"].endswith("one of: right")
    again = feed.add("left", 3)
    sink.close()
    with pytest.raises(ArgumentError, match="'left' again"):
        feed.add("left", 3)
    again.close()


def test_an_oversized_message_ends_its_connection_alone(feed):
    sink = feed.add("skin", 3)
    with listening(feed) as other:
        with listening(feed) as client:
            client.send("x" * 5000)
            with pytest.raises(ConnectionClosed, match="1009"):
                client.recv(timeout=10.0)
        sink.write(reading())
        assert received(other)["sequence"] == 0


def answered(url: str, **headers: str) -> int:
    """HTTP status with which a request for a WebSocket is answered."""
    parts = urlsplit(url)
    asked = {
        "Host": parts.netloc,
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "MDEyMzQ1Njc4OWFiY2RlZg==",
    } | headers
    connection = HTTPConnection("127.0.0.1", parts.port, timeout=10.0)
    connection.putrequest("GET", f"/?{parts.query}", skip_host=True)
    for name, value in asked.items():
        connection.putheader(name, value)
    connection.endheaders()
    status = connection.getresponse().status
    connection.close()
    return status


@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"}],
)
def test_pages_of_other_sites_and_other_names_of_this_machine_need_the_token(feed, headers):
    assert answered(bare(feed)) == 101
    assert answered(bare(feed), **headers) == 403
    assert answered(f"{bare(feed)}/?token=guessed", **headers) == 403
    assert answered(feed.url, **headers) == 101


def test_beyond_this_machine_nobody_comes_in_without_the_token():
    with Feed(host="0.0.0.0") as feed:
        assert answered(bare(feed)) == 403
        assert answered(feed.url) == 101


@pytest.mark.parametrize("rate", ["0", "-1", "nan", "fast"])
def test_a_rate_that_is_none_is_refused(feed, rate):
    assert answered(f"{bare(feed)}/?rate_hz={rate}") == 400


def test_clients_that_come_and_go_leave_nothing_behind(feed):
    sink = feed.add("skin", 3)

    def held() -> tuple[int, int]:
        gc.collect()
        return threading.active_count(), len(list(Path("/proc/self/fd").iterdir()))

    before = held()
    for k in range(10):
        with listening(feed) as client:
            sink.write(reading(float(k)))
            received(client)
    end = time.monotonic() + 10.0
    while (feed.clients or held() != before) and time.monotonic() < end:
        time.sleep(0.01)
    assert feed.clients == 0
    assert held() == before


def test_wrong_use_is_named(feed):
    sink = feed.add("skin", 3)
    with pytest.raises(ArgumentError, match="name must be of one skin alone; got 'skin' again"):
        feed.add("skin", 3)
    with pytest.raises(ArgumentError, match="reading must have 3 chips; got 2"):
        sink.write(reading(chips=2))
    port = urlsplit(feed.url).port
    with pytest.raises(ArgumentError, match=f"must be free to listen at; got 127.0.0.1:{port}"):
        Feed(port=port)
    feed.close()
    feed.close()
    sink.write(reading())  # a loop may outlive its feed


def test_the_client_of_the_page_runs(feed):
    (program,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    sink = feed.add("left", 3, PLANAR)
    touch = Contact(position=(0.045, 0.080), force=(0.1, -0.05, -0.5))
    printed, ended = io.StringIO(), threading.Event()

    def client() -> None:
        text = program.replace("ws://127.0.0.1:8770", bare(feed))
        exec(text, {"print": lambda *parts: print(*parts, file=printed)})
        ended.set()

    threading.Thread(target=client, daemon=True).start()
    end = time.monotonic() + 10.0
    while "45.0 80.0 [0.1, -0.05, -0.5]" not in printed.getvalue() and time.monotonic() < end:
        sink.write(
            reading(),
            Estimate(
                time=0.0, status=Status.CONTACT, contacts=(touch,), covariance=COVARIANCE[None]
            ),
        )
        time.sleep(0.01)
    feed.close()
    assert ended.wait(10.0)
    first, *rest = printed.getvalue().splitlines()
    assert "'size_mm': [120.0, 160.0]" in first
    assert set(rest) == {"left 45.0 80.0 [0.1, -0.05, -0.5]"}
