"""`smoskin table`: the table that it makes, and what it says of it."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.commands.table import Effort, make_table
from smoskin.errors import ArgumentError
from smoskin.sensing.response.table import load_response_table
from tables_of_response import reduced_table


def run(*arguments):
    return CliRunner().invoke(app, [str(one) for one in arguments])


def test_a_table_is_made_with_the_effort_asked_for(planar, tmp_path, monkeypatch):
    asked = []

    def made(design, effort, progress):
        asked.append(effort)
        progress("pressing", 0.5)
        return reduced_table(design)

    monkeypatch.setattr("smoskin.commands.table.make_table", made)
    monkeypatch.chdir(tmp_path)
    result = run(
        "table", "planar", "--presses", "50", "--pairs", "0", "--skins", "3", "--seed", "2"
    )
    assert result.exit_code == 0, result.output
    assert asked == [replace(Effort(), presses=50, pairs=0, skins=3, seed=2)]
    assert "normal forces" in result.stdout
    assert load_response_table("planar.table").design_hash == planar.content_hash
    machines = run("table", "planar", "--out", tmp_path / "c.table", "--json")
    answer = json.loads(machines.stdout)
    assert answer["chips"] == [0, 1, 2]
    assert answer["file"] == str(tmp_path / "c.table")
    assert answer["modes"] == 0
    assert asked[-1] == Effort()
    assert (tmp_path / "c.table").exists()


def test_impossible_efforts_are_refused():
    for wrong in ({"presses": 0}, {"pairs": -1}, {"skins": 0}, {"draws": 0}, {"presses_a_skin": 0}):
        with pytest.raises(ArgumentError, match="counts must be positive"):
            Effort(**wrong)
    for wrong in ({"force": (0.0, 1.0)}, {"force": (0.5, 0.5)}, {"drag": -0.1}):
        with pytest.raises(ArgumentError, match="force must rise from above 0"):
            Effort(**wrong)
    assert Effort(pairs=0, drag=0.0).pairs == 0


@pytest.mark.slow
def test_a_table_is_made_from_presses_of_the_twin(planar):
    pytest.importorskip("jax")
    small = Effort(presses=3700, pairs=200, skins=3, draws=2, presses_a_skin=120)
    shares = []
    table = make_table(planar, small, progress=lambda task, share: shares.append(share))
    assert shares == sorted(shares)
    assert np.sqrt(np.diag(table.misfit)).max() < 100e-6
    assert len(table.modes) >= 3
    assert table.origin["effort"] == asdict(small)
