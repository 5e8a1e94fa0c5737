"""Estimates for any program, as JSON over a WebSocket: the protocol ``smoskin.feed.v1``.

Decides what is sent to whom: every client gets every estimate while it keeps up, and the newest
alone when it does not; none of them slows the loop or another client. The messages stand in
``docs/feed.md``. Hides the server, which runs in a thread of its own.
"""

import asyncio
import json
import logging
import math
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, Final, final
from urllib.parse import parse_qs, urlsplit

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError, SmoskinError
from smoskin.origami.geometry import geometry
from smoskin.records import Estimate, Reading
from smoskin.roles import Resource, Sink
from smoskin.service.bridges.door import HERE, Door
from smoskin.service.bridges.values import chip_values, covariance_values, estimate_values

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

PROTOCOL: Final = "smoskin.feed.v1"
_LOG: Final = logging.getLogger(__name__)
_DEADLINE: Final = 5.0
"""s for the server to begin and to end."""
_BEHIND: Final = 32
"""Messages that wait for a client, at most; then the newest of them stays alone."""
_CLIENTS: Final = 32
"""Clients at a time."""
_HELD: Final = 32768
"""Bytes that the system holds for a client, at most."""
_LARGEST: Final = 4096
"""Bytes of a client's message."""
_as_json: Final = json.JSONEncoder(allow_nan=False).encode


@dataclass(frozen=True, slots=True)
class _Skin:
    """A skin of the feed."""

    hello: Mapping[str, Any]
    zero: Callable[[], None] | None
    counters: Callable[[], Mapping[str, Any]] | None


@dataclass(slots=True, eq=False)
class _Client:
    """Somebody who listens."""

    period: float
    """s between two estimates of one skin, at least."""
    waiting: deque[str] = field(default_factory=deque)
    ready: asyncio.Event = field(default_factory=asyncio.Event)
    due: dict[str, float] = field(default_factory=dict)
    """When the next estimate of each skin is wanted, on the loop's clock, s."""
    skipped: int = 0
    """Estimates that the client was too slow for."""

    def offer(self, skin: str, text: str, now: float) -> None:
        """Put a message in the queue, unless the client wants fewer."""
        due = self.due.get(skin, now)
        if now < due:
            return
        self.due[skin] = max(due + self.period, now)
        if len(self.waiting) == _BEHIND:
            self.skipped += _BEHIND
            self.waiting.clear()
        self.waiting.append(text)
        self.ready.set()


