"""Bounds without a table, limits of what can be made, and the search for a better design."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.commands.optimise import (
    Limits,
    Objective,
    Optimised,
    SearchEffort,
    Side,
    changes_of,
    check_made,
    compare_bounds,
    design_bound,
    made_sheets,
    optimise,
)
from smoskin.commands.optimise.limits import (
    Reached,
    allowed_field,
    alone_over,
    clearances,
    fit_gaps,
    largest_field,
    made_allowance,
    own_limits,
    slowest_setting,
    stood_limits,
)
from smoskin.commands.optimise.objective import (
    design_information,
    try_design,
    unknown_of,
    worth,
)
from smoskin.commands.optimise.pressed import PressedSheet, rated_touches
from smoskin.commands.optimise.search import _point, _varied, exchange, find_design
from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.records import Motion
from smoskin.sensing.response.bound import bound_of_information, bound_of_slopes, figures
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import draw
from smoskin.twin.readout import Readout

COARSE = (3, 5)


@pytest.fixture(scope="module")
def sheet(planar):
    return PressedSheet(planar, places=COARSE)


def ticking():
    """A clock that goes on by a second whenever it is looked at."""
    ticks = itertools.count()
    return lambda: float(next(ticks))


PLACED = SearchEffort(seconds=9.5)
"""Time, by that clock, for gains and magnets' places on the first sheet."""
AIM, WITHIN = Objective(places=COARSE), Limits(made_skins=2)


@pytest.fixture(scope="module")
def found(planar):
    return optimise(
        planar, objective=AIM, limits=WITHIN, effort=PLACED, places=COARSE, clock=ticking()
    )


def exact_slopes(design, position, force=0.5):
    """Slopes of the signals as designed at B places, (B, 2) m; shape (B, C, 5), T/m and T/N.

    Mechanics by the implicit function theorem; the field along them by central differences.
    """
    push = np.tile([0.0, 0.0, -force], (len(position), 1))
    solver = BarHinge(design)
    touches = Touches(position=position[:, None], force=push[:, None])
    pressed, rates = solver.press(touches, tolerance=1e-10), solver.sensitivity(touches)
    holders = holder_matrix(design)
    flat = holders.reshape(-1, pressed.displacements[0].size).T

    def magnets(displacements):
        joined = displacements.reshape(*displacements.shape[:-2], -1)
        return np.asarray((joined @ flat).reshape(*joined.shape[:-1], -1, 6))

    at, along = magnets(pressed.displacements), magnets(rates.displacements[:, 0])
    readout, slopes = Readout(design), []
    for k, span in enumerate(0.05 * np.array([1e-3, 1e-3, 0.1, 0.1, 0.1])):
        signals = [
            readout.risen(
                Motion(
                    magnets=at + side * span * along[:, k],
                    board=pressed.board + side * span * rates.board[:, 0, k],
                )
            ).reshape(len(at), -1)
            for side in (1.0, -1.0)
        ]
        slopes.append((signals[0] - signals[1]) / (2 * span))
    return np.stack(slopes, axis=-1)


def test_differences_of_presses_meet_the_exact_slopes(planar, sheet):
    near = sheet.slopes(planar)[1].reshape(-1, 9, 5)
    some = [0, 4, 7, 11]
    exact = exact_slopes(planar, places_to_the_rim(geometry(planar).extent, COARSE)[some])
    for k in range(5):
        assert near[some, :, k] == pytest.approx(exact[..., k], abs=0.02 * abs(exact[..., k]).max())


def test_a_design_has_a_bound_without_a_table(planar, sheet):
    found = design_bound(planar, places=COARSE)
    slopes = sheet.slopes(planar)[1]
    direct = bound_of_slopes(sheet.x, sheet.y, slopes, signal_noise(planar))
    assert found.location == pytest.approx(direct.location, rel=1e-3)
    assert not found.blind.any()
    straight = design_bound(planar, places=COARSE, drags=False)
    assert (straight.location < found.location).all()


