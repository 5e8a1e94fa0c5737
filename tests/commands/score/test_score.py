"""Scores of estimators: what an exam asks and tells, and that the same one tells the same."""

import io
import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from smoskin.commands.score import Exam, candidate, examine, score
from smoskin.commands.score.evaluate import parse_places
from smoskin.commands.score.report import (
    Count,
    ScoreSheet,
    Target,
)
from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.sheet.contact import CoverPanels
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.files import TensorFile
from smoskin.sensing.network.model import Layer, NetworkModel
from smoskin.sensing.response.table import load_response_table, shipped_tables
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.world.worlds import HARD, PLAIN, world_of
from tables_of_response import plain, reduced_table


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def reduced_skin(design):
    """As much of a twin as sessions need, by the reduced model."""
    return ReducedTwin(design, seed=None)


@pytest.fixture(scope="module")
def sheet(skin):
    shares = []
    exam = Exam(skins=(1,), touches=0, places=(4, 5), count=6, drag=0.2, pairs=1)
    scored = sheet_of(skin, exam, lambda what, share: shares.append(share))
    assert shares == sorted(shares)
    assert shares[-1] < 1
    return scored


def sheet_of(skin, exam, progress=lambda what, share: None):
    return examine(
        skin,
        candidate(reduced_table(skin), skin, exam),
        exam,
        make=lambda seed: reduced_skin(skin),
        progress=progress,
    )


def test_an_exam_finds_what_its_skins_answer(sheet):
    straight, dragged = sheet.case("straight"), sheet.case("dragged")
    assert [level.touches for level in straight.levels] == [6] * 10
    assert straight.headline.touches == 8 * 6
    assert straight.touched.right == dragged.touched.right == 1.0
    assert straight.idle.right > 0.95
    assert straight.headline.location.median < 1e-3
    assert straight.headline.near.share > 0.1
    assert dragged.headline.drag < 0.2
    # The same touches, by an estimator that may not take them to be straight.
    undragged = sheet.case("undragged")
    assert np.array_equal(undragged.answers.truth, straight.answers.truth)
    assert undragged.answers.spread[:, 2, 2].min() > 0.0 == straight.answers.spread[:, 2, 2].max()
    names = [target.name for target in sheet.targets()]
    assert "mean error of place" in names
    together, in_turn = sheet.case("pairs"), sheet.case("pairs in turn")
    assert np.array_equal(in_turn.answers.truth, together.answers.truth)
    for pairs in (together, in_turn):
        assert len(pairs.answers.truth) == 2
        assert pairs.map is None
        assert f"{pairs.name}: told as two touches" in names


def test_the_same_exam_gives_the_same_json(skin):
    exam = Exam(skins=(1, 2), touches=0, places=(4, 5), count=2, pairs=0)
    first, again = (json.dumps(sheet_of(skin, exam).as_json(), allow_nan=False) for _ in range(2))
    assert first == again
    answer = json.loads(first)
    assert answer["exam"]["seeds"] == [1, 2]
    assert (answer["exam"]["world"], answer["exam"]["contact"]) == ("plain", None)
    assert answer["design"]["sha256"] == skin.content_hash
    straight = answer["cases"][0]
    assert np.array(straight["map"]["location_mm"], dtype=float).shape == (4, 5)
    assert straight["confidence"][0]["stated"] == 0.05


@pytest.mark.slow
def test_figures_are_written_the_same_every_time(skin, sheet, tmp_path):
    pytest.importorskip("matplotlib")
    from smoskin.commands.score.plates import score_plates

    assert len(sheet.cases) == 5  # all that there are
    first, again = (
        {plate.name: plate.write(tmp_path).read_bytes() for plate in score_plates(sheet)}
        for _ in range(2)
    )
    assert first == again
    assert set(first) == {
        "score_maps", "score_confidence", "score_histograms_straight",
        "score_histograms_undragged", "score_histograms_dragged",
    }  # fmt: skip


def test_people_see_every_force_region_and_target(sheet):
    rich = pytest.importorskip("rich.console")
    console = rich.Console(width=100, record=True, file=io.StringIO())
    for table in sheet.tables():
        console.print(table)
    text = console.export_text()
    for word in (
        "plain world",
        "0.3 to 1 N",
        "0.1 N",
        "rim",
        "inside",
        "Targets",
        "bound by noise",
    ):
        assert word in text
    assert "…" not in text


