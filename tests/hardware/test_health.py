"""What goes wrong with chips on real boards, each fault by itself on a sound skin."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.hardware.health import examine_readings, interference
from smoskin.records import ChipFlag, Reading
from smoskin.twin.reduced import ReducedTwin

RATE = 100.0
COUNT = 500


@pytest.fixture(scope="module")
def sound() -> np.ndarray:
    """Fields of a skin at rest, (N, S, 3), T."""
    planar = load_design("planar")
    twin = ReducedTwin(planar, seed=1)
    rest = twin.motion()
    return np.array([twin.sense(rest).field for _ in range(COUNT)])


def readings(field: np.ndarray, *, flags=None, warmth=None) -> list[Reading]:
    count, chips = field.shape[:2]
    marks = np.zeros((count, chips), int) if flags is None else flags
    degrees = np.full((count, chips), 25.0) if warmth is None else warmth
    return [
        Reading(time=k / RATE, field=field[k], temperature=degrees[k], flags=marks[k])
        for k in range(count)
    ]


def sentences(findings) -> list[str]:
    return [str(finding) for finding in findings]


def test_a_sound_skin_has_no_findings(sound: np.ndarray, planar: SkinDesign) -> None:
    assert examine_readings(readings(sound), planar) == ()
    assert examine_readings(readings(sound)) == ()


TIME = np.arange(COUNT) / RATE


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (lambda f: f + np.random.default_rng(0).normal(0, 12e-6, f.shape), "Its noise in "),
        (lambda f: f + 5e-6 * np.sin(2 * np.pi * 50.1 * TIME)[:, None, None], "It hums at 50 Hz"),
        (lambda f: f + 5e-6 * np.sin(2 * np.pi * 59.9 * TIME)[:, None, None], "It hums at 60 Hz"),
        (lambda f: f + 5e-6 * TIME[:, None, None], r"Its field drifts by \d+ uT a minute\. Wait"),
        (lambda f: np.broadcast_to(f[0], f.shape), "It says the same to the bit every time"),
        (lambda f: 0.1 * f, r"Its magnet is missing, weak or far away"),
        (lambda f: 2.0 * f, "Its magnet is too near, or it is another"),
        (lambda f: -f, "Another turn of the chip explains it: correct its axes"),
        (lambda f: f[..., [2, 0, 1]], "Another turn of the chip explains it"),
    ],
)
def test_each_fault_of_a_field_is_found(
    sound: np.ndarray, planar: SkinDesign, spoil: Callable, problem: str
) -> None:
    import re

    field = sound.copy()
    field[:, 1] = spoil(sound)[:, 1]
    findings = sentences(examine_readings(readings(field), planar))
    assert findings
    assert all(finding.startswith("chip S2: ") for finding in findings)
    assert any(re.search(problem, finding) for finding in findings), findings
    alone = [f for f in findings if re.search(problem, f)]
    # A hum or a drift is no noise; what freezes or is turned is not noisy either.
    assert len(findings) == len(alone)


def test_mains_is_found_through_its_alias(sound: np.ndarray, planar: SkinDesign) -> None:
    """At 45 readings a second 50 Hz looks like 5 Hz, which the times tell."""
    time = np.arange(COUNT) / 45.0
    field = sound + 4e-6 * np.sin(2 * np.pi * 50.0 * time)[:, None, None]
    slow = [replace_time(r, t) for r, t in zip(readings(field), time, strict=True)]
    findings = sentences(examine_readings(slow, planar))
    assert len(findings) == 3
    assert all("It hums at 50 Hz with" in finding for finding in findings)


def replace_time(reading: Reading, time: float) -> Reading:
    return Reading(time=time, field=reading.field, temperature=reading.temperature)


def test_exchanged_chips_name_each_other(planar: SkinDesign) -> None:
    first, second, third = planar.halls
    unlike = replace(first, gap=4.5e-3), replace(second, gap=6.9e-3), third
    near = replace(planar, halls=unlike)
    twin = ReducedTwin(near, seed=1)
    rest = twin.motion()
    field = np.array([twin.sense(rest).field for _ in range(100)])
    assert examine_readings(readings(field), near) == ()
    findings = sentences(examine_readings(readings(field[:, [1, 0, 2]]), near))
    assert len(findings) == 2
    assert "chip S1" in findings[0]
    assert "That is the field of S2" in findings[0]
    assert "That is the field of S1" in findings[1]


@pytest.mark.parametrize(
    ("flag", "problem"),
    [
        (ChipFlag.MISSING, "It does not answer, in 10 % of the readings."),
        (ChipFlag.INVALID, "It starts again by itself, in 10 % of the readings."),
        (ChipFlag.OLD, "It has nothing new to say, in 10 % of the readings."),
        (ChipFlag.SATURATED, "Its field is at the end of its range, in 10 % of the readings."),
        (ChipFlag.WRAPPED, "Its field has run over its 16 bits, in 10 % of the readings."),
    ],
)
def test_flags_are_told_with_their_share(
    sound: np.ndarray, planar: SkinDesign, flag: ChipFlag, problem: str
) -> None:
    flags = np.zeros((COUNT, 3), int)
    flags[::10, 2] = int(flag)
    findings = sentences(examine_readings(readings(sound, flags=flags), planar))
    assert len(findings) == 1
    assert findings[0].startswith(f"chip S3: {problem}")
    flags[:, 2] = int(flag)
    findings = sentences(examine_readings(readings(sound, flags=flags), planar))
    assert len(findings) == 1
    assert ", every time." in findings[0]


@pytest.mark.parametrize(
    ("degrees", "problem"),
    [(90.0, "It reports 90 degC."), (45.0, "It reports 45 degC, the others 25.")],
)
def test_temperatures_that_cannot_be_are_told(sound, planar, degrees: float, problem: str) -> None:
    warmth = np.full((COUNT, 3), 25.0)
    warmth[:, 0] = degrees
    findings = sentences(examine_readings(readings(sound, warmth=warmth), planar))
    assert len(findings) == 1
    assert findings[0].startswith(f"chip S1: {problem}")


def test_a_skin_that_warms_up_is_told_to_wait(sound: np.ndarray, planar: SkinDesign) -> None:
    warmth = 25.0 + 0.05 * TIME[:, None] * np.ones(3)
    field = sound * (1 - 0.005 * (warmth - 25.0))[..., None]
    findings = sentences(examine_readings(readings(field, warmth=warmth), planar))
    assert len(findings) == 3
    assert all("while it warms by 3.0 K a minute" in finding for finding in findings)


def test_a_robot_that_disturbs_is_told(sound: np.ndarray) -> None:
    still = readings(sound[:200])
    quiet = interference(still, readings(sound[200:]), ("S1", "S2", "S3"))
    assert quiet == ()
    moved = sound[200:].copy()
    moved[:, 1, 0] += 60e-6 * np.sin(TIME[200:])
    findings = sentences(interference(still, readings(moved), ("S1", "S2", "S3")))
    assert len(findings) == 1
    assert findings[0].startswith("chip S2: Its field changes by 6")


def test_chips_need_no_design_but_enough_readings(sound: np.ndarray, planar: SkinDesign) -> None:
    field = np.broadcast_to(sound[0], sound.shape)
    assert sentences(examine_readings(readings(field)))[0].startswith("chip 1: It says the same")
    with pytest.raises(ArgumentError, match="readings must be at least 30; got 10"):
        examine_readings(readings(sound[:10]), planar)
    with pytest.raises(ArgumentError, match="readings must have the design's 3; got 2"):
        examine_readings(readings(sound[:, :2]), replace(planar))
