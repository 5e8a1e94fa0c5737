"""The demonstration, headless and in a real browser."""

import json
import os
import re
import threading
import time
from pathlib import Path

import pytest

from chromium import open_page
from smoskin.commands import demo
from smoskin.commands.demo import Readers, hand, run_demo
from smoskin.errors import ArgumentError, ModelError
from smoskin.records import Contact, Status
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.service.recording import open_recording
from smoskin.twin.reduced import ReducedTwin

pytest.importorskip("jax")
pytest.importorskip("safetensors")


def test_headless_finds_every_touch_and_says_how_well(planar, tmp_path):
    starts, sentences = [], []
    result = run_demo(
        planar,
        seconds=4.3,
        page=False,
        record=tmp_path / "demo.mcap",
        on_start=starts.append,
        say=sentences.append,
    )
    assert starts == [None]
    assert sentences[0] == "A workshop makes a virtual skin of the whole folded sheet."
    assert re.fullmatch(
        r"A rig touches the skin: touch 15 of 15: located to 0\.\d+ mm .*\.", sentences[-1]
    )
    plain = json.loads(json.dumps(result.as_json()))
    assert set(plain) == {"touches", "summary"}
    summary = plain["summary"]
    assert summary["estimator"] == "BayesEstimator"
    assert summary["calibration_touches"] == 15
    assert summary["touches"] == summary["found"] >= 3
    assert summary["touches"] + summary["unread"] == len(plain["touches"]) >= 4
    assert summary["mean_position_error_mm"] < 0.8
    assert summary["mean_force_error_percent"] < 1.0
    assert 0 < summary["first_touch_after_s"] < 60
    assert set(summary) == {
        "estimator", "calibration_touches", "touches", "unread", "found", "mean_position_error_mm",
        "mean_force_error_percent", "rate_hz", "latency_us_median", "first_touch_after_s",
    }  # fmt: skip
    recording = open_recording(tmp_path / "demo.mcap")
    assert recording.reading_count == recording.estimate_count > 100
    statuses = [estimate.status for estimate in recording.estimates()]
    assert statuses[:20] == [Status.NOT_CALIBRATED] * 20
    assert Status.NOT_CALIBRATED not in statuses[20:]


@pytest.mark.slow
def test_touches_that_a_busy_machine_read_nothing_of_are_told_apart(planar, monkeypatch):
    """The machine stands still while the second touch of the hand is held."""
    write = demo._Stage.write

    def stall(stage, reading, estimate=None):
        if not stalls and reading.time > 0.2 + hand.PERIOD:
            stalls.append(reading.time)
            time.sleep(hand.PERIOD)
        write(stage, reading, estimate)

    stalls: list[float] = []
    monkeypatch.setattr(demo._Stage, "write", stall)
    result = run_demo(planar, seconds=3.5, page=False)
    summary = result.summary
    assert stalls
    assert summary.unread >= 1
    assert summary.touches + summary.unread == len(result.touches)
    assert [touch.status for touch in result.touches].count("NO_READING") == summary.unread
    assert demo._farewell(result.touches[1:2]) == "The demonstration is over."
    assert demo._farewell(result.touches).startswith(
        f"The demonstration is over: {summary.touches} touch"
    )


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_wrong_numbers_are_refused_before_a_skin_is_made(planar, rate, monkeypatch):
    monkeypatch.setattr(demo, "Twin", None)
    with pytest.raises(ArgumentError, match=r"rate must be 0\.01 to 10000 Hz"):
        run_demo(planar, seconds=2.0, page=False, rate=rate)
    with pytest.raises(ArgumentError, match=r"seconds must be at least 1; got 0\.5"):
        run_demo(planar, seconds=0.5, page=False)


def test_a_design_without_a_table_is_told_so(monkeypatch):
    from smoskin.feasibility import load_design

    monkeypatch.setattr(demo, "Twin", None)
    with pytest.raises(ModelError, match="optimised"):
        run_demo(load_design("optimised"), seconds=2.0, page=False)


