"""`smoskin train`: the files that it leaves, and what it refuses."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from networks import TINY
from smoskin.cli import app
from smoskin.cli import train as commands
from smoskin.commands.train import checkpoint_of, figure_rows, parse_chips, train, write_network
from smoskin.design.document import format_design
from smoskin.errors import ArgumentError, DesignError, ModelError
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.sensing.network.model import load_network
from smoskin.sensing.network.samples import TrainingEffort
from tables_of_response import plain, reduced_table

SHORT = replace(TINY, epochs=2, steps=4)


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def run(*arguments):
    assert commands.app is app
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_a_training_gives_a_network_that_can_be_saved_and_gone_on_from(skin, tmp_path):
    pressed, out = tmp_path / "plain.table", tmp_path / "net.safetensors"
    reduced_table(skin).save(pressed)
    first = train(pressed, design=skin, chips=(1, 2), effort=SHORT, seed=4)
    assert (first.ended, len(first.curve)) == ("all 2 epochs are done", 2)
    answer = json.loads(json.dumps(first.as_json()))
    assert (answer["epochs"], answer["chips"], answer["drag_N"]) == (2, [1, 2], 0.0)
    assert answer["held_out_nats"] == min(point.held_out for point in first.curve)
    assert answer["metrics"][0]["unit"] == "m"
    assert figure_rows(first).row_count == 4
    assert write_network(first, out, tmp_path / "net.onnx") == [out, tmp_path / "net.onnx"]
    again = load_network(out)
    assert again.chips == (1, 2)
    assert again.data_sha256 == first.model.data_sha256
    further = train(reduced_table(skin), design=skin, chips=(1, 2), effort=SHORT, start=out)
    assert further.curve[-1].held_out < first.curve[-1].held_out


def test_minutes_members_and_seed_take_the_place_of_an_efforts(planar, skin, monkeypatch):
    asked = {}

    def stand_in(design, table, **given):
        asked.update(given, design=design)
        return SimpleNamespace(model=None, curve=(), ended="")

    monkeypatch.setattr("smoskin.sensing.network.training.train_network", stand_in)
    train(reduced_table(skin), design=skin, minutes=2.0, seed=4, members=3, effort=SHORT, drag=0.2)
    assert asked["effort"] == replace(SHORT, seconds=120.0, seed=4, members=3)
    assert asked["spread"].drag == 0.2
    assert 0 <= asked["clock"]() < 60
    rubber = elastomer_prony(skin.columns.material)
    assert np.array_equal(asked["creep"].moduli, rubber.moduli)
    train(reduced_table(planar))
    assert asked["effort"] == TrainingEffort()
    assert asked["design"] == planar
    with pytest.raises(DesignError, match="design must be given"):
        train(reduced_table(skin))


def test_a_stopped_training_is_neither_lost_nor_taken_for_another(skin, tmp_path):
    class Killed(Exception):
        pass

    def progress(what, share):
        if share > 0:
            raise Killed

    out = tmp_path / "planar.safetensors"
    with pytest.raises(ArgumentError, match="got no"):
        checkpoint_of(out, resume=True)
    asked = {"design": skin, "effort": SHORT, "checkpoint": checkpoint_of(out, resume=False)}
    with pytest.raises(Killed):
        train(reduced_table(skin), **asked, progress=progress)
    assert checkpoint_of(out, resume=True).name == "planar.safetensors.checkpoint"
    with pytest.raises(ArgumentError, match="resume must be asked for"):
        checkpoint_of(out, resume=False)
    with pytest.raises(ModelError, match="must be of this training"):
        train(reduced_table(skin), **asked, seed=5)
    resumed = train(reduced_table(skin), **asked)
    assert resumed.curve[-1].epoch == 2


def test_the_command_trains_and_says_what_it_reached(skin, tmp_path, monkeypatch):
    design, table = tmp_path / "plain.toml", tmp_path / "plain.table"
    design.write_text(format_design(skin), encoding="utf-8")
    reduced_table(skin).save(table)
    monkeypatch.setattr("smoskin.commands.train.TrainingEffort", lambda: SHORT)
    out = tmp_path / "net.safetensors"
    result = run("train", table, "--out", out, "--design", design, "--chips", "1,2",
                 "--drag", "0.3", "--members", "3", "--minutes", "5", "--json")  # fmt: skip
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["chips"] == [1, 2]
    assert answer["drag_N"] == 0.3
    model = load_network(out)
    assert model.members == 3
    assert model.data_sha256 == answer["data_sha256"]
    names = {"net.safetensors", "net.safetensors.curve.jsonl"}
    assert {path.name for path in tmp_path.iterdir()} == names | {"plain.toml", "plain.table"}
    assert {Path(file).name for file in answer["files"]} == names
    resumed = run("train", table, "--out", out, "--resume", "--force", "--design", design)
    assert isinstance(resumed.exception, ArgumentError)
    plot = tmp_path / "missed.svg"
    more = ("--design", design, "--seed", "3", "--plot", plot)
    shown = run("train", table, "--out", tmp_path / "b", "--drag", "0.3", *more)
    assert shown.exit_code == 0, shown.output
    assert plot.read_text(encoding="utf-8").count('<g id="axes_') == 6  # the skin and five values
    assert "skins leave" in shown.stdout
    assert "mean distance of the place" in shown.stdout
    assert "Training ended: all 2 epochs are done." in shown.stdout


def test_chips_are_numbers():
    assert parse_chips("0,2") == (0, 2)
    with pytest.raises(ArgumentError, match="chips must be numbers"):
        parse_chips("one")
