"""The live page as a sink: what it refuses, that it never waits, and how it ends."""

import asyncio
import socket
import threading
import time
from dataclasses import replace
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest

from pages import NOTHING, PLANAR, SHEET, TOUCH, assert_gone, reading
from smoskin.errors import ArgumentError, SmoskinError
from smoskin.records import Contact, Reading
from smoskin.roles import Source
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.service.loop import Loop
from smoskin.service.page import view as views
from smoskin.service.page.markers import UNITS
from smoskin.service.page.view import View


def test_wrong_moments_are_refused() -> None:
    with View(PLANAR) as view:
        with pytest.raises(ArgumentError, match="reading must have 3 chips; got 2"):
            view.write(Reading(time=0.0, field=np.zeros((2, 3))), NOTHING)
        with pytest.raises(ArgumentError, match=r"vertices must have shape \(\.\.\., 169, 3\)"):
            view.write(reading(), NOTHING, vertices=np.zeros((4, 3)))


def test_a_port_in_use_is_refused() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ArgumentError, match=f"port must be free; got {port}"):
            View(PLANAR, port=port)


def test_the_page_is_on_this_machine_only() -> None:
    with View(PLANAR) as view:
        address = urlsplit(view.url)
        assert address.hostname == "127.0.0.1"
        assert address.query.startswith("token=")
        with pytest.raises(OSError, match=r".*"):
            socket.create_connection(("127.0.0.2", address.port), timeout=1.0)


def test_closing_twice_leaves_no_thread_and_no_output(capsys: pytest.CaptureFixture[str]) -> None:
    before = set(threading.enumerate())
    with View(PLANAR) as view:
        view.write(reading(), NOTHING)
    view.close()
    assert_gone(before)
    assert capsys.readouterr().out == ""


def test_writing_never_waits() -> None:
    with View(PLANAR) as view:
        spans = []
        for number in range(200):
            begin = time.perf_counter()
            view.write(reading(number * 1e-3), NOTHING, truth=[TOUCH], vertices=SHEET.vertices)
            spans.append(time.perf_counter() - begin)
        assert float(np.median(spans)) < 1e-3


def test_a_view_is_a_sink_of_the_loop_and_counts_what_it_passes_over() -> None:
    """Four readings that come while the page draws nothing yet: the newest wins."""

    class Four(Source):
        chips = 3
        times = iter(range(4))

        def read(self, timeout: float = 1.0) -> Reading | None:
            time = next(self.times, None)
            return None if time is None else reading(0.01 * time)

        def close(self) -> None:
            """Hold nothing."""

    view = View(PLANAR)
    view._closing.set()  # its thread draws no more
    view._thread.join(10.0)
    loop = Loop(Four(), ZeroFirst(ClosedFormEstimator(PLANAR)), sinks=[view])
    assert len(list(loop)) == 4
    assert loop.counters.dropped == view.dropped == 3
    assert not view.watched
    view._server.stop()


def test_it_draws_25_times_a_second_and_words_every_third_time(monkeypatch) -> None:
    waits, drawn, slept, flushed = [], [], [], []

    def wait(seconds: float) -> bool:
        waits.append(seconds)
        return len(waits) > 7

    monkeypatch.setattr(views.time, "sleep", slept.append)
    page = SimpleNamespace(
        _closing=SimpleNamespace(wait=wait),
        _act=lambda: drawn.append("act"),
        _return=lambda: None,
        _draw=lambda *, write: drawn.append(write),
        _panel=SimpleNamespace(end=""),
        _server=SimpleNamespace(flush=lambda: flushed.append(len(drawn))),
        watched=True,
        _fingers={"left": TOUCH.position},
    )
    View._run(page)
    assert set(waits) == {1 / 25}
    assert drawn[1::2] == [True, False, False, True, False, False, True]
    assert set(drawn[::2]) == {"act"}
    assert (page._fingers, slept) == ({}, [])
    # A last sentence is drawn, sent, and given a moment to arrive in.
    drawn.clear()
    page._panel.end = "It is over."
    View._run(page)
    assert drawn == ["act", True]
    assert flushed == [2]
    assert 0.2 <= sum(slept) <= 0.5
    page.watched = False
    View._run(page)
    assert drawn[2:] == ["act"]


