"""The operator's page of an arm: its door, and its controls pressed in a browser."""

import logging
import queue
import threading
import time
from collections import deque
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from http.client import HTTPConnection
from urllib.parse import urlsplit

import numpy as np
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("viser")

from chromium import open_page
from pages import FAINT, feeding, pixels, reading
from smoskin.commands.follow.live import WARNING, follow_source
from smoskin.commands.follow.page import ArmPage
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Status
from smoskin.robot.driver import Driver
from smoskin.robot.follow import Follow, State
from smoskin.robot.holding import DEADLINE, Holding
from smoskin.robot.law import Limits
from smoskin.robot.reasons import Reason
from smoskin.robot.simulated import SimulatedArm

CURVED = read_design("curved")
PATIENT = Limits(patience=5.0, cycle=5.0, distance=1.0, duration=100.0)
"""A machine that is busy with other tests is no fault here."""

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (9.0, 0.0, 0.0),
    "fov": 1.0, "near": 0.1, "far": 99.0, "image_height": 90, "image_width": 140,
    "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip


@pytest.fixture(autouse=True)
def busy(monkeypatch):
    """No clock has jumped, and no arm gone astray, where other programs kept this one waiting."""
    monkeypatch.setattr("smoskin.robot.follow._JUMP", 5.0)
    monkeypatch.setattr("smoskin.robot.follow._UNLIKE", 5.0)


@contextmanager
def operated(touch=None, on_command=lambda command: None):
    """An arm that a page's button lets move, and the page."""
    arm, holding, words = SimulatedArm(CURVED, time.monotonic), Holding(), queue.Queue()
    follow = Follow(arm.chain, CURVED, PATIENT)
    with Driver(arm, follow, held=holding, on_command=on_command) as driver:
        driver.look()
        driver.start()
        page = ArmPage(CURVED, arm, driver, follow, words, holding, WARNING, 0, touch)
        with page:
            yield page, driver, follow, words


def felt(force):
    """What the skin's middle feels now."""
    touch = Contact(position=np.array(geometry(CURVED).extent) / 2, force=(0.0, 0.0, -force))
    if not force:
        return Estimate(time=time.monotonic(), status=Status.NO_CONTACT)
    known = np.diag([1e-3, 1e-3, 0.01, 0.01, 0.01])[None] ** 2
    status = Status.CONTACT
    return Estimate(time=time.monotonic(), status=status, contacts=(touch,), covariance=known)


def test_the_page_is_for_who_has_its_address_and_its_threshold_has_ends():
    with operated() as (page, driver, follow, _):
        port = urlsplit(page.url).port
        for path, host in (("/", f"127.0.0.1:{port}"), (page.url[page.url.index("/?") :], "x.org")):
            connection = HTTPConnection("127.0.0.1", port, timeout=10.0)
            connection.request("GET", path, headers={"Host": host})
            assert connection.getresponse().status == 403
            connection.close()
        driver.set_threshold(0.8)
        assert (follow.limits.begin, follow.limits.end) == (0.8, pytest.approx(0.7))
        for begin in (0.2, 1.1, np.nan):
            with pytest.raises(ArgumentError, match=r"threshold must be from 0.3 to 1 N"):
                driver.set_threshold(begin)
        follow.state = State.STANDING
        with pytest.raises(ArgumentError, match="disarmed before its threshold changes"):
            driver.set_threshold(0.5)


