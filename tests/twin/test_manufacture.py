"""Draws of made skins: their spread, their repeatability, and where each deviation goes."""

from dataclasses import fields, is_dataclass, replace
from operator import attrgetter

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.errors import ArgumentError
from smoskin.mechanics.board import board_of
from smoskin.mechanics.sheet.lattice import build_lattice
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.twin.manufacture import (
    CONTACTS,
    Tolerances,
    as_designed,
    draw,
    made_mechanics,
)


def same(left: object, right: object) -> bool:
    """Whether all numbers in two records agree."""
    if not is_dataclass(left):
        return np.array_equal(left, right)
    return all(same(getattr(left, f.name), getattr(right, f.name)) for f in fields(left))


def test_the_same_stream_draws_the_same_skin_and_another_does_not(planar):
    first, same_seed, other = (draw(planar, np.random.default_rng(k)) for k in (5, 5, 6))
    assert same(first, same_seed)
    assert not same(first, other)


@pytest.mark.parametrize(
    ("of", "tolerance", "rest"),
    [
        ("remanence", "remanence", 1.0),
        ("frame", "frame_clearance", 1.0),
        ("shear_layer", "stiffness_variation", 1.0),
        ("creases", "crease_stiffness", 1.0),
        ("magnet_place", "magnet_place", 0.0),
        ("magnet_turn", "magnet_tilt", 0.0),
        ("chips.place", "chip_place", 0.0),
        ("chips.turn", "chip_tilt", 0.0),
        ("chips.sensitivity", "chip_sensitivity", 1.0),
        ("chips.zero", "chip_zero", 0.0),
        ("chips.warmth", "chip_warmth", 0.0),
    ],
)
def test_what_scatters_scatters_by_its_tolerance(planar, of, tolerance, rest):
    rng = np.random.default_rng(0)
    values = np.stack([np.asarray(attrgetter(of)(draw(planar, rng))) for _ in range(600)])
    spread = getattr(Tolerances(), tolerance)
    assert values.mean() == pytest.approx(rest, abs=0.2 * spread)
    assert values.std() == pytest.approx(spread, rel=0.1)
    assert np.abs(values - rest).max() <= 3 * spread * (1 + 1e-12)


def test_columns_scatter_one_by_one_and_together(planar):
    rng, limits = np.random.default_rng(0), Tolerances()
    columns = np.stack([draw(planar, rng).columns for _ in range(400)])
    together, apart = columns.mean(axis=(1, 2)).std(), columns.std(axis=(1, 2)).mean()
    height = limits.column_height / planar.columns.height
    assert together == pytest.approx(limits.stiffness_variation, rel=0.1)
    assert apart == pytest.approx(np.hypot(limits.column_stiffness, height), rel=0.1)


def test_without_tolerances_the_skin_is_as_designed(planar):
    lattice, board = made_mechanics(planar, as_designed(planar), 25.0)
    plain = build_lattice(planar)
    assert_allclose(board.stiffness, board_of(planar).stiffness, rtol=1e-12)
    for name in ("bar_stiffness", "hinge_stiffness", "crease_set"):
        assert_array_equal(getattr(lattice, name), getattr(plain, name))
    for part in ("supports", "stops"):
        for field in fields(getattr(plain, part)):
            made, designed = (getattr(getattr(of, part), field.name) for of in (lattice, plain))
            assert_allclose(made, designed, rtol=1e-12)


def test_each_deviation_scales_its_springs_alone(planar):
    made = draw(planar, np.random.default_rng(3))
    lattice, board = made_mechanics(planar, made, 25.0)
    plain = build_lattice(planar)
    factor, height = made.columns.ravel(), made.heights.ravel()
    assert_allclose(lattice.supports.axial, factor * plain.supports.axial, rtol=1e-12)
    # Stiffness along the axis goes with 1 / h, against sway with 1 / h^3.
    bends = factor / height**2
    assert_allclose(lattice.supports.lateral, bends * plain.supports.lateral, rtol=1e-12)
    assert_array_equal(lattice.supports.height, plain.supports.height)
    first = np.searchsorted(plain.feet, plain.stops.nodes[0])
    assert lattice.stops.stiffness[0] == pytest.approx(bends[first] * plain.stops.stiffness[0])
    assert_allclose(lattice.stops.free, made.frame * plain.stops.free, rtol=1e-12)
    assert_array_equal(lattice.bar_stiffness, plain.bar_stiffness)
    panels = plain.panel_hinges
    assert_array_equal(lattice.hinge_stiffness[:panels], plain.hinge_stiffness[:panels])
    assert_allclose(
        lattice.hinge_stiffness[panels:], made.creases * plain.hinge_stiffness[panels:], rtol=1e-12
    )
    assert_allclose(board.stiffness, made.shear_layer * board_of(planar).stiffness, rtol=1e-12)