@final
class Feed(Resource):
    """A server of the estimates of any number of skins.

    Parameters
    ----------
    host : str
        Address to listen at; by default this machine's alone. At any other, every client needs the
        token that `url` holds.
    port : int
        TCP port; 0 takes a free one.

    Raises
    ------
    ArgumentError
        If it cannot listen there.
    MissingExtraError
        If the extra `view`, which brings the WebSocket library, is not installed.

    Examples
    --------
    ::

        with Feed() as feed, Loop(source, estimator, sinks=[feed.add("arm", 3, design)]) as loop:
            print(feed.url)
            for estimate in loop:
                pass
    """

    def __init__(self, *, host: str = HERE, port: int = 0) -> None:
        try:
            import websockets.asyncio.server  # noqa: F401
        except ImportError as error:
            raise MissingExtraError("the feed", "view") from error
        self._door = Door(host)
        self._skins: dict[str, _Skin] = {}
        self._clients: set[_Client] = set()
        self._lock = threading.Lock()
        self._published: deque[tuple[str, Callable[[], Mapping[str, Any]]]] = deque(maxlen=_BEHIND)
        self._untold = 0
        self._closed = False
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        begun: Future[int] = Future()
        self._thread = threading.Thread(
            target=self._loop.run_until_complete,
            args=(self._listen(host, port, begun),),
            name="smoskin-feed",
            daemon=True,
        )
        self._thread.start()
        try:
            self._door.port = begun.result(_DEADLINE)
        except OSError as error:
            self._thread.join(_DEADLINE)
            self._loop.close()
            raise ArgumentError(
                f"host and port must be free to listen at; got {host}:{port}: {error.strerror}"
            ) from error

    @property
    def url(self) -> str:
        """Address of the feed, with the token that lets browsers and other machines in."""
        return f"ws://{self._door.host}:{self._door.port}/?token={self._door.token}"

    @property
    def clients(self) -> int:
        """How many programs listen."""
        return len(self._clients)

    def add(
        self,
        name: str,
        chips: int,
        design: SkinDesign | None = None,
        *,
        zero: Callable[[], None] | None = None,
        counters: Callable[[], Mapping[str, Any]] | None = None,
    ) -> Sink:
        """A sink that tells the clients of a skin's readings, of so many chips, under this name.

        `zero` is called, from the feed's thread, when a client asks for a new zero, and `counters`
        when one asks what the skin's loop has done. It raises an `ArgumentError` if the name is
        taken.
        """
        if name in self._skins:
            raise ArgumentError(f"name must be of one skin alone; got {name!r} again")
        hello: dict[str, Any] = {"skin": name, "chips": chips}
        if design is not None:
            size = [round(1e3 * side, 3) for side in geometry(design).extent]
            hello |= {"design": design.name, "design_hash": design.content_hash, "size_mm": size}
        self._skins[name] = _Skin(hello, zero, counters)
        return _FeedSink(self, name, chips)

    def remove(self, name: str) -> None:
        """Take a skin away, whose name is then free again."""
        self._skins.pop(name, None)

    def close(self) -> None:
        """End the connections and the server; any number of times."""
        if self._closed:
            return
        self._closed = True
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(_DEADLINE)
        if self._thread.is_alive():
            raise SmoskinError(f"the feed has not ended within {_DEADLINE} s")
        self._loop.close()

    def publish(self, skin: str, message: Callable[[], Mapping[str, Any]]) -> None:
        """Send a message, made only if anybody listens; never waits."""
        if not self._clients or self._closed:
            return
        with self._lock:
            idle = not self._published
            # Readings that come unpaced are more than can be told: the oldest go untold.
            self._untold += len(self._published) == _BEHIND
            self._published.append((skin, message))
        if idle:
            self._loop.call_soon_threadsafe(self._spread)

    def _spread(self) -> None:
        """Offer what has been published to every client."""
        with self._lock:
            published, untold = list(self._published), self._untold
            self._published.clear()
            self._untold = 0
        for client in self._clients:
            client.skipped += untold
        for skin, message in published:
            text = _as_json(message())
            now = self._loop.time()
            for client in self._clients:
                client.offer(skin, text, now)

    async def _listen(self, host: str, port: int, begun: "Future[int]") -> None:
        """Serve until the end."""
        from websockets.asyncio.server import serve

        try:
            server = await serve(
                self._attend,
                host,
                port,
                process_request=self._admit,
                max_size=_LARGEST,
                write_limit=_LARGEST,
                close_timeout=1.0,
                logger=_LOG,
            )
        except OSError as error:
            begun.set_exception(error)
            return
        async with server:
            begun.set_result(next(iter(server.sockets)).getsockname()[1])
            await self._ended.wait()

    def _admit(self, connection: "ServerConnection", request: "Request") -> "Response | None":
        """A refusal of what may not come in."""
        reason = self._door.refusal(request)
        if reason:
            _LOG.warning("refused a client: %s", reason)
            return connection.respond(HTTPStatus.FORBIDDEN, f"Refused: {reason}.\n")
        if len(self._clients) >= _CLIENTS:
            full = f"{_CLIENTS} clients listen already"
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, f"Refused: {full}.\n")
        try:
            _period(request.path)
        except ArgumentError as error:
            return connection.respond(HTTPStatus.BAD_REQUEST, f"Refused: {error}.\n")
        return None

    async def _attend(self, connection: "ServerConnection") -> None:
        """Tell a client who is here, then what is felt; answer what it asks."""
        from websockets.exceptions import ConnectionClosed

        assert connection.request is not None
        wire = connection.transport.get_extra_info("socket")
        # What the system holds for a slow client grows old there.
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _HELD)
        client = _Client(_period(connection.request.path))
        skins = [skin.hello for skin in list(self._skins.values())]
        sender = asyncio.create_task(_quietly(_send(connection, client)))
        try:
            await connection.send(
                json.dumps({"type": "hello", "protocol": PROTOCOL, "skins": skins})
            )
            self._clients.add(client)
            async for asked in connection:
                await connection.send(_as_json(self._answer(client, asked)))
        except ConnectionClosed:
            pass
        finally:
            self._clients.discard(client)
            sender.cancel()
            await asyncio.gather(sender, return_exceptions=True)

    def _answer(self, client: _Client, asked: str | bytes) -> Mapping[str, Any]:
        """What is answered to a client's message."""
        try:
            message = json.loads(asked)
            kind, name = message["type"], message["skin"]
            skin = self._skins[name]
        except (ValueError, TypeError, LookupError, RecursionError):
            names = ", ".join(list(self._skins))
            return _error(f'a message must be JSON with "type" and "skin", one of: {names}')
        if kind == "zero" and skin.zero is not None:
            skin.zero()
            return {"type": "done", "command": "zero", "skin": name}
        if kind == "counters" and skin.counters is not None:
            skipped = {"skipped_for_you": client.skipped}
            return {"type": "counters", "skin": name, **skin.counters(), **skipped}
        able = [("zero", skin.zero), ("counters", skin.counters)]
        kinds = " or ".join(word for word, does in able if does is not None)
        return _error(f"type must be {kinds or 'nothing: this skin takes no commands'}")