def test_a_made_skin_is_bounded_much_like_its_design(planar):
    made = draw(planar, np.random.default_rng(5))
    whole, one = design_bound(planar, places=COARSE), design_bound(planar, made, places=COARSE)
    ratio = one.location / whole.location
    assert (abs(ratio - 1) > 1e-3).any()
    assert ((ratio > 0.5) & (ratio < 2)).all()


def test_a_row_of_cells_is_blind_across_it(planar):
    magnets = [
        replace(m, corner=c) for m, c in zip(planar.magnets, [(3, 0), (4, 1), (2, 1)], strict=True)
    ]
    row = replace(planar, cells=(6, 1), magnets=tuple(magnets))
    found = design_bound(row, places=COARSE)
    assert found.blind.all()
    assert found.place[..., 1] == pytest.approx(found.y[-1] / math.sqrt(12), rel=1e-3)


def test_the_rated_touches_press_and_drag_every_way(planar):
    where, push = rated_touches(places_to_the_rim(geometry(planar).extent, (2, 3)))
    assert where.shape == (30, 2)
    assert (push[:, 2] == -1.0).all()
    assert sorted({tuple(one) for one in push[:, :2].tolist()}) == [
        (-0.5, 0.0), (0.0, -0.5), (0.0, 0.0), (0.0, 0.5), (0.5, 0.0)
    ]  # fmt: skip


def test_the_reference_design_keeps_every_limit(planar, sheet):
    reached = own_limits(planar, Limits()) + stood_limits(planar, sheet, Limits())
    assert all(one.kept for one in reached)
    assert sheet.stands()


@pytest.mark.parametrize(
    ("part", "change", "name"),
    [
        ("columns", {"radius": 0.9e-3}, "columns.radius, mm"),
        ("columns", {"height": 16e-3}, "columns.height, mm"),
        ("frame", {"stiffness": 5.0}, "frame.stiffness, N/mm"),
        ("hall_setting", {"oversampling": 3}, "readings a second"),
        ("hall_setting", {"gain_selection": 7}, "feasible"),
    ],
)
def test_a_broken_limit_is_named(planar, part, change, name):
    other = replace(planar, **{part: replace(getattr(planar, part), **change)})
    broken = [one.name for one in own_limits(other, Limits()) if not one.kept]
    assert name in broken


def test_a_rated_touch_breaks_what_is_too_soft_or_too_near(planar):
    slender = replace(planar, columns=replace(planar.columns, radius=1.1e-3, height=14e-3))
    near = tuple(replace(site, gap=4.6e-3) for site in slender.halls)
    slender = replace(slender, halls=near)
    sheet = PressedSheet(slender, places=(2, 2))
    broken = [one.name for one in stood_limits(slender, sheet, Limits()) if not one.kept]
    assert "column's load, of Euler's" in broken
    assert "S2 field, of what is allowed" in broken


def test_slack_is_a_share_of_the_limit():
    both = Reached(name="x", value=2.0, least=1.0, most=4.0)
    assert both.slack == pytest.approx(0.5)
    assert both.kept
    assert not Reached(name="x", value=5.0, most=4.0).kept
    assert not Reached(name="x", value=math.nan, most=4.0).kept


def test_gaps_are_as_small_as_the_range_allows(planar, sheet):
    limits = Limits()
    fitted = fit_gaps(planar, sheet, limits)
    slip, stronger, _ = made_allowance(limits)
    nearer = replace(fitted, halls=tuple(replace(s, gap=s.gap - slip) for s in fitted.halls))
    for seen in largest_field(nearer, sheet.rated(nearer)):
        used = (stronger * seen / allowed_field(planar, limits)).max()
        assert 0.95 < used < 1.02  # neighbours add a little
    assert min(clearances(fitted, sheet.rated(fitted))) > limits.clearance
    wide = fit_gaps(planar, sheet, replace(limits, front_end=30e-3))
    assert all(w.gap > f.gap for w, f in zip(wide.halls, fitted.halls, strict=True))
    rounded = fit_gaps(planar, sheet, limits, step=0.05e-3)
    for site, plain in zip(rounded.halls, fitted.halls, strict=True):
        assert 0 <= site.gap - plain.gap < 0.05e-3
        assert site.gap / 0.05e-3 == pytest.approx(round(site.gap / 0.05e-3))


