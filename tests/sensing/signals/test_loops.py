"""Loops: hysteresis undone, and learned from what touches leave behind."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.sensing.signals.loops import PLAYS, Loops, Unlooping, elastic_signals, learn_loops

REACH = np.array([4e-3, 1e-3, 2e-3])
WEIGHTS = np.array([0.0, 0.05, 0.05, 0.0, 0.05, 0.02])
NOISE = np.full(3, 1e-6)


def loops(weights=WEIGHTS, plays=PLAYS, reach=REACH) -> Loops:
    return Loops(weights=weights, plays=plays, reach=reach)


def looped(own: Loops, elastic, start=0.0) -> np.ndarray:
    """Signals of a skin with these loops, play by play and signal by signal."""
    out = np.array(elastic, dtype=float)
    for c, reach in enumerate(own.reach):
        begun = np.broadcast_to(start, own.plays.shape)
        for weight, share, begin in zip(own.weights[:, c], own.plays, begun, strict=True):
            state, width = begin * share * reach, share * reach
            for row, x in enumerate(np.asarray(elastic)[:, c]):
                state = max(x - width, min(x + width, state))
                out[row, c] += weight * (state - x)
    return out


def bouc_wen(elastic, share=0.15, width=0.1) -> np.ndarray:
    """Another law: friction z takes off, y = x - a z with dz = (1 - sign(z dx) |z| / z_u) dx."""
    out = np.array(elastic, dtype=float)
    for c, reach in enumerate(REACH):
        z, last, most = 0.0, 0.0, width * reach
        for row, x in enumerate(np.asarray(elastic)[:, c]):
            for step in np.full(200, (x - last) / 200):
                z += (1 - np.sign(z * step) * abs(z) / most) * step
            last = x
            out[row, c] -= share * z
    return out


def touches(count=60, seed=0) -> np.ndarray:
    """Rest and touch in turn, (2 N, 3)."""
    rng = np.random.default_rng(seed)
    elastic = np.zeros((2 * count, 3))
    elastic[1::2] = REACH * rng.uniform(-1, 1, (count, 3)) * rng.uniform(0.1, 1, (count, 1))
    return elastic


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=20), st.floats(-1.0, 1.0), st.integers(0, 9)
)
def test_whatever_happened_is_undone_once_the_plays_have_met(shares, start, seed):
    """A swing by twice the widest play to either side makes the past known."""
    weights = np.random.default_rng(seed).dirichlet(np.ones(6)) * 0.3
    own = loops(weights)
    elastic = np.outer([1.0, -1.0, 0.0, *shares], REACH)
    skin = Unlooping(own)
    undone = np.array([skin.step(read) for read in looped(own, elastic, start)])
    assert_allclose(undone[2:], elastic[2:], atol=2e-8)
    spread = skin.covariance.diagonal()
    assert not spread.any() or (spread <= (0.3 * REACH) ** 2).all()


def test_what_is_not_known_of_the_past_is_said():
    """Plays that began anywhere: their mean, and how far the truth may be from it."""
    own = loops()
    elastic = np.outer([0.05, 0.15, -0.1, 0.3, -0.3, 0.0], REACH)
    starts = np.random.default_rng(1).uniform(-1, 1, (400, 6))
    off, spread = [], []
    for start in starts:
        skin, read = Unlooping(own), looped(own, [np.zeros(3), *elastic], start)
        rows = []
        for row in read[1:] - read[0]:
            rows.append(skin.step(row))
            spread.append(np.sqrt(skin.covariance.diagonal()))
        off.append(np.array(rows) - elastic)
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    stated = np.mean(np.reshape(spread, (len(starts), len(elastic), 3)), axis=0)
    assert (rms < 1.3 * stated).all()
    assert (rms > 0.8 * stated).all()
    assert (stated[0] < 0.02 * REACH).all()


def test_rest_makes_what_is_unknown_part_of_the_zero():
    skin = Unlooping(loops())
    skin.step(0.1 * REACH)
    assert (skin.covariance.diagonal() > 0).all()
    skin.rest()
    assert not skin.covariance.any()


def test_a_zero_is_taken_of_what_touches_left():
    own = loops()
    read = looped(own, np.outer([0.0, 1.0, -1.0, 1.0, 0.0], REACH))
    skin = Unlooping(own)
    for row in read:
        skin.step(row)
    assert (np.abs(read[-1]) > 5e-3 * REACH).all()
    skin.zero()
    assert_allclose(skin.step(np.zeros(3)), 0.0, atol=1e-8)
    assert_allclose(skin.step(looped(own, np.outer([1, -1, 1, 0, 0.5], REACH))[-1] - read[-1]),
                    0.5 * REACH, atol=1e-8)  # fmt: skip
    skin.reset()
    assert_allclose(skin.step(np.zeros(3)), 0.0, atol=1e-12)


@pytest.mark.parametrize("start", [0.0, 0.7])
def test_loops_are_learned_from_what_touches_leave(start):
    elastic, rng = touches(), np.random.default_rng(3)
    read = looped(loops(), elastic, start)
    read = read - read[0] + rng.normal(size=read.shape) * 1e-6
    own = learn_loops(read[::2], read[1::2], NOISE)
    fresh = touches(seed=9)
    again = looped(loops(), fresh, start)
    rests, held = elastic_signals(own, again[::2] - again[0], again[1::2] - again[0])
    before = np.abs(again[1::2] - again[0] - fresh[1::2]).max(axis=0)
    # All but the zero, of which it is not known how much an earlier past had left.
    wrong, raw = np.ptp(rests[20:], axis=0), np.ptp(again[40::2], axis=0)
    assert (wrong < 0.12 * raw).all()
    off = (held - fresh[1::2] - rests)[20:]
    assert (np.abs(off).max(axis=0) < 0.2 * before).all()


def test_another_law_of_hysteresis_is_undone_in_the_main():
    read = bouc_wen(touches())
    own = learn_loops(read[::2], read[1::2], NOISE)
    read = bouc_wen(touches(seed=9))
    rests, _ = elastic_signals(own, read[::2], read[1::2])
    left, more = (np.sqrt((part[10:] ** 2).mean()) for part in (rests, read[::2]))
    assert left < 0.35 * more


def test_without_hysteresis_nothing_is_learned():
    for seed in range(20):
        read = touches(seed=seed)
        read += np.random.default_rng(seed).normal(size=read.shape) * 1e-6
        assert not learn_loops(read[::2], read[1::2], NOISE).weights.any()


def test_loops_too_wide_are_learned_as_wide_as_they_may_be():
    elastic = touches()
    read = elastic.copy()
    read[2::2] = 0.5 * elastic[1:-1:2]
    assert learn_loops(read[::2], read[1::2], NOISE).weights.sum(axis=0).max() < 0.4


def test_values_go_through_json_and_signals_are_chosen():
    own = loops()
    again = Loops.from_json(own.as_json())
    for name in ("weights", "plays", "reach"):
        assert_allclose(getattr(again, name), getattr(own, name), rtol=0)
    assert Loops.from_json(None) is None
    assert_allclose(own.of_signals([2, 0]).reach, REACH[[2, 0]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": -WEIGHTS}, "weights must be >= 0 with a sum below 0.4"),
        ({"weights": np.full(6, 0.07)}, "weights must be >= 0 with a sum below 0.4"),
        ({"reach": [0.0, 1.0, 1.0]}, "reach must be positive"),
        ({"plays": [0.0, 1, 2, 3, 4, 5]}, "plays must be positive"),
        ({"plays": [0.1]}, "plays must have shape"),
    ],
)
def test_wrong_loops_are_refused(change, message):
    with pytest.raises(ArgumentError, match=message):
        loops(**change)


def test_each_chip_has_loops_of_its_own():
    """A sheet that loses more than the board: of two chips' signals, only one's stay behind."""
    elastic, rng = np.hstack([touches(), touches(seed=1)]), np.random.default_rng(3)
    still = np.repeat([WEIGHTS, 0 * WEIGHTS], 3, axis=0).T
    both = Loops(weights=still, plays=PLAYS, reach=np.tile(REACH, 2))
    read = looped(both, elastic) + rng.normal(size=elastic.shape) * 1e-6
    own = learn_loops(read[::2], read[1::2], np.tile(NOISE, 2))
    assert not own.weights[:, 3:].any()
    assert_allclose(PLAYS @ own.weights[:, :3], PLAYS @ WEIGHTS, rtol=0.15)
    assert_allclose(Loops(weights=WEIGHTS, plays=PLAYS, reach=REACH).weights, still[:, :3])


def test_loops_of_motions_that_chips_mix_are_learned_along_these_motions():
    """Each motion loses on its own; a chip's signals are sums of them, their plays are not."""
    rng, mix = np.random.default_rng(5), np.array([[1.0, 0.6, 0.0], [-0.5, 1.0, 0.4], [0, -0.7, 1]])
    elastic = touches()
    moved = looped(loops(), elastic)
    read = (moved - moved[0]) @ mix.T + rng.normal(size=moved.shape) * 1e-6
    fresh = touches(seed=9)
    again = (looped(loops(), fresh)) @ mix.T
    left = []
    for axes in (None, np.linalg.inv(mix)[None]):
        own = learn_loops(read[::2], read[1::2], NOISE, axes)
        own = Loops.from_json(own.as_json()).of_signals([0, 1, 2])
        rests, held = elastic_signals(own, again[::2], again[1::2])
        left.append(np.sqrt(((held - rests - fresh[1::2] @ mix.T)[20:] ** 2).mean()))
    assert left[1] < 0.5 * left[0]


