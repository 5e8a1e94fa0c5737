"""Touches of a rig in a recording: written as they are made, gone on with, and read back.

Decides that a touch counts once its label is in the file behind all that belongs to it, and how a
campaign that was killed goes on in one file and on one clock.
"""

import hashlib
import itertools
import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from smoskin.arrays import Floats
from smoskin.design.document import format_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, RecordingError
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.records import Contact, HeldTouch, Reading, Trace
from smoskin.roles import Resource, Rig
from smoskin.service.campaign import table_of
from smoskin.service.mcap import UnbegunError
from smoskin.service.recorder import Recorder
from smoskin.service.recording import (
    GAUGE_TOPIC,
    PHASE_TOPIC,
    READING_TOPIC,
    RIG_TOPIC,
    STAGE_TOPIC,
    TOUCH_TOPIC,
    open_recording,
)
from smoskin.service.ros import POSITION, WRENCH, Codec, TouchLabel

RIG_PARTS: Final[dict[str, tuple[str, ...]]] = {
    "touch_position_m": ("touch_x_m", "touch_y_m"),
    "touch_force_N": ("touch_Fx_N", "touch_Fy_N", "touch_Fz_N"),
    "gauge_N": ("gauge_Fx_N", "gauge_Fy_N", "gauge_Fz_N"),
    "stage_m": ("stage_x_m", "stage_y_m", "stage_z_m"),
}
"""Names of the parts of the columns of what a rig says."""
_PAUSE: Final = 1.0
"""Seconds put at least between what was made before an interruption and what comes after."""