@pytest.mark.slow
def test_better_places_lower_the_bound_and_keep_the_limits(planar, sheet, found):
    assert found.kept
    assert found.gain > 1.3
    new = PressedSheet(found.after, places=COARSE)
    before = try_design(planar, sheet, AIM, WITHIN)
    after = try_design(found.after, new, AIM, WITHIN)
    assert after.value < 0.85 * before.value
    assert after.merit == after.value
    corners = [one.corner for one in found.after.magnets]
    assert len(set(corners)) == len(corners)
    assert 1 / mlx90393.conversion_time(found.after.hall_setting, 0) >= WITHIN.rate


def test_magnets_are_placed_where_they_tell_most(planar, sheet):
    told = []
    best = find_design(
        planar, AIM, WITHIN, PLACED, lambda what, share: told.append((what, share)), ticking()
    )
    assert [one.corner for one in best.design.magnets] == [(3, 1), (5, 5), (1, 5)]
    assert [site.gap for site in best.design.halls] == pytest.approx([4.95e-3, 6.15e-3, 6.15e-3])
    assert best.design.hall_setting.gain_selection == 3
    assert best.merit == best.value == pytest.approx(0.36462e-3, rel=1e-3)
    assert [what for what, _ in told] == ["places of magnets"] * 9 + ["rounding"]
    assert told[-1][1] == 1.0
    # No other corner of a single magnet would tell more, as far as each chip sees its own alone.
    limits = Limits()
    placed = exchange(planar, sheet, AIM, limits, np.random.default_rng(0))
    corners = {
        site.magnet: next(m.corner for m in placed.magnets if m.name == site.magnet)
        for site in placed.halls
    }

    def value(chosen):
        whole = sum(
            design_information(alone_over(planar, site, chosen[site.magnet]), sheet, AIM.unmodelled)
            for site in planar.halls
        )
        return worth(whole, sheet, len(planar.halls), AIM)

    best = value(corners)
    assert best < value({m.name: m.corner for m in planar.magnets})
    assert len(set(corners.values())) == 3
    for name in corners:
        for corner in ((1, 1), (1, 5), (3, 3), (5, 1), (5, 5), (2, 4)):
            if corner not in corners.values():
                assert value(corners | {name: corner}) >= best


def test_numbers_are_rounded_to_what_a_workshop_sets(planar):
    odd = replace(
        planar,
        columns=replace(planar.columns, radius=1.518e-3, height=10.04e-3),
        frame=replace(planar.frame, stiffness=123.4),
        magnets=tuple(replace(m, radius=4.03e-3, height=2.98e-3) for m in planar.magnets),
    )
    best = find_design(odd, AIM, WITHIN, SearchEffort(seconds=0.5), lambda *told: None, ticking())
    columns = best.design.columns
    assert columns.radius in (1.5e-3, 1.55e-3)
    assert columns.height in (10.0e-3, 10.1e-3)
    assert best.design.frame.stiffness == 120.0
    for magnet in best.design.magnets:
        assert (magnet.radius, magnet.height) == (4.0e-3, 3.0e-3)
    for site in best.design.halls:
        assert site.gap / 0.05e-3 == pytest.approx(round(site.gap / 0.05e-3))


def test_variables_run_evenly_in_their_logarithms_between_their_ends(planar):
    limits = Limits()
    for part in (0.0, 0.5, 1.0, 1.5):
        varied = _varied(planar, np.full(5, part), limits)
        ends = (
            (varied.columns.radius, limits.column_radius),
            (varied.columns.height, limits.column_height),
            (varied.frame.stiffness, limits.frame_stiffness),
            (varied.magnets[1].radius, limits.magnet_radius),
            (varied.magnets[2].height, limits.magnet_height),
        )
        for value, (least, most) in ends:
            expected = [least, math.sqrt(least * most), most, most][round(2 * part)]
            assert value == pytest.approx(expected)
        assert _point(varied, limits) == pytest.approx(np.full(5, min(part, 1.0)))
    thin = replace(planar, columns=replace(planar.columns, radius=0.5e-3))
    assert _point(thin, limits)[0] == 0.0


