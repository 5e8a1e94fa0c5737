"""A recording on the page: paused, sought in, and played at another speed."""

import asyncio
import threading
import time
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from chromium import open_page
from pages import settle
from smoskin.commands.run import Watch
from smoskin.records import Contact, Estimate, Status
from smoskin.service.page import player as players
from smoskin.service.page.player import Player, Rerun
from smoskin.service.page.view import View
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.twin.reduced import ReducedTwin
from touch_recordings import DESIGN


class Slider(SimpleNamespace):
    """A widget that holds what it was made with and what listens to it."""

    def on_update(self, listener):
        self.listener = listener

    on_click = on_update


class Server:
    """Stands for the viewer: keeps the widgets that are added."""

    def __init__(self):
        self.gui, self.added = self, {}

    def add_folder(self, name, order=None):
        return threading.Lock()  # any context

    def add_slider(self, name, least, most, step, value, **_):
        self.added[name] = Slider(min=least, max=most, step=step, value=value)
        return self.added[name]

    def add_button_group(self, name, options):
        self.added[name] = Slider(options=options)
        return self.added[name]


def source(duration):
    sought = []
    return SimpleNamespace(
        recording=SimpleNamespace(duration=duration), speed=1.0, paused=False, ended=False,
        goal=None, position=0.0, sought=sought, seek=sought.append,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("duration", "step", "end"), [(0.0, 1e-5, 1e-3), (0.73, 1e-3, 0.73), (9.99, 0.01, 9.99),
                                  (10.0, 0.1, 10.0), (83.21, 0.1, 83.3), (100.5, 1.0, 101.0)]
)  # fmt: skip
def test_a_slider_reaches_the_end_in_100_to_1000_steps(duration, step, end):
    server = Server()
    Player(server, source(duration))
    slider = server.added["Time, s"]
    assert (slider.min, slider.value) == (0.0, 0.0)
    assert slider.step == pytest.approx(step)
    assert slider.max == pytest.approx(end)


def test_speeds_are_those_on_the_buttons():
    server, played = Server(), source(10.0)
    Player(server, played)
    buttons = server.added["Speed"]
    for label in buttons.options:
        asyncio.run(buttons.listener(SimpleNamespace(target=SimpleNamespace(value=label))))
        assert played.speed == {"¼": 0.25, "1": 1.0, "4": 4.0}[label.removesuffix(" ×")]
    assert len(buttons.options) == 3


