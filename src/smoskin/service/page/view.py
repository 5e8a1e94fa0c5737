"""A live page for a skin, served to browsers on this machine.

Decides the pace of the page (the newest reading wins, drawn by a thread of its own), how a pointer
on the sheet becomes a `Contact`, and how failures reach the caller. Hides server and thread.
"""

import io
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SmoskinError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading
from smoskin.roles import Sink
from smoskin.service.page.carpet import Bound
from smoskin.service.page.markers import UNITS
from smoskin.service.page.panel import RECORD, Panel
from smoskin.service.page.parts import first_paint
from smoskin.service.page.player import Rerun
from smoskin.service.page.scene import ESTIMATED, TRUE, Moment, SkinScene, camera
from smoskin.service.page.server import serve
from smoskin.service.replay import ReplaySource

if TYPE_CHECKING:
    import viser

_DRAW_PERIOD: Final = 1.0 / 25.0
_WRITE_EVERY: Final = 3
_CLOSE_DEADLINE: Final = 5.0
_LAST_WORDS: Final = 0.3
"""s in which the last sentence reaches the browsers."""
_RATE_WINDOW: Final = 1.0
_NUMBERS: Final = {2: "Two", 3: "Three", 4: "Four", 5: "Five", 6: "Six"}


class View(Sink):
    """A live page for one skin: a sink that never waits and shows the newest reading.

    Every callback is called from the view's own thread.

    Parameters
    ----------
    design : SkinDesign
    port : int
        TCP port on 127.0.0.1; 0 takes a free one.
    on_press : callable, optional
        Called with the contacts, none to two, with which people press the sheet in the page,
        whenever one begins, moves, changes or ends.
    on_still : callable, optional
        Called with whether somebody wants the hand to stay where it is.
    on_zero, on_undo : callable
        Called when somebody asks for a new zero, and, where it is given, for the one before.
    on_record : callable, optional
        Called with whether somebody wants a recording; `show_recording` tells whether there is one.
        What has no callable has no control on the page.
    estimators, on_choose : sequence of str and callable
        Names of the estimators to choose from, the one that reads the skin first; called with the
        one that somebody chooses.
    player : ReplaySource, optional
        Source to pause, to seek in and to play at other speeds on the page.

    Raises
    ------
    ArgumentError
        If the port is taken.
    MissingExtraError
        If the extra `view` is not installed.
    """

    _rerun: Rerun | None = None
    _shown: Moment | None = None

    def __init__(
        self,
        design: SkinDesign,
        *,
        port: int = 0,
        on_press: Callable[[tuple[Contact, ...]], None] | None = None,
        on_still: Callable[[bool], None] | None = None,
        on_zero: Callable[[], None] = lambda: None,
        on_undo: Callable[[], None] | None = None,
        on_record: Callable[[bool], None] | None = None,
        estimators: Sequence[str] = (),
        on_choose: Callable[[str], None] = lambda name: None,
        player: ReplaySource | None = None,
    ) -> None:
        self._design = design
        self._on_press, self._on_still, self._on_choose = on_press, on_still, on_choose
        self._on_zero, self._on_undo, self._on_record = on_zero, on_undo, on_record
        self._lock = threading.Lock()
        self._newest: Moment | None = None
        self._waiting = False
        self._dropped = 0
        self._announced: tuple[str, str] | None = None
        self._arrivals: deque[float] = deque()
        self._told_rate: float | None = None
        self._fingers: dict[str, Floats] = {}
        self._pressed: tuple[Contact, ...] = ()
        self._paused = False
        self._asked: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._failure: Exception | None = None
        self._closing = threading.Event()
        title = f"smoskin: {design.name}"
        self._server, self._url = serve(
            port, title, *_first_paint(design, title, on_press is not None)
        )
        self._panel = Panel(
            self._server,
            title,
            design,
            estimators,
            pressable=on_press is not None,
            holdable=on_still is not None,
            undoable=on_undo is not None,
            recordable=on_record is not None,
            played=player,
        )
        self._played = player
        self._scene = SkinScene(self._server, design)
        self._listen()
        self._thread = threading.Thread(target=self._run, name="smoskin-view", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page, with the token that lets a browser in."""
        return self._url

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

    def show_bound(self, bound: Bound) -> None:
        """Offer a heat map of how finely touches can be placed."""
        with self._lock:
            self._scene.carpet.lay(bound)
            self._panel.lay(bound)

    def show_drift(self, drift: Floats) -> None:
        """Tell how far the zero has followed since it was set, (S, 3), T."""
        self._panel.drift = drift

    def show_recording(self, goes_on: bool, sentence: str, finished: Path | None = None) -> None:
        """Tell whether a recording goes on, and in a sentence its name and what it lost.

        One that is finished can be played on the page while the skin is read on.
        """
        self._panel.recording = (goes_on, sentence, finished)

    def end(self, sentence: str) -> None:
        """Say a last sentence over the whole page; it stays there after the view is closed."""
        with self._lock:
            self._panel.end = sentence

    def write(
        self,
        reading: Reading,
        estimate: Estimate | None = None,
        *,
        truth: Sequence[Contact] = (),
        vertices: Floats | None = None,
        latency: float = math.nan,
        rate: float | None = None,
    ) -> None:
        """Make this the moment that the page shows next, as `Moment` has it; never waits.

        Where not every reading is written, `rate` tells how many there are, Hz.
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
            self._told_rate = rate
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
        panel, asked = self._panel, self._asked

        @panel.actions.on_click
        async def _(event: "viser.GuiEvent[viser.GuiButtonGroupHandle]") -> None:
            self._do(event.target.value)

        @panel.still.on_update
        async def _(event: object) -> None:
            if self._on_still is not None:
                asked.put(partial(self._on_still, bool(panel.still.value)))

        @panel.rerun.on_click
        async def _(event: object) -> None:
            asked.put(self._rerun_or_return)

        chooser = panel.chooser
        if chooser is not None:

            @chooser.on_update
            async def _(event: object) -> None:
                if chooser.value in chooser.options:  # a stranger's message may hold anything
                    asked.put(partial(self._on_choose, str(chooser.value)))

        if self._on_press is not None:
            self._scene.sheet.on_drag("left")(self._move_finger)
            self._scene.sheet.on_drag("right")(self._set_finger)

    def _do(self, action: str) -> None:
        """Act on one of the panel's buttons."""
        if action in ("Pause", "Go on"):
            self._panel.relabel(action, "Go on" if action == "Pause" else "Pause")
            self._pause(action == "Pause")
        elif action == "Zero":
            self._asked.put(self._panel.zero)
            self._asked.put(self._on_zero)
        elif action == "Undo" and self._on_undo is not None:
            self._asked.put(self._on_undo)
        elif action in RECORD and self._on_record is not None:
            self._asked.put(partial(self._on_record, action == "Record"))

    def _pause(self, paused: bool) -> None:
        """Let what is played stand, or else the picture alone."""
        played = self._played if self._rerun is None else self._rerun.source
        if played is None:
            self._paused = paused
        else:
            played.pause(paused)

    def _rerun_or_return(self) -> None:
        """Play the last recording, or show the skin again."""
        self._panel.refusal, self._paused = "", False
        if self._rerun is not None:
            self._return()
        elif (path := self._panel.recording[2]) is not None:
            try:
                self._rerun = Rerun(path)
            except SmoskinError as error:
                self._panel.refusal = f"Not played: {error}."
                return
            caption = f"Estimates of the time of {path.name}; the skin is read on meanwhile."
            self._panel.play(self._rerun.source, caption)

    def _return(self) -> None:
        """Show the skin again."""
        if self._rerun is not None:
            self._rerun.close()
            self._rerun = None
            self._panel.play(None)

    async def _move_finger(self, event: "viser.SceneNodeDragEvent[viser.MeshHandle]") -> None:
        """Press where the left button is held."""
        place = None if event.phase == "end" else self._place(event)
        with self._lock:
            if place is not None:
                self._fingers["left"] = place
            elif event.phase == "end":
                self._fingers.pop("left", None)

    async def _set_finger(self, event: "viser.SceneNodeDragEvent[viser.MeshHandle]") -> None:
        """Set a finger that stays, or take it away."""
        place = self._place(event) if event.phase == "start" else None
        with self._lock:
            if event.phase == "start" and self._fingers.pop("right", None) is not None:
                return
            if place is not None:
                self._fingers["right"] = place

    def _place(self, event: "viser.SceneNodeDragEvent[viser.MeshHandle]") -> Floats | None:
        """The place on the skin under a pointer."""
        eye = event.client.camera.position
        return self._scene.place_under(eye, np.asarray(event.end_position) - eye)

    def _run(self) -> None:
        """Act on what people did, then draw the newest moment, until closed."""
        try:
            frame = 0
            while not self._closing.wait(_DRAW_PERIOD):
                self._act()
                self._draw(write=frame % _WRITE_EVERY == 0)
                frame += 1
            self._fingers = {}
            self._act()
            self._return()
            if self._panel.end and self.watched:
                self._draw(write=True)
                self._server.flush()
                time.sleep(_LAST_WORDS)
        except Exception as error:  # carried over to whoever calls write or close
            self._failure = error

    def _act(self) -> None:
        """Call back for a change of the presses and for all that was asked for."""
        with self._lock:
            fingers = list(self._fingers.values())
        while not self._asked.empty():
            self._asked.get()()
        wanted = tuple(Contact(position=place, force=self._panel.force) for place in fingers)
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
        if write:
            self._panel.write_recording()
        if self._paused and not self._panel.end:
            return
        if (rerun := self._rerun) is not None:
            if new and newest is not None:
                self._panel.tally.add(newest)
            newest, rate = rerun.newest, math.nan
            new = newest is not self._shown
            if rerun.failure:
                self._panel.refusal = f"Not played on: {rerun.failure}."
                self._return()
        self._shown = newest
        if self._panel.player is not None:
            if self._panel.player.stands and newest is not None:
                now = newest.arrival  # what stands is not silent
            announced = (self._panel.player.write() if write else None) or announced
        with self._server.atomic():
            self._scene.spread(*self._panel.spread)
            self._scene.carpet.show(self._panel.mapped)
            if newest is not None:
                self._scene.draw(newest, *self._panel.picture)
                if new:
                    self._panel.record(newest, again=rerun is not None)
            if write:
                self._panel.write(newest, rate, now, announced)

    def _rate(self, now: float) -> float:
        """Readings shown a second, over the last second, Hz."""
        recent = [arrival for arrival in self._arrivals if now - arrival <= _RATE_WINDOW]
        if len(recent) < 2:
            return 0.0
        if self._told_rate is not None:
            return self._told_rate
        return (len(recent) - 1) / (recent[-1] - recent[0]) if recent[-1] > recent[0] else math.inf


def _first_paint(design: SkinDesign, title: str, virtual: bool) -> tuple[str, str]:
    """What the page says before the viewer works, for people who have never seen a skin.

    The true touch is known of a virtual skin only.
    """
    count = len(design.halls)
    chips = "One magnetic chip" if count == 1 else f"{_NUMBERS.get(count, count)} magnetic chips"
    feel = "feels" if count == 1 else "feel"
    eye, aim, _ = (np.asarray(part) * UNITS for part in camera(design, narrow=True))
    return first_paint(
        title,
        f"{chips} under a folded sheet {feel} where, how hard and which way you touch",
        ({"true touch": TRUE} if virtual else {}) | {"what the chips say": ESTIMATED},
        keys="z zero, r record or stop recording, space pause or go on",
        eye=",".join(f"{value:.3f}" for value in eye),
        aim=",".join(f"{value:.3f}" for value in aim),
    )
