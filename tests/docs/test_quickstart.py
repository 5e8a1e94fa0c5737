"""The quick start as a new user types it, block after block, in an empty folder."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "quickstart.md"
BLOCKS = re.findall(r"```(sh|python)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)


@pytest.mark.timeout(280)
def test_every_block_runs_from_an_empty_folder(tmp_path):
    folder = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}
    printed = []
    for kind, text in BLOCKS:
        if "pip install" in text:
            continue
        command = ["bash", "-ec", text] if kind == "sh" else [sys.executable, "-c", text]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, f"{text}\n{done.stderr}"
        printed.append(done.stdout)
    calibrated, run, replayed, pressed, live, read = printed
    assert "15 │" in calibrated
    assert (tmp_path / "skin.table").is_file()
    assert run.count("NO_CONTACT") > 200
    assert replayed == run
    for located in (pressed, live):
        assert located.startswith("CONTACT")
        x, y = (float(value) for value in re.findall(r"\[\s*([\d.]+)\s+([\d.]+)\s*\]", located)[0])
        assert abs(x - 0.045) < 1e-3
        assert abs(y - 0.080) < 1e-3
    assert int(read.split()[0]) == run.count("\n")