@final
class _FeedSink(Sink):
    """The part of a feed that is one skin's."""

    def __init__(self, feed: Feed, name: str, chips: int) -> None:
        self._feed, self._name, self._chips = feed, name, chips
        self._sequence, self._closed = 0, False

    @property
    def dropped(self) -> int:
        """Nothing: what a client has missed is counted for that client."""
        return 0

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Send a reading and its estimate to whoever listens; never waits."""
        if len(reading.field) != self._chips:
            raise ArgumentError(f"reading must have {self._chips} chips; got {len(reading.field)}")
        sequence, taken = self._sequence, time.time()
        self._sequence += 1

        def message() -> Mapping[str, Any]:
            values = {"time_s": reading.time} if estimate is None else estimate_values(estimate)
            more = (
                {}
                if estimate is None
                else {"means": estimate.status.value, "covariance": covariance_values(estimate)}
            )
            return {
                "type": "estimate",
                "skin": self._name,
                "sequence": sequence,
                "unix_s": round(taken, 6),
                **values,
                **more,
                "chips": chip_values(reading),
            }

        self._feed.publish(self._name, message)

    def close(self) -> None:
        """Take the skin away; the feed goes on for the others, and holds nothing of this one."""
        if not self._closed:
            self._closed = True
            self._feed.remove(self._name)


async def _send(connection: "ServerConnection", client: _Client) -> None:
    """Send a client what waits for it, for as long as it stays."""
    while True:
        await client.ready.wait()
        client.ready.clear()
        while client.waiting:
            await connection.send(client.waiting.popleft())


async def _quietly(work: Coroutine[Any, Any, None]) -> None:
    """Do this until the connection ends."""
    from websockets.exceptions import ConnectionClosed

    try:
        await work
    except ConnectionClosed:
        return


def _period(path: str) -> float:
    """Time between two estimates that a client asks for in its address, s; 0 for all."""
    text = parse_qs(urlsplit(path).query).get("rate_hz", ["inf"])[0]
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not rate > 0.0:
        raise ArgumentError(f"rate_hz must be positive; got {text!r:.40}")
    return 1.0 / rate


def _error(sentence: str) -> Mapping[str, Any]:
    return {"type": "error", "sentence": sentence}
