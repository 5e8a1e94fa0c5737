"""`smoskin train`: the files that it leaves, and what it refuses."""

import json
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from networks import TINY
from smoskin.cli import app
from smoskin.cli import train as commands
from smoskin.commands.train import effort_of, parse_chips, train_on_table
from smoskin.design.document import format_design
from smoskin.errors import ArgumentError, ModelError
from smoskin.sensing.network.model import load_network
from tables_of_response import plain, reduced_table

SHORT = replace(TINY, epochs=2, steps=4)


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def run(*arguments):
    assert commands.app is app
    return CliRunner().invoke(app, [str(one) for one in arguments])


def test_a_training_leaves_a_model_its_curve_and_no_checkpoint(skin, tmp_path):
    out = tmp_path / "planar.safetensors"
    done = train_on_table(
        skin, reduced_table(skin), out, chips=(1, 2), effort=SHORT, onnx=tmp_path / "planar.onnx"
    )
    names = {file.name for file in tmp_path.iterdir()}
    assert names == {"planar.safetensors", "planar.safetensors.curve.jsonl", "planar.onnx"}
    assert {file.name for file in done.files} == names
    assert load_network(out).chips == (1, 2)
    said = json.loads(json.dumps(done.as_json()))
    assert said["epochs"] == 2
    assert said["ended"] == "all 2 epochs are done"
    assert said["metrics"][0]["unit"] == "m"
    assert done.table().row_count == 3
    further = train_on_table(
        skin, reduced_table(skin), tmp_path / "own.safetensors", chips=(1, 2), effort=SHORT,
        start=out,
    )  # fmt: skip
    assert further.curve[-1].held_out < done.curve[-1].held_out


def test_a_stopped_training_is_neither_lost_nor_taken_for_another(skin, tmp_path):
    class Killed(Exception):
        pass

    def progress(what, share):
        if share > 0:
            raise Killed

    out = tmp_path / "planar.safetensors"
    with pytest.raises(ArgumentError, match="got no"):
        train_on_table(skin, reduced_table(skin), out, effort=SHORT, resume=True)
    with pytest.raises(Killed):
        train_on_table(skin, reduced_table(skin), out, effort=SHORT, progress=progress)
    assert (tmp_path / "planar.safetensors.checkpoint").exists()
    assert not out.exists()
    with pytest.raises(ArgumentError, match="resume must be asked for"):
        train_on_table(skin, reduced_table(skin), out, effort=SHORT)
    other = replace(SHORT, seed=5)
    with pytest.raises(ModelError, match="must be of this training"):
        train_on_table(skin, reduced_table(skin), out, effort=other, resume=True)
    done = train_on_table(skin, reduced_table(skin), out, effort=SHORT, resume=True)
    assert done.curve[-1].epoch == 2
    assert not (tmp_path / "planar.safetensors.checkpoint").exists()


def test_the_command_trains_and_says_what_it_reached(skin, tmp_path, monkeypatch):
    design, table = tmp_path / "plain.toml", tmp_path / "plain.table"
    design.write_text(format_design(skin), encoding="utf-8")
    reduced_table(skin).save(table)
    monkeypatch.setattr(
        "smoskin.commands.train.NetworkEffort", lambda seed: replace(SHORT, seed=seed)
    )
    out = tmp_path / "net.safetensors"
    result = run("train", table, "--out", out, "--design", design, "--chips", "1,2",
                 "--drag", "0.3", "--members", "3", "--minutes", "5", "--json")  # fmt: skip
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["chips"] == [1, 2]
    assert said["drag_N"] == 0.3
    model = load_network(out)
    assert model.members == 3
    assert model.data_sha256 == said["data_sha256"]
    shown = run("train", table, "--out", tmp_path / "b", "--design", design, "--seed", "3")
    assert shown.exit_code == 0, shown.output
    assert "mean distance of the place" in shown.stdout
    assert "Training ended: all 2 epochs are done." in shown.stdout


def test_what_cannot_be_is_refused():
    assert parse_chips("0,2") == (0, 2)
    with pytest.raises(ArgumentError, match="chips must be numbers"):
        parse_chips("one")
    effort = effort_of(members=3, minutes=2.0, seed=4)
    assert (effort.members, effort.seconds, effort.seed) == (3, 120.0, 4)
