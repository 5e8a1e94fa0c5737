"""What readings of an untouched skin tell of its chips: faults, each with what to do.

Decides from which size noise, hum, drift and a wrong place of a chip are worth a word. What is
checked is what goes wrong on real boards: wires, supplies, magnets, mains, and chips soldered
otherwise than the design says.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import HallSetting, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.feasibility import field_extent
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag, Reading

_LEAST: Final = 30
"""Readings from which a judgement is made."""
_LOUD: Final = 3.0
"""Noise over the data sheet's from which it is told."""
_HUM: Final = 1.0e-6
"""Amplitude of mains hum from which it is told, T."""
_MAINS: Final = (50.0, 60.0)
"""Frequencies of mains, Hz."""
_SPAN: Final = 1.0
"""Seconds of readings from which mains is looked for."""
_OFF_MAINS: Final = 0.2
"""How far mains may be off them, Hz."""
_DRIFT: Final = 30e-6 / 60
"""Drift from which it is told, T/s."""
_FAR: Final = 0.5
"""Difference from the design's rest field, over that field, from which a chip is told."""
_NEAR: Final = 0.3
"""The same difference up to which another place or turn of a chip explains it."""
_WARM: Final = (-40.0, 85.0)
"""Least and most that a working chip reports, degC."""
_APART: Final = 15.0
"""Difference of temperature from the other chips' median from which a chip is told, K."""
_INTERFERENCE: Final = 15e-6
"""Change of the field while a robot moves from which it is told, T."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something wrong, and what to do."""

    where: str
    """Part that it is wrong with, such as ``chip S2`` or ``port /dev/ttyACM0``."""
    problem: str
    """Sentence that says what was seen."""
    remedy: str
    """Sentence that says what to do."""

    def __str__(self) -> str:
        return f"{self.where}: {self.problem} {self.remedy}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Chip:
    """One chip's readings that are good."""

    where: str
    time: Floats
    field: Floats
    warmth: Floats


def chip_names(chips: int, design: SkinDesign | None) -> tuple[str, ...]:
    """What so many chips are called: as in the design, or by their number from 1."""
    if design is None:
        return tuple(str(place + 1) for place in range(chips))
    return tuple(site.name for site in design.halls)


@typed
def examine_readings(
    readings: Sequence[Reading],
    design: SkinDesign | None = None,
    *,
    setting: HallSetting | None = None,
) -> tuple[Finding, ...]:
    """What is wrong with the chips of a skin at rest, by some seconds of its readings.

    With a design, chips are called by its names, and their fields are compared with those that it
    has at rest. The setting of the chips, for their noise, is the design's by default.

    Raises
    ------
    ArgumentError
        If there are fewer than 30 readings, or their chips are not as many as the design's.

    Examples
    --------
    >>> from smoskin.feasibility import load_design
    >>> from smoskin.twin.reduced import ReducedTwin
    >>> planar = load_design("planar")
    >>> twin = ReducedTwin(planar)
    >>> examine_readings([twin.read(time=0.01 * k) for k in range(100)], planar)
    ()
    """
    if len(readings) < _LEAST:
        raise ArgumentError(f"readings must be at least {_LEAST}; got {len(readings)}")
    chips = len(readings[0].field)
    if design is not None and chips != len(design.halls):
        raise ArgumentError(f"readings must have the design's {len(design.halls)}; got {chips}")
    if setting is None and design is not None:
        setting = design.hall_setting
    flags = np.array([reading.flags for reading in readings])
    time = np.array([reading.time for reading in readings])
    field = np.array([reading.field for reading in readings])
    warmth = np.array([reading.temperature for reading in readings])
    findings: list[Finding] = []
    heard: list[_Chip | None] = []
    for place, name in enumerate(chip_names(chips, design)):
        where = f"chip {name}"
        findings += _flagged(where, flags[:, place])
        good = (flags[:, place] == 0) & np.isfinite(field[:, place]).all(axis=-1)
        enough = np.count_nonzero(good) >= _LEAST
        kept = _Chip(
            where=where, time=time[good], field=field[good, place], warmth=warmth[good, place]
        )
        heard.append(kept if enough else None)
    present = [chip for chip in heard if chip is not None]
    findings += _warm(present)
    for chip in present:
        findings += _frozen(chip) or [*_noisy(chip, setting), *_drifting(chip)]
    findings += _humming(present)
    if design is not None:
        findings += _misplaced(design, heard)
    return tuple(findings)


