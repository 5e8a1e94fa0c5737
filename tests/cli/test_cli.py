"""The command line as a person or a script meets it: a process of its own."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest


def smoskin(*arguments: str, timeout: float = 120.0) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from smoskin.cli import main; main()", *arguments],
        capture_output=True,
        text=True,
        timeout=timeout,
        env=os.environ | {"COLUMNS": "120"},
    )


def refused(*arguments: str, code: int = 1) -> str:
    """Standard error of a command that must fail in one line, without a traceback."""
    done = smoskin(*arguments)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    return done.stderr


def test_help_names_every_command():
    done = smoskin("--help")
    assert done.returncode == 0
    for command in ("demo", "info", "run", "score"):
        assert command in done.stdout


def test_version():
    assert smoskin("--version").stdout == "smoskin 0.1.0\n"


def test_info_shows_values_provenance_and_what_follows():
    people = smoskin("info", "planar").stdout
    assert "panel_a_mm" in people
    assert "inferred" in people
    rows = json.loads(smoskin("info", "--json").stdout)
    derived = {row["name"]: row["value"] for row in rows["derived"]}
    assert derived["columns"] == 91
    assert derived["column_stiffness_N_per_mm"] == pytest.approx(0.07401, abs=1e-5)


def test_record_then_replay_gives_the_same_estimates(tmp_path):
    file = tmp_path / "idle.mcap"
    source = "twin://planar?speed=max"
    live = smoskin("run", source, "--seconds", "1", "--record", str(file), "--json")
    assert live.returncode == 0, live.stderr
    replayed = smoskin("run", f"replay:{file}?speed=max", "--json")
    assert replayed.stdout == live.stdout
    lines = [json.loads(line) for line in live.stdout.splitlines()]
    statuses = [line["status"] for line in lines]
    assert statuses == 20 * ["NOT_CALIBRATED"] + (len(lines) - 20) * ["NO_CONTACT"]
    assert "idle.mcap" in refused("run", "twin://planar", "--record", str(file))


@pytest.mark.slow
def test_a_bench_calibrates_a_skin_and_the_skin_runs_with_it(tmp_path):
    table, file = tmp_path / "touches.csv", tmp_path / "skin.toml"
    made = smoskin("virtual-bench", str(table), "--seed", "2", "--sheet", "reduced")
    assert made.returncode == 0
    done = smoskin("fit-paper", str(table), "--out", str(file), "--date", "2026-01-31", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["date"] == "2026-01-31"
    names = {number["name"] for number in answer["numbers"]}
    assert {"attenuation_x", "stiffness_variation", "board_stiffness_N_per_mm"} <= names
    source = "twin://planar?speed=max"
    ran = smoskin("run", source, "--calibration", str(file), "--seconds", "0.2", "--json")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout
    again = refused("fit-paper", str(table), "--out", str(file))
    assert "skin.toml exists; choose another name or --force" in again
    text = file.read_text().replace("stiffness_variation", "stifness_variation", 1)
    file.write_text(text)
    assert "skin.toml: the calibration is damaged" in refused(
        "run", source, "--calibration", str(file)
    )
    file.write_text(text[: text.rindex("#")])  # as a person does who changes a file
    message = refused("run", source, "--calibration", str(file))
    assert "stifness_variation" in message
    table.write_text(table.read_text().splitlines()[0] + "\n")
    assert "touches.csv" in refused("fit-paper", str(table), "--out", str(file), "--force")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            ("info", "plannar"),
            "must be the name of a shipped design (curved, optimised, planar)",
        ),
        (("run", "usb://planar"), "error: url must be replay:FILE"),
        (("run", "replay:nowhere.mcap"), "nowhere.mcap"),
        (("demo", "--headless", "--seconds", "0.1"), "error: seconds must be at least 1"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(arguments, reason):
    message = refused(*arguments)
    assert reason in message
    assert message.count("\n") == 1


def test_unknown_options_are_wrong_use():
    done = smoskin("demo", "--loud")
    assert done.returncode == 2
    assert "--loud" in done.stderr


def test_a_design_of_ones_own_is_read_by_path(tmp_path, planar):
    from dataclasses import replace

    from smoskin.design.document import format_design

    own = replace(planar, name="own", columns=replace(planar.columns, radius=1.4e-3))
    path = tmp_path / "own.toml"
    path.write_text(format_design(own))
    assert json.loads(smoskin("info", str(path), "--json").stdout)["name"] == "own"
    path.write_text(path.read_text().replace("panel_a_mm", "panel_a_cm"))
    assert "own.toml: cell: unknown key 'panel_a_cm'" in refused("info", str(path))


def test_the_core_needs_numpy_and_scipy_alone(tmp_path):
    """Every other third-party package is made to fail on import."""
    blocker = tmp_path / "sitecustomize.py"
    blocker.write_text(
        "import sys\n"
        "class Block:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'typer', 'rich', 'viser', 'mcap', 'rosbags', 'jax',\n"
        "                                  'optax', 'safetensors', 'matplotlib', 'tomli_w'}:\n"
        "            raise ImportError(name)\n"
        "sys.meta_path.insert(0, Block())\n"
    )
    program = (
        "import smoskin as smo\n"
        "from smoskin import cli\n"
        "design = smo.load_design('planar')\n"
        "touch = smo.Contact(position=(0.05, 0.067), force=(0, 0, -0.5))\n"
        "estimate = smo.ClosedFormEstimator(design).step(smo.ReducedTwin(design).read([touch]))\n"
        "print(estimate.status.name)\n"
        "for call in (lambda: smo.Recorder('x.mcap', design), lambda: cli._run(0.0)):\n"
        "    try:\n"
        "        call()\n"
        "    except (smo.SmoskinError, SystemExit) as error:\n"
        "        print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "CONTACT"
    assert re.search(r"pip install .*\[recording\]'$", lines[1])
    assert re.search(r"pip install .*\[cli\]'$", lines[2])
    assert not (tmp_path / "x.mcap").exists()


def test_the_package_is_marked_as_typed():
    import smoskin

    assert (Path(smoskin.__file__).parent / "py.typed").is_file()
