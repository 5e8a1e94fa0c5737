"""Frames of boards by others: what counts as one, which setting it has, and what noise may do."""

import random
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError
from smoskin.hardware.wire.foreign import (
    STEPS,
    AnySkinDecoder,
    EfleshDecoder,
    anyskin_frame,
    eflesh_frame,
    whole,
)
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag
from studies.recordings.eflesh import read_eflesh


def setting(gain: int, resolution: int) -> HallSetting:
    return HallSetting(gain_selection=gain, resolution=resolution, oversampling=0, digital_filter=2)


ANYSKIN = setting(6, 0)
EFLESH = setting(4, 3)


def fields(chosen: HallSetting, count: int, seed: int = 0, chips: int = 5) -> np.ndarray:
    """Fields of whole counts, (N, C, 3), T, that wander by a few counts as noise does."""
    rng = np.random.default_rng(seed)
    rest = rng.integers(-8000, 8000, (chips, 3))
    counts = rest + np.rint(rng.normal(0, 3, (count, chips, 3)))
    return np.asarray(mlx90393.tesla(counts, chosen))


def warmth(count: int, chips: int = 5) -> np.ndarray:
    return np.asarray(mlx90393.degrees(46244 + np.arange(count * chips).reshape(count, chips) % 90))


@cache
def anyskin_stream(count: int, seed: int = 0) -> bytes:
    return b"".join(map(anyskin_frame, fields(ANYSKIN, count, seed), warmth(count)))


@cache
def eflesh_stream(count: int, seed: int = 0) -> bytes:
    return b"".join(eflesh_frame(f, k) for k, f in enumerate(fields(EFLESH, count, seed)))


def test_frames_have_the_published_lengths() -> None:
    assert len(anyskin_stream(1)) == 82
    assert len(eflesh_stream(1)) == 64
    assert anyskin_stream(1)[-2:] == b"\r\n"
    assert eflesh_stream(1)[:3] == b"\xaa\x55\x00"


def test_each_of_the_32_settings_has_its_step() -> None:
    pairs = [pair for step in STEPS for pair in step.pairs]
    assert sorted(pairs) == [(gain, res) for gain in range(8) for res in range(4)]
    for step in STEPS:
        for pair in step.pairs:
            assert_allclose(mlx90393.sensitivity(setting(*pair))[[0, 2]] * 1e6, step[:2])


@pytest.mark.parametrize("gain", range(8))
@pytest.mark.parametrize("resolution", range(4))
def test_the_setting_is_recovered_from_the_values(gain: int, resolution: int) -> None:
    chosen = setting(gain, resolution)
    sent = fields(chosen, 20, seed=8 * resolution + gain) / 2
    sent = mlx90393.tesla(np.rint(sent / mlx90393.sensitivity(chosen)), chosen)
    decoder = AnySkinDecoder()
    packets = decoder.feed(b"".join(map(anyskin_frame, sent, warmth(20))))
    assert len(packets) == 20
    assert (gain, resolution) in decoder.settings
    assert {g for g, _ in decoder.settings} <= set(range(8))
    assert decoder.corrupt == 0


def test_values_are_those_sent() -> None:
    packets = AnySkinDecoder().feed(anyskin_stream(50))
    assert_allclose([p.field for p in packets], fields(ANYSKIN, 50), rtol=1e-6)
    assert_allclose([p.temperature for p in packets], warmth(50), atol=1e-4)
    packets = EfleshDecoder().feed(eflesh_stream(300))
    assert_allclose([p.field for p in packets], fields(EFLESH, 300), rtol=1e-6)
    assert [p.sequence for p in packets] == [k % 256 for k in range(300)]


@pytest.mark.parametrize("chips", [1, 3, 5, 10])
def test_boards_may_have_any_number_of_chips(chips: int) -> None:
    sent = fields(ANYSKIN, 12, chips=chips)
    packets = AnySkinDecoder(chips).feed(b"".join(map(anyskin_frame, sent, warmth(12, chips))))
    assert_allclose([p.field for p in packets], sent, rtol=1e-6)


@given(st.integers(1, 200))
def test_pieces_of_any_size_give_the_same_packets(size: int) -> None:
    for decoder, stream in (
        (AnySkinDecoder(), anyskin_stream(20)),
        (EfleshDecoder(), eflesh_stream(20)),
    ):
        pieces = (stream[k : k + size] for k in range(0, len(stream), size))
        assert sum(len(decoder.feed(piece)) for piece in pieces) == 20
        assert (decoder.corrupt, decoder.lost) == (0, 0)


def test_every_cut_is_in_step_within_two_frames() -> None:
    for decoded, stream, length in (
        (AnySkinDecoder, anyskin_stream(20), 82),
        (EfleshDecoder, eflesh_stream(20), 64),
    ):
        for cut in range(1, length):
            decoder = decoded()
            assert len(decoder.feed(stream[cut:])) == 19
            assert decoder.corrupt == 1


def test_line_ends_inside_the_floats_mislead_nobody() -> None:
    """Some counts are floats with CR LF in them."""
    rng = np.random.default_rng(1)
    every = mlx90393.tesla(np.arange(-32768, 32768)[:, None] * np.ones(3), ANYSKIN)
    inside = [f for f in every if b"\r\n" in anyskin_frame(f[None], np.array([25.0]))[4:-2]]
    assert len(inside) >= 2
    sent = rng.permuted(rng.choice(inside, (300, 5)), axis=0)
    stream = b"".join(map(anyskin_frame, sent, warmth(300)))
    assert stream.count(b"\r\n") > 900
    for start in range(82):
        assert len(AnySkinDecoder().feed(stream[start : start + 82 * 50])) == 49 + (start == 0)