def test_malformed_messages_move_nothing(caplog):
    """By who has the address: junk ends the connection, wrong values change nothing."""
    sockets = pytest.importorskip("websockets.sync.client")
    import msgspec
    import viser
    from websockets.exceptions import ConnectionClosed

    caplog.set_level(logging.WARNING)
    with operated() as (page, _, follow, words):
        parts = urlsplit(page.url)
        uuid = page._threshold._impl.uuid

        def connected():
            return sockets.connect(
                f"ws://{parts.netloc}/?{parts.query}",
                origin=f"http://{parts.netloc}",
                subprotocols=[f"viser-v{viser.__version__}"],
            )

        def update(value, name=uuid):
            message = {"type": "GuiUpdateMessage", "uuid": name, "updates": {"value": value}}
            return msgspec.msgpack.encode(message)

        wrong = [b"\xff\x00junk", "text", update("half")[:-3], bytes(256 * 1024 + 1)]
        for message in wrong:
            with connected() as connection:
                connection.send(message)
                with pytest.raises(ConnectionClosed, match=r"1003|1009"):
                    deque(iter(connection), maxlen=0)
        with connected() as connection:
            hold = {"type": "GuiButtonHoldMessage", "uuid": uuid, "frequency": np.inf}
            connection.send(msgspec.msgpack.encode(CAMERA))  # as every browser does first
            values = ("junk", None, [], float("nan"), -1.0, 1e300)
            for message in (*map(update, values), update(0.9, "x"), msgspec.msgpack.encode(hold)):
                connection.send(message)
            end = time.monotonic() + 10.0
            while not page._answer.endswith("got 1e+300") and time.monotonic() < end:
                time.sleep(0.01)
            assert page._answer == "Not done: threshold must be from 0.3 to 1 N; got 1e+300"
            connection.send(update(0.7))
            while follow.limits.begin != 0.7 and time.monotonic() < end:
                time.sleep(0.01)
        assert (follow.limits.begin, follow.state) == (0.7, State.DISARMED)
        assert words.empty()
        assert not page._switch()
    assert caplog.records
    assert all(record.exc_info is None for record in caplog.records)


def told_late(looks, sign):
    """Seconds from the end of the switch's patience to the arm's being told to stand.

    Where other programs kept the driver from looking in time, that does not count.
    """
    times = np.array([at for at, _ in looks])
    commanded = next(at for at, reason in looks if at > sign and reason is Reason.SWITCH)
    kept = np.diff(times[(times > sign - 0.1) & (times <= commanded)]).max() - 1 / 125
    return commanded - sign - DEADLINE - max(kept, 0.0)


@pytest.mark.slow
@pytest.mark.browser
def test_an_operator_arms_holds_stops_and_resets():
    forces, looks, signs = [0.0], [], []

    def note(command):
        looks.append((time.monotonic(), command.reason))

    with (
        operated(on_command=note) as (page, driver, follow, words),
        open_page(page.url) as opened,
    ):
        sign = page._switch.sign
        page._switch.sign = lambda: signs.append(time.monotonic()) or sign()

        def feed(k):
            driver.write(reading(0.02 * k, 1e-6 * (k % 2)), felt(forces[0]))

        def press(name):
            opened.click(opened.page.get_by_role("button", name=name, exact=True))

        def becomes(state):
            opened.wait_until(lambda: follow.state is state)
            opened.wait_until(lambda: opened.text("status") == state.value.capitalize())

        def hold():
            box = opened.page.get_by_role("button", name="Hold to run").bounding_box()
            opened.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            opened.page.mouse.down()

        def out_of_sight():
            """What a browser does when another tab is chosen; the button stays pressed."""
            opened.page.evaluate(
                """() => {
                    Object.defineProperty(document, "hidden", { get: () => true });
                    document.dispatchEvent(new Event("visibilitychange"));
                }"""
            )

        def freeze(state):
            session = opened.page.context.new_cdp_session(opened.page)
            session.send("Page.setWebLifecycleState", {"state": state})

        with feeding(feed):
            becomes(State.DISARMED)
            assert "true touch" not in opened.page.locator("#skin-title").text_content()
            assert opened.text("warning") == WARNING
            assert opened.page.evaluate(FAINT) == {}
            opened.wait_until(lambda: follow._now - follow._resting > 1.0)
            # Not while touched, and touched it only shows where and how hard.
            forces[0] = 0.6
            opened.wait_until(lambda: opened.text("touch") == "F 0.60 N")
            press("Arm")
            opened.wait_until(lambda: opened.text("answer").startswith("Not done: arm must rest"))
            forces[0] = 0.0
            opened.page.wait_for_timeout(1500)
            press("Arm")
            becomes(State.STANDING)
            press("Zero")  # disabled while armed
            forces[0] = 0.6
            opened.wait_until(lambda: opened.text("sentence") == Reason.SWITCH.value)
            before = driver.newest[0].angles
            hold()
            becomes(State.MOVING)
            assert "● Moving: yes" in opened.text("lamps")
            opened.page.mouse.up()
            becomes(State.STANDING)
            assert np.abs(driver.newest[0].angles - before).max() > 1e-3
            # A page that goes out of sight lets go, and so does one whose timers stand still.
            for hide, show in (
                (out_of_sight, lambda: None),
                (partial(freeze, "frozen"), partial(freeze, "active")),
            ):
                hold()
                becomes(State.MOVING)
                hide()
                end = time.monotonic() + 5.0
                while follow.state is not State.STANDING and time.monotonic() < end:
                    time.sleep(0.01)
                assert follow.state is State.STANDING, follow.fault
                assert not page._switch()
                show()
                opened.page.mouse.up()
            press("Stop")
            becomes(State.DISARMED)
            assert words.empty()
            press("Zero")
            opened.wait_until(lambda: not words.empty())
            driver._follow.fail(Reason.STALE)
            becomes(State.FAULT)
            assert opened.text("sentence") == Reason.STALE.value
            forces[0] = 0.0
            opened.page.wait_for_timeout(1500)
            press("Reset")
            becomes(State.DISARMED)
            # A page that closes while its button is held lets go of it.
            press("Arm")
            becomes(State.STANDING)
            forces[0] = 0.6
            hold()
            becomes(State.MOVING)
            opened.page.goto("about:blank")
            end = time.monotonic() + 5.0
            while follow.state is not State.STANDING and time.monotonic() < end:
                time.sleep(0.01)
            assert follow.state is State.STANDING
            assert told_late(looks, signs[-1]) <= 0.02
        assert not opened.outside
        assert not opened.errors


