"""A live page for a skin, served to browsers on this machine.

Decides the pace of the page (the newest reading wins, drawn by a thread of its own), how a mouse
press becomes a `Contact`, and how failures reach the caller. Hides the web server and the thread.
"""

import io
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError, SmoskinError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading
from smoskin.roles import Sink
from smoskin.service.page.panel import Panel
from smoskin.service.page.scene import Moment, SkinScene

if TYPE_CHECKING:
    import viser

_HOST: Final = "127.0.0.1"
_DRAW_PERIOD: Final = 1.0 / 25.0
_WRITE_EVERY: Final = 3
_CLOSE_DEADLINE: Final = 5.0
_RATE_WINDOW: Final = 1.0


class View(Sink):
    """A live page for one skin: a sink that never waits and shows the newest reading.

    Every callback is called from the view's own thread.

    Parameters
    ----------
    design : SkinDesign
    port : int
        TCP port on 127.0.0.1; 0 takes a free one.
    on_press : callable, optional
        Called with a `Contact` when somebody presses the sheet in the page, whenever that
        press moves or changes, and with None when it ends.
    on_zero : callable
        Called when somebody asks for a new zero.
    estimators, on_choose : sequence of str and callable
        Names of the estimators to choose from, the one that reads the skin first; called with the
        one that somebody chooses.

    Raises
    ------
    ArgumentError
        If the port is taken.
    MissingExtraError
        If the extra `view` is not installed.
    """

    def __init__(
        self,
        design: SkinDesign,
        *,
        port: int = 0,
        on_press: Callable[[Contact | None], None] | None = None,
        on_zero: Callable[[], None] = lambda: None,
        estimators: Sequence[str] = (),
        on_choose: Callable[[str], None] = lambda name: None,
    ) -> None:
        self._design = design
        self._on_press, self._on_zero, self._on_choose = on_press, on_zero, on_choose
        self._lock = threading.Lock()
        self._newest: Moment | None = None
        self._waiting = False
        self._dropped = 0
        self._announced: tuple[str, str] | None = None
        self._arrivals: deque[float] = deque()
        self._finger: tuple[Floats, float] | None = None
        self._pressed: Contact | None = None
        self._asked: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._failure: Exception | None = None
        self._closing = threading.Event()
        title, chips = f"smoskin: {design.name}", [site.name for site in design.halls]
        self._server = _serve(port, title)
        self._panel = Panel(self._server, title, chips, on_press is not None, estimators)
        self._scene = SkinScene(self._server, design)
        self._listen()
        self._thread = threading.Thread(target=self._run, name="smoskin-view", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{_HOST}:{self._server.get_port()}"

    @property
    def watched(self) -> bool:
        """Whether a browser shows the page."""
        return bool(self._server.get_clients())

    @property
    def dropped(self) -> int:
        """How many readings were overtaken by newer ones before they were drawn."""
        return self._dropped

    def announce(self, word: str = "", sentence: str = "") -> None:
        """Say this in place of the estimates' status, or the status again."""
        with self._lock:
            self._announced = (word, sentence) if word else None

    def write(
        self,
        reading: Reading,
        estimate: Estimate | None = None,
        *,
        truth: Sequence[Contact] = (),
        vertices: Floats | None = None,
        latency: float = math.nan,
    ) -> None:
        """Make this the moment that the page shows next, as `Moment` has it; never waits.

        Raises what a callback raised since the last call, and `ArgumentError` if the number of
        chips or vertices differs from the design's.
        """
        chips = len(self._design.halls)
        if len(reading.field) != chips:
            raise ArgumentError(f"reading must have {chips} chips; got {len(reading.field)}")
        if vertices is not None:
            rest = geometry(self._design).sheet.vertices
            vertices = floats("vertices", vertices, rest.shape)
        self._raise_failure()
        now = time.monotonic()
        moment = Moment(reading, estimate, tuple(truth), vertices, latency, now)
        with self._lock:
            self._dropped += self._waiting
            self._newest, self._waiting = moment, True
            self._arrivals.append(now)
            while now - self._arrivals[0] > _RATE_WINDOW:
                self._arrivals.popleft()

    def close(self) -> None:
        """End the page; a press still held is let go. Any number of times.

        Raises what a callback raised, and `SmoskinError` if one still runs after five seconds.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join(_CLOSE_DEADLINE)
        with redirect_stdout(io.StringIO()):  # the standard output is the caller's
            self._server.stop()
        self._raise_failure()
        if self._thread.is_alive():
            raise SmoskinError(f"a callback has not returned within {_CLOSE_DEADLINE} s")

    def _raise_failure(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _listen(self) -> None:
        """Take note of what people do in the page; the view's thread acts on it."""
        # The callbacks are coroutines so that the server runs them in order on its own loop.

        @self._panel.zero_button.on_click
        async def _(event: object) -> None:
            self._asked.put(self._panel.zero)
            self._asked.put(self._on_zero)

        chooser = self._panel.chooser
        if chooser is not None:

            @chooser.on_update
            async def _(event: object) -> None:
                self._asked.put(partial(self._on_choose, str(chooser.value)))

        if self._on_press is None:
            return

        @self._panel.release_button.on_click
        async def _(event: object) -> None:
            self._lay_finger(None, 0.0)

        @self._scene.sheet.on_click
        async def _(event: "viser.SceneNodePointerEvent[viser.MeshHandle]") -> None:
            self._press(event.ray_origin, event.ray_direction, self._panel.hold)

        @self._scene.sheet.on_drag("left", modifier="shift")
        async def _(event: "viser.SceneNodeDragEvent[viser.MeshHandle]") -> None:
            if event.phase == "end":
                self._lay_finger(None, 0.0)
                return
            eye = event.client.camera.position
            self._press(eye, np.asarray(event.end_position) - eye, math.inf)

    def _press(self, origin: ArrayLike, direction: ArrayLike, hold: float) -> None:
        place = self._scene.place_under(origin, direction)
        if place is not None:
            self._lay_finger(place, hold)

    def _lay_finger(self, place: Floats | None, hold: float) -> None:
        """Press at a place for so many seconds from now; None lets go."""
        with self._lock:
            self._finger = None if place is None else (place, time.monotonic() + hold)

    def _run(self) -> None:
        """Act on what people did, then draw the newest moment, until closed."""
        try:
            frame = 0
            while not self._closing.wait(_DRAW_PERIOD):
                self._act()
                self._draw(write=frame % _WRITE_EVERY == 0)
                frame += 1
            self._lay_finger(None, 0.0)
            self._act()
        except Exception as error:  # carried over to whoever calls write or close
            self._failure = error

    def _act(self) -> None:
        """Call back for a change of the press, for a zero and for another estimator."""
        with self._lock:
            if self._finger is not None and time.monotonic() >= self._finger[1]:
                self._finger = None
            finger = self._finger
        while not self._asked.empty():
            self._asked.get()()
        wanted = None if finger is None else Contact(position=finger[0], force=self._panel.force)
        if wanted != self._pressed and self._on_press is not None:
            self._pressed = wanted
            self._on_press(wanted)

    def _draw(self, *, write: bool) -> None:
        """Draw the newest moment, and with `write` its words too."""
        now = time.monotonic()
        with self._lock:
            newest, rate = self._newest, self._rate(now)
            new, self._waiting = self._waiting, False
            announced = self._announced
        with self._server.atomic():
            if newest is not None:
                self._scene.draw(newest, *self._panel.picture)
                if new:
                    self._panel.record(newest.reading)
            if write:
                self._panel.write(newest, rate, now, announced)

    def _rate(self, now: float) -> float:
        """Readings shown a second, over the last second, Hz."""
        recent = [arrival for arrival in self._arrivals if now - arrival <= _RATE_WINDOW]
        if len(recent) < 2:
            return 0.0
        return (len(recent) - 1) / (recent[-1] - recent[0]) if recent[-1] > recent[0] else math.inf


def _serve(port: int, title: str) -> "viser.ViserServer":
    """A server on exactly this port of this machine only."""
    try:
        import viser
    except ImportError as error:
        raise MissingExtraError("the live page", "view") from error
    with redirect_stdout(io.StringIO()):  # the standard output is the caller's
        server = viser.ViserServer(host=_HOST, port=port, label=title, verbose=False)
    # The server takes the next port where one is in use; an address given must hold.
    if port and server.get_port() != port:
        with redirect_stdout(io.StringIO()):
            server.stop()
        raise ArgumentError(f"port must be free; got {port}, which is in use")
    return server