def test_both_designs_are_compared_in_every_case(planar):
    sides = compare_bounds(
        planar, load_design("optimised"), force=0.5, unmodelled=0.005, places=COARSE
    )
    assert len(sides) == 52
    known = {(one.case, one.quantity): (one.before, one.after) for one in sides}
    for case, quantity, before, after in (
        ("all chips, drag unknown", "mean location, mm", 0.4220, 0.18052),
        ("all chips, drag unknown", "worst drag, mN", 1.86732, 0.55018),
        ("all chips, drag unknown", "super-resolution by area", 35288.2, 189067.0),
        ("all chips, no drag", "mean normal force, mN", 0.74908, 0.89292),
        ("the sheet's chips, no drag", "median location, mm", 0.26855, 0.14683),
        ("the sheet's chips, no drag", "super-resolution by spacing", 428.358, 745.741),
        (
            "all chips, drag and a share of signals unknown",
            "maximum location, mm",
            0.79596,
            0.33481,
        ),
        ("all chips, drag unknown, made skins", "mean location, mm", 0.41280, 0.17801),
    ):
        assert known[case, quantity] == pytest.approx((before, after), rel=2e-3)


@pytest.mark.slow
def test_the_same_seed_finds_the_same_design(planar):
    one, other = (
        find_design(planar, AIM, WITHIN, PLACED, lambda what, share: None, ticking())
        for _ in range(2)
    )
    assert one == other


def test_no_time_leaves_a_design_all_the_same(planar):
    told = []
    best = find_design(
        planar,
        AIM,
        WITHIN,
        SearchEffort(seconds=3.5),
        lambda what, share: told.append(what),
        ticking(),
    )
    assert math.isfinite(best.merit)
    assert len(told) == 4


@pytest.mark.slow
def test_the_comparison_is_told_in_full(planar, found, tmp_path):
    document, beside = found.write(tmp_path / "better.toml")
    read = load_design(document)
    assert read == found.after
    assert read.name == "optimised"
    told = json.loads(beside.read_text(encoding="utf-8"))
    assert told["kept"] is True
    assert told["gain"] == pytest.approx(found.gain)
    paths = {one["path"] for one in told["changes"]}
    assert "magnets.1.corner" in paths
    assert all(read.provenance[path].origin == "assumed" for path in paths)
    assert all("smoskin optimise" in read.provenance[path].reason for path in paths)
    cases = {one["case"] for one in told["bounds"]}
    assert {"all chips, drag unknown", "all chips, no drag", "the sheet's chips, no drag",
            "all chips, drag unknown, made skins"} <= cases  # fmt: skip
    quantities = {one["quantity"] for one in told["bounds"]}
    assert {"mean location, mm", "worst location, mm", "mean normal force, mN", "mean drag, mN",
            "super-resolution by area", "super-resolution by spacing"} <= quantities  # fmt: skip
    assert len(found.tables()) == 3


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
    run = CliRunner().invoke(app, [*arguments, "--json", "--force", "0.4", "--rate", "150"])
    assert run.exit_code == (0 if kept else 1), run.output
    told = json.loads(run.stdout)
    assert told["kept"] is kept
    assert told["gain"] == 2.0
    assert {one["path"] for one in told["changes"]} >= {"magnets.0.corner", "columns.radius"}
    assert asked["effort"] == SearchEffort(seconds=120, seed=3)
    assert asked["objective"] == Objective(force=0.4)
    assert asked["limits"] == Limits(rate=150.0)
    assert asked["name"] == "found"
    assert load_design(out) == load_design("optimised")
    assert json.loads(out.with_suffix(".json").read_text(encoding="utf-8")) == told
    shown = CliRunner().invoke(app, ["optimise", "--out", str(out)])
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


