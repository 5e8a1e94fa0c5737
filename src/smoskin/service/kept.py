"""Touches of a rig that are kept where no table comes of them, so that nobody presses anew.

Decides their files: a CSV of when each touch was held, and a recording of what the chips read,
which `smoskin calibrate --sheet CSV --recording MCAP` reads.
"""

import itertools
from pathlib import Path

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.measurement import TouchTable, write_touches
from smoskin.records import Contact, HeldTouch
from smoskin.roles import Rig
from smoskin.service.recorder import Recorder


class RememberingRig(Rig):
    """A rig that remembers its touches; closing it leaves the rig itself open."""

    def __init__(self, rig: Rig, design: SkinDesign) -> None:
        self._rig, self._design = rig, design
        self._touches: list[HeldTouch] = []

    @property
    def place_spread(self) -> float:
        """The rig's own, m."""
        return self._rig.place_spread

    @property
    def force_spread(self) -> float:
        """The rig's own, N."""
        return self._rig.force_spread

    def press(self, contact: Contact, timeout: float = 30.0) -> HeldTouch:
        """As the rig does."""
        self._touches.append(self._rig.press(contact, timeout))
        return self._touches[-1]

    def close(self) -> None:
        """Do nothing."""

    def keep(self, beside: Path) -> str:
        """Write the touches beside a file, under names that are free; how to go on, in words.

        It raises a `RecordingError` or a `FileError` if they cannot be written.
        """
        if not self._touches:
            return "no touch was made"
        for number in itertools.count(1):
            stem = beside.with_name(f"{beside.stem}.touches{'' if number == 1 else number}")
            sheet, recording = (stem.with_name(f"{stem.name}.{end}") for end in ("csv", "mcap"))
            if not (sheet.exists() or recording.exists()):
                break
        with Recorder(recording, self._design) as recorder:
            for reading in (one for touch in self._touches for one in touch.readings):
                recorder.write(reading)
        write_touches(sheet, self._sheet())
        return f"the touches are kept: --sheet {sheet} --recording {recording}"

    def _sheet(self) -> TouchTable:
        """Rest and hold of every touch, a row each."""
        nowhere, nothing = np.full(2, np.nan), np.zeros(3)
        rows = [
            row
            for touch in self._touches
            for row in (
                (nowhere, nothing, touch.rest),
                (touch.contact.position, touch.contact.force, touch.held),
            )
        ]
        position, force, held = map(np.array, zip(*rows, strict=True))
        blank = np.full((len(rows), len(self._design.halls), 3), np.nan)
        return TouchTable(position=position, force=force, field=blank, held=held)