def test_warm_rubber_is_stiffer_and_film_is_not(planar):
    cold, _ = made_mechanics(planar, as_designed(planar), 25.0)
    warm, board = made_mechanics(planar, as_designed(planar), 55.0)
    factor = float(modulus_factor(planar.columns.material, 55.0))
    assert factor > 1.05
    for part in ("lateral", "axial"):
        warmer, colder = (getattr(of.supports, part) for of in (warm, cold))
        assert_allclose(warmer, factor * colder, rtol=1e-12)
    assert_array_equal(warm.hinge_stiffness, cold.hinge_stiffness)
    assert_allclose(board.stiffness, factor * board_of(planar).stiffness, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("magnet_tilt", -0.1, r"magnet_tilt must be finite and >= 0; got -0\.1"),
        ("chip_zero", float("inf"), "chip_zero must be finite and >= 0; got inf"),
        ("column_stiffness", 0.5, r"column_stiffness must be below 0\.333; got 0\.5"),
    ],
)
def test_absurd_tolerances_are_refused(name, value, message):
    with pytest.raises(ArgumentError, match=message):
        replace(Tolerances(), **{name: value})


RELATIVE = {
    "stiffness_variation",
    "column_stiffness",
    "crease_stiffness",
    "frame_clearance",
    "remanence",
    "sector_strength",
    "chip_sensitivity",
    "chip_cross_axis",
}


@pytest.mark.parametrize("name", [field.name for field in fields(Tolerances)])
def test_no_stiffness_can_come_out_negative(name):
    """Three standard deviations below one is above zero for what is relative, and only for that."""
    assert getattr(replace(Tolerances(), **{name: 0.333}), name) == 0.333
    if name in RELATIVE:
        with pytest.raises(ArgumentError, match="must be below"):
            replace(Tolerances(), **{name: 0.334})
    else:
        replace(Tolerances(), **{name: 0.334})


def test_a_higher_column_is_softer(planar):
    none = Tolerances(**dict.fromkeys((field.name for field in fields(Tolerances)), 0.0))
    columns = draw(planar, np.random.default_rng(8), replace(none, column_height=1e-3)).columns
    rng = np.random.default_rng(8)
    rng.normal()  # the rubber's own
    higher = 1e-3 * np.clip(rng.normal(size=columns.shape), -3.0, 3.0)
    height = planar.columns.height
    assert_allclose(columns, height / (height + higher), rtol=1e-12)


def test_axes_read_of_each_other_not_of_themselves(planar):
    rng = np.random.default_rng(0)
    cross = np.stack([draw(planar, rng).chips.cross_axis for _ in range(400)])
    own = np.eye(3, dtype=bool)
    assert not cross[..., own].any()
    assert cross[..., ~own].std() == pytest.approx(Tolerances().chip_cross_axis, rel=0.1)


def test_each_skin_draws_its_own_contact(planar):
    """And all else as it would without."""
    wide = replace(Tolerances(), contact=1.0)
    laws = [draw(planar, np.random.default_rng(seed), wide).contact for seed in range(20)]
    for name, (low, high) in CONTACTS.items():
        values = np.array([getattr(law, name) for law in laws])
        assert ((low <= values) & (values <= high)).all()
        assert np.ptp(values) > 0.5 * (high - low)
    usual, other = (draw(planar, np.random.default_rng(3), how) for how in (None, wide))
    assert usual.contact is None
    assert_array_equal(usual.columns, other.columns)
    assert_array_equal(usual.chips.zero, other.chips.zero)
    near = draw(planar, np.random.default_rng(3), replace(Tolerances(), contact=1e-6)).contact
    assert (near.spread, near.rim) == (pytest.approx(0, abs=1e-8), pytest.approx(1, abs=1e-6))
    with pytest.raises(ArgumentError, match=r"contact must lie in \[0, 1\]; got 1.1"):
        replace(Tolerances(), contact=1.1)