def test_readers_change_and_keep_the_zero(planar):
    """An estimator is made when it is first chosen, and starts with the zero of the one before."""
    made = []

    def maker(name):
        def make():
            made.append(name)
            return ClosedFormEstimator(planar)

        return make

    readers = Readers({"a": maker("a"), "b": maker("b")})
    twin = ReducedTwin(planar)
    touch = Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5))
    first = [readers.step(twin.read(time=0.01 * k)).status for k in range(21)]
    assert first == [Status.NOT_CALIBRATED] * 20 + [Status.NO_CONTACT]
    assert (made, readers.name) == (["a"], "a")
    readers.choose("b")
    assert (made, readers.name) == (["a", "b"], "b")
    assert readers.step(twin.read([touch], time=0.3)).status is Status.CONTACT
    readers.choose("a")
    readers.choose("b")
    assert made == ["a", "b"]
    readers.zero([twin.read([touch], time=0.4)], force=True)
    assert readers.step(twin.read([touch], time=0.5)).status is Status.NO_CONTACT
    readers.choose("a")
    assert readers.step(twin.read([touch], time=0.6)).status is Status.NO_CONTACT
    assert readers.drift.shape == (3, 3)
    readers.reset()
    assert readers.step(twin.read(time=0.0)).status is Status.NOT_CALIBRATED


@pytest.mark.slow
@pytest.mark.browser
def test_the_page_shows_rig_and_press_and_changes_the_estimator(planar, monkeypatch, tmp_path):
    """The whole chain: rig, hand, twin, chips, estimator, page; its picture is the README's."""
    press = Contact(position=(0.073, 0.0905), force=(0.25, -0.1, -0.8))
    monkeypatch.setattr(demo, "scripted_hand", lambda *_, **__: (press,))
    monkeypatch.setattr(demo, "_PATIENCE", 60.0)
    monkeypatch.setattr(demo, "_LIFT", 5.0)  # a busy page may draw nothing for half a second
    monkeypatch.setattr(hand, "HOLD", 600.0)
    monkeypatch.setattr(hand, "PERIOD", 700.0)
    started, stop, urls, results = threading.Event(), threading.Event(), [], []

    def on_start(url):
        urls.append(url)
        started.set()

    work = threading.Thread(
        target=lambda: results.append(run_demo(planar, on_start=on_start, stop=stop))
    )
    work.start()
    try:
        assert started.wait(30.0)
        with open_page(urls[0]) as opened:
            opened.wait_until(lambda: opened.text("status") == "Calibrating")
            assert "A rig touches the skin: touch" in opened.text("sentence")
            opened.wait_until(lambda: opened.text("status") == "Touched", deadline=60.0)
            opened.dismiss_notices()

            def read() -> list[float]:
                return list(map(float, re.findall(r"-?\d+\.\d+", opened.text("touch"))))

            # The first reading may be drawn while the hand's force still grows.
            opened.wait_until(lambda: read()[2] == pytest.approx(0.844, abs=0.05))
            assert read()[:2] == pytest.approx([73.0, 90.5], abs=1.2)
            opened.page.wait_for_timeout(2500)  # the curves fill
            # SMOSKIN_PICTURES=docs renews the pictures of README and quick start.
            pictures = Path(os.environ.get("SMOSKIN_PICTURES", tmp_path))
            opened.page.screenshot(path=str(pictures / "demo.png"))
            opened.click(opened.page.get_by_role("button", name="Zero"))
            opened.wait_until(lambda: opened.text("status") == "Not touched")  # the hand lets go
            opened.wait_until(lambda: opened.text("status") == "Touched")
            opened.click(opened.page.locator('input[role="combobox"][value="Bayes"]'))
            opened.click(opened.page.get_by_role("option", name="closed form"))
            # The closed form knows cells: it says the middle of one.
            opened.wait_until(
                lambda: opened.text("touch").startswith("x 70.0 mm  y 93.3 mm"), deadline=60.0
            )
            opened.page.set_viewport_size({"width": 390, "height": 844})
            opened.page.reload()
            now = opened.page.locator("#skin-now")
            opened.wait_until(lambda: now.text_content().startswith("x 70.0 mm"))
            opened.page.wait_for_timeout(3000)  # the panel folds
            opened.dismiss_notices()
            opened.page.screenshot(path=str(pictures / "demo_phone.png"))
    finally:
        stop.set()
        work.join(60.0)
    assert not work.is_alive()
    assert (pictures / "demo.png").stat().st_size > 50_000
    assert (pictures / "demo_phone.png").stat().st_size > 20_000
    assert results[0].touches == ()
