"""The search for a better design, within its time and its limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

import smoskin.commands.optimise as commands
from searches_of_designs import AIM, PLACED, WITHIN, Told
from smoskin.commands.optimise import Limits, SearchEffort
from smoskin.commands.optimise.limits import alone_over
from smoskin.commands.optimise.pressed import design_information
from smoskin.commands.optimise.search import (
    Search,
    _OutOfTime,
    _point,
    _varied,
    exchange,
    try_design,
    worth,
)
from smoskin.sensing.response.bound import bound_of_information, figures


def test_magnets_are_placed_where_they_tell_most(planar, sheet):
    listener = Told()
    best = Search(planar, AIM, WITHIN, PLACED, listener, listener.clock).run()
    assert [magnet.corner for magnet in best.design.magnets] == [(5, 5), (1, 5), (5, 1)]
    assert [site.gap for site in best.design.halls] == pytest.approx([5.6e-3, 5.25e-3, 5.35e-3])
    assert best.design.hall_setting.gain_selection == 3
    assert best.merit == best.value == pytest.approx(0.2832619e-3, rel=1e-3)
    assert [what for what, _ in listener.events] == ["places of magnets"] * 9 + ["rounding"]
    assert listener.events[-1][1] == 1.0
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


@pytest.mark.slow
def test_numbers_are_rounded_to_what_a_workshop_sets(planar):
    odd = replace(
        planar,
        columns=replace(planar.columns, radius=1.518e-3, height=10.04e-3),
        frame=replace(planar.frame, clearance=1.234e-3),
        magnets=tuple(replace(m, radius=4.03e-3, height=2.98e-3) for m in planar.magnets),
    )
    listener = Told()
    best = Search(odd, AIM, WITHIN, SearchEffort(seconds=0.5), listener, listener.clock).run()
    columns = best.design.columns
    assert columns.radius in (1.5e-3, 1.55e-3)
    assert columns.height in (10.0e-3, 10.1e-3)
    assert best.design.frame.clearance == 1.25e-3
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
            (varied.frame.clearance, limits.frame_clearance),
            (varied.magnets[1].radius, limits.magnet_radius),
            (varied.magnets[2].height, limits.magnet_height),
        )
        for value, (least, most) in ends:
            expected = [least, math.sqrt(least * most), most, most][round(2 * part)]
            assert value == pytest.approx(expected)
        assert _point(varied, limits) == pytest.approx(np.full(5, min(part, 1.0)))
    thin = replace(planar, columns=replace(planar.columns, radius=0.5e-3))
    assert _point(thin, limits)[0] == 0.0


@pytest.mark.slow
def test_the_same_seed_finds_the_same_design(planar):
    first, second = (
        Search(planar, AIM, WITHIN, PLACED, listener, listener.clock).run()
        for listener in (Told(), Told())
    )
    assert first == second


def test_no_time_leaves_a_design_all_the_same(planar):
    listener = Told()
    best = Search(planar, AIM, WITHIN, SearchEffort(seconds=2.5), listener, listener.clock).run()
    assert math.isfinite(best.merit)
    assert len(listener.events) == 4


def test_broken_limits_weigh_on_a_design(planar, sheet):
    trial = try_design(planar, sheet, AIM, Limits())
    assert trial.merit == trial.value
    strict = try_design(planar, sheet, AIM, Limits(crush=0.01))
    broken = sum(max(-limit.slack, 0.0) for limit in (*strict.own, *strict.stood))
    assert broken > 1
    assert strict.merit == pytest.approx(strict.value * (1 + 20 * broken))
    straight, free = (
        figures(bound_of_information(sheet.x, sheet.y, informed, 3, drags=drags).location)
        for informed in [design_information(planar, sheet, AIM.unmodelled)]
        for drags in (False, True)
    )
    both = [bound.mean + AIM.worst_weight * bound.worst for bound in (straight, free)]
    assert trial.value == pytest.approx(np.mean(both))


@pytest.mark.parametrize(("pressing", "end"), [(1.0, 48.0), (2.0, 43.0), (0.1, 52.5)])
def test_the_search_leaves_time_by_the_measured_speed(planar, monkeypatch, pressing, end):
    """Of 90 s what follows, 37 s, four presses to round and one press more."""
    now, effort = [0.0], SearchEffort(seconds=90.0)
    search = Search(planar, AIM, WITHIN, effort, lambda *progress: None, lambda: now[0])
    search.rest = 37.0
    monkeypatch.setattr(search, "_took", [99.0, pressing, pressing])
    monkeypatch.setattr(search, "_fitted", lambda design: search._best)
    now[0] = end - 0.1
    assert search.left == pytest.approx(90 - now[0])
    search._try(planar, "in time")
    now[0] = end + 0.1
    assert not search.has_time()
    with pytest.raises(_OutOfTime):
        search._try(planar, "too late")


@pytest.mark.parametrize(
    ("minutes", "grid", "took"), [(20.0, (25, 33), 9.0), (1.0, (13, 17), 2.0), (0.2, (13, 17), 2.0)]
)
def test_what_follows_is_timed_before_the_search(planar, monkeypatch, minutes, grid, took):
    now = [3.0]
    search = Search(
        planar,
        AIM,
        WITHIN,
        SearchEffort(seconds=60 * minutes),
        lambda *progress: None,
        lambda: now[0],
    )

    def press(columns, frame):
        now[0] += 0.5
        search._took.append(0.5)

    def compare(design, places):
        now[0] += 2.0 if places == (13, 17) else 9.0
        return {("case", "quantity"): float(places[0])}

    def check(*_):
        now[0] += 1.0

    monkeypatch.setattr(search, "_pressed", press)
    monkeypatch.setattr(search, "_press", press)
    monkeypatch.setattr(commands, "made_sheets", lambda *_: [])
    monkeypatch.setattr(commands, "check_made", check)
    places, old = commands._judged_first(search, planar, WITHIN, (25, 33), compare, lambda: now[0])
    assert (places, old) == (grid, {("case", "quantity"): float(grid[0])})
    # Two made skins of a second each, and the comparison, half as long again.
    assert search.rest == pytest.approx(1.5 * (2 * 1.0 + took))
    assert search.has_time() is (minutes > 0.2)