def test_a_skin_out_of_range_untouched_is_sent_back_and_named(planar):
    """Of the hard world's skin 7003 a chip reads the end of its range in the cold."""
    exam = Exam(skins=(7003, 7004), touches=0, count=1, pairs=0, world=world_of("hard"))
    subject = candidate(load_response_table("planar"), planar, exam)
    scored = examine(planar, subject, exam)
    assert scored.sent_back == (7003,)
    assert scored.as_json()["sent_back"] == [7003]
    assert len(scored.case("straight").answers.count) == 10
    title = scored.tables()[0].title
    assert title == "straight: 1 unseen skins, hard world (out of range untouched, sent back: 7003)"
    alone = replace(exam, skins=(7003,))
    with pytest.raises(ArgumentError, match="skins must read within their chips' range untouched"):
        examine(planar, subject, alone)


def test_exams_that_cannot_be_held_are_refused():
    for options, reason in (
        ({"skins": ()}, "skins must be at least 1"),
        ({"places": (1, 5)}, "places must be at least 2"),
        ({"count": 0}, "count at least 1"),
        ({"drag": -0.1}, "drag must be finite"),
        ({"pairs_after": 0.0}, "pairs_after must lie in 0.02 to 10 s; got 0.0"),
        ({"skins": (999_999, 1_000_000)}, "seeds must lie in"),
        ({"skins": (-1,)}, "seeds must lie in"),
    ):
        with pytest.raises(ArgumentError, match=reason):
            Exam(**options)
    with pytest.raises(ArgumentError, match="places must be two whole numbers"):
        parse_places("25")


def network(design, **other):
    """An untrained one that reads the two upper chips of straight touches."""
    rng = np.random.default_rng(0)
    widths = (7, 4, 4, 9)
    layers = tuple(
        Layer(
            rng.normal(size=(1, a, b)).astype(np.float32),
            rng.normal(size=(1, 1, b)).astype(np.float32),
        )
        for a, b in pairwise(widths)
    )
    whole = {
        "design_hash": design.content_hash,
        "chips": (1, 2),
        "layers": layers,
        "centre": np.zeros(7),
        "scale": np.ones(7),
        "middle": np.array([0.06, 0.08, 5.0]),
        "size": np.array([0.03, 0.04, 1.0]),
        "stretch": np.ones(3),
        "whitener": np.eye(7),
        "reach": 100.0,
        "forces": (0.05, 1.15),
        "drag": 0.0,
        "floor": 1e-5,
        "softening": 0.0,
        "data_sha256": "",
        "split": "",
        "metrics": (),
    }
    return NetworkModel(**(whole | other))


def test_shipped_tables_go_by_their_designs_names(planar):
    pytest.importorskip("safetensors")
    by_name, by_file = (
        candidate(given, planar, Exam(touches=0))
        for given in ("planar", shipped_tables()["planar"])
    )
    assert by_name.file_sha256 == by_file.file_sha256 != ""
    with pytest.raises(ModelError, match="must be of the design"):
        candidate("curved", planar, Exam(touches=0))


def test_a_file_says_itself_what_it_is(skin, long_planar, tmp_path):
    pytest.importorskip("safetensors")
    table, model, other = (tmp_path / name for name in ("table", "model", "other"))
    reduced_table(skin).save(table)
    network(skin).save(model)
    other.write_bytes(b"no tensors")
    exam = Exam(touches=0)
    assert candidate(table, skin, exam).chips == (0, 1, 2)
    assert candidate(table, skin, replace(exam, chips=(1, 2))).chips == (1, 2)
    assert candidate(model, skin, exam).kind == "network"
    for file in (table, model):
        with pytest.raises(ModelError, match="must be of the design '4x5'"):
            candidate(file, long_planar, exam)
    with pytest.raises(ModelError, match="other: not a TOML document"):
        candidate(other, skin, exam)
    with pytest.raises(ArgumentError, match=r"chips must be those of the network, \(1, 2\)"):
        candidate(model, skin, replace(exam, chips=(0, 1)))
    TensorFile("another file", "another", 1).write(other, {}, {})
    with pytest.raises(ModelError, match="a model file of this package"):
        candidate(other, skin, exam)


