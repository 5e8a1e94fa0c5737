"""The read-me's program does what the read-me says of it."""

import re
from pathlib import Path

import numpy as np
import pytest

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def test_eight_lines_go_from_a_fresh_skin_to_a_touch(capsys):
    pytest.importorskip("jax")
    pytest.importorskip("safetensors")
    (program,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len([line for line in program.splitlines() if line]) == 8
    names = {}
    exec(compile(program, "README.md", "exec"), names)
    printed = capsys.readouterr().out
    numbers = [float(text) for text in re.findall(r"-?\d+\.\d*(?:e-?\d+)?|-?\d+\.", printed)]
    assert len(numbers) == 5
    x, y = (float(text) for text in re.search(r"\((0\.\d+), (0\.\d+)\) m with", README).groups())
    assert numbers[:2] == pytest.approx((x, y), abs=1e-4)
    assert np.hypot(numbers[0] - 0.045, numbers[1] - 0.080) < 0.5e-3
    assert numbers[2:] == pytest.approx((0.1, 0.0, -0.5), abs=0.01)


def test_every_command_is_named():
    pytest.importorskip("typer")
    from typer.main import get_command

    from smoskin.cli import app

    for name in get_command(app).commands:
        assert f"`smoskin {name}" in README
