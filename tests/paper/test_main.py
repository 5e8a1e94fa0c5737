"""The paper's report as a person runs it: a process of its own."""

import json
import subprocess
import sys

import pytest


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_report_writes_its_files_and_says_how_many_rows_hold(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "paper", "--out", str(tmp_path / "report")],
        capture_output=True,
        text=True,
        timeout=840.0,
    )
    assert done.returncode == 0, done.stderr
    assert "reproduced" in done.stdout
    rows = json.loads((tmp_path / "report" / "report.json").read_text())["rows"]
    assert {row["verdict"] for row in rows} == {"reproduced", "corrected", "unresolved"}