@pytest.mark.slow
@pytest.mark.browser
def test_a_mouse_presses_a_virtual_skin_and_the_arm_yields():
    """Up to its threshold the arm stands; nothing is left of a press once the button is up."""
    sentences, words = queue.Queue(), queue.Queue()
    states = []

    def say(sentence):
        sentences.put(sentence)
        states.append(sentence.partition(":")[0])

    url = "twin://curved?rate=100"
    # Uncalibrated, the closed form reads less than half of the force round a limb.
    limits = replace(PATIENT, begin=0.3, end=0.2)
    run = partial(follow_source, url, limits=limits, port=0, words=words, say=say)
    follower = threading.Thread(target=run, daemon=True)
    follower.start()
    try:
        while not (sentence := sentences.get(timeout=60.0)).startswith("The arm is live at "):
            pass
        with open_page(sentence.removeprefix("The arm is live at ")) as opened:
            button = opened.page.get_by_role("button", name="Arm", exact=True)
            opened.wait_until(lambda: opened.text("status") == "Disarmed")
            for _ in range(20):  # until there is a zero, and the arm has rested
                opened.click(button)
                opened.page.wait_for_timeout(500)
                if opened.text("status") == "Standing":
                    break
            where = middle_of_skin(opened.canvas())
            push = opened.page.locator("input.mantine-NumberInput-input").last
            for newton, state in (("0.3", "Standing"), ("0.8", "Moving")):
                push.fill(newton)
                push.press("Enter")
                opened.page.mouse.move(*where)
                opened.page.mouse.down()
                opened.wait_until(lambda: opened.text("touch").startswith("F 0."))
                opened.wait_until(lambda state=state: opened.text("status") == state)
                assert ("moving" in states) == (state == "Moving")
                opened.page.mouse.up()
                opened.wait_until(lambda: opened.text("touch") == "–")
            opened.wait_until(lambda: opened.text("status") == "Standing")
            assert not opened.errors
    finally:
        words.put("quit")
        follower.join(30.0)
    assert not follower.is_alive()


def middle_of_skin(canvas):
    """Where a page first shows the middle of an arm's skin, pixels."""
    with SimulatedArm(CURVED, lambda: 0.0) as arm:
        posture = arm.chain.posture(arm.state().angles)
        low, high = arm.chain.corners.min(axis=0), arm.chain.corners.max(axis=0)
    aim = (low + high) / 2 * (0.5, 1.0, 1.0)
    eye = aim + np.array((0.35, -1.0, 0.35)) * 1.15 * (high - low).max()
    skin = geometry(CURVED)
    middle = posture.on_skin(skin.sheet.vertices.mean(axis=0))
    return pixels(middle, canvas, (eye, aim, np.radians(75.0)))
