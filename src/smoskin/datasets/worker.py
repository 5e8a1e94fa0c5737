"""One worker process of `smoskin.datasets.workers.LocalEngine`: takes items, answers with results.

It holds one end of a socket pair. When the other end closes, by purpose or by the parent's death,
the process ends at once, whatever it computes.
"""

import os
import pickle
import queue
import sys
import threading
import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a worker sends back for one item."""

    item: int
    result: Any = None
    """What the work returned."""
    error: str | None = None
    """What it raised instead, in a line."""
    trace: str = ""
    """Where it was raised."""


def serve(connection: Connection) -> None:
    """Answer items until the other end closes."""
    items: queue.SimpleQueue[int] = queue.SimpleQueue()
    work = pickle.loads(connection.recv_bytes())

    def listen() -> None:
        try:
            while True:
                items.put(connection.recv())
        except (EOFError, OSError):
            os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        item = items.get()
        try:
            answer = Answer(item=item, result=work(item))
        except Exception as error:  # the process' edge: whatever it is travels to the parent
            line = f"{type(error).__name__}: {error}"
            answer = Answer(item=item, error=line, trace=traceback.format_exc())
        connection.send(answer)


def main() -> None:
    """Serve on the file descriptor that the command line names."""
    serve(Connection(int(sys.argv[1])))