def test_a_hand_on_the_slider_is_left_alone_for_07_s(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(players.time, "monotonic", lambda: now[0])
    server, played = Server(), source(10.0)
    player = Player(server, played)
    slider = server.added["Time, s"]
    played.position = 2.0
    assert player.write() is None
    assert slider.value == 2.0
    slider.value = 5.0
    asyncio.run(slider.listener(SimpleNamespace(client=None)))  # moved by the program
    assert played.sought == []
    asyncio.run(slider.listener(SimpleNamespace(client="somebody")))
    assert played.sought == [5.0]
    for later, value in ((0.65, 5.0), (0.75, 2.0)):
        now[0] = 100.0 + later
        player.write()
        assert slider.value == value
    played.position = 20.0
    player.write()
    assert slider.value == slider.max
    played.goal = 5.04
    assert player.write() == ("Seeking", "Reading on to 5.0 s, now at 20.0 s.")
    for paused, ended in ((True, False), (False, True), (False, False)):
        played.paused, played.ended = paused, ended
        assert player.stands == (paused or ended)


@pytest.fixture
def recorded_touch(tmp_path):
    """2 s of a skin that is touched after the first; the estimates are the numbers of readings."""
    path, twin = tmp_path / "a.mcap", ReducedTwin(DESIGN, seed=None)
    with Recorder(path, DESIGN) as recorder:
        for number in range(201):
            moment = 7.0 + 0.01 * number
            estimate = Estimate(time=moment, status=list(Status)[number % 3])
            recorder.write(twin.read(time=moment), estimate)
    return path


def test_what_was_recorded_plays_beside_a_live_skin_with_the_estimates_of_its_time(recorded_touch):
    rerun = Rerun(recorded_touch)
    rerun.source.seek(1.5)
    rerun.source.pause()
    wait_for(lambda: rerun.newest is not None and rerun.source.goal is None)
    assert rerun.newest.reading.time == pytest.approx(8.5)
    assert rerun.newest.estimate.status is list(Status)[150 % 3]
    # Its file may be gone by the time that somebody wants to see the beginning again.
    recorded_touch.unlink()
    rerun.source.seek(0.0)
    wait_for(lambda: rerun.failure)
    assert "No such file" in rerun.failure
    rerun.close()
    assert not rerun._thread.is_alive()


def test_what_cannot_be_played_is_told_and_the_skin_is_shown_on(tmp_path, recorded_touch):
    empty = tmp_path / "empty.mcap"
    Recorder(empty, DESIGN).close()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(b"no recording")
    with View(DESIGN, on_record=lambda on: None) as view:

        def ask_for(path):
            view.show_recording(False, f"Recorded {path.name}.", path)
            view._asked.put(view._rerun_or_return)

        for path, word in (
            (tmp_path / "gone.mcap", "No such file"),
            (torn, "torn.mcap"),
            (empty, "has no readings"),
        ):
            ask_for(path)
            wait_for(lambda path=path: path.name in view._panel._notice and view._panel.refusal)
            assert view._panel._notice.startswith("Not played: ")
            assert word in view._panel._notice
            assert view._rerun is None
        ask_for(recorded_touch)
        wait_for(lambda: view._rerun is not None and view._panel.player is not None)
        assert view._panel.rerun.label == "Back to live"
        recorded_touch.unlink()
        view._rerun.source.seek(0.0)
        wait_for(lambda: view._rerun is None)
        assert view._panel.refusal.startswith("Not played on: ")
        assert view._panel.player is None
        view.show_recording(True, "Recording into b.mcap: 1 readings, 0 lost.", recorded_touch)
        view._asked.put(view._rerun_or_return)  # gone for good
        wait_for(lambda: view._panel.refusal.startswith("Not played: "))


def wait_for(happened):
    end = time.monotonic() + 20.0
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.browser
def test_a_recording_is_paused_and_sought_in(tmp_path: Path) -> None:
    """Untouched for 1 s, then touched until 4 s; the page stays at the end."""
    twin = ReducedTwin(DESIGN, seed=1)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    with Recorder(tmp_path / "a.mcap", DESIGN) as recorder:
        for number in range(201):
            recorder.write(twin.read([touch] * (number >= 50), time=7.0 + 0.02 * number))
    estimates: list[Estimate] = []
    with Watch(f"replay:{tmp_path / 'a.mcap'}?speed=max", view=True) as watch:
        player = threading.Thread(target=lambda: estimates.extend(watch))
        player.start()
        assert watch.url is not None
        with open_page(watch.url) as opened:
            page = opened.page
            slider = page.get_by_role("slider").first
            slider.wait_for()

            def at(place: str, status: str) -> None:
                opened.wait_until(lambda: slider.get_attribute("aria-valuenow") == place)
                opened.wait_until(lambda: opened.text("status") == status)

            def go(place: str) -> None:
                box = page.locator(".mantine-NumberInput-input").first
                box.fill(place)
                box.blur()

            def press(name: str) -> None:
                page.get_by_role("button", name=name, exact=True).dispatch_event("click")

            at("4", "Touched")
            assert len(estimates) == 201
            page.wait_for_timeout(1500)
            assert opened.text("status") == "Touched"  # what stands is not silent
            press("Pause")
            go("0.8")
            at("0.8", "Not touched")
            assert len(estimates) == 202
            assert estimates[-1] == estimates[40]
            go("2.5")
            at("2.5", "Touched")
            assert estimates[-1] == estimates[125]
            press("¼ ×")
            press("Go on")
            opened.wait_until(lambda: len(estimates) > 210)
            assert len(estimates) < 278
            at("4", "Touched")
            assert estimates[203:] == estimates[126:201]
    player.join(10.0)
    assert not player.is_alive()
    assert watch.summary.touches == 1  # what is shown again counts once


@pytest.mark.slow
@pytest.mark.browser
def test_a_live_skin_is_recorded_and_read_by_another_estimator(tmp_path: Path) -> None:
    touch = Contact(position=(0.045, 0.090), force=(0.1, -0.05, -0.5))
    # Eight readings a second: a browser without a graphics card draws no more beside its panels.
    url = "twin://planar?mechanics=reduced&creep=no&rate=8"
    shipped = str(resources.files("smoskin.sensing.response") / "planar.table")
    options = {"record": tmp_path, "estimators": [shipped], "uncalibrated": True}
    with Watch(url, view=True, **options) as watch:
        reader = threading.Thread(target=lambda: list(watch))
        reader.start()
        assert watch.url is not None
        with open_page(watch.url) as opened:

            def press(name: str) -> None:
                button = opened.page.get_by_role("button", name=name, exact=True)
                button.wait_for()
                opened.click(button)

            opened.wait_until(lambda: opened.text("status") == "Not touched")
            settle(opened)
            assert opened.page.locator('[data-name="recording"]').count() == 0
            press("Record")
            opened.wait_until(lambda: opened.text("recording").startswith("Recording into planar-"))
            watch._source.touch([touch])
            # The closed form tells the middle of a cell, Bayes the place.
            opened.wait_until(lambda: opened.text("touch").startswith("x 50.0 mm  y 93.3 mm"))
            opened.click(opened.page.locator('input[role="combobox"][value^="closed"]'))
            opened.click(opened.page.get_by_role("option", name="Bayes, planar.table"))
            opened.wait_until(lambda: not opened.text("touch").startswith(("x 50.0 mm", "–")))
            press("Stop recording")
            opened.wait_until(lambda: opened.text("recording").startswith("Recorded planar-"))
            sentence = opened.text("recording")
            (file,) = tmp_path.iterdir()
            kept = [
                estimate.contacts[0]
                for _, estimate in open_recording(file)
                if estimate and estimate.contacts
            ]
            texts = {
                "x {:.1f} mm  y {:.1f} mm  F {:.2f} N".format(
                    *(1e3 * contact.position), np.linalg.norm(contact.force)
                )
                for contact in kept
            }
            watch._source.touch([])
            opened.wait_until(lambda: opened.text("status") == "Not touched")
            press("Play the last recording")
            opened.wait_until(lambda: opened.text("status") == "Played back")
            # What was estimated then, by either estimator.
            for closed in (True, False):
                opened.wait_until(
                    lambda closed=closed: (
                        opened.text("touch") in texts
                        and opened.text("touch").startswith("x 50.0 mm") == closed
                    )
                )
            # While it is played the skin is read on, and may be recorded again.
            press("Record")
            opened.wait_until(lambda: opened.text("recording").startswith("Recording into planar-"))
            press("Back to live")
            opened.wait_until(lambda: opened.text("status") == "Not touched")
            watch.stop()
        reader.join(10.0)
        assert not reader.is_alive()
    first, second = (open_recording(file) for file in sorted(tmp_path.iterdir()))
    assert sentence == f"Recorded {first.path.name}: {first.reading_count} readings, 0 lost."
    moments = [reading.time for reading, _ in first]
    assert first.reading_count == len(moments) > len(kept) > 0
    assert (np.diff(moments) > 0).all()
    assert second.damage == ""
