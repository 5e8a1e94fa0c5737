"""A design found by the search beside the one that it came from."""

import json
from dataclasses import replace

import pytest

from searches_of_designs import AIM, COARSE, WITHIN
from smoskin.commands.optimise import (
    Limits,
    Objective,
    Optimised,
    SearchEffort,
    Side,
    changes_of,
    check_made,
    compare_bounds,
    made_sheets,
    optimise,
    widened,
)
from smoskin.commands.optimise.limits import Reached, own_limits, stood_limits
from smoskin.commands.optimise.pressed import PressedSheet
from smoskin.commands.optimise.search import try_design
from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.magnetics import mlx90393
from smoskin.sensing.response.bound import bound_of_slopes, figures
from smoskin.sensing.signals.signals import signal_noise


@pytest.mark.slow
def test_better_places_lower_the_bound_and_keep_the_limits(planar, sheet, optimised):
    assert optimised.kept
    assert optimised.gain > 1.3
    new = PressedSheet(optimised.after, places=COARSE)
    before = try_design(planar, sheet, AIM, WITHIN)
    after = try_design(optimised.after, new, AIM, WITHIN)
    assert after.value < 0.85 * before.value
    assert after.merit == after.value
    corners = [magnet.corner for magnet in optimised.after.magnets]
    assert len(set(corners)) == len(corners)
    assert 1 / mlx90393.conversion_time(optimised.after.hall_setting, 0) >= WITHIN.rate


def test_both_designs_are_compared_in_every_case(planar):
    sides = compare_bounds(
        planar, load_design("optimised"), force=0.5, unmodelled=0.005, places=COARSE
    )
    assert len(sides) == 52
    known = {(side.case, side.quantity): (side.before, side.after) for side in sides}
    for case, quantity, before, after in (
        ("all chips, drag unknown", "mean location, mm", 0.378591, 0.124868),
        ("all chips, drag unknown", "worst drag, mN", 0.974979, 0.393306),
        ("all chips, drag unknown", "super-resolution by area", 43386.4, 405086.0),
        ("all chips, no drag", "mean normal force, mN", 1.239954, 0.470865),
        ("the sheet's chips, no drag", "median location, mm", 0.345988, 0.108601),
        ("the sheet's chips, no drag", "super-resolution by spacing", 323.684, 1000.52),
        (
            "all chips, drag and a share of signals unknown",
            "maximum location, mm",
            0.589984,
            0.228133,
        ),
        ("all chips, drag unknown, made skins", "mean location, mm", 0.401311, 0.131284),
    ):
        assert known[case, quantity] == pytest.approx((before, after), rel=2e-3)


@pytest.mark.slow
def test_the_comparison_is_told_in_full(planar, optimised, tmp_path):
    document, beside = optimised.write(tmp_path / "better.toml")
    read = load_design(document)
    assert read == optimised.after
    assert read.name == "optimised"
    answer = json.loads(beside.read_text(encoding="utf-8"))
    assert answer["kept"] is True
    assert answer["gain"] == pytest.approx(optimised.gain)
    paths = {change["path"] for change in answer["changes"]}
    assert "magnets.1.corner" in paths
    assert all(read.provenance[path].origin == "assumed" for path in paths)
    assert all("smoskin optimise" in read.provenance[path].reason for path in paths)
    cases = {bound["case"] for bound in answer["bounds"]}
    assert {"all chips, drag unknown", "all chips, no drag", "the sheet's chips, no drag",
            "all chips, drag unknown, made skins"} <= cases  # fmt: skip
    quantities = {bound["quantity"] for bound in answer["bounds"]}
    assert {"mean location, mm", "worst location, mm", "mean normal force, mN", "mean drag, mN",
            "super-resolution by area", "super-resolution by spacing"} <= quantities  # fmt: skip
    assert len(optimised.tables()) == 3


def result(planar, kept):
    """What a search might have found, keeping its limits or not."""
    after = load_design("optimised")
    reached = Reached(name="column pressed, of its height", value=0.3 if kept else 0.36, most=0.35)
    return Optimised(
        before=planar,
        after=after,
        changes=changes_of(planar, after),
        bounds=(Side("all chips, drag unknown", "mean location, mm", 1.0, 0.5),),
        limits=(Reached(name="feasible", value=1.0, least=1.0),),
        made=(reached,),
    )


