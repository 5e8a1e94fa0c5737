"""Who may come in to a server of this package: who knows its token, or programs of this machine.

Decides that no page of another site can reach a server by a browser of this machine, whatever names
it has itself given to the machine's address. Hides tokens, and how servers refuse.
"""

import hmac
import secrets
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final
from urllib.parse import parse_qs, urlsplit

if TYPE_CHECKING:
    from websockets.http11 import Request

HERE: Final = "127.0.0.1"
"""Address at which a server is reached from its own machine alone."""
_NAMES: Final = (HERE, "localhost")


class Door:
    """Token of a server, and what is asked of requests; `port` is set when it is known.

    Parameters
    ----------
    host : str
        Address at which the server listens; beyond this machine nobody comes in without the token.
    """

    def __init__(self, host: str = HERE) -> None:
        self.token = secrets.token_urlsafe(16)
        self.host, self.port = host, 0

    @property
    def places(self) -> list[str]:
        """What this machine's own programs may call the server."""
        return [f"{name}:{self.port}" for name in _NAMES]

    def opened_by(self, tokens: Sequence[str]) -> bool:
        """Whether one of these is the token."""
        mine = self.token.encode()
        return any(hmac.compare_digest(token.encode(), mine) for token in tokens)

    def refusal(self, request: "Request") -> str:
        """Why a program may not come in; empty for one that may.

        Whoever has the token may. Without it may, where the server listens to this machine alone,
        what is no browser's page: it names no page that it comes from, and this machine by its own
        names.
        """
        if self.opened_by(tokens_in_address(request)):
            return ""
        hosts = request.headers.get_all("Host")
        own = self.host == HERE and len(hosts) == 1 and hosts[0] in self.places
        if own and not request.headers.get_all("Origin"):
            return ""
        return "the address lacks its token: use the one that was printed"


def tokens_in_address(request: "Request") -> list[str]:
    """Tokens that a request's address holds."""
    return parse_qs(urlsplit(request.path).query).get("token", [])