@final
class Campaign(Resource):
    """A recording of a rig's touches, which goes on with what its file holds of the same plan.

    Each touch is in the file, with its readings, once `add` returns. Where a campaign was killed
    what can be read of it is taken over: it stands beside the file, as ``NAME.before``, until all
    of it is in the new one, and of a touch that was not whole its readings stay.

    Parameters
    ----------
    path : str or path-like
        Recording (MCAP), new or of the same campaign.
    design : SkinDesign
        Design of the skin that is touched.
    plan : bytes
        Sheet of the touches to make, an attachment of the recording beside the design.
    rig : mapping, optional
        What is known of the rig and how it is set, kept as JSON.

    Raises
    ------
    ArgumentError
        If the file holds touches of another design.
    RecordingError
        If the file cannot be read or written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        design: SkinDesign,
        *,
        plan: bytes = b"",
        rig: Mapping[str, Any] | None = None,
    ) -> None:
        self._path = Path(path)
        before = self._path.with_name(f"{self._path.name}.before")
        if before.exists():
            # It was being taken over: what there is beside it is less.
            self._path.unlink(missing_ok=True)
        elif self._path.exists():
            try:
                open_recording(self._path)
            except UnbegunError:
                self._path.unlink()
            else:
                self._path.rename(before)
        rig_document = json.dumps(dict(rig or {}), sort_keys=True)
        files = {"design.toml": format_design(design).encode(), "rig.json": rig_document.encode()}
        self._late = 0.0
        self._last = -np.inf
        self._shift: float | None = None
        self.touches: list[HeldTouch] = []
        """Touches that are in the file, in their order."""
        earlier = open_recording(before) if before.exists() else None
        if earlier is not None and earlier.description.design_hash != design.content_hash:
            before.rename(self._path)
            raise ArgumentError(
                f"{path} holds touches of the design {earlier.description.design}; choose another "
                "name"
            )
        resumed = earlier is not None and earlier.reading_count > 0
        self._begun = earlier.description.start if earlier is not None and resumed else time.time()
        begun = round(1e9 * self._begun)
        self._recorder = Recorder(
            self._path,
            design,
            attachments=files | ({"plan.csv": plan} if plan else {}),
            rig=rig_document,
            wall_clock=(lambda: begun) if resumed else self._wall,
            on_failure=lambda sentence: None,
        )
        if earlier is not None:
            self._recorder.take_over(earlier)
            self.touches += recorded_touches(before)
            self._last = max((r.time for r in earlier.readings()), default=-np.inf)
            before.unlink()

    @property
    def made(self) -> TouchTable | None:
        """The touches that are in the file, as a table; None if there is none."""
        return table_of(self.touches) if self.touches else None

    def add(self, touch: HeldTouch) -> None:
        """Write a touch; raises a `RecordingError` if the file cannot be written any more."""
        span = touch.readings[-1].time - touch.readings[0].time
        self._late = span
        if self._shift is None:
            first, self._shift = touch.readings[0].time, 0.0
            if np.isfinite(self._last):
                since = time.time() - span - self._begun
                self._shift = max(self._last + _PAUSE, since) - first
        whole = _shifted(touch, self._shift)
        self._recorder.write_touch(len(self.touches), whole)
        if self._recorder.failure:
            raise RecordingError(self._recorder.failure)
        self.touches.append(whole)

    def close(self) -> None:
        """Write the file's index."""
        self._recorder.close()

    def _wall(self) -> int:
        """The wall clock when the first reading of the touch that is written was made, ns."""
        return time.time_ns() - round(1e9 * self._late)


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

        A sheet (CSV) says when each was held, so that a wrong unit or sign can be mended there. It
        raises a `RecordingError` or a `FileError` if they cannot be written.
        """
        if not self._touches:
            return "no touch was made"
        for number in itertools.count(1):
            stem = beside.with_name(f"{beside.stem}.touches{'' if number == 1 else number}")
            sheet, recording = (stem.with_name(f"{stem.name}.{end}") for end in ("csv", "mcap"))
            if not (sheet.exists() or recording.exists()):
                break
        with Campaign(recording, self._design) as campaign:
            for touch in self._touches:
                campaign.add(touch)
        table = table_of(self._touches)
        write_touches(sheet, replace(table, field=np.full_like(table.field, np.nan)))
        return f"the touches are kept: --sheet {sheet} --recording {recording}"


def recorded_touches(path: str | os.PathLike[str], *, some: bool = False) -> tuple[HeldTouch, ...]:
    """The touches of a rig in a recording, in their order, each once.

    Raises
    ------
    RecordingError
        If the recording cannot be read, or there are to be some and are none.
    MissingExtraError
        If the library of recordings is not installed.
    """
    recording, codec = open_recording(path), Codec()
    readings: list[Reading] = []
    anchor: tuple[int, float] | None = None
    streams: dict[str, list[tuple[int, Floats]]] = {WRENCH: [], POSITION: []}
    phases: dict[int, list[tuple[str, float, float]]] = {}
    labels: dict[int, TouchLabel] = {}

    def take_reading(payload: bytes) -> None:
        nonlocal anchor
        readings.append(codec.decode_reading(payload)[1])
        anchor = anchor or (codec.stamp(payload), readings[0].time)

    def take_phase(payload: bytes) -> None:
        number, phase = codec.decode_phase(payload)
        phases.setdefault(number, []).append(phase)

    def take_touch(payload: bytes) -> None:
        label = codec.decode_touch(payload)
        labels.setdefault(label.number, label)

    taken = {
        READING_TOPIC: take_reading,
        GAUGE_TOPIC: lambda payload: streams[WRENCH].append(codec.decode_vector(payload, WRENCH)),
        STAGE_TOPIC: lambda payload: streams[POSITION].append(
            codec.decode_vector(payload, POSITION)
        ),
        PHASE_TOPIC: take_phase,
        TOUCH_TOPIC: take_touch,
    }
    for _ in recording.decoded(taken):
        pass
    if some and not labels:
        raise RecordingError(f"{path} holds no touch of a rig: give the sheet (CSV) of its touches")
    times = np.array([reading.time for reading in readings])
    gauge, stage = (_timed(streams[name], anchor) for name in (WRENCH, POSITION))
    return tuple(
        _touch_of(label, readings, times, gauge, stage, phases.get(number, []))
        for number, label in sorted(labels.items())
        if ((times >= label.span[0]) & (times <= label.span[1])).any()
    )


def read_sheet(path: str | os.PathLike[str]) -> tuple[TouchTable, str]:
    """The touches of a sheet (CSV) or of a rig's recording (MCAP), and the file's SHA-256.

    It raises as `smoskin.measurement.read_touches` and `recorded_touches`, and a `RecordingError`
    if a recording holds no touch of a rig.
    """
    if Path(path).suffix != ".mcap":
        return read_touches(path)
    touches = recorded_touches(path, some=True)
    return table_of(touches), hashlib.sha256(Path(path).read_bytes()).hexdigest()


def parted_sheet(path: str | os.PathLike[str]) -> tuple[TouchTable, TouchTable | None]:
    """The touches of a sheet or a recording to learn by, and those that were held out of it.

    A recording says before its first touch which these are; there are none where it does not, or
    none of them has been made. It raises as `read_sheet` and `held_out_of`, and a `RecordingError`
    if all are held out.
    """
    table, _ = read_sheet(path)
    if Path(path).suffix != ".mcap" or not (numbers := held_out_of(path)):
        return table, None
    # A row of the untouched skin stands before each touch.
    held = np.isin(np.arange(len(table.field)) // 2, numbers)
    if not held.any():
        return table, None
    if held.all():
        raise RecordingError(f"{path}: all touches are held out; there must be some to learn by")
    return table.rows(~held), table.rows(held)


def held_out_of(path: str | os.PathLike[str]) -> tuple[int, ...]:
    """Numbers, from 0, of the touches of a recording that were held out before the first press."""
    numbers = rig_of(path).get("held_out", [])
    if not (isinstance(numbers, list) and all(type(number) is int for number in numbers)):
        raise RecordingError(f"{path}: the rig's description is damaged: held_out is no numbers")
    return tuple(numbers)


def rig_columns(path: str | os.PathLike[str], times: Floats) -> dict[str, NDArray[Any]]:
    """Columns of what a rig said at readings' times, (N,), s; none where it made no touch.

    ``touch``, (N,), is the number of the touch that is held, or -1, ``touch_position_m``, (N, 2),
    and ``touch_force_N``, (N, 3), what it is, NaN where none is held. Where gauge and stage were
    read, ``gauge_N`` and ``stage_m``, (N, 3), are between their own samples on straight lines, NaN
    beyond them, and ``phase``, (N,), names what the rig did.
    """
    touches = recorded_touches(path)
    if not touches:
        return {}
    columns: dict[str, NDArray[Any]] = {
        "touch": np.full(len(times), -1, dtype=np.int64),
        "touch_position_m": np.full((len(times), 2), np.nan),
        "touch_force_N": np.full((len(times), 3), np.nan),
    }
    if any(touch.trace is not None for touch in touches):
        columns |= {name: np.full((len(times), 3), np.nan) for name in ("gauge_N", "stage_m")}
        longest = max(len(name) for t in touches if t.trace for name, _, _ in t.trace.phases)
        columns["phase"] = np.full(len(times), "", dtype=f"U{longest}")
    for number, touch in enumerate(touches):
        held = (times >= touch.held[0]) & (times <= touch.held[1])
        columns["touch"][held] = number
        columns["touch_position_m"][held] = touch.contact.position
        columns["touch_force_N"][held] = touch.contact.force
        if touch.trace is None:
            continue
        for name, stream in (("gauge_N", touch.trace.gauge), ("stage_m", touch.trace.stage)):
            if len(stream):
                within = (times >= stream[0, 0]) & (times <= stream[-1, 0])
                for axis in range(3):
                    columns[name][within, axis] = np.interp(
                        times[within], stream[:, 0], stream[:, 1 + axis]
                    )
        for name, begin, end in touch.trace.phases:
            columns["phase"][(times >= begin) & (times < end)] = name
    return columns


def rig_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a recording says of the rig that touched the skin; empty where it says nothing."""
    documents = [*open_recording(path).decoded({RIG_TOPIC: Codec().decode_document})]
    try:
        return dict(json.loads(documents[0])) if documents else {}
    except ValueError as error:
        raise RecordingError(f"{path}: the rig's description is damaged") from error


