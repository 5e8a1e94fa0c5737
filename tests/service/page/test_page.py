"""The live page in a browser: what it shows of a moment, and what a mouse on it does."""

import threading

import numpy as np
import pytest

from chromium import open_page
from pages import (
    NOTHING,
    PLANAR,
    SHEET,
    SKIN,
    TOUCH,
    TOUCHED,
    assert_gone,
    feeding,
    picture,
    pixels,
    reading,
    settle,
    vermilion,
)
from smoskin.arrays import Floats
from smoskin.records import ChipFlag, Contact, Estimate, Status
from smoskin.service.page.view import View


@pytest.mark.browser
def test_the_page_shows_what_it_is_told() -> None:
    missing = Estimate(time=0.0, status=Status.CHIP_MISSING)
    flags = [0, ChipFlag.MISSING, 0]

    with View(PLANAR) as view, open_page(view.url) as opened:
        opened.wait_until(lambda: opened.text("status") == "Waiting")
        assert view.watched
        view.announce("Calibrating", "Touch 1 of 15.")
        opened.wait_until(lambda: opened.text("status") == "Calibrating")
        assert opened.text("sentence") == "Touch 1 of 15."
        view.announce()
        opened.wait_until(lambda: opened.text("status") == "Waiting")
        assert opened.page.get_by_text("Estimator").count() == 0
        with feeding(lambda k: view.write(reading(0.02 * k))):
            opened.wait_until(lambda: opened.text("status") == "Reading")

        with feeding(lambda k: view.write(reading(0.02 * k), NOTHING, latency=1.25e-3)):
            opened.wait_until(lambda: opened.text("status") == "Not touched")
            opened.wait_until(lambda: float(opened.text("rate").removesuffix(" readings/s")) > 10)
            assert opened.text("latency") == "1.2 ms"
            assert opened.page.get_by_text("smoskin: planar").count() > 0
            assert opened.page.get_by_text("Press the skin").count() == 0
            assert opened.page.get_by_text("Three magnetic chips under a folded sheet").count() == 1
            assert opened.page.get_by_role("button", name="Record").count() == 0
            empty = opened.page.locator('[data-name="touches"] tr').all_text_contents()
        opened.wait_until(lambda: opened.text("status") == "Silent")
        opened.dismiss_notices()
        untouched = picture(opened)
        # The sheet covers the middle, and its panels differ in shade.
        height, width, _ = untouched.shape
        middle = untouched[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3]
        assert middle.max(axis=-1).mean() < 240
        assert middle.mean(axis=-1).std() > 8
        assert vermilion(untouched) < 20

        with feeding(lambda k: view.write(reading(100 + 0.02 * k), TOUCHED, truth=[TOUCH])):
            opened.wait_until(lambda: opened.text("status") == "Touched")
            assert opened.text("sentence") == Status.CONTACT.value
        assert opened.text("touch") == "x 45.0 mm  y 80.0 mm  F 0.51 N"
        assert opened.page.locator('[data-name="touches"] tr').all_text_contents() == [
            "estimatetrueerror",
            "x, mm45.0± 2.045.0+0.0",
            "y, mm80.0± 1.080.0+0.0",
            "F, N0.512± 0.0390.512+0.000",
            "press, N0.500± 0.0400.500+0.000",
            "Fx, N0.100± 0.0200.100+0.000",
            "Fy, N-0.050± 0.030-0.050+0.000",
        ]
        assert len(empty) == 7  # the rows stand where they are
        opened.wait_until(lambda: vermilion(picture(opened)) > 100)

        with feeding(lambda k: view.write(reading(200 + 0.02 * k, flags=flags), missing)):
            opened.wait_until(lambda: opened.text("status") == "Chip missing")
            opened.wait_until(lambda: opened.page.get_by_text("S2 · missing").count() == 1)
        assert opened.text("tally") == "1 touch so far, off by 0.0 mm (median)"
        opened.page.get_by_role("checkbox", name="Trail").uncheck()
        opened.wait_until(lambda: vermilion(picture(opened)) < 20)

        view.end("The demonstration is over: 24 touches, 0.3 mm.")
        view.close()
        over = opened.page.locator("#skin-end")
        opened.wait_until(over.is_visible)
        assert over.inner_text().strip() == "The demonstration is over: 24 touches, 0.3 mm."


