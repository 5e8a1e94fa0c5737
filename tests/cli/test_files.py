"""Commands about files: what they are told to do reaches the work, and a damaged file fails."""

import importlib
import json
from pathlib import Path

import pytest

pytest.importorskip("typer")

from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.errors import FileError, MissingExtraError


def invoke(*arguments):
    return CliRunner().invoke(app, list(arguments))


def test_files_are_checked_and_a_damaged_one_fails(monkeypatch):
    import smoskin.commands.check as work

    class Found:
        def __init__(self, path):
            self.problem = "cut" if path.name == "bad" else ""
            self.path = path

        def as_json(self):
            return {"path": str(self.path)}

        def lines(self):
            return [str(self.path), "more"]

    monkeypatch.setattr(work, "check_file", Found)
    done = invoke("check", "good", "fine")
    assert (done.exit_code, done.stdout) == (0, "good\nmore\nfine\nmore\n")
    done = invoke("check", "good", "bad", "--json")
    assert (done.exit_code, json.loads(done.stdout)) == (1, [{"path": "good"}, {"path": "bad"}])


def test_a_new_design_is_written_as_asked(monkeypatch, tmp_path):
    import smoskin.commands.new_design as work

    asked = []
    monkeypatch.setattr(work, "new_design", lambda *words: asked.append(words) or "text")
    monkeypatch.chdir(tmp_path)
    done = invoke("new-design", "mine", "--out", "a.toml")
    assert (done.exit_code, done.stdout) == (0, ""), done.output
    assert done.stderr == "Now: edit a.toml, then smoskin info a.toml\n"
    assert (asked[-1], Path("a.toml").read_text()) == (("mine", "planar", None, None), "text")
    assert isinstance(invoke("new-design", "mine", "--out", "a.toml").exception, FileError)
    some = "--cells 2x3 --from optimised --remanence 0.6 --force"
    assert invoke("new-design", "mine", "--out", "a.toml", *some.split()).exit_code == 0
    assert asked[-1] == ("mine", "optimised", "2x3", 0.6)


@pytest.mark.parametrize(
    ("theme", "words", "needed"),
    [
        ("calibration", "fit-paper a.csv", ("writing a calibration", "cli", "tomli_w")),
        ("optimise", "optimise --out b.toml", ("writing a design", "cli", "tomli_w")),
        ("score", "score a.table --out judged", ("drawing", "plots", "matplotlib")),
        ("train", "train a.table --onnx a.onnx", ("writing ONNX files", "onnx", "onnx")),
    ],
)
def test_an_extra_that_is_missing_is_named_before_any_work(
    monkeypatch, tmp_path, theme, words, needed
):
    def refuse(what, extra, module):
        asked.append((what, extra, module))
        raise MissingExtraError(what, extra)

    asked = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(importlib.import_module(f"smoskin.cli.{theme}"), "require", refuse)
    # There is no table of touches and no response table: whoever began to work would say so.
    done = invoke(*words.split())
    assert asked == [needed]
    assert isinstance(done.exception, MissingExtraError)
    assert list(tmp_path.iterdir()) == []