def test_an_untrained_network_is_examined_as_any_other(skin):
    exam = Exam(skins=(1,), places=(4, 5), count=2, pairs=0)
    scored = examine(
        skin, candidate(network(skin), skin, exam), exam, make=lambda _: reduced_skin(skin)
    )
    headline = scored.case("straight").headline
    assert headline.near is None
    assert headline.location.mean > 5e-3
    json.dumps(scored.as_json(), allow_nan=False)


def test_the_command_says_what_it_cannot_do(tmp_path):
    pytest.importorskip("safetensors")
    testing = pytest.importorskip("typer.testing")
    from smoskin.cli import score as command

    def failed(*options):
        arguments = ["score", str(tmp_path / "none"), "--out", str(tmp_path / "out"), *options]
        return str(testing.CliRunner().invoke(command.app, arguments).exception)

    assert "No such file" in failed()
    assert "places must be two whole numbers" in failed("--places", "25")
    assert "chips must be numbers" in failed("--chips", "1;2")
    assert not (tmp_path / "out").exists()


def test_the_exit_code_is_1_where_a_target_is_missed(skin, sheet, tmp_path, monkeypatch):
    testing = pytest.importorskip("typer.testing")
    from smoskin.cli import app

    straight = sheet.case("straight")
    good = replace(sheet, cases=(replace(straight, idle=Count.of(0, np.zeros(5))),))
    bad = replace(sheet, cases=(replace(straight, idle=Count.of(0, np.ones(5))),))
    assert [target.name for target in bad.targets() if not target.met] == [
        *(target.name for target in good.targets() if not target.met), "told as none"
    ]  # fmt: skip
    assert good.met is all(target.met for target in good.targets())
    assert bad.met is False
    asked = {}

    def run(met, *options):
        def stand_in(file, design, **given):
            asked.update(given)
            return sheet

        monkeypatch.setattr("smoskin.commands.score.score", stand_in)
        monkeypatch.setattr(ScoreSheet, "met", property(lambda self: met))
        return testing.CliRunner().invoke(app, ["score", "some.table", *options])

    assert run(True).exit_code == 0
    assert asked["out"] is None
    assert asked["skins"] == range(1, 3)
    assert (asked["world"], asked["effect"]) == ("hard", None)
    assert run(True, "--world", "plain").exit_code == 0
    assert asked["world"] == "plain"
    assert run(True, "--effect", "earth").exit_code == 0
    assert asked["effect"] == "earth"
    assert run(False).exit_code == 1
    done = run(False, "--json", "--skins", "3", "--seed", "7", "--out", str(tmp_path))
    assert done.exit_code == 1
    assert json.loads(done.stdout)["design"]["name"] == skin.name
    assert (asked["out"], asked["skins"]) == (tmp_path, range(7, 10))
    spoken = testing.CliRunner().invoke(app, ["score", "--help"]).stdout
    assert "exit code is 1" in " ".join(spoken.split())


def test_targets_are_met_up_to_their_ends():
    assert [Target("a", "", x, 85, 95).met for x in (84.99, 85, 95, 95.01)] == [
        False, True, True, False
    ]  # fmt: skip
    assert [Target("b", "", x, None, 1.2).met for x in (-5.0, 1.2, 1.21)] == [True, True, False]


def test_targets_are_those_of_the_world(sheet):
    """Asked of three chips and of two, and bounds of the plain world alone."""
    plain = {target.name: (target.least, target.most) for target in sheet.targets()}
    assert plain["mean error of place"] == (None, pytest.approx(1.2))
    assert plain["mean error of normal force"] == (None, 5)
    assert plain["told as one touch"] == plain["told as none"] == (97, 100)
    exam = replace(sheet.exam, world=HARD)
    for chips, most in (((0, 1, 2), 1.0), ((1, 2), 1.3)):
        hard = replace(sheet, exam=exam, chips=chips).targets()
        asked = {target.name: (target.least, target.most) for target in hard}
        assert asked["mean error of place"] == (None, pytest.approx(most))
        assert asked["mean error of normal force"] == (None, 3)
        assert asked["dragged: mean error of place"] == (None, pytest.approx(1.5))
        assert asked["told as one touch"] == asked["told as none"] == (99, 100)
        assert asked["90 % regions hold"] == plain["90 % regions hold"] == (85, 95)
        assert not any("over" in name for name in asked)
    dragged = next(target for target in hard if target.name == "dragged: mean error of place")
    assert dragged.reached == 1e3 * sheet.case("dragged").headline.location.mean