@pytest.mark.slow
@pytest.mark.browser
def test_keys_press_the_buttons() -> None:
    done: list[object] = []
    view = View(PLANAR, on_zero=lambda: done.append("zero"), on_record=done.append)
    with view, open_page(view.url) as opened:
        view.write(reading(), NOTHING)
        view.show_recording(True, "Recording into a.mcap: 1 readings, 0 lost.")
        opened.wait_until(
            lambda: opened.page.get_by_role("button", name="Stop recording").count() == 1
        )
        words = opened.page.locator("#skin-keys")
        assert not words.is_visible()
        for key in ("z", "r"):
            opened.page.keyboard.press(key)
        opened.wait_until(lambda: done == ["zero", False])
        opened.page.keyboard.press("?")
        opened.wait_until(words.is_visible)
        opened.page.keyboard.press(" ")
        opened.wait_until(lambda: opened.page.get_by_text("Go on", exact=True).count() == 1)
        opened.page.locator("input.mantine-NumberInput-input").last.focus()
        opened.page.keyboard.press("z")
        opened.page.wait_for_timeout(300)
        assert done == ["zero", False]


@pytest.mark.slow
@pytest.mark.browser
def test_the_skin_is_pressed_while_the_button_is_held() -> None:
    presses: list[tuple[Contact, ...]] = []
    top = SHEET.vertices[:, 2].max()
    before_all = set(threading.enumerate())
    view = View(PLANAR, on_press=presses.append)
    with open_page(view.url) as opened:
        inside = set(threading.enumerate())
        view.write(reading(), NOTHING)
        canvas = settle(opened)
        mouse = opened.page.mouse

        def go(place: Floats, **options: int) -> None:
            mouse.move(*pixels(np.array([*place, top]), canvas), **options)

        # The left button presses from down to up, and slides between.
        for cell in ((0, 0), (5, 4)):
            place = SKIN.tops[cell]
            presses.clear()
            go(place)
            mouse.down()
            opened.wait_until(lambda: presses)
            opened.page.wait_for_timeout(500)
            assert len(presses) == 1
            ((pressed,),) = presses
            np.testing.assert_allclose(pressed.position, place, atol=1e-3)
            np.testing.assert_allclose(pressed.force, (0.0, 0.0, -0.5))
            mouse.up()
            opened.wait_until(lambda: presses[-1] == ())

        presses.clear()
        along = SKIN.tops[1:5, 1]
        go(along[0])
        mouse.down()
        for place in along:
            go(place, steps=8)
            opened.page.wait_for_timeout(200)
        mouse.up()
        opened.wait_until(lambda: presses and presses[-1] == ())
        slide = np.array([contact.position for press in presses for contact in press])
        assert len(slide) > 4
        assert np.all(np.diff(slide[:, 0]) >= 0)
        np.testing.assert_allclose(slide[-1], along[-1], atol=2e-3)

        # The right button sets a finger that stays beside the left one, until it is pressed again.
        presses.clear()
        go(SKIN.tops[1, 1])
        mouse.click(*pixels(np.array([*SKIN.tops[1, 1], top]), canvas), button="right", delay=1000)
        opened.wait_until(lambda: presses)
        go(SKIN.tops[4, 4])
        mouse.down()
        opened.wait_until(lambda: len(presses[-1]) == 2)
        assert {contact.position[0] > 0.06 for contact in presses[-1]} == {True, False}
        mouse.up()
        opened.wait_until(lambda: len(presses[-1]) == 1)
        mouse.click(*pixels(np.array([*SKIN.tops[4, 4], top]), canvas), button="right", delay=1000)
        opened.wait_until(lambda: presses[-1] == ())

        # Beside the sheet a drag turns the picture, and back again, and presses nothing.
        presses.clear()
        before = picture(opened)
        mouse.move(canvas[0] + 60, canvas[1] + 60)
        mouse.down()
        mouse.move(canvas[0] + 160, canvas[1] + 90, steps=5)
        mouse.up()
        opened.wait_until(lambda: np.abs(picture(opened) - before).mean() > 2)
        assert presses == []
        mouse.down()
        mouse.move(canvas[0] + 60, canvas[1] + 60, steps=5)
        mouse.up()

        # Closing lets go of a press and of the browser.
        opened.page.wait_for_timeout(500)
        mouse.move(canvas[0] + canvas[2] / 2, canvas[1] + canvas[3] / 2)
        mouse.down()
        opened.wait_until(lambda: presses)
        view.close()
        assert presses[-1] == ()
        assert len(presses) == 2
        assert_gone(inside)
    assert_gone(before_all)