@typed
def interference(
    resting: Sequence[Reading], moving: Sequence[Reading], names: Sequence[str]
) -> tuple[Finding, ...]:
    """What a moving robot does to the chips of an untouched skin, against the same at rest."""
    still = np.array([reading.field for reading in resting])
    moved = np.array([reading.field for reading in moving])
    change = np.nanmax(np.abs(moved - np.nanmean(still, axis=0)), axis=(0, 2))
    own = np.nanmax(np.abs(still - np.nanmean(still, axis=0)), axis=(0, 2))
    return tuple(
        Finding(
            where=f"chip {name}",
            problem=f"Its field changes by {1e6 * big:.0f} uT while the robot moves.",
            remedy="Motors, steel and the Earth's field do that: keep 50 mm from motors and steel, "
            "take the zero in the pose of work, and set the threshold of touch above it.",
        )
        for name, big, small in zip(names, change, own, strict=True)
        if big > small + _INTERFERENCE
    )


def _flagged(where: str, flags: Floats) -> list[Finding]:
    """What the flags of a chip say."""
    findings = []
    for flag, problem, remedy in _FLAGS:
        share = float(np.mean((flags.astype(int) & int(flag)) != 0))
        if share:
            often = "every time" if share == 1.0 else f"in {100 * share:.2g} % of the readings"
            findings.append(Finding(where=where, problem=problem.format(often), remedy=remedy))
    return findings


def _warm(chips: Sequence[_Chip]) -> list[Finding]:
    """Chips whose temperature cannot be right."""
    means = np.array([np.mean(chip.warmth) for chip in chips])
    findings = []
    for chip, mean in zip(chips, means.tolist(), strict=True):
        middle = float(np.nanmedian(means))
        if mean == mean and not _WARM[0] < mean < _WARM[1]:
            problem = f"It reports {mean:.0f} degC."
        elif abs(mean - middle) > _APART:
            problem = f"It reports {mean:.0f} degC, the others {middle:.0f}."
        else:
            continue
        findings.append(Finding(where=chip.where, problem=problem, remedy=_REPLACE))
    return findings


def _frozen(chip: _Chip) -> list[Finding]:
    """A chip that says the same every time."""
    if np.ptp(chip.field, axis=0).any():
        return []
    problem = "It says the same to the bit every time."
    return [Finding(where=chip.where, problem=problem, remedy=_REPLACE)]


def _noisy(chip: _Chip, setting: HallSetting | None) -> list[Finding]:
    """Noise from reading to reading, which drift and slow touches do not enter."""
    if setting is None:
        return []
    spread = np.diff(chip.field, axis=0).std(axis=0) / 2**0.5
    step = mlx90393.sensitivity(setting)
    usual = np.hypot(mlx90393.noise(setting), step / 12**0.5)
    axis = int(np.argmax(spread / usual))
    if spread[axis] <= _LOUD * usual[axis]:
        return []
    return [
        Finding(
            where=chip.where,
            problem=f"Its noise in {'xyz'[axis]} is {1e6 * spread[axis]:.1f} uT, where "
            f"{1e6 * usual[axis]:.1f} uT is usual.",
            remedy="Let nothing touch or move the skin; keep motors and mains leads away; give "
            "the chip 100 nF of its own.",
        )
    ]


def _drifting(chip: _Chip) -> list[Finding]:
    """A field that goes away steadily."""
    time = chip.time - chip.time.mean()
    spread = float(time @ time)
    slope = time @ (chip.field - chip.field.mean(axis=0)) / spread
    # From reading to reading, so that what drifts is not noise.
    error = np.diff(chip.field, axis=0).std(axis=0) / (2 * spread) ** 0.5
    axis = int(np.argmax(np.abs(slope)))
    if not (abs(slope[axis]) > _DRIFT and abs(slope[axis]) > 5 * error[axis]):
        return []
    rate = 60 * float(time @ (chip.warmth - chip.warmth.mean())) / spread
    warms = f", while it warms by {rate:.1f} K a minute" if abs(rate) > 0.2 else ""
    return [
        Finding(
            where=chip.where,
            problem=f"Its field drifts by {60e6 * slope[axis]:.0f} uT a minute{warms}.",
            remedy="Wait until it is as warm as it gets, ten minutes after it was switched on; let "
            "nothing touch the skin.",
        )
    ]