def test_closing_waits_five_seconds_for_a_callback() -> None:
    view = View(PLANAR)
    thread, waited = view._thread, []
    view._thread = SimpleNamespace(join=waited.append, is_alive=lambda: True)
    with pytest.raises(SmoskinError, match=r"a callback has not returned within 5\.0 s"):
        view.close()
    assert waited == [5.0]
    thread.join(5.0)
    assert not thread.is_alive()


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (1, "One magnetic chip under a folded sheet feels"),
        (2, "Two magnetic chips under a folded sheet feel "),
        (3, "Three magnetic chips under a folded sheet feel "),
        (4, "Four magnetic chips"),
        (5, "Five magnetic chips"),
        (6, "Six magnetic chips"),
        (7, "7 magnetic chips"),
    ],
)
def test_the_first_paint_counts_the_chips(count: int, words: str) -> None:
    halls = tuple(replace(PLANAR.halls[0], name=f"S{k}") for k in range(count))
    design = SimpleNamespace(halls=halls)
    eye = (np.array((0.1, 0.2, 0.3)), np.array((0.06, 0.08, 0.0)), 0.5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(views, "camera", lambda design, *, narrow: eye if narrow else None)
        head, body = views._first_paint(design, "a <b>", virtual=False)
    assert "<title>a &lt;b&gt;</title>" in head
    assert words in body
    assert "what the chips say" in body
    assert "true touch" not in body  # which nobody knows of a real skin
    assert 'data-eye="10.000,20.000,30.000" data-aim="6.000,8.000,0.000"' in body


def test_what_people_ask_for_is_called_back_in_their_words() -> None:
    done: list[object] = []
    asks = {
        "on_zero": lambda: done.append("zero"),
        "on_undo": lambda: done.append("undo"),
        "on_record": lambda on: done.append(("record", on)),
    }
    with View(PLANAR, **asks) as view:
        view._panel.zero = lambda: done.append("curves")
        for action in ("Zero", "Undo", "Record", "Stop recording", "junk"):
            view._do(action)
            begin = time.monotonic()
            while not view._asked.empty() and time.monotonic() < begin + 5:
                time.sleep(0.01)
        time.sleep(0.05)
        assert done == ["curves", "zero", "undo", ("record", True), ("record", False)]
        for action, next_label in (("Pause", "Go on"), ("Go on", "Pause")):
            view._do(action)
            assert view._paused == (action == "Pause")
            assert next_label in view._panel.actions.options
        for goes_on, label in ((True, "Stop recording"), (False, "Record")):
            view.show_recording(goes_on, "Recording into a.mcap.")
            view._panel.write_recording()
            assert view._panel.actions.options[-1] == label


def test_the_right_button_sets_a_finger_that_stays_until_it_is_pressed_again() -> None:
    seen: list[tuple[Contact, ...]] = []

    def right(view: View, phase: str, place: tuple[float, float]) -> tuple[Contact, ...]:
        """What is pressed once a pointer has come straight over a place of the sheet."""
        under = np.array([*place, 0.0]) * UNITS
        camera = SimpleNamespace(position=np.add(under, [0.0, 0.0, 50.0]))
        event = SimpleNamespace(
            phase=phase, client=SimpleNamespace(camera=camera), end_position=under
        )
        asyncio.run(view._set_finger(event))
        time.sleep(0.15)
        return seen[-1]

    with View(PLANAR, on_press=seen.append) as view:
        for phase, place in (
            ("start", (0.05, 0.07)),
            ("update", (0.06, 0.1)),
            ("end", (0.06, 0.1)),
        ):
            (contact,) = right(view, phase, place)
            np.testing.assert_allclose(contact.position, (0.05, 0.07), atol=1e-6)
        assert right(view, "start", (0.06, 0.1)) == ()
        assert right(view, "end", (0.06, 0.1)) == ()
    assert len(seen) == 2


def test_a_recording_may_stand_before_its_first_reading() -> None:
    player = SimpleNamespace(
        recording=SimpleNamespace(duration=1.0), speed=1.0, paused=True, ended=False, goal=None,
        position=0.0,
    )  # fmt: skip
    with View(PLANAR, player=player) as view:
        time.sleep(0.15)
        assert view._failure is None


@pytest.mark.parametrize("stands", [True, False])
def test_what_stands_is_not_silent(stands) -> None:
    """The age of the newest reading grows while its recording plays, and not while it stands."""
    player = SimpleNamespace(
        recording=SimpleNamespace(duration=1.0), speed=1.0, paused=stands, ended=False, goal=None,
        position=0.0,
    )  # fmt: skip
    written: list[tuple[object, ...]] = []
    with View(PLANAR, player=player) as view:
        view._panel.write = lambda *given: written.append(given)
        view.write(reading(), NOTHING)
        time.sleep(0.4)
    newest, _, now, _ = written[-1]
    assert (now == newest.arrival) is stands


def test_words_may_be_announced_in_place_of_a_status() -> None:
    with View(PLANAR) as view:
        view.announce("Calibrating", "Touch 1 of 15.")
        assert view._announced == ("Calibrating", "Touch 1 of 15.")
        view.announce()
        assert view._announced is None
