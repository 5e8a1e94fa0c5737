"""Sweeps: every press once, the same rows in the same chunk whoever asks."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smoskin.datasets.patterns import (
    Grid,
    Pairs,
    Random,
    Repeated,
    Sweep,
    format_sweep,
    parse_sweep,
    sideways,
)
from smoskin.errors import ArgumentError, RecordingError
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sliding
from smoskin.origami.geometry import geometry
from smoskin.twin.manufacture import Tolerances

TENTHS = tuple(k / 10 for k in range(1, 11))


def all_touches(sweep, design):
    """Position and force of every row, in order."""
    parts = [sweep.touches(design, chunk) for chunk in range(sweep.chunks)]
    return (
        np.concatenate([part.position for part in parts]),
        np.concatenate([part.force for part in parts]),
    )


def test_the_grid_of_the_paper(planar):
    position, force = all_touches(Sweep(presses=Grid(forces=TENTHS)), planar)
    assert position.shape == (8250, 1, 2)
    xs, ys = (np.unique(position[:, 0, axis].round(9)) for axis in (0, 1))
    assert xs == pytest.approx(np.arange(25) * 5e-3, abs=2e-6)
    assert ys == pytest.approx(np.arange(33) * 5e-3, abs=2e-6)
    assert (force[:, 0, :2] == 0).all()
    assert np.unique(force[:, 0, 2]).tolist() == sorted(-tenth for tenth in TENTHS)


@settings(max_examples=30)
@given(
    places=st.tuples(st.integers(2, 5), st.integers(2, 5)),
    forces=st.lists(st.floats(0, 5), min_size=1, max_size=4, unique=True),
    drags=st.integers(1, 3),
    per_chunk=st.integers(1, 70),
)
def test_a_grid_presses_every_combination_once(planar, places, forces, drags, per_chunk):
    pattern = Grid(places=places, forces=tuple(forces), drags=sideways([0.2], drags))
    sweep = Sweep(presses=pattern, presses_per_chunk=per_chunk)
    position, force = all_touches(sweep, planar)
    seen = {(*p, *f) for p, f in zip(position[:, 0].tolist(), force[:, 0].tolist(), strict=True)}
    assert len(seen) == len(position) == pattern.count == np.prod(places) * len(forces) * drags


def test_pairs_press_every_combination_once(planar):
    pattern = Pairs(places=(2, 3), forces=(0.1, 0.3))
    position, force = all_touches(Sweep(presses=pattern, presses_per_chunk=17), planar)
    seen = {(*p, *f) for p, f in zip(position.reshape(-1, 4).tolist(),
                                     force.reshape(-1, 6).tolist(), strict=True)}  # fmt: skip
    assert len(seen) == pattern.count == (6 * 2) ** 2
    assert Pairs(forces=(0.5,)).count == 680_625


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32),
    most=st.integers(1, 3),
    margin=st.floats(0, 0.05),
    high=st.floats(0.2, 5),
    wide=st.floats(0.002, 0.01),
)
def test_random_presses_keep_within_bounds(planar, seed, most, margin, high, wide):
    pattern = Random(count=60, forces=(0.1, high), drags=(0.05, 0.1), radius=(0.001, wide),
                     touches_at_once=(1, most), margin=margin)  # fmt: skip
    touches = Sweep(presses=pattern, seed=seed).touches(planar, 0)
    inside = touches.position[..., 0]
    assert ((inside >= margin) & (inside <= 0.12 - margin + 1e-6)).all()
    pressed = touches.pressed
    assert pressed[:, 0].all()
    assert (np.diff(pressed.astype(int), axis=1) <= 0).all()
    force = touches.force[pressed]
    assert ((-force[:, 2] >= 0.1) & (-force[:, 2] <= high)).all()
    drag = np.hypot(force[:, 0], force[:, 1])
    assert ((drag >= 0.05 - 1e-12) & (drag <= 0.1 + 1e-12)).all()
    assert ((touches.radius >= 0.001) & (touches.radius <= wide)).all()


def test_repeated_presses_are_the_same_on_every_skin_at_every_temperature(planar):
    presses = Repeated(count=4000, forces=(0.05, 1.15), drag=0.6, seed=3)
    sweep = Sweep(presses=presses, temperatures=(15.0, 35.0), skins=(4, 9), presses_per_chunk=1500)
    position, force = all_touches(sweep, planar)
    for values in (position, force):
        assert (values.reshape(4, 4000, -1) == values[:4000].reshape(4000, -1)).all()
    # All over the skin, two in five straight, the others dragged evenly over a disc.
    place, force = position[:4000, 0], force[:4000, 0]
    assert place.min(axis=0) == pytest.approx([0, 0], abs=2e-4)
    assert place.max(axis=0) == pytest.approx(geometry(planar).extent, abs=2e-4)
    assert (force[:, 2].min(), force[:, 2].max()) == pytest.approx((-1.15, -0.05), abs=2e-3)
    drag = np.hypot(force[:, 0], force[:, 1])
    assert (drag == 0).mean() == pytest.approx(0.4, abs=0.03)
    assert drag.max() == pytest.approx(0.6, abs=2e-3)
    assert np.mean(drag[drag > 0] ** 2) == pytest.approx(0.6**2 / 2, rel=0.05)
    assert np.abs(force[:, :2].mean(axis=0)).max() < 0.03
    other = replace(presses, seed=4).touches(planar, np.arange(2), np.random.default_rng(0))
    assert (other.position[:, 0] != place[:2]).all()


def test_repeated_pairs_are_straight_and_apart(planar):
    presses = Repeated(count=500, forces=(0.05, 1.15), apart=0.03)
    position, force = all_touches(Sweep(presses=presses), planar)
    assert position.shape == (500, 2, 2)
    assert not force[..., :2].any()
    assert (force[..., 2].min(), force[..., 2].max()) == pytest.approx((-1.15, -0.05), abs=0.02)
    apart = np.hypot(*(position[:, 0] - position[:, 1]).T).min()
    assert 0.03 <= apart == pytest.approx(0.03, rel=0.05)


def test_random_presses_are_spread_evenly(planar):
    touches = Sweep(presses=Random(count=4000), presses_per_chunk=4000).touches(planar, 0)
    counts, _, _ = np.histogram2d(*touches.position[:, 0].T, bins=5, range=[[0, 0.12], [0, 0.16]])
    assert ((counts - 160) ** 2 / 160).sum() < 60  # chi-squared of 24 degrees, far in the tail


def test_a_chunk_is_the_same_whenever_it_is_asked_for(planar):
    sweep = Sweep(presses=Random(count=100), presses_per_chunk=30, seed=3)
    late = sweep.touches(planar, 2)
    early = [sweep.touches(planar, chunk) for chunk in (0, 1, 2, 3)][2]
    assert np.array_equal(late.position, early.position)
    assert np.array_equal(late.force, early.force)
    assert sweep.noise(2).normal() == sweep.noise(2).normal()
    others = [sweep.touches(planar, 1), replace(sweep, seed=4).touches(planar, 2)]
    assert all(not np.array_equal(late.position, other.position) for other in others)
    assert sweep.noise(2).random() != sweep.noise(1).random() != late.position[0, 0, 0]


def test_chunks_are_cut_by_skin_and_temperature():
    sweep = Sweep(
        presses=Grid(places=(2, 5), forces=(0.5,)),
        temperatures=(25.0, 35.0, 45.0),
        skins=(7, 9),
        presses_per_chunk=4,
    )
    assert sweep.chunks == 2 * 3 * 3
    assert [len(sweep.rows_of(chunk)) for chunk in range(6)] == [4, 4, 2, 4, 4, 2]
    rows = [row for chunk in range(sweep.chunks) for row in sweep.rows_of(chunk)]
    assert rows == list(range(sweep.rows)) == list(range(60))
    assert [sweep.skin(chunk) for chunk in (0, 8, 9, 17)] == [7, 7, 9, 9]
    assert [sweep.temperature(chunk) for chunk in (0, 2, 3, 6, 9)] == [25, 25, 35, 45, 25]
    with pytest.raises(ArgumentError, match=r"chunk must lie in 0\.\.17; got 18"):
        sweep.rows_of(18)


SWEEPS = (
    Sweep(presses=Grid(forces=TENTHS, drags=sideways([0.1, 0.2], 5), radius=3.3e-3)),
    Sweep(presses=Pairs(forces=(0.1, 0.7), places=(3, 4)), temperatures=(20.1, 30.7)),
    Sweep(presses=Random(count=9, drags=(0.0, 0.3), touches_at_once=(1, 2), margin=1e-3), seed=5),
    Sweep(presses=Grid(forces=(0.5,)), mechanics="reduced"),
    Sweep(presses=Grid(forces=(0.5,)), grip=Sliding(friction=0.3), skins=(1, 2, 3)),
    Sweep(presses=Grid(forces=(0.5,)), grip=Frictionless(), presses_per_chunk=7),
    Sweep(presses=Grid(forces=(0.5,)), grip=Covered()),
    Sweep(presses=Repeated(count=3, forces=(0.1, 1.0), drag=0.5, apart=0.03, seed=4)),
    Sweep(presses=Repeated(count=3, forces=(0.1, 1.0)), skins=(1,),
          tolerances=Tolerances(remanence=0.01, magnet_tilt=0.02, chip_zero=3e-6)),
)  # fmt: skip


@pytest.mark.parametrize("sweep", SWEEPS)
def test_a_sweep_is_read_back_from_its_document(sweep):
    document = json.loads(json.dumps(format_sweep(sweep)))
    assert parse_sweep(document) == sweep
    assert parse_sweep(document).content_hash == sweep.content_hash


def test_documents_name_their_units():
    document = format_sweep(SWEEPS[0])
    assert document["temperatures_degC"] == [25.0]
    assert document["presses"]["kind"] == "grid"
    assert document["presses"]["radius_mm"] == 3.3
    assert document["presses"]["forces_N"] == list(TENTHS)


def test_whatever_changes_the_rows_changes_the_hash():
    base = Sweep(presses=Random(count=9))
    others = [
        replace(base, seed=1),
        replace(base, temperatures=(26.0,)),
        replace(base, skins=(0,)),
        replace(base, mechanics="reduced"),
        replace(base, grip=Frictionless()),
        replace(base, presses_per_chunk=8),
        replace(base, presses=Random(count=10)),
        replace(base, presses=Random(count=9, margin=1e-3)),
        replace(base, presses=Grid(forces=(0.1,), places=(3, 3))),
        *SWEEPS,
    ]
    hashes = {sweep.content_hash for sweep in (base, *others)}
    assert len(hashes) == 1 + len(others)


@pytest.mark.parametrize(
    "damage",
    [
        {"presses": {"kind": "spiral"}},
        {"presses": 3},
        {"presses": {"kind": "sliding", "friction": 0.5}},
        {"grip": "sticky"},
        {"colour": "red"},
        {"seed": -1},
        {"temperatures_degC": ["warm"]},
    ],
)
def test_what_describes_no_sweep_is_refused(damage):
    where = next(iter(damage)).removesuffix("_degC")
    with pytest.raises(RecordingError, match=where):
        parse_sweep(format_sweep(SWEEPS[0]) | damage)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Grid(forces=()), "forces must name at least one; got none"),
        (lambda: Grid(forces=(0.5, 51.0)), "forces must lie in 0..50 N; got 51"),
        (lambda: Grid(forces=(-0.5,)), "forces must lie in 0..50 N; got -0.5"),
        (lambda: Grid(forces=(float("nan"),)), "forces must lie in 0..50 N; got nan"),
        (lambda: Grid(forces=(1.0,), places=(1, 33)), "places must be two numbers of at least 2"),
        (lambda: Grid(forces=(1.0,), drags=((60.0, 0.0),)), "drags must lie in -50..50 N; got 60"),
        (lambda: Grid(forces=(1.0,), drags=()), "drags must name at least one"),
        (lambda: Grid(forces=(1.0,), radius=0.0), "radius must lie in 0.0001..0.05 m; got 0"),
        (lambda: Pairs(forces=(99.0,)), "forces must lie in 0..50 N; got 99"),
        (lambda: Random(count=0), "count must be at least 1; got 0"),
        (lambda: Random(count=1, forces=(1.0, 0.5)), "forces must be from and to, rising"),
        (lambda: Random(count=1, touches_at_once=(0, 1)), "touches_at_once must be at least 1"),
        (lambda: Random(count=1, touches_at_once=(2, 1)), "touches_at_once must be from and to"),
        (lambda: Repeated(count=0, forces=(0.1, 1.0)), "count must be at least 1; got 0"),
        (lambda: Repeated(count=1, forces=(1.0, 0.1)), "forces must be from and to, rising"),
        (lambda: Repeated(count=1, forces=(0.1, 1.0), drag=60.0), "drag must lie in 0..50 N"),
        (lambda: Random(count=1, margin=-1.0), "margin must lie in 0..inf m; got -1"),
        (lambda: sideways([0.1], 0), "directions must be at least 1; got 0"),
    ],
)
def test_absurd_patterns_are_refused_by_name(make, message):
    with pytest.raises(ArgumentError) as refused:
        make()
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"temperatures": (25.0, 90.0)}, "temperatures must lie in -40..75 degC; got 90"),
        ({"temperatures": ()}, "temperatures must name at least one"),
        ({"presses_per_chunk": 0}, "presses_per_chunk must be at least 1; got 0"),
        ({"seed": -1}, "seed must be at least 0; got -1"),
        ({"skins": (1, -2)}, "skins must be at least 0; got -2"),
        ({"skins": (1, 1)}, "skins must differ"),
        ({"mechanics": "magic"}, "mechanics must be whole or reduced; got 'magic'"),
        ({"mechanics": "reduced", "skins": (1,)}, "skins must be left out with reduced"),
        ({"mechanics": "reduced", "grip": Covered()}, "grip must be left out with reduced"),
    ],
)
def test_absurd_sweeps_are_refused_by_name(change, message):
    with pytest.raises(ArgumentError) as refused:
        Sweep(presses=Grid(forces=(0.5,)), **change)
    assert message in str(refused.value)


def test_a_margin_wider_than_the_skin_is_refused(planar):
    with pytest.raises(ArgumentError, match="margin must be at most half the skin"):
        Sweep(presses=Random(count=1, margin=0.07)).touches(planar, 0)