def _touch_of(
    label: TouchLabel,
    readings: Sequence[Reading],
    times: Floats,
    gauge: Floats,
    stage: Floats,
    phases: Sequence[tuple[str, float, float]],
) -> HeldTouch:
    """A touch with what of all streams lies within its span."""
    begin, end = label.span
    ends = [begin, end, *(moment for _, *both in phases for moment in both)]
    parts = [
        part[(part[:, 0] >= min(ends) - 1e-6) & (part[:, 0] <= max(ends) + 1e-6)]
        for part in (gauge, stage)
    ]
    traced = bool(phases) or any(map(len, parts))
    return HeldTouch(
        contact=label.contact,
        readings=tuple(
            readings[k] for k in np.flatnonzero((times >= begin) & (times <= end)).tolist()
        ),
        rest=label.rest,
        held=label.held,
        trace=Trace(gauge=parts[0], stage=parts[1], phases=phases) if traced else None,
    )


def _timed(stream: Sequence[tuple[int, Floats]], anchor: tuple[int, float] | None) -> Floats:
    """A stream, (N, 4), in the order of time, its stamps, ns, as times of the readings' clock."""
    if not stream or anchor is None:
        return np.zeros((0, 4))
    stamp, moment = anchor
    rows = np.array([(moment + 1e-9 * (each - stamp), *values) for each, values in stream])
    return rows[np.argsort(rows[:, 0], kind="stable")]


def _shifted(touch: HeldTouch, shift: float) -> HeldTouch:
    """The same touch so many seconds later."""
    if shift == 0.0:
        return touch
    trace = touch.trace
    if trace is not None:
        later = np.array([shift, 0.0, 0.0, 0.0])
        trace = Trace(
            gauge=trace.gauge + later,
            stage=trace.stage + later,
            phases=[(name, begin + shift, end + shift) for name, begin, end in trace.phases],
        )
    return HeldTouch(
        contact=touch.contact,
        readings=tuple(replace(reading, time=reading.time + shift) for reading in touch.readings),
        rest=(touch.rest[0] + shift, touch.rest[1] + shift),
        held=(touch.held[0] + shift, touch.held[1] + shift),
        trace=trace,
    )