def of_three_chips(weights, mixed=0.0, seed=2) -> tuple[np.ndarray, np.ndarray]:
    """Reads and elastic signals (2 N, 9) of chips with these weights (6, 3).

    The first chip mixes in what another motion leaves, a share `mixed` of its own size.
    """
    rng = np.random.default_rng(seed)
    elastic = np.concatenate([touches(seed=seed + k) for k in range(3)], axis=1)
    own = [loops(part) for part in np.transpose(weights)]
    read = np.concatenate(
        [looped(part, elastic[:, 3 * k : 3 * k + 3]) for k, part in enumerate(own)], axis=1
    )
    read[:, :3] += mixed * REACH * rng.normal(size=(len(read), 3))
    return read + rng.normal(size=read.shape) * 1e-6, elastic


def test_a_chip_that_mixes_motions_has_the_loops_of_the_others(monkeypatch):
    read, _ = of_three_chips(np.repeat(WEIGHTS[:, None], 3, axis=1), mixed=0.01)
    noise = np.full(9, 1e-6)
    off = []
    for apart in (0.02, 1e6):
        monkeypatch.setattr("smoskin.sensing.signals.loops._APART", apart)
        own = learn_loops(read[::2], read[1::2], noise)
        off.append(np.abs(own.weights[:, 0] - WEIGHTS).sum())
    assert off[0] < min(0.08, 0.6 * off[1])


def test_chips_keep_loops_of_their_own():
    """Where each tells them well, one of them none."""
    weights = np.stack([WEIGHTS, 0.4 * WEIGHTS, 0 * WEIGHTS], axis=1)
    read, _ = of_three_chips(weights)
    own = learn_loops(read[::2], read[1::2], np.full(9, 1e-6))
    assert not own.weights[:, 6:].any()
    again, fresh = of_three_chips(weights, seed=7)
    rests, held = elastic_signals(own, again[::2], again[1::2])
    left = np.sqrt(((held - rests - fresh[1::2])[10:] ** 2).mean(axis=0))
    raw = np.sqrt(((again[1::2] - again[::2] - fresh[1::2])[10:] ** 2).mean(axis=0))
    assert (left[:6] < 0.35 * raw[:6]).all()
