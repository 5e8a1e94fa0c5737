"""The live page: what it draws of a moment, and what a mouse on it does."""

import io
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chromium import OpenPage, open_page
from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.roles import Source
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.service.loop import Loop
from smoskin.service.page.scene import ESTIMATED, camera, creases, pick, triangles
from smoskin.service.page.view import View

TOUCH = Contact(position=(0.045, 0.080), force=(0.1, -0.05, -0.5))
NOTHING = Estimate(time=0.0, status=Status.NO_CONTACT)


PLANAR = load_design("planar")
SKIN = geometry(PLANAR)
SHEET = SKIN.sheet
TRIANGLES = triangles(SHEET.facets)


def reading(time: float = 0.0, field: float = 0.0, flags: object = None) -> Reading:
    return Reading(time=time, field=np.full((3, 3), field), flags=flags)


@contextmanager
def feeding(moment: Callable[[int], None]) -> Iterator[None]:
    """Calls `moment` fifty times a second, with a running number, from a thread of its own."""
    stop = threading.Event()

    def feed() -> None:
        number = 0
        while not stop.wait(0.02):
            moment(number)
            number += 1

    thread = threading.Thread(target=feed)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(10.0)


def assert_gone(before: set[threading.Thread]) -> None:
    """Every thread that was not there before has ended, or does within five seconds."""
    for thread in set(threading.enumerate()) - before:
        thread.join(5.0)
        assert not thread.is_alive(), f"{thread.name} is still running"


# The sheet and the rays


def test_every_edge_of_the_sheet_is_one_crease() -> None:
    # Euler: V - E + F = 1 for a disc.
    assert len(SHEET.vertices) - len(creases(SHEET.facets)) + len(SHEET.facets) == 1


@given(
    triangle=st.integers(0, len(TRIANGLES) - 1),
    u=st.floats(0.05, 0.9),
    v=st.floats(0.05, 0.9),
    exaggeration=st.floats(0.0, 1.0),
)
def test_a_ray_through_a_point_of_the_sheet_lands_there(
    triangle: int, u: float, v: float, exaggeration: float
) -> None:
    x, y, z = SHEET.vertices.T
    dent = np.exp(-((x - 0.06) ** 2 + (y - 0.08) ** 2) / 0.02**2)
    drawn = np.stack([x, y, z - 3e-3 * exaggeration * dent], axis=-1)
    weights = np.array([1.0 - u, u * (1.0 - v), u * v])
    corners = TRIANGLES[triangle]
    above = weights @ drawn[corners] + (0.0, 0.0, 0.2)
    place = pick(PLANAR, drawn, above, (0.0, 0.0, -3.0))
    assert place is not None
    landed = weights @ SHEET.vertices[corners, :2]
    # The zigzag of the rim reaches beyond the sensing area, where its edge counts.
    np.testing.assert_allclose(place, np.clip(landed, 0.0, SKIN.extent), atol=1e-12)


def test_a_ray_past_the_sheet_or_away_from_it_lands_nowhere() -> None:
    assert pick(PLANAR, SHEET.vertices, (0.5, 0.5, 0.1), (0.0, 0.0, -1.0)) is None
    assert pick(PLANAR, SHEET.vertices, (0.06, 0.08, 0.1), (0.0, 0.0, 1.0)) is None


def test_a_press_on_the_rim_counts_inside_the_extent() -> None:
    top = float(SHEET.vertices[:, 1].max())
    assert top > SKIN.extent[1]
    place = pick(PLANAR, SHEET.vertices, (1e-3, top - 2e-3, 0.1), (0.0, 0.0, -1.0))
    assert place is not None
    np.testing.assert_allclose(place, (1e-3, SKIN.extent[1]))


def test_the_camera_sees_the_whole_sheet() -> None:
    columns, rows = pixels(SHEET.vertices, (0.0, 0.0, 700.0, 900.0)).T
    assert 0 < columns.min() < columns.max() < 700
    assert 0 < rows.min() < rows.max() < 900


# The view without a page


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


# The page in a browser


