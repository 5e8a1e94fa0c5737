"""Any file is known by its content, told whole or damaged, and told by which command it is read."""

import json
from dataclasses import replace

import pytest

pytest.importorskip("typer")

from typer.testing import CliRunner

from learned_examples import presses
from networks import random_network
from smoskin.cli import app
from smoskin.commands.check import check_file
from smoskin.commands.new_design import new_design
from smoskin.design.document import parse_design
from smoskin.errors import ArgumentError, DesignError
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.training import FittingEffort, train_model
from smoskin.sensing.response.table import load_response_table
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.twin.reduced import ReducedTwin


@pytest.fixture(scope="module")
def recording(planar, tmp_path_factory):
    file, twin = tmp_path_factory.mktemp("check") / "touch", ReducedTwin(planar)
    with Recorder(file, planar, flush_interval=0.0) as recorder:
        for k in range(20):
            recorder.write(twin.read(time=0.01 * k))
    return file


def test_a_recording_is_whole_or_told_what_it_lost(recording, tmp_path):
    whole = check_file(recording)
    assert (whole.kind, whole.problem) == ("a recording", "")
    assert whole.facts["readings"].startswith("20 ")
    assert whole.facts["design"].startswith("planar")
    assert whole.read_by == (f"run replay:{recording}",)
    content = recording.read_bytes()
    cut, flipped = tmp_path / "cut", tmp_path / "flipped"
    cut.write_bytes(content[: len(content) * 2 // 3])
    assert "it ends too early" in check_file(cut).problem
    span = open_recording(recording).spans[4]
    middle = span.offset + span.length // 2
    flipped.write_bytes(content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :])
    assert check_file(flipped).problem
    assert check_file(flipped).read_by == ()


def test_designs_tables_sheets_and_others_are_known_by_their_content(tmp_path, planar):
    table, design, other = tmp_path / "a", tmp_path / "b", tmp_path / "c"
    load_response_table("planar").save(table)
    design.write_text(new_design("mine"))
    other.write_text("hello")
    assert check_file(table).kind == "a response table"
    assert check_file(table).facts["design"].startswith("planar")
    assert check_file(design).kind == "a design"
    assert check_file(design).problem == ""
    assert check_file(other).problem == "no kind of file that smoskin writes or reads"
    table.write_bytes(table.read_bytes()[:10_000])
    assert "cannot be read" in check_file(table).problem
    design.write_text(design.read_text().replace("panel_b_mm", "panel_c_mm"))
    assert "unknown key 'panel_c_mm'" in check_file(design).problem
    assert "No such file" in check_file(tmp_path / "nowhere").problem
    sheet = tmp_path / "d"
    done = CliRunner().invoke(app, ["touches", "plan", "--count", "2", "--out", str(sheet)])
    assert done.exit_code == 0
    assert check_file(sheet).facts["rows"].endswith("0 are filled in")


def test_a_table_says_whose_it_is_and_what_it_was_made_of(tmp_path):
    table = load_response_table("planar")
    for name, known, whose in (
        ("design", 1.0, "the design, no skin's own"),
        ("skin", 0.1, "one skin, calibrated by touches"),
    ):
        replace(table, modes=known * table.modes).save(tmp_path / name)
        facts = check_file(tmp_path / name).facts
        assert facts["of"] == whose
        assert "presses 12000, pairs 4000, skins 96" in facts["made from"]


def test_trained_models_say_what_they_reached_on_what_was_held_out(tmp_path):
    random_network().save(tmp_path / "network")
    facts = check_file(tmp_path / "network").facts
    assert facts["held out, mean distance of the place"] == "1 mm"
    examples = presses(passes=1, side=5)
    learned = train_model(examples, Encoding(chips=(0, 1, 2)), effort=FittingEffort(iterations=1))
    learned.save(tmp_path / "learned")
    facts = check_file(tmp_path / "learned").facts
    metric = learned.metrics[0]
    assert facts["held out, rmse x"] == f"{1e3 * metric.value:.3g} mm"


def test_the_command_tells_of_each_and_fails_where_one_is_damaged(recording, tmp_path):
    empty = tmp_path / "empty"
    empty.touch()
    done = CliRunner().invoke(app, ["check", str(recording), str(empty)])
    assert done.exit_code == 1
    assert f"{recording}: a recording, whole" in done.output
    assert f"{empty}: a file, the file is empty" in done.output
    done = CliRunner().invoke(app, ["check", str(recording), "--json"])
    assert done.exit_code == 0
    assert json.loads(done.output)[0]["whole"] is True


def test_info_of_a_recording_points_to_check(recording):
    from smoskin.cli.skins import info

    with pytest.raises(DesignError, match=r"is a recording, not a design; smoskin check"):
        info(str(recording))


def test_a_new_design_is_commented_and_can_be_built(tmp_path, planar):
    text = new_design("mine")
    assert parse_design(text).content_hash == planar.content_hash
    assert text.count("\n# ") >= 13
    resized = parse_design(new_design("mine", "planar", "4x8"))
    assert (resized.name, resized.cells) == ("mine", (4, 8))
    assert [magnet.corner for magnet in resized.magnets] == [(3, 5), (3, 3), (1, 5)]
    with pytest.raises(DesignError, match="overlap"):
        new_design("mine", "planar", "2x2")
    with pytest.raises(ArgumentError, match="6x8"):
        new_design("mine", "planar", "6")
    out = tmp_path / "mine.toml"
    done = CliRunner().invoke(app, ["new-design", "mine", "--out", str(out), "--cells", "5x6"])
    assert done.exit_code == 0
    assert parse_design(out.read_text()).cells == (5, 6)


def test_a_crease_pattern_is_told_by_the_rules_that_it_breaks(tmp_path):
    file, plot = tmp_path / "pattern.fold", tmp_path / "pattern.svg"
    places = [[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]]
    document = {
        "file_spec": 1.2,
        "vertices_coords": places,
        "edges_vertices": [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]],
        "edges_assignment": list("MVMVBBBB"),
    }
    file.write_text(json.dumps(document))
    checked = check_file(file)
    assert (checked.kind, checked.problem) == ("a crease pattern (FOLD)", "")
    assert checked.facts["creases"] == "2 mountain, 2 valley, 0 unassigned"
    assert checked.facts["flat folding"] == "broken rules: 1"
    assert checked.facts["vertex 0"].startswith("Maekawa: 2 mountains and 2 valleys")
    done = CliRunner().invoke(app, ["check", str(file), "--plot", str(plot)])
    assert done.exit_code == 0, done.output
    assert plot.read_text().startswith("<?xml")
    done = CliRunner().invoke(app, ["check", str(file), str(file), "--plot", str(plot)])
    assert done.exit_code != 0
    assert "--plot needs one crease pattern; got 2 files" in str(done.exception)
    file.write_text(json.dumps(document | {"edges_assignment": list("MMMVBBBB")}))
    assert check_file(file).facts["flat folding"] == "no vertex forbids it"
