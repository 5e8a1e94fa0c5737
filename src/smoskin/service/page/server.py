"""The web server of the page: on this machine only, and for those alone who know its address.

Decides who may come in (a token in the address, this machine's own names as Host and Origin), what
a browser gets first, and that what nobody understands is one line of the log. Hides how the
viewer's server is made to ask.
"""

import asyncio
import gzip
import io
import logging
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias
from urllib.parse import urlsplit

from smoskin.errors import ArgumentError, MissingExtraError, SmoskinError, require
from smoskin.roles import Resource
from smoskin.service.bridges.door import HERE, Door, tokens_in_address

if TYPE_CHECKING:
    import viser
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

    Handler: TypeAlias = Callable[[ServerConnection], Awaitable[None]]
    Answerer: TypeAlias = Callable[[ServerConnection, Request], Response | None]

_HEADERS: Final = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
_LARGEST: Final = 256 * 1024
"""Largest message that a page takes from a browser, bytes; what people do there is far smaller."""
_LOG: Final = logging.getLogger(__name__)
_MAKING: Final = threading.Lock()


def serve(port: int, title: str, head: str, body: str) -> tuple["viser.ViserServer", str]:
    """A viewer's server on exactly this port of this machine, and the address of its page.

    `head` and `body` are HTML that the page has before the viewer's own. `ArgumentError` if the
    port is taken; 0 takes a free one.
    """
    try:
        import viser
    except ImportError as error:
        raise MissingExtraError("the live page", "view") from error
    index = Path(viser.__file__).parent / "client" / "build" / "index.html"
    page = index.read_text(encoding="utf-8")
    page = page.replace("<title>Viser</title>", head, 1).replace("<body>", f"<body>{body}", 1)
    door = _Door(page)
    with redirect_stdout(io.StringIO()), _asked(door):  # the standard output is the caller's
        server = viser.ViserServer(host=HERE, port=port, label=title, verbose=False)
    door.port = server.get_port()
    # The server takes the next port where one is in use; an address given must hold.
    if (port and door.port != port) or not door.stands:
        with redirect_stdout(io.StringIO()):
            server.stop()
        if not door.stands:
            raise SmoskinError(
                "the page must be guarded; this version of viser passes the guard by"
            )
        raise ArgumentError(f"port must be free; got {port}, which is in use")
    _take_values_alone(server)
    return server, f"http://{HERE}:{door.port}/?token={door.token}"


def _take_values_alone(server: "viser.ViserServer") -> None:
    """Let browsers set the value of what a page offers, as its controls do, and nothing else.

    The viewer would set any property of a control: its callbacks, or that it may be used.
    """
    from viser import _messages as messages

    gui = server.gui
    plain, sockets = gui._handle_gui_updates, gui._websock_interface

    async def update(client: Any, message: messages.GuiUpdateMessage) -> None:
        control = gui._gui_input_handle_from_uuid.get(message.uuid)
        if set(message.updates) != {"value"}:
            _LOG.warning("refused to set %s of a control", ", ".join(map(str, message.updates)))
        elif control is not None and control.visible and not control.disabled:
            await plain(client, message)

    sockets.unregister_handler(messages.GuiUpdateMessage, plain)
    sockets.register_handler(messages.GuiUpdateMessage, update)


