"""Touches made by hand: recorded when held, in the plan's order, whatever the hand does between."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from boards import Readings
from pads import CHIPS, REST, hand, pressed
from smoskin.errors import ArgumentError
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.records import ChipFlag, Reading
from smoskin.service.guided import GuidedTouches, grid_plan, record_touches


def plan(count: int = 6) -> TouchTable:
    return grid_plan(30e-3, 30e-3, count, force=0.5)


def followed(readings, wanted: TouchTable) -> tuple[GuidedTouches, list[str]]:
    sentences: list[str] = []
    guided = GuidedTouches(wanted, say=sentences.append)
    for reading in readings:
        guided.step(reading)
    return guided, sentences


def test_every_touch_is_recorded_with_the_rest_before_it() -> None:
    wanted = plan()
    guided, sentences = followed(hand(wanted), wanted)
    assert guided.done
    table = guided.table
    assert table.touched.tolist() == [False, True] * 6
    assert_allclose(table.position[1::2], wanted.position)
    assert_allclose(table.force[1::2], wanted.force)
    assert_allclose(table.field[::2], np.tile(REST, (6, 1, 1)), atol=2e-6)
    for row, contact in zip(table.field[1::2], wanted.contacts, strict=True):
        true = pressed(contact.position, 0.5)
        assert np.abs(row - REST - true).max() < 0.25 * np.abs(true).max()
    assert (table.held[1:, 0] > table.held[:-1, 1]).all()
    assert sentences[0] == "Let nothing touch the skin."
    x, y = 1e3 * wanted.contacts[0].position
    assert (
        sentences[1] == f"1 of 6: press at x {x:.1f} mm, y {y:.1f} mm with 0.50 N, and hold still."
    )
    assert sentences[2] == "Got it: let go."
    assert sentences[-1] == "Got it: that was the last one."
    assert len(sentences) == 1 + 2 * 6


def test_only_what_is_held_still_counts() -> None:
    """A touch that slides is no touch until it rests; a fault begins the stillness anew."""
    wanted = plan(1)
    readings = list(hand(wanted))
    shaken = []
    rng = np.random.default_rng(3)
    for k, reading in enumerate(readings):
        wobble = 80e-6 * np.sin(0.6 * k) if 60 <= k < 130 else 0.0
        flags = [0, 0, int(rng.random() < 0.2), 0, 0] if 60 <= k < 130 else np.zeros(5, int)
        shaken.append(
            Reading(
                time=reading.time,
                field=reading.field + wobble,
                temperature=reading.temperature,
                flags=flags,
            )
        )
    guided, _ = followed(shaken[:130], wanted)
    assert guided.made == 0


def test_a_hand_that_waits_is_waited_for() -> None:
    wanted = plan(2)
    readings = list(hand(wanted))
    guided, sentences = followed([readings[k] for k in range(60)], wanted)
    held = len(sentences)
    later = [
        Reading(time=2.0 + k / 60, field=readings[k % 50].field, temperature=np.full(5, 25.0))
        for k in range(600)
    ]
    for reading in later:
        guided.step(reading)
    assert guided.made == 0
    assert held == 2
    assert len(sentences) == 3
    assert sentences[2].startswith(sentences[1])
    assert re.search(r"The field is \d uT from rest; a touch changes it by 30 uT", sentences[2])


@pytest.mark.parametrize("rate", [5.0, 19.0, 500.0])
def test_slow_and_fast_boards_are_recorded_too(rate: float) -> None:
    wanted = plan(4)
    each = round(max(1.2 * rate, 15))
    shares = np.repeat([0.0, 1.0] * 4, each)
    changes = [pressed(c.position, 0.5) for c in wanted.contacts]
    rng = np.random.default_rng(2)
    readings = [
        Reading(
            time=k / rate,
            field=REST + share * changes[k // (2 * each)] + rng.normal(0, 1.5e-6, (5, 3)),
            temperature=np.full(5, 25.0),
        )
        for k, share in enumerate(shares)
    ]
    guided, _ = followed(readings, wanted)
    assert guided.done


def test_what_keeps_the_next_touch_from_being_made_is_said() -> None:
    wanted = plan(2)
    calm, fault = [0] * 5, [0, 0, int(ChipFlag.MISSING), 0, 0]
    field = REST + pressed(wanted.contacts[0].position, 0.5)

    def reading(k: int, seen: np.ndarray, flags: list[int]) -> Reading:
        return Reading(time=k / 60, field=seen, temperature=np.full(5, 25.0), flags=flags)

    _, sentences = followed([reading(k, REST, fault) for k in range(700)], wanted)
    assert sentences[1:] == ["Chip 3 has a fault: smoskin doctor says what to do."]
    warming = [reading(k, REST * (1 + 0.01 * k), calm) for k in range(700)]
    assert followed(warming, wanted)[1][1:] == [
        "The skin does not rest yet: let nothing touch or move it."
    ]
    stays = [reading(k, REST if k < 60 else field, calm) for k in range(800)]
    assert followed(stays, wanted)[1][-1] == "The skin is touched still: let go."


def test_what_was_made_is_kept_after_each_touch(tmp_path) -> None:
    wanted = plan(4)
    kept: list[TouchTable] = []
    source = Readings(None, hand(wanted))
    table = record_touches(source, wanted, keep=kept.append)
    assert [len(k.contacts) for k in kept] == [1, 2, 3, 4]
    write_touches(tmp_path / "touches.csv", table)
    back, _ = read_touches(tmp_path / "touches.csv")
    assert_allclose(back.field, table.field, rtol=1e-12)
    assert len(back.contacts) == 4


def test_a_grid_covers_the_pad_in_random_order(tmp_path) -> None:
    wanted = grid_plan(40e-3, 20e-3, 32, force=0.3, seed=1)
    place = wanted.position
    assert len(place) == 32
    assert len(np.unique(place, axis=0)) == 32
    assert_allclose([place.min(axis=0), place.max(axis=0)], [[2.5e-3, 2.5e-3], [37.5e-3, 17.5e-3]])
    assert_allclose(wanted.force, np.tile([0, 0, -0.3], (32, 1)))
    assert np.abs(np.diff(place[:, 0])).mean() > 5e-3
    write_touches(tmp_path / "plan.csv", wanted)
    assert_allclose(read_touches(tmp_path / "plan.csv")[0].position, place)
    assert CHIPS.max() < 30e-3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0.0}, "width and height must be above 0 m"),
        ({"count": 0}, "count and force must be positive"),
        ({"force": -1.0}, "count and force must be positive"),
    ],
)
def test_wrong_use_is_named(change, message: str) -> None:
    options = {"width": 0.03, "height": 0.03, "count": 9, "force": 0.5} | change
    with pytest.raises(ArgumentError, match=message):
        grid_plan(options["width"], options["height"], options["count"], force=options["force"])
    rest = TouchTable(position=[[np.nan] * 2], force=[[0.0] * 3], field=np.zeros((1, 5, 3)))
    with pytest.raises(ArgumentError, match="plan must hold at least one touch"):
        GuidedTouches(rest)
    with pytest.raises(ArgumentError, match="no rest has been recorded yet"):
        _ = GuidedTouches(plan()).table
