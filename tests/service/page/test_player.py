"""A recording on the page: paused, sought in, and played at another speed."""

import threading
from pathlib import Path

import pytest

from chromium import open_page
from smoskin.commands.run import Watch
from smoskin.records import Contact, Estimate
from smoskin.service.recorder import Recorder
from smoskin.twin.reduced import ReducedTwin
from touch_recordings import DESIGN


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
