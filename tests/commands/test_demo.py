"""The demonstration, headless and in a real browser."""

import json
import os
import re
import threading
from pathlib import Path

import numpy as np
import pytest

from chromium import open_page
from smoskin.commands.demo import _Hand, run_demo, scripted_hand
from smoskin.errors import ArgumentError
from smoskin.records import Contact, Estimate, Status
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.service.recorder import open_recording


def test_the_hand_touches_all_over_the_skin(planar):
    touches = scripted_hand(planar, 60.0, seed=0)
    assert len(touches) == 74
    cells = {tuple((t.position // (0.02, 0.16 / 6)).astype(int)) for t in touches}
    assert len(cells) == 36
    assert {bool(np.any(t.force[:2])) for t in touches} == {True, False}


def test_headless_finds_every_touch_and_says_how_well(planar, tmp_path):
    starts, said = [], []
    result = run_demo(
        planar,
        seconds=5.0,
        page=False,
        record=tmp_path / "demo.mcap",
        on_start=starts.append,
        say=said.append,
    )
    assert starts == [None]
    assert said[-1] == "Calibrating it on a virtual bench: 114 touches, on every cell."
    plain = json.loads(json.dumps(result.as_json()))
    assert set(plain) == {"touches", "summary"}
    assert set(plain["summary"]) == {
        "touches", "found", "mean_position_error_mm", "mean_force_error_percent",
        "rate_hz", "latency_us_median",
    }  # fmt: skip
    assert plain["summary"]["touches"] == plain["summary"]["found"] == 5
    assert plain["summary"]["mean_position_error_mm"] < 8.0
    assert plain["summary"]["mean_force_error_percent"] < 8.0
    recording = open_recording(tmp_path / "demo.mcap")
    assert recording.reading_count == recording.estimate_count > 100


def test_by_theory_touches_of_a_whole_sheet_are_missed(planar, monkeypatch):
    """The judge can fail: without its calibration the skin is not as the estimator believes."""
    import smoskin.commands.demo as demo

    monkeypatch.setattr(demo, "_calibrated", lambda twin, _: Calibration.nominal(twin.design))
    result = run_demo(planar, seconds=4.0, page=False)
    assert result.summary.found < result.summary.touches == 4


def test_a_touch_that_nobody_read_is_missed_and_one_unfinished_is_not_counted(planar):
    """A loop that stalls while a touch is held must not lose it silently."""
    script = scripted_hand(planar, 4.0, seed=0)
    hand = _Hand(script, repeat=False)
    for time in (0.0, 0.1, 1.6, 1.9):  # the second hold ends at 1.5, the third begins at 1.95
        hand.note(Estimate(time=time, status=Status.NO_CONTACT))
    judged = hand.judge(planar)
    assert [touch.status for touch in judged] == ["NO_READING", "NO_READING"]
    assert not any(touch.found for touch in judged)


def test_too_short_a_demonstration_is_refused(planar):
    with pytest.raises(ArgumentError, match=r"seconds must be at least 1; got 0\.5"):
        run_demo(planar, seconds=0.5, page=False)


@pytest.mark.browser
def test_the_page_shows_the_press_where_it_is_and_how_hard(planar, monkeypatch, tmp_path):
    """The whole chain: hand, twin, chips, estimator, page; its picture is the README's."""
    import smoskin.commands.demo as demo

    press = Contact(position=(0.073, 0.0905), force=(0.25, -0.1, -0.8))
    monkeypatch.setattr(demo, "scripted_hand", lambda *_: (press,))
    monkeypatch.setattr(demo, "_HOLD", 60.0)
    monkeypatch.setattr(demo, "_PERIOD", 70.0)
    started, urls = threading.Event(), []

    def on_start(url):
        urls.append(url)
        started.set()

    work = threading.Thread(
        target=run_demo, args=(planar,), kwargs={"seconds": 45.0, "on_start": on_start}
    )
    work.start()
    try:
        assert started.wait(30.0)
        with open_page(urls[0]) as opened:
            opened.dismiss_notices()
            opened.wait_until(lambda: opened.text("status") == "Touched")
            said = opened.text("touch")
            x, y, force = map(float, re.findall(r"-?\d+\.\d+", said))
            assert (x, y) == pytest.approx((70.0, 93.3), abs=0.1), said
            assert force == pytest.approx(0.8, abs=0.05), said
            opened.page.wait_for_timeout(4000)
            # SMOSKIN_PICTURE=docs/demo.png renews the README's picture.
            picture = Path(os.environ.get("SMOSKIN_PICTURE", tmp_path / "demo.png"))
            opened.page.screenshot(path=str(picture))
    finally:
        work.join(90.0)
    assert not work.is_alive()
    assert picture.stat().st_size > 50_000