@pytest.mark.browser
def test_every_control_does_what_it_says() -> None:
    done: list[object] = []
    failing = threading.Event()

    def record(on: bool) -> None:
        done.append(("record", on))
        view.show_recording(on, f"{'Recording into' if on else 'Recorded'} <a>.mcap.")

    def zero() -> None:
        if failing.is_set():
            raise RuntimeError("no zero to be had")
        done.append("zero")

    before = set(threading.enumerate())
    with (
        View(
            PLANAR,
            estimators=["Bayes", "closed form"],
            on_choose=done.append,
            on_press=lambda contacts: None,
            on_still=lambda still: done.append(("still", still)),
            on_zero=zero,
            on_undo=lambda: done.append("undo"),
            on_record=record,
        ) as view,
        open_page(view.url) as opened,
    ):
        settle(opened)

        def press(name: str) -> None:
            opened.click(opened.page.get_by_role("button", name=name, exact=True))

        with feeding(lambda k: view.write(reading(0.02 * k), NOTHING)):
            for name, what in (
                ("Zero", "zero"),
                ("Undo", "undo"),
                ("Record", ("record", True)),
                ("Stop recording", ("record", False)),
            ):
                opened.page.get_by_role("button", name=name, exact=True).wait_for()
                press(name)
                opened.wait_until(lambda what=what: done and done[-1] == what)  # type: ignore[misc]
            opened.wait_until(lambda: opened.text("recording") == "Recorded <a>.mcap.")
            opened.click(opened.page.get_by_label("Hold the hand still"))
            opened.wait_until(lambda: done[-1] == ("still", True))
            opened.wait_until(lambda: opened.text("status") == "Not touched")
            press("Pause")
            opened.page.get_by_role("button", name="Go on", exact=True).wait_for()
        opened.page.wait_for_timeout(2000)
        assert opened.text("status") == "Not touched"  # it would have fallen silent
        press("Go on")
        opened.wait_until(lambda: opened.text("status") == "Silent")

        # A box beside a slider shows what the slider holds.
        box = opened.page.locator(".mantine-NumberInput-input").first
        for typed, shown in (("99", "1"), ("abc", "1"), ("0.3", "0.3"), ("", "0.3")):
            box.fill("")
            box.press_sequentially(typed)
            box.blur()
            opened.wait_until(lambda shown=shown: box.input_value() == shown)  # type: ignore[misc]
        assert view._panel.force == (0.0, 0.0, -0.3)

        opened.click(opened.page.locator('input[role="combobox"][value="Bayes"]'))
        opened.click(opened.page.get_by_role("option", name="closed form"))
        opened.wait_until(lambda: done[-1] == "closed form")

        # What a callback raises reaches the caller.
        failing.set()
        press("Zero")

        def failed() -> bool:
            try:
                view.write(reading(), NOTHING)
            except RuntimeError as error:
                return str(error) == "no zero to be had"
            return False

        opened.wait_until(failed)
    assert_gone(before)


@pytest.mark.slow
@pytest.mark.browser
def test_a_telephone_shows_the_skin_and_folds_the_panel() -> None:
    asked: list[bool] = []
    view = View(PLANAR, on_press=lambda contacts: None, on_record=asked.append)
    with view, open_page(view.url) as opened:
        opened.page.set_viewport_size({"width": 390, "height": 844})
        opened.page.reload()
        with feeding(lambda k: view.write(reading(0.02 * k), TOUCHED, truth=[TOUCH])):
            now = opened.page.locator("#skin-now")
            opened.wait_until(lambda: now.text_content() == "x 45.0 mm  y 80.0 mm  F 0.51 N")
            folder = opened.page.get_by_text("Press the skin")
            opened.wait_until(lambda: not folder.is_visible())
            opened.wait_until(lambda: vermilion(picture(opened)) > 50)
            left, top, width, height = opened.canvas()
            assert (left, width) == (0, 390)
            assert top < 150 < 600 < height  # a heading above, the folded panel below

            def covered() -> float:
                """How much of the picture the panel covers, in pixels."""
                _, top, _, height = opened.canvas()
                box = opened.page.locator(sheet).bounding_box()
                return top + height - box["y"] if box else 999.0

            sheet = '.mantine-Paper-root[style*="position: fixed"]'
            opened.wait_until(lambda: covered() <= 0)
            assert now.is_visible()
            assert not folder.is_visible()
            assert opened.page.get_by_text("smoskin: planar").first.is_visible()
            opened.click(opened.page.locator(f'{sheet} div[style*="height: 3.5em"]'))
            record = opened.page.get_by_role("button", name="Record", exact=True)
            record.scroll_into_view_if_needed()
            opened.wait_until(lambda: covered() <= 0 and opened.canvas()[3] < 400)
            assert opened.canvas()[3] > 250
            assert vermilion(picture(opened)) > 50
            opened.click(record)
            opened.wait_until(lambda: asked == [True])


@pytest.mark.slow
@pytest.mark.browser
def test_the_system_says_whether_the_page_is_dark() -> None:
    with View(PLANAR) as view, open_page(view.url) as opened:
        page = opened.page
        for scheme in ("light", "dark", "light"):  # the page opens anew in each
            page.emulate_media(color_scheme=scheme)
            page.locator(f'html[data-mantine-color-scheme="{scheme}"]').wait_for(state="attached")
            assert "token=" in page.url
            assert ("darkMode" in page.url) == (scheme == "dark")
