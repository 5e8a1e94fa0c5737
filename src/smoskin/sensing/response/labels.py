"""From touches that a rig has held to the labelled signals that a calibration is made of.

Decides which readings of a touch count: the mean of those while it was held, less the mean of
those of the rest just before it, creep undone, so that a slow drift takes no part ("Labels and
creep undone" in `docs/derivations.md`). Hides what the rubber remembers from touch to touch.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.records import Contact, HeldTouch, Status
from smoskin.sensing.response.calibrate import LabelledTouches
from smoskin.sensing.signals.loops import Loops, elastic_signals, learn_loops
from smoskin.sensing.signals.signals import Signals, signal_noise

_FEWEST: Final = 3
"""Touches from which loops are learned."""


class Label(NamedTuple):
    """One touch and its signals."""

    contact: Contact
    values: Floats
    """(S, 3), T: signals of all chips."""
    temperature: float
    """Rubber temperature as the chips report it, degC; NaN where no reading was good."""
    status: Status | None
    """What forbids to use it; None where nothing does."""
    left: Floats | None = None
    """(S, 3), T: what the touch before left behind; None where that is unknown."""
    read: Floats | None = None
    """(2, S, 3), T: signals of the rest before it and while it was held, against the first rest;
    None where one is unknown."""


class Labeller:
    """Signals of held touches of one skin, one after the other: ``mean(held) - mean(rest)``.

    Creep of a solid of rubber is undone if it is given; else touches are taken to have settled.
    """

    def __init__(self, design: SkinDesign, creep: Prony | None = None) -> None:
        self._design = design
        self._signals = Signals(design, creep=creep)
        self._level: Floats | None = None

    def label(self, touch: HeldTouch) -> Label:
        """The label of a touch; every touch must be given, in the order of time.

        A rest without good readings is that of the touch before; `ArgumentError` if there is none,
        or readings come from another number of chips than the design has.
        """
        if self._level is None:
            start, end = touch.rest
            # A rig knows when nothing touches.
            self._signals.zero([r for r in touch.readings if start <= r.time <= end], force=True)
        before, left = self._level, None
        rest: list[Floats] = []
        held: list[Floats] = []
        status: Status | None = None
        temperature = np.nan
        for reading in touch.readings:
            signal = self._signals.step(reading)
            for (start, end), values in ((touch.rest, rest), (touch.held, held)):
                if not start <= reading.time <= end:
                    continue
                if signal.status is None:
                    values.append(signal.values)
                    temperature = signal.temperature
                elif values is held:
                    # One saturated chip spoils the creep of the whole touch.
                    status = signal.status
        if rest:
            self._level = np.mean(rest, axis=0)
            left = None if before is None else self._level - before
        if not held or self._level is None:
            nothing = np.full((len(touch.readings[0].field), 3), np.nan)
            return Label(touch.contact, nothing, temperature, status or Status.CHIP_MISSING, left)
        read = np.stack([self._level, np.mean(held, axis=0)])
        return Label(touch.contact, read[1] - read[0], temperature, status, left, read)

    def unlooped(self, labels: Sequence[Label]) -> tuple[list[Label], Loops | None]:
        """The labels of all touches with hysteresis undone, and the loops that were learned.

        Where touches left nothing behind, or fewer than three were read, they stay as they are.
        """
        reads = [label.read for label in labels if label.read is not None]
        if len(reads) < _FEWEST:
            return list(labels), None
        bend = self._signals.straightening
        read = bend.straightened(np.stack(reads).reshape(len(reads), 2, -1))
        noise = np.sqrt(signal_noise(self._design).diagonal())
        loops = learn_loops(read[:, 0], read[:, 1], noise, bend.motions)
        if not loops.weights.any():
            return list(labels), None
        rests, held = elastic_signals(loops, read[:, 0], read[:, 1])
        values = iter(bend.bent(held - rests).reshape(len(reads), -1, 3))
        left = iter([None, *np.diff(rests, axis=0).reshape(len(reads) - 1, -1, 3)])
        made = [
            label if label.read is None else label._replace(values=next(values), left=next(left))
            for label in labels
        ]
        return made, loops


def labelled_touches(
    labels: Sequence[Label],
    chips: tuple[int, ...],
    *,
    place_spread: float,
    force_spread: float,
    loops: Loops | None = None,
) -> LabelledTouches:
    """The labels that can be used, with the signals of these chips alone; `ArgumentError` if none.

    Spreads are standard deviations of their places, m, and forces, N, along each axis; loops are
    those of all chips that were undone.
    """
    good = [label for label in labels if label.status is None]
    if not good:
        causes = ", ".join(sorted({label.status.name for label in labels if label.status}))
        raise ArgumentError(
            f"labels must hold at least one that can be used; got {len(labels)} ({causes}); are "
            "the fields in the right unit?"
        )
    left = [label.left[list(chips)] for label in labels if label.left is not None]
    return LabelledTouches(
        position=np.stack([label.contact.position for label in good]),
        force=np.stack([label.contact.force for label in good]),
        signals=np.stack([label.values for label in good])[:, list(chips)],
        temperature=np.array([label.temperature for label in good]),
        place_spread=place_spread,
        force_spread=force_spread,
        # A change is what one touch left less what the one before had.
        left=float(np.sqrt(np.mean(np.square(left)) / 2)) if left else 0.0,
        loops=loops and loops.of_signals([3 * chip + axis for chip in chips for axis in range(3)]),
    )