def test_the_setting_is_the_least_noisy_that_is_fast_enough(planar):
    for rate in (50.0, 100.0, 200.0):
        chosen = slowest_setting(planar, Limits(rate=rate))
        assert mlx90393.conversion_time(chosen, 0) * rate <= 1
        noise = float(mlx90393.noise(chosen)[0])
        for over, smooth in itertools.product(range(4), range(8)):
            other = replace(chosen, oversampling=over, digital_filter=smooth)
            if mlx90393.settles(other) and mlx90393.conversion_time(other, 0) * rate <= 1:
                assert float(mlx90393.noise(other)[0]) >= noise


def test_limits_are_kept_up_to_their_ends():
    for value, kept in ((0.35, True), (0.3500001, False), (0.2, True)):
        assert Reached(name="x", value=value, most=0.35).kept is kept
    for value, kept in ((1.0, True), (0.999, False), (7.0, True)):
        assert Reached(name="x", value=value, least=1.0).kept is kept
    assert Reached(name="x", value=0.7, most=0.35).slack == pytest.approx(-1.0)


def test_broken_limits_weigh_on_a_design(planar, sheet):
    trial = try_design(planar, sheet, AIM, Limits())
    assert trial.merit == trial.value
    strict = try_design(planar, sheet, AIM, Limits(crush=0.01))
    broken = sum(max(-one.slack, 0.0) for one in (*strict.own, *strict.stood))
    assert broken > 1
    assert strict.merit == pytest.approx(strict.value * (1 + 20 * broken))
    straight, free = (
        figures(bound_of_information(sheet.x, sheet.y, informed, 3, drags=drags).location)
        for informed in [design_information(planar, sheet, AIM.unmodelled)]
        for drags in (False, True)
    )
    both = [one.mean + AIM.worst_weight * one.worst for one in (straight, free)]
    assert trial.value == pytest.approx(np.mean(both))


def test_a_share_of_each_signal_is_unknown_by_the_inverse_square_of_the_gap(planar):
    signals = np.arange(1.0, 10.0) * 1e-4
    far = replace(planar, halls=tuple(replace(site, gap=11e-3) for site in planar.halls))
    spread = unknown_of(far, signals, 0.02)
    assert spread == pytest.approx(np.diag((0.02 / 4 * signals) ** 2))


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
    worst = {one.name: one for one in check_made(near, sheets, WITHIN)}
    assert not worst["S2 field, of its range"].kept
    assert all(one.kept for one in check_made(far, sheets, WITHIN))


def test_the_shipped_optimum_halves_the_bound(planar, sheet):
    better = load_design("optimised")
    new = PressedSheet(better, places=COARSE)
    for drags in (True, False):
        before, after = (
            figures(
                bound_of_slopes(
                    one.x, one.y, one.slopes(design)[1], signal_noise(design), drags=drags
                ).location
            )
            for one, design in ((sheet, planar), (new, better))
        )
        better_by = 2.0 if drags else 1.3
        assert after.mean < before.mean / better_by
        assert after.worst < before.worst / min(better_by, 1.5)
    reached = own_limits(better, Limits()) + stood_limits(better, new, Limits())
    assert all(one.kept for one in reached)
    assert all(one.kept for one in check_made(better, made_sheets(better, WITHIN), WITHIN))


@pytest.mark.slow
def test_a_fuller_search_halves_the_bound_on_finer_grids_and_made_skins(planar):
    better = optimise(
        planar, limits=Limits(rubbers=("Ecoflex 00-30",)), effort=SearchEffort(steps=80, rounds=1)
    )
    assert better.kept
    gains = {(one.case, one.quantity): one.gain for one in better.bounds}
    for case in ("all chips, drag unknown", "all chips, drag unknown, made skins"):
        assert gains[case, "mean location, mm"] >= 2
        assert gains[case, "worst location, mm"] >= 1.5
