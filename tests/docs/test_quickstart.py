"""The quick start as a new user types it, command after command, in an empty folder."""

import os
import re
import subprocess
import sys
import threading
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from chromium import CHROMIUM, open_page
from smoskin.feasibility import load_design
from smoskin.service.recording import open_recording
from smoskin.twin.hand import HOLD, PERIOD, RAMP, scripted_hand

TEXT = (Path(__file__).parents[2] / "docs" / "quickstart.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(sh|python)\n(.*?)```", TEXT, re.S)
COMMANDS = [text.strip() for kind, text in BLOCKS if kind == "sh"]
INSTALL = "python3 -m venv .venv && . .venv/bin/activate && pip install -q -e '.[demo]' && "


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """An empty folder."""
    return tmp_path_factory.mktemp("home")


def typed(text, home, kind="sh", **options):
    """A process of what is typed, with the commands of this Python at hand."""
    folder = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}
    command = ["bash", "-ec", text] if kind == "sh" else [sys.executable, "-c", text]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=home, env=environment, **pipes, **options)


def printed(text, home, kind="sh"):
    """What it prints, when it has ended well."""
    with typed(text, home, kind) as process:
        out, err = process.communicate(timeout=200)
    assert process.returncode == 0, f"{text}\n{err}"
    return out


def test_it_is_one_command_and_three_more():
    assert len(COMMANDS) == 4
    assert COMMANDS[0] == f"{INSTALL}smoskin demo"
    assert [command.split()[:2] for command in COMMANDS[1:]] == [
        ["smoskin", "calibrate"],
        ["smoskin", "run"],
        ["smoskin", "run"],
    ]
    assert all("\n" not in command for command in COMMANDS)


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on the path")
def test_the_first_command_is_live_in_the_browser_to_parts_of_a_millimetre(home):
    """For twenty seconds of the hand instead of until Ctrl-C."""
    with typed(f"{COMMANDS[0].removeprefix(INSTALL)} --seconds 20", home) as process:
        lines = []
        for line in process.stderr:
            lines.append(line)
            if address := re.search(r"http://\S+", line):
                break
        rest = threading.Thread(target=lambda: lines.extend(process.stderr))
        rest.start()
        with open_page(address[0]) as opened:
            opened.wait_until(lambda: opened.text("status") == "Touched", deadline=60.0)
            over = opened.page.locator("#skin-end")
            opened.wait_until(over.is_visible, deadline=90.0)
            last = over.inner_text().strip()
        out = process.stdout.read()
        rest.join()
    assert process.returncode == 0, out
    touches, off = re.fullmatch(
        r"The demonstration is over: (\d+) touches, (\d\.\d) mm\.", last
    ).groups()
    assert int(touches) > 10
    least, most = re.search(r"each to (0\.\d) to (0\.\d) mm", " ".join(TEXT.split())).groups()
    assert float(least) <= float(off) <= float(most)
    assert float(re.search(r"mean_position_error_mm: (.*)", out)[1]) == pytest.approx(
        float(off), abs=0.051
    )


@pytest.mark.slow
@pytest.mark.timeout(280)
def test_every_other_block_runs(home):
    outputs = [
        printed(text.strip(), home, kind) for kind, text in BLOCKS if text.strip() != COMMANDS[0]
    ]
    calibrated, run, replayed, pressed, live, read = outputs
    assert "15 │" in calibrated
    assert (home / "skin.table").is_file()
    assert replayed == run  # with the calibration: every place, to the last digit
    for located in (pressed, live):
        assert located.startswith("CONTACT")
        x, y = (float(value) for value in re.findall(r"\[\s*([\d.]+)\s+([\d.]+)\s*\]", located)[0])
        assert abs(x - 0.045) < 1e-3
        assert abs(y - 0.080) < 1e-3
    assert int(read.split()[0]) == run.count("\n")

    # What the hand did, beside what was recorded in the middle of each touch.
    recording = open_recording(home / "session.mcap")
    hand = scripted_hand(load_design("planar"), 60.0, 3)
    places = defaultdict(list)
    for estimate in recording.estimates():
        number, since = divmod(estimate.time - 0.25, PERIOD)
        if number >= 0 and RAMP + 0.1 < since < RAMP + HOLD - 0.05:
            (contact,) = estimate.contacts
            places[int(number)].append(contact.position)
    errors = [
        np.linalg.norm(np.mean(positions, axis=0) - hand[number].position)
        for number, positions in places.items()
    ]
    assert len(errors) >= 10
    assert np.mean(errors) <= 0.5e-3
    assert "met to 0.5 mm on average" in " ".join(TEXT.split())