def test_what_is_scored_may_be_a_model_or_any_estimator(skin, planar, monkeypatch):
    exams = []
    monkeypatch.setattr(
        "smoskin.commands.score.examine",
        lambda design, subject, exam, progress: exams.append((design, subject, exam)),
    )
    score(network(skin), skin)
    score(ClosedFormEstimator(skin), skin, skins=[4, 9], places=(5, 7), drag=0.3, pairs=2)
    score(reduced_table(planar), touches=0, chips=[1, 2], count=7, effect="earth")
    (_, first, usual), (_, second, other), (design, third, last) = exams
    assert (usual.world, usual.contact) == (HARD, None)
    assert last.world == world_of(effect="earth")
    score(ClosedFormEstimator(skin), skin, world="plain")
    assert exams[-1][2].world == PLAIN
    score(ClosedFormEstimator(skin), skin, contact=CoverPanels())
    hard = exams[-1][2]
    assert (hard.world, hard.contact) == (HARD, CoverPanels())
    document = hard.as_json()
    assert (document["world"], document["contact"]) == ("hard", "CoverPanels")
    with pytest.raises(ArgumentError, match="world must be one of plain, hard, limb; got 'soft'"):
        score(ClosedFormEstimator(skin), skin, world="soft")
    assert (first.kind, first.chips) == ("network", (1, 2))
    assert usual == Exam(skins=(1, 2, 3, 4, 5), pairs=0, world=HARD)
    assert (usual.touches, usual.count, usual.places, usual.drag) == (60, 200, (25, 33), 0.0)
    assert (second.kind, second.chips) == ("calibration", (0, 1, 2))
    assert (other.skins, other.places, other.count, other.pairs) == ((4, 9), (5, 7), None, 2)
    assert (design.name, third.chips, third.plan) == ("planar", (1, 2), ())
    assert (last.count, last.chips) == (7, (1, 2))


@pytest.mark.slow
def test_a_table_is_scored_on_made_skins(planar, tmp_path):
    for module in ("safetensors", "jax", "matplotlib"):
        pytest.importorskip(module)
    from smoskin.commands.table import Effort, make_table

    small = Effort(presses=3700, pairs=200, skins=6, draws=2, presses_a_skin=200)
    make_table(planar, small).save(tmp_path / "table")
    asked = {"skins": (1,), "touches": 30, "count": 8, "pairs": 2, "chips": (1, 2)}
    asked["world"] = "plain"
    sheets = [score(tmp_path / "table", planar, **asked, out=tmp_path / k) for k in "ab"]
    texts = [(tmp_path / k / "score.json").read_bytes() for k in "ab"]
    assert texts[0] == texts[1]
    assert sheets[0].case("straight").headline.location.mean < 5e-3
    names = {path.name for path in (tmp_path / "a").iterdir()}
    assert names == {
        "score.json", "score_maps.svg", "score_confidence.svg", "score_histograms_straight.svg"
    }  # fmt: skip


@pytest.mark.slow
def test_a_table_is_scored_in_the_hard_world_by_a_law_of_ones_own(planar):
    for module in ("safetensors", "jax"):
        pytest.importorskip(module)
    from smoskin.sensing.response.table import load_response_table

    table = load_response_table("planar")
    few = {"skins": (1,), "touches": 10, "count": 1}
    plain, hard = (score(table, planar, **few, world=world) for world in ("plain", "hard"))
    assert (
        plain.case("straight").headline.location.mean < hard.case("straight").headline.location.mean
    )
    again = score(table, planar, **few, world="hard")
    assert json.dumps(again.as_json()) == json.dumps(hard.as_json())


@pytest.mark.slow
def test_an_arm_that_tells_its_pose_costs_less():
    table = load_response_table("planar")
    with_pose, without_pose = (
        score(table, skins=[31], count=8, posed=posed).case("straight").headline.location.mean
        for posed in (True, False)
    )
    assert with_pose < 0.8 * without_pose
    assert with_pose < 1e-3


def test_only_an_arm_tells_its_pose(planar):
    skin = ClosedFormEstimator(planar)
    with pytest.raises(ArgumentError, match="posed must go with an effect on an arm; got world"):
        score(skin, world="plain", posed=True)