def pixels(points: Floats, canvas: tuple[float, float, float, float]) -> Floats:
    """Where points, m, appear in the page, by a pinhole camera; shape (..., 2)."""
    left, top, width, height = canvas
    eye, target, field_of_view = camera(PLANAR)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    scale = height / 2 / math.tan(field_of_view / 2)
    ray = points - eye
    depth = ray @ ahead
    return np.stack(
        [
            left + width / 2 + scale * (ray @ right) / depth,
            top + height / 2 - scale * (ray @ np.cross(right, ahead)) / depth,
        ],
        axis=-1,
    )


def picture(opened: OpenPage) -> Floats:
    """The 3-D picture, shape (H, W, 3), 0 to 255."""
    image = pytest.importorskip("PIL.Image")
    left, top, width, height = opened.canvas()
    png = opened.page.screenshot(clip={"x": left, "y": top, "width": width, "height": height})
    return np.asarray(image.open(io.BytesIO(png)).convert("RGB"), dtype=float)


def vermilion(colors: Floats) -> int:
    """How many pixels have about the colour of an estimated force in some light."""
    share = colors / np.maximum(colors.sum(axis=-1, keepdims=True), 1.0)
    wanted = np.array(ESTIMATED) / sum(ESTIMATED)
    vivid = np.ptp(colors, axis=-1) > 90
    return int((vivid & (np.linalg.norm(share - wanted, axis=-1) < 0.15)).sum())


@pytest.mark.browser
def test_the_page_shows_what_it_is_told() -> None:
    covariance = np.diag([2e-3, 1e-3, 0.02, 0.03, 0.04]) ** 2
    touched = Estimate(
        time=0.0, status=Status.CONTACT, contacts=(TOUCH,), covariance=covariance[None]
    )
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
            assert opened.page.get_by_role("button", name="Stop recording").count() == 0
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

        with feeding(lambda k: view.write(reading(100 + 0.02 * k), touched, truth=[TOUCH])):
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


Presses = list[tuple[Contact, ...]]


def settle(opened: OpenPage) -> tuple[float, float, float, float]:
    """Waits until the panels stand; the place of the picture."""
    opened.page.get_by_text("Press the skin").wait_for()
    opened.page.wait_for_timeout(1500)  # the panels slide in and the canvas shrinks
    opened.dismiss_notices()
    return opened.canvas()


@pytest.mark.browser
def test_the_skin_is_pressed_while_the_button_is_held() -> None:
    presses: Presses = []
    top = SHEET.vertices[:, 2].max()
    with View(PLANAR, on_press=presses.append) as view, open_page(view.url) as opened:
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
        mouse.click(*pixels(np.array([*SKIN.tops[1, 1], top]), canvas), button="right", delay=300)
        opened.wait_until(lambda: presses)
        go(SKIN.tops[4, 4])
        mouse.down()
        opened.wait_until(lambda: len(presses[-1]) == 2)
        assert {contact.position[0] > 0.06 for contact in presses[-1]} == {True, False}
        mouse.up()
        opened.wait_until(lambda: len(presses[-1]) == 1)
        mouse.click(*pixels(np.array([*SKIN.tops[4, 4], top]), canvas), button="right", delay=300)
        opened.wait_until(lambda: presses[-1] == ())

        # Beside the sheet a drag turns the picture and presses nothing.
        presses.clear()
        before = picture(opened)
        mouse.move(canvas[0] + 60, canvas[1] + 60)
        mouse.down()
        mouse.move(canvas[0] + 160, canvas[1] + 90, steps=5)
        mouse.up()
        opened.wait_until(lambda: np.abs(picture(opened) - before).mean() > 2)
        assert presses == []


@pytest.mark.browser
def test_every_control_does_what_it_says() -> None:
    done: list[object] = []
    with (
        View(
            PLANAR,
            on_press=lambda contacts: None,
            on_still=lambda still: done.append(("still", still)),
            on_zero=lambda: done.append("zero"),
            on_undo=lambda: done.append("undo"),
            on_record=lambda recording: done.append(("record", recording)),
        ) as view,
        open_page(view.url) as opened,
    ):
        settle(opened)

        def press(name: str) -> None:
            opened.page.get_by_role("button", name=name, exact=True).dispatch_event("click")

        with feeding(lambda k: view.write(reading(0.02 * k), NOTHING)):
            for name, what in (
                ("Zero", "zero"),
                ("Undo", "undo"),
                ("Stop recording", ("record", False)),
                ("Record", ("record", True)),
            ):
                press(name)
                opened.wait_until(lambda what=what: done and done[-1] == what)  # type: ignore[misc]
            opened.page.get_by_label("Hold the hand still").check()
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