def test_a_chip_of_zeros_or_nonsense_is_missing_and_the_rest_is_read() -> None:
    sent, degrees = fields(ANYSKIN, 20), warmth(20).copy()
    sent[:, 1] = 0.0
    sent[:, 4] = 1.2345e-3
    packets = AnySkinDecoder().feed(b"".join(map(anyskin_frame, sent, degrees)))
    assert len(packets) == 20
    missing = int(ChipFlag.MISSING)
    assert_array_equal([p.flags for p in packets], [[0, missing, 0, 0, missing]] * 20)
    assert all(np.isnan(p.field[[1, 4]]).all() for p in packets)
    degrees[:, 2] = 25.01
    assert AnySkinDecoder().feed(b"".join(map(anyskin_frame, sent, degrees))) == []


def test_a_field_that_wraps_is_flagged_until_it_comes_back() -> None:
    rise = np.arange(25_000, 40_000, 500)
    true = np.concatenate([rise, rise[::-1]])
    counts = np.broadcast_to([100, 200, 300], (len(true), 5, 3)).copy()
    counts += np.random.default_rng(0).integers(-2, 3, counts.shape)
    counts[:, 2, 0] = (true + 32_768) % 65_536 - 32_768
    sent = mlx90393.tesla(counts, ANYSKIN)
    packets = AnySkinDecoder().feed(b"".join(map(anyskin_frame, sent, warmth(len(sent)))))
    flags = np.array([p.flags for p in packets])
    assert_array_equal(flags[:, 2] == int(ChipFlag.WRAPPED), true > 32_767)
    assert not flags[:, [0, 1, 3, 4]].any()


def test_a_field_at_the_rail_is_flagged() -> None:
    counts = np.random.default_rng(0).integers(50, 90, (20, 5, 3))
    counts[10:, 3, 2] = 10_500
    packets = EfleshDecoder().feed(
        b"".join(eflesh_frame(f, k) for k, f in enumerate(mlx90393.tesla(counts, EFLESH)))
    )
    flags = np.array([p.flags for p in packets])
    assert_array_equal(flags[:, 3] == int(ChipFlag.SATURATED), np.arange(20) >= 10)


def test_numbers_of_frames_tell_what_is_lost_and_repeated() -> None:
    stream = eflesh_stream(600)
    frames = [stream[64 * k : 64 * k + 64] for k in range(600)]
    del frames[250:260]
    frames[100:100] = frames[90:100]
    decoder = EfleshDecoder()
    assert len(decoder.feed(b"".join(frames))) == 590
    assert (decoder.lost, decoder.repeated, decoder.corrupt) == (10, 10, 0)


def test_a_board_of_another_setting_is_read_after_some_frames() -> None:
    decoder = AnySkinDecoder()
    decoder.feed(anyskin_stream(20))
    other = fields(setting(7, 0), 20, seed=5)
    packets = decoder.feed(b"".join(map(anyskin_frame, other, warmth(20))))
    assert len(packets) >= 16
    assert_allclose(packets[-1].field, other[-1], rtol=1e-6)
    assert (7, 0) in decoder.settings


@pytest.mark.parametrize("count", [100_000, pytest.param(10_000_000, marks=pytest.mark.slow)])
def test_noise_holds_no_frame(count: int) -> None:
    """Noise with the mark of a frame at every turn, and with checks that agree."""
    rng = random.Random(2)
    decoders = AnySkinDecoder(), EfleshDecoder()
    for _ in range(count // 80):
        noise = rng.randbytes(80)
        assert decoders[0].feed(noise + b"\r\n") == []
        inside = noise[:61]
        check = 0
        for byte in inside:
            check ^= byte
        assert decoders[1].feed(b"\xaa\x55" + inside + bytes([check])) == []


def test_floats_that_are_nearly_counts_are_none() -> None:
    counts = np.array([[100.0, 200.0, 300.0]])
    size = np.array([0.2, 0.2, 0.242 * 4 / 3])
    assert whole(counts * size).any()
    for off in (0.05, 0.5):
        assert not whole((counts + np.array([0.0, off, 0.0])) * size).any()
    for nonsense in (np.nan, np.inf, 1e30, 1e-30, 1e-7):
        assert not whole(np.array([[nonsense, 20.0, 32.0]])).any()
    assert not whole(np.zeros((1, 3))).any()


def test_wrong_use_is_named() -> None:
    with pytest.raises(ArgumentError, match=r"chips must lie in 1\.\.64; got 0"):
        AnySkinDecoder(0)


@pytest.mark.recordings
def test_recorded_eflesh_values_are_whole_counts_of_one_step(recordings) -> None:
    run = next(run for run in read_eflesh(recordings) if run.set == "normal_force")
    decoder = EfleshDecoder()
    packets = decoder.feed(b"".join(eflesh_frame(f, k) for k, f in enumerate(run.field)))
    assert len(packets) == len(run.field)
    assert (4, 3) in decoder.settings
    assert not np.any([p.flags for p in packets])