@pytest.mark.parametrize("kept", [True, False])
def test_the_command_writes_both_files_and_exits_with_1_where_a_limit_is_broken(
    planar, kept, tmp_path, monkeypatch
):
    from typer.testing import CliRunner

    import smoskin.commands.optimise as application
    from smoskin.cli import app

    asked = {}

    def stand_in(design, **given):
        asked.update(given, design=design)
        return result(planar, kept)

    monkeypatch.setattr(application, "optimise", stand_in)
    out = tmp_path / "found.toml"
    arguments = ["optimise", "planar", "--out", str(out), "--minutes", "2", "--seed", "3"]
    run = CliRunner().invoke(app, [*arguments, "--json", "--force-N", "0.4", "--rate", "150"])
    assert run.exit_code == (0 if kept else 1), run.output
    answer = json.loads(run.stdout)
    assert answer["kept"] is kept
    assert answer["gain"] == 2.0
    assert {change["path"] for change in answer["changes"]} >= {
        "magnets.0.corner",
        "columns.height",
    }
    assert asked["effort"] == SearchEffort(seconds=120, seed=3)
    assert asked["objective"] == Objective(force=0.4)
    assert asked["limits"] == Limits(rate=150.0)
    assert asked["name"] == "found"
    assert load_design(out) == load_design("optimised")
    assert json.loads(out.with_suffix(".json").read_text(encoding="utf-8")) == answer
    shown = CliRunner().invoke(app, ["optimise", "--out", str(out), "--force"])
    assert shown.exit_code == (0 if kept else 1)
    assert "times better" in shown.stdout
    assert ("broken" in shown.stdout) is not kept
    assert asked["effort"] == SearchEffort()
    spoken = CliRunner().invoke(app, ["optimise", "--help"]).stdout
    assert "exit code is 1" in " ".join(spoken.split())


def test_gains_are_of_lower_bounds_and_of_higher_super_resolution():
    for quantity, before, after, gain in (
        ("mean location, mm", 1.0, 0.5, 2.0),
        ("mean location, mm", 0.5, 1.0, 0.5),
        ("super-resolution by area", 100.0, 300.0, 3.0),
        ("super-resolution by area", 300.0, 100.0, 1 / 3),
    ):
        assert Side("", quantity, before, after).gain == pytest.approx(gain)


def test_limits_and_wrong_use_are_refused(planar):
    with pytest.raises(ArgumentError, match="force must be positive"):
        Objective(force=0.0)
    with pytest.raises(ArgumentError, match="steps, rounds and seconds"):
        SearchEffort(steps=0)
    with pytest.raises(ArgumentError, match="two places or more"):
        PressedSheet(planar, places=(1, 5))
    with pytest.raises(ArgumentError, match="rate must leave"):
        optimise(planar, limits=Limits(rate=1e5))


def test_a_made_skin_out_of_range_is_found(planar):
    sheets = made_sheets(planar, WITHIN)
    near, far = (
        replace(planar, halls=tuple(replace(site, gap=gap) for site in planar.halls))
        for gap in (4.7e-3, 6.4e-3)
    )
    worst = {limit.name: limit for limit in check_made(near, sheets, WITHIN)}
    assert not worst["S2 field, of its range"].kept
    assert all(limit.kept for limit in check_made(far, sheets, WITHIN))


def test_only_chips_whose_made_skins_leave_their_range_get_wider_gaps(planar):
    halls = [
        replace(site, name=f"over {site.magnet}", gap=gap)
        for site, gap in zip(planar.halls, (6.4e-3, 5.1e-3, 6.4e-3), strict=True)
    ]
    new, made = widened(replace(planar, halls=tuple(halls)), WITHIN)
    assert all(limit.kept for limit in made)
    assert [new.halls[0], new.halls[2]] == [halls[0], halls[2]]
    assert 5.1e-3 < new.halls[1].gap < 6.4e-3


def test_the_shipped_optimum_halves_the_bound(planar, sheet):
    better = load_design("optimised")
    new = PressedSheet(better, places=COARSE)
    for drags in (True, False):
        before, after = (
            figures(
                bound_of_slopes(
                    pressed.x,
                    pressed.y,
                    pressed.slopes(design)[1],
                    signal_noise(design),
                    drags=drags,
                ).location
            )
            for pressed, design in ((sheet, planar), (new, better))
        )
        better_by = 2.0 if drags else 1.3
        assert after.mean < before.mean / better_by
        assert after.worst < before.worst / min(better_by, 1.5)
    reached = own_limits(better, Limits()) + stood_limits(better, new, Limits())
    assert all(limit.kept for limit in reached)
    assert all(limit.kept for limit in check_made(better, made_sheets(better, WITHIN), WITHIN))


@pytest.mark.slow
def test_a_fuller_search_halves_the_bound_on_finer_grids_and_made_skins(planar):
    better = optimise(
        planar, limits=Limits(rubbers=("Ecoflex 00-30",)), effort=SearchEffort(steps=80, rounds=1)
    )
    assert better.kept
    gains = {(side.case, side.quantity): side.gain for side in better.bounds}
    for case in ("all chips, drag unknown", "all chips, drag unknown, made skins"):
        assert gains[case, "mean location, mm"] >= 2
        assert gains[case, "worst location, mm"] >= 1.5
