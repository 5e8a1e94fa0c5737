"""Words and bytes of the chip, against the data sheet's own numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError
from smoskin.hardware.registers import (
    ERROR,
    NO_ANSWER,
    WAS_RESET,
    Scan,
    counts_of,
    register_words,
    setting_of,
    words_of,
)
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag

SETTINGS = st.builds(
    HallSetting,
    gain_selection=st.integers(0, 7),
    resolution=st.integers(0, 3),
    oversampling=st.integers(0, 3),
    digital_filter=st.integers(0, 7),
)
PLANAR = HallSetting(gain_selection=3, resolution=2, oversampling=1, digital_filter=3)


def test_the_planar_designs_registers_bit_by_bit() -> None:
    first, second, third = register_words(PLANAR, 3)
    assert f"{first:07b}" == "0111100"  # GAIN_SEL 011, HALLCONF 1100
    assert second == 0  # no burst pause, no compensation, no trigger
    assert f"{third:013b}" == "1110101001101"  # OSR2 11, RES 10 10 10, DIG_FILT 011, OSR 01


@given(SETTINGS, st.integers(0, 3))
def test_a_setting_survives_its_registers(setting: HallSetting, oversampling: int) -> None:
    assert setting_of(register_words(setting, oversampling)) == (setting, oversampling)


@pytest.mark.parametrize("words", [(0x3C, 0, 0x5CD), (0x30, 0, 0x54D), (0x3C, 0x400, 0x54D)])
def test_registers_that_would_read_falsely_are_refused(words: tuple[int, int, int]) -> None:
    with pytest.raises(ArgumentError, match="words must be registers with HALLCONF 0xC"):
        setting_of(words)


def test_temperature_oversampling_is_checked() -> None:
    with pytest.raises(ArgumentError, match=r"temperature_oversampling must lie in 0\.\.3; got 4"):
        register_words(PLANAR, 4)


@given(SETTINGS, st.lists(st.integers(-16384, 32767), min_size=3, max_size=3))
def test_counts_survive_their_words(setting: HallSetting, counts: list[int]) -> None:
    words = words_of(counts, setting)
    assert words.min() >= 0
    assert words.max() <= 0xFFFF
    assert_array_equal(counts_of(words, setting), counts)


def test_no_field_is_the_middle_of_the_words() -> None:
    middles = [
        int(
            words_of(
                0,
                HallSetting(
                    gain_selection=7, resolution=resolution, oversampling=0, digital_filter=2
                ),
            )
        )
        for resolution in range(4)
    ]
    assert middles == [0x0000, 0x0000, 0x8000, 0x4000]


def test_a_scan_becomes_a_reading() -> None:
    words = [[46244, 0x8001, 0x7FFF, 0x9000], [46289, 0x8000, 0x8000, 0x8000]]
    reading = Scan(time=1.5, status=[0x23, 0x23], words=words).reading(PLANAR)
    step = mlx90393.sensitivity(PLANAR)
    assert reading.time == 1.5
    assert_allclose(reading.field, [step * [1, -1, 0x1000], [0, 0, 0]])
    assert_allclose(reading.temperature, [25.0, 26.0], atol=0.01)
    assert_array_equal(reading.flags, [0, 0])


@pytest.mark.parametrize(
    ("status", "flag"),
    [
        (NO_ANSWER, ChipFlag.MISSING),
        (ERROR, ChipFlag.OLD),
        (WAS_RESET, ChipFlag.INVALID),
        (WAS_RESET | ERROR, ChipFlag.INVALID | ChipFlag.OLD),
    ],
)
def test_a_chip_with_nothing_to_say_says_nothing(status: int, flag: ChipFlag) -> None:
    reading = Scan(time=0.0, status=[status, 0], words=[[1, 2, 3, 4]] * 2).reading(PLANAR)
    assert reading.flags[0] == int(flag)
    assert np.isnan(reading.field[0]).all()
    assert np.isnan(reading.temperature[0])
    assert np.isfinite(reading.field[1]).all()


def test_a_rail_is_flagged() -> None:
    words = [[46244, 0x8000 + 20_000, 0x8000, 0x8000], [46244, 0x8000, 0x8000 - 19_999, 0x8000]]
    reading = Scan(time=0.0, status=[0, 0], words=words).reading(PLANAR)
    assert_array_equal(reading.flags, [ChipFlag.SATURATED, 0])


@pytest.mark.parametrize(
    ("status", "words", "message"),
    [
        ([256], [[0, 0, 0, 0]], "status must lie in 0..0xff"),
        ([0], [[0, 0, 0, 65536]], "words must lie in 0..0xffff"),
        ([0], [[0, -1, 0, 0]], "words must lie in 0..0xffff"),
        ([0, 0], [[0, 0, 0, 0]], "words must have shape"),
    ],
)
def test_a_scan_of_no_bytes_is_refused(status, words, message) -> None:
    with pytest.raises(ArgumentError, match=message):
        Scan(time=0.0, status=status, words=words)