def _humming(chips: Sequence[_Chip]) -> list[Finding]:
    """Mains in the fields; the times of readings tell it even from slow boards, by its alias."""
    findings = []
    for chip in chips:
        span = float(np.ptp(chip.time))
        if span < _SPAN:
            continue
        time = chip.time - chip.time[0]
        trend = np.polynomial.polynomial.polyfit(time, chip.field, 2)
        rest = chip.field - np.polynomial.polynomial.polyval(time, trend).T
        floor = 6 * rest.std(axis=0).max() * (2 / len(time)) ** 0.5
        step = min(0.25 / span, _OFF_MAINS)
        best = 0.0, 0.0
        for mains in _MAINS:
            for frequency in np.arange(mains - _OFF_MAINS, mains + _OFF_MAINS + step / 2, step):
                wave = np.exp(-2j * np.pi * frequency * time)
                best = max(best, (float(2 * np.abs(wave @ rest / len(time)).max()), mains))
        amplitude, mains = best
        if amplitude > max(_HUM, floor):
            findings.append(
                Finding(
                    where=chip.where,
                    problem=f"It hums at {mains:.0f} Hz with {1e6 * amplitude:.1f} uT.",
                    remedy="Keep mains leads, transformers and power supplies half a metre away.",
                )
            )
    return findings


def _misplaced(design: SkinDesign, heard: Sequence[_Chip | None]) -> list[Finding]:
    """Chips whose field at rest is not what the design says."""
    wanted = np.array([field_extent(design, site).rest for site in design.halls])
    findings = []
    for place, chip in enumerate(heard):
        if chip is None:
            continue
        seen, size = chip.field.mean(axis=0), float(np.linalg.norm(wanted[place]))
        if np.linalg.norm(seen - wanted[place]) <= _FAR * size:
            continue
        strength = float(np.linalg.norm(seen)) / size
        problem = f"It reads {_millitesla(seen)} mT; the design has {_millitesla(wanted[place])}."
        turned = any(np.linalg.norm(turn @ seen - wanted[place]) < _NEAR * size for turn in _TURNS)
        others = [
            site.name
            for other, site in enumerate(design.halls)
            if other != place and np.linalg.norm(seen - wanted[other]) < _NEAR * size
        ]
        if others:
            remedy = f"That is the field of {others[0]}: are address and place exchanged?"
        elif turned:
            remedy = "Another turn of the chip explains it: correct its axes in the design."
        elif strength < 1 - _FAR:
            remedy = "Its magnet is missing, weak or far away, or lies with its face up."
        else:
            remedy = "Its magnet is too near, or it is another than the design's."
        findings.append(Finding(where=chip.where, problem=problem, remedy=remedy))
    return findings


def _millitesla(field: Floats) -> str:
    return "({})".format(", ".join(f"{1e3 * value:.1f}" for value in field))


def _turns() -> tuple[Floats, ...]:
    """The 24 turns of a cube."""
    turns = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0:
                turns.append(turn)
    return tuple(turns)


_TURNS: Final = _turns()
_REPLACE: Final = "Solder it anew or replace it."
_FLAGS: Final = (
    (
        ChipFlag.MISSING,
        "It does not answer, {}.",
        "Look at its supply, its wires and pull-ups, and the order code, which gives the address.",
    ),
    (
        ChipFlag.INVALID,
        "It starts again by itself, {}.",
        "Its supply breaks down: give it a capacitor of 100 nF beside it, or shorter wires.",
    ),
    (
        ChipFlag.OLD,
        "It has nothing new to say, {}.",
        "It is read faster than it measures: lower the rate, or the oversampling and filter.",
    ),
    (
        ChipFlag.SATURATED,
        "Its field is at the end of its range, {}.",
        "Move its magnet away, or choose a lower gain (a higher GAIN_SEL).",
    ),
    (
        ChipFlag.WRAPPED,
        "Its field has run over its 16 bits, {}.",
        "Choose RES 2 or 3, which stop instead, or a lower gain; or move its magnet away.",
    ),
)
"""Flags with what they mean and what to do."""