@pytest.mark.slow
@pytest.mark.browser
def test_a_telephone_shows_the_skin_and_folds_the_panel() -> None:
    touched = Estimate(
        time=0.0,
        status=Status.CONTACT,
        contacts=(TOUCH,),
        covariance=np.diag([2e-3, 1e-3, 0.02, 0.03, 0.04])[None] ** 2,
    )
    with View(PLANAR, on_press=lambda contacts: None) as view, open_page(view.url) as opened:
        opened.page.set_viewport_size({"width": 390, "height": 844})
        opened.page.reload()
        with feeding(lambda k: view.write(reading(0.02 * k), touched, truth=[TOUCH])):
            now = opened.page.locator("#skin-now")
            opened.wait_until(lambda: now.text_content() == "x 45.0 mm  y 80.0 mm  F 0.51 N")
            folder = opened.page.get_by_text("Press the skin")
            opened.wait_until(lambda: not folder.is_visible())
            opened.wait_until(lambda: vermilion(picture(opened)) > 50)


@pytest.mark.slow
@pytest.mark.browser
def test_the_system_says_whether_the_page_is_dark() -> None:
    with View(PLANAR) as view, open_page(view.url) as opened:
        page = opened.page
        for scheme in ("light", "dark", "light"):  # the page opens anew in each
            page.emulate_media(color_scheme=scheme)
            page.locator(f'html[data-mantine-color-scheme="{scheme}"]').wait_for(state="attached")
            assert "token=" in page.url


def test_a_cell_is_outlined_where_the_estimate_is_one() -> None:
    with View(PLANAR) as view:
        cells = view._scene._cells
        shown = []
        for place in (SKIN.tops[3, 3], SKIN.tops[3, 3] + 1e-5):
            cells.show([Contact(position=place, force=(0.0, 0.0, -0.5))], lambda _: 5e-3)
            shown.append([outline.visible for outline in cells._outlines])
        assert shown == [[True, False], [False, False]]


@pytest.mark.browser
def test_an_estimator_is_chosen_from_the_list() -> None:
    chosen: list[str] = []
    names = ["Bayes", "closed form"]
    with (
        View(PLANAR, estimators=names, on_choose=chosen.append) as view,
        open_page(view.url) as opened,
    ):
        box = opened.page.locator('input[role="combobox"][value="Bayes"]')
        box.click()
        opened.page.get_by_role("option", name="closed form").click()
        opened.wait_until(lambda: chosen)
    assert chosen == ["closed form"]


@pytest.mark.browser
def test_what_a_callback_raises_reaches_the_caller() -> None:
    def zero() -> None:
        raise RuntimeError("no zero to be had")

    before = set(threading.enumerate())
    with View(PLANAR, on_zero=zero) as view, open_page(view.url) as opened:
        opened.page.get_by_role("button", name="Zero").click()

        def failed() -> bool:
            try:
                view.write(reading(), NOTHING)
            except RuntimeError as error:
                return str(error) == "no zero to be had"
            return False

        opened.wait_until(failed)
    assert_gone(before)


@pytest.mark.browser
def test_closing_lets_go_of_a_press_and_of_the_browser() -> None:
    presses: Presses = []
    before = set(threading.enumerate())
    view = View(PLANAR, on_press=presses.append)
    with open_page(view.url) as opened:
        inside = set(threading.enumerate())
        canvas = settle(opened)
        opened.page.mouse.move(*pixels(np.array([*SKIN.tops[2, 2], 8e-3]), canvas))
        opened.page.mouse.down()
        opened.wait_until(lambda: presses)
        view.close()
        assert presses[-1] == ()
        assert len(presses) == 2
        assert_gone(inside)
    assert_gone(before)
