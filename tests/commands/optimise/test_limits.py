"""Limits of what can be made and of what a skin must stand."""

import itertools
import math
from dataclasses import replace

import pytest

from smoskin.commands.optimise import Limits
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
from smoskin.commands.optimise.pressed import PressedSheet
from smoskin.magnetics import mlx90393


def test_the_reference_design_keeps_every_limit(planar, sheet):
    reached = own_limits(planar, Limits()) + stood_limits(planar, sheet, Limits())
    assert all(limit.kept for limit in reached)
    assert sheet.stands()


@pytest.mark.parametrize(
    ("part", "change", "name"),
    [
        ("columns", {"radius": 0.9e-3}, "columns.radius, mm"),
        ("columns", {"height": 21e-3}, "columns.height, mm"),
        ("frame", {"clearance": 0.2e-3}, "frame.clearance, mm"),
        ("hall_setting", {"oversampling": 3}, "readings a second"),
        ("hall_setting", {"gain_selection": 7}, "feasible"),
    ],
)
def test_a_broken_limit_is_named(planar, part, change, name):
    other = replace(planar, **{part: replace(getattr(planar, part), **change)})
    broken = [limit.name for limit in own_limits(other, Limits()) if not limit.kept]
    assert name in broken


def test_a_rated_touch_breaks_what_is_too_soft_or_too_near(planar):
    slender = replace(planar, columns=replace(planar.columns, radius=2e-3))
    near = tuple(replace(site, gap=4.6e-3) for site in slender.halls)
    slender = replace(slender, halls=near)
    sheet = PressedSheet(slender, places=(2, 2))
    broken = [limit.name for limit in stood_limits(slender, sheet, Limits()) if not limit.kept]
    assert "column's buckling load, of its load" in broken
    assert "S2 field, of what is allowed" in broken
    assert {"rim's sway, of its height", "rim's sway, of the way to the frame"} <= set(broken)


def test_slack_is_a_share_of_the_limit():
    both = Reached(name="x", value=2.0, least=1.0, most=4.0)
    assert both.slack == pytest.approx(0.5)
    assert both.kept
    assert not Reached(name="x", value=5.0, most=4.0).kept
    assert not Reached(name="x", value=math.nan, most=4.0).kept


def test_limits_are_kept_up_to_their_ends():
    for value, kept in ((0.35, True), (0.3500001, False), (0.2, True)):
        assert Reached(name="x", value=value, most=0.35).kept is kept
    for value, kept in ((1.0, True), (0.999, False), (7.0, True)):
        assert Reached(name="x", value=value, least=1.0).kept is kept
    assert Reached(name="x", value=0.7, most=0.35).slack == pytest.approx(-1.0)


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


def test_the_setting_is_the_least_noisy_that_is_fast_enough(planar):
    for rate in (50.0, 100.0, 200.0):
        chosen = slowest_setting(planar, Limits(rate=rate))
        assert mlx90393.conversion_time(chosen, 0) * rate <= 1
        noise = float(mlx90393.noise(chosen)[0])
        for over, smooth in itertools.product(range(4), range(8)):
            other = replace(chosen, oversampling=over, digital_filter=smooth)
            if mlx90393.settles(other) and mlx90393.conversion_time(other, 0) * rate <= 1:
                assert float(mlx90393.noise(other)[0]) >= noise


def test_a_column_too_short_for_what_manufacture_needs_breaks_a_limit(planar):
    frame = replace(planar.frame, held_height=4e-3)
    short = replace(planar, columns=replace(planar.columns, height=8.5e-3), frame=frame)
    sheet = PressedSheet(short, places=(2, 2))
    fitted = fit_gaps(short, sheet, Limits())
    slip, stronger, _ = made_allowance(Limits())
    for chip, site in enumerate(fitted.halls):
        nearer = replace(site, gap=site.gap - slip)
        alone = alone_over(replace(fitted, halls=(nearer,)), nearer)
        seen = largest_field(alone, sheet.rated(alone))[0]
        used = (stronger * seen / allowed_field(short, Limits())).max()
        assert used < 1.01, chip  # the gap is solved for to a micrometre
    broken = [limit.name for limit in own_limits(fitted, Limits()) if not limit.kept]
    assert "M2's holder wall, mm" in broken
