"""Touches drawn from a response table: what they are the mean and the scatter of."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.magnetics.nonlinearity import cross_signals, field_curvature
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.sensing.network.samples import TouchSource, TouchSpread, Turns
from smoskin.sensing.signals.signals import signal_noise
from smoskin.sensing.signals.turning import turning
from tables_of_response import plain, table_with_modes

QUIET = {"drift": 0.0, "temperatures": (25.0, 25.0)}


@pytest.fixture(scope="module")
def table(planar):
    return table_with_modes(plain(planar))


def without_scatter(table):
    return replace(
        table,
        modes=table.modes[:0],
        grip_modes=table.grip_modes[:0],
        misfit=np.zeros_like(table.misfit),
    )


def test_without_scatter_they_are_the_tables_own_answers(table):
    exact = without_scatter(table)
    source = TouchSource(exact, 1e-20 * np.eye(9), TouchSpread(drag=0.4, **QUIET))
    drawn = source.draw(np.random.default_rng(0), 20, 30)
    expected = exact.signals(drawn.values[:, :2], drawn.values[:, 2:])
    assert drawn.signals == pytest.approx(expected, rel=1e-4, abs=1e-8)


def test_softening_is_left_to_the_model_and_warmth_is_not(table):
    exact = replace(without_scatter(table), softening=0.01, warmth=1e-3 * table.mean)
    warm = TouchSpread(drift=0.0, temperatures=(35.0, 35.0))
    drawn = TouchSource(exact, 1e-20 * np.eye(9), warm).draw(np.random.default_rng(0), 4, 9)
    force = drawn.values[:, 2:].astype(float)
    # A force that is so much larger on rubber that is so much stiffer.
    expected = exact.signals(drawn.values[:, :2], 1.1 * force, 35.0)
    assert drawn.signals == pytest.approx(expected, rel=1e-4, abs=1e-8)


def test_creep_that_is_undone_leaves_what_is_not_proportional(table):
    """Of the answer to a weaker motion, taken up to full motion in proportion."""
    exact, prony = without_scatter(table), Prony(moduli=[0.2], times=[1.0])
    source = TouchSource(exact, 1e-20 * np.eye(9), TouchSpread(**QUIET), prony)
    drawn = source.draw(np.random.default_rng(0), 10, 10)
    where, force = drawn.values[:, :2], drawn.values[:, 2:].astype(float)
    late = float(prony.retardation_shares.sum())
    settled = exact.signals(where, force)
    prompt = exact.signals(where, (1 - late) * force) / (1 - late)
    # About settled: along the way from one to the other, nearly straight, half of it either way.
    way = prompt - settled
    share = ((drawn.signals - settled) * way).sum(axis=1) / (way * way).sum(axis=1)
    assert -0.52 < share.min() < -0.4
    assert 0.4 < share.max() < 0.52


def test_their_scatter_is_that_of_skins_misfit_and_noise(table, planar):
    noise = signal_noise(planar)
    rough = replace(table, misfit=np.diag(np.arange(1, 10) * 1e-12))
    spread = TouchSpread(margin=0.0, **QUIET)
    source = TouchSource(rough, noise, spread)
    drawn = source.draw(np.random.default_rng(1), 3000, 4)
    where, force = drawn.values[:, :2].astype(float), drawn.values[:, 2:].astype(float)
    ways = rough.mode_signals(where, force)
    size = (force**2).sum(axis=1)[:, None, None]
    spread = noise + size * rough.misfit + np.einsum("bkc,bkd->bcd", ways, ways)
    apart = drawn.signals - rough.signals(where, force)
    squared = np.einsum("bi,bij,bj->b", apart, np.linalg.inv(spread), apart)
    assert squared.mean() == pytest.approx(9, rel=0.03)
    # Touches of one skin go together.
    white = np.linalg.solve(np.linalg.cholesky(spread), apart[..., None])[..., 0]
    together = (white[::4] * white[1::4]).mean()
    assert together > 0.05


def test_a_skin_on_an_arm_adds_what_its_zero_lacks_and_what_it_bends_amiss(table, planar):
    noise, curvature = 1e-5 * signal_noise(planar), field_curvature(planar)
    exact, pattern = without_scatter(table), turning(planar).whole
    turns = Turns(pattern, curvature)
    source = TouchSource(exact, noise, TouchSpread(margin=0.0, **QUIET), None, turns)
    drawn = source.draw(np.random.default_rng(1), 2000, 6)
    signals = exact.signals(drawn.values[:, :2], drawn.values[:, 2:].astype(float))
    # A turn of random size moves along its pattern; a twentieth of what it adds is amiss, alike
    # along a chip's three axes.
    rng, amiss = np.random.default_rng(2), np.zeros((len(signals), 9))
    for moved in rng.multivariate_normal(np.zeros(9), pattern, 200):
        added = cross_signals(curvature, np.broadcast_to(moved, signals.shape), signals)
        each = (added.reshape(-1, 3, 3) ** 2).mean(axis=2).repeat(3, axis=1)
        amiss += 0.05**2 * each / 200
    spread = noise + 0.01**2 * pattern + amiss[:, :, None] * np.eye(9)
    apart = drawn.signals - signals
    squared = np.einsum("bi,bij,bj->b", apart, np.linalg.inv(spread), apart)
    assert squared.mean() == pytest.approx(9, rel=0.1)
    known = np.linalg.inv(noise + 0.01**2 * pattern)
    assert np.einsum("bi,ij,bj->b", apart, known, apart).mean() > 1.15 * 9


def test_they_lie_where_they_are_told_to(table):
    spread = TouchSpread(drag=0.5, straight=0.25, margin=2e-3)
    drawn = TouchSource(table, np.eye(9) * 1e-12, spread).draw(np.random.default_rng(2), 100, 64)
    low, high = drawn.values[:, :2].min(axis=0), drawn.values[:, :2].max(axis=0)
    assert low == pytest.approx([-0.002, -0.002], abs=2e-4)
    assert high == pytest.approx(table.basis.extent + 0.002, abs=2e-4)
    drag = np.hypot(drawn.values[:, 2], drawn.values[:, 3])
    assert drag.max() == pytest.approx(0.5, abs=0.01)
    assert np.mean(drag == 0) == pytest.approx(0.25, abs=0.02)
    force = -drawn.values[:, 4]
    assert table.forces[0] - 1e-6 <= force.min()
    assert force.max() <= table.forces[1] + 1e-6


def test_the_same_seed_draws_the_same_and_the_hash_tells_what_was_drawn_from(table):
    source = TouchSource(table, np.eye(9) * 1e-12)
    first, again = (source.draw(np.random.default_rng(5), 20, 3) for _ in range(2))
    assert np.array_equal(first.signals, again.signals)
    others = [
        TouchSource(table, np.eye(9) * 2e-12),
        TouchSource(table, np.eye(9) * 1e-12, TouchSpread(drag=0.1)),
        TouchSource(replace(table, mean=1.001 * table.mean), np.eye(9) * 1e-12),
        TouchSource(table, np.eye(9) * 1e-12, None, Prony(moduli=[0.2], times=[1.0])),
        TouchSource(table, np.eye(9) * 1e-12, TouchSpread(arm=True)),
    ]
    assert TouchSource(table, np.eye(9) * 1e-12).sha256() == source.sha256()
    assert len({each.sha256() for each in (source, *others)}) == 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"margin": -1.0}, "margin"),
        ({"drag": np.inf}, "drag"),
        ({"drift": np.nan}, "drift"),
        ({"straight": 1.5}, "straight"),
        ({"uneven": -0.1}, "uneven"),
        ({"temperatures": (30.0, 20.0)}, "temperatures must rise"),
    ],
)
def test_wrong_use_is_refused(change, message):
    with pytest.raises(ArgumentError, match=message):
        TouchSpread(**change)