class StillPage(Resource):
    """A page of one file, served to browsers on this machine that know its address.

    `ArgumentError` if the port is taken; 0 takes a free one.
    """

    def __init__(self, content: bytes, *, port: int = 0) -> None:
        require("pages", "view", "websockets")
        from websockets.sync.server import serve as serve_sockets

        door = _Door(content.decode())

        def answer(connection: Any, request: "Request") -> "Response | None":
            return door.answer(connection, request, _nothing)

        def end(connection: Any) -> None:
            """A still page has nothing to say to a socket."""

        try:
            self._server = serve_sockets(
                end, HERE, port, process_request=answer, logger=_quiet_log(), max_size=_LARGEST
            )
        except OSError as error:
            raise ArgumentError(f"port must be free; got {port}: {error.strerror}") from error
        door.port = self._server.socket.getsockname()[1]
        self.url = f"http://{HERE}:{door.port}/?token={door.token}"
        """Address of the page, with the token that lets a browser in."""
        self._thread = threading.Thread(
            target=self._server.serve_forever, name="smoskin-page", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """End the page; any number of times."""
        self._server.shutdown()
        self._thread.join(5.0)


def _nothing(connection: Any, request: "Request") -> "Response":
    """What a still page answers to anything but a request for itself."""
    answer: Response = connection.respond(HTTPStatus.NOT_FOUND, "Nothing here.\n")
    return answer


class _Door(Door):
    """Who may come in, the token's cookie included, and what they get first."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.stands = False
        self._page = gzip.compress(page.encode())

    def refusal(self, request: "Request") -> str:
        """Why a request is refused; empty for one that may come in."""
        places = self.places
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or hosts[0] not in places:
            return "the page is asked for by another machine's name"
        if any(origin not in [f"http://{place}" for place in places] for origin in origins):
            return "another page asks"
        if not self.opened_by([*tokens_in_address(request), *self._in_cookies(request)]):
            return "the address lacks its token: open the one that was printed"
        return ""

    def answer(
        self, connection: "ServerConnection", request: "Request", otherwise: "Answerer"
    ) -> "Response | None":
        """A refusal, the page, or what the viewer answers."""
        from websockets.datastructures import Headers
        from websockets.http11 import Response

        reason = self.refusal(request)
        if reason:
            _LOG.warning("refused a request: %s", reason)
            return connection.respond(HTTPStatus.FORBIDDEN, f"Refused: {reason}.\n")
        is_page = urlsplit(request.path).path in ("/", "/index.html")
        if request.headers.get("Upgrade", "").lower() == "websocket" or not is_page:
            return otherwise(connection, request)
        cookie = f"{self._cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"
        headers = Headers(
            _HEADERS,
            **{
                "Content-Type": "text/html; charset=utf-8",
                "Content-Encoding": "gzip",
                "Content-Length": str(len(self._page)),
                "Set-Cookie": cookie,
            },
        )
        return Response(HTTPStatus.OK.value, HTTPStatus.OK.phrase, headers, self._page)

    @property
    def _cookie(self) -> str:
        # Pages of one machine share their cookies whatever the port.
        return f"smoskin-{self.port}"

    def _in_cookies(self, request: "Request") -> list[str]:
        """Tokens in the cookies; the viewer's own connection has no other place for one."""
        try:
            cookies = [SimpleCookie(text) for text in request.headers.get_all("Cookie")]
        except CookieError:
            return []
        return [cookie[self._cookie].value for cookie in cookies if self._cookie in cookie]


@contextmanager
def _asked(door: _Door) -> Iterator[None]:
    """While servers are made, they ask at this door: the viewer's has no option for it."""
    from websockets.asyncio import server as sockets

    plain = sockets.serve

    def guarded(
        handler: "Handler", host: str, port: int, *, process_request: "Answerer", **options: Any
    ) -> Any:
        door.stands = True
        return plain(
            _in_one_line(handler),
            host,
            port,
            process_request=lambda connection, request: door.answer(
                connection, request, process_request
            ),
            logger=_quiet_log(),
            **options | {"max_size": _LARGEST},
        )

    with _MAKING:
        sockets.serve = guarded  # type: ignore[misc, assignment]
        try:
            yield
        finally:
            sockets.serve = plain  # type: ignore[misc]


def _in_one_line(handler: "Handler") -> "Handler":
    """A handler of connections that ends one with a line where the frames make no sense."""

    def complain(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        _LOG.warning("a frame was not understood: %r", context.get("exception", context["message"]))

    async def handle(connection: "ServerConnection") -> None:
        asyncio.get_running_loop().set_exception_handler(complain)
        try:
            await handler(connection)
        except Exception as error:  # whatever a stranger's bytes bring about in the viewer
            _LOG.warning("a frame was not understood: %s", type(error).__name__)
            await connection.close(1003)

    return handle


def _quiet_log() -> logging.Logger:
    """A log of the sockets in which no record carries a traceback."""
    log = logging.getLogger(f"{__name__}.sockets")

    def shorten(record: logging.LogRecord) -> bool:
        if record.exc_info and record.exc_info[1] is not None:
            record.msg, record.args = f"{record.getMessage()}: {record.exc_info[1]!r:.200}", None
            record.exc_info = None
        return True

    if not log.filters:
        log.addFilter(shorten)
    return log
