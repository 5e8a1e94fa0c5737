"""Touches of a plan that a rig makes alone, each once, however often it is interrupted.

Decides what is kept of a touch: the means of what the chips read at rest before it and while it was
held, and when that was.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.errors import ArgumentError
from smoskin.measurement import TouchTable
from smoskin.records import Contact, HeldTouch
from smoskin.roles import Progress, Rig, unheard

_SAME: Final = 1e-3
"""Distance up to which a reported place is that of the plan, m."""
_PATIENCE: Final = 30.0
"""Seconds that a rig may take for a touch."""
_PAUSE: Final = 1.0
"""Seconds put between what was made before an interruption and what comes after."""


@typed
def press_plan(
    rig: Rig,
    plan: TouchTable,
    *,
    made: TouchTable | None = None,
    keep: Callable[[TouchTable], object] = lambda table: None,
    every: float = 5.0,
    on_touch: Callable[[HeldTouch], object] = lambda touch: None,
    progress: Progress = unheard,
) -> TouchTable:
    """The touches of a plan in its order, with a row of the untouched skin before each.

    A touch that a chip could not read has its times, but no field; it is not pressed again.

    Parameters
    ----------
    rig : Rig
        Rig with the skin on it, which is left open.
    plan : TouchTable
        Touches to make; its rows of the untouched skin are left out.
    made : TouchTable, optional
        Kept touches of an earlier call with this plan, which is gone on with.
    keep : callable, optional
        Function that gets the table so far every so many seconds, and however the call ends.
    on_touch : callable, optional
        Function that gets each touch as soon as it has been made.

    Raises
    ------
    ArgumentError
        If the plan has no touch, `made` is not of its beginning or of another number of chips, or
        the skin cannot be touched so.
    SourceError
        If the rig does not answer in time.
    """
    targets = plan.contacts
    if not targets:
        raise ArgumentError("plan must hold at least one touch; got none")
    rows = [] if made is None else [made]
    begun = 0 if made is None else _made_of(made, targets)
    shift = 0.0 if made is None else float(np.nanmax(made.held, initial=0.0)) + _PAUSE
    first: float | None = None
    kept = time.monotonic()
    try:
        for number, target in enumerate(targets[begun:], begun):
            progress(f"touch {number + 1} of {len(targets)}", number / len(targets))
            touch = rig.press(target, _PATIENCE)
            on_touch(touch)
            first = touch.rest[0] if first is None else first
            rows.append(_rows(touch, shift - first))
            if time.monotonic() - kept > every:
                rows = [_joined(rows)]
                keep(rows[0])
                kept = time.monotonic()
    finally:
        if rows:
            keep(_joined(rows))
    progress("done", 1.0)
    return _joined(rows)


def table_of(touches: Sequence[HeldTouch]) -> TouchTable:
    """The table of touches that were held, with a row of the untouched skin before each."""
    if not touches:
        raise ArgumentError("touches must hold at least one; got none")
    return _joined([_rows(touch, 0.0) for touch in touches])


def _made_of(made: TouchTable, targets: tuple[Contact, ...]) -> int:
    """How many of a plan's touches have been made; raises where they are of another plan."""
    places = [contact.position for contact in made.contacts]
    for number, (place, target) in enumerate(zip(places, targets, strict=False), 1):
        if not np.linalg.norm(place - target.position) <= _SAME:
            x, y = 1e3 * target.position
            raise ArgumentError(
                f"touches made before must be those of the plan; touch {number} is not at "
                f"({x:.1f}, {y:.1f}) mm"
            )
    if len(places) > len(targets):
        raise ArgumentError(f"plan must hold the {len(places)} touches made; got {len(targets)}")
    return len(places)


def _rows(touch: HeldTouch, shift: float) -> TouchTable:
    """Rest and hold of a touch as two rows, their times shifted."""
    chips = len(touch.readings[0].field)
    both = TouchTable(
        position=[np.full(2, np.nan), touch.contact.position],
        force=[np.zeros(3), touch.contact.force],
        field=np.full((2, chips, 3), np.nan),
        held=[touch.rest, touch.held],
    )
    with suppress(ArgumentError):  # no reading had all chips good
        both = both.with_readings(touch.readings)
    return replace(both, held=both.held + shift)


def _joined(tables: list[TouchTable]) -> TouchTable:
    """Tables one after the other."""
    chips = {table.field.shape[1] for table in tables}
    if len(chips) > 1:
        raise ArgumentError(f"touches must be of one board; got boards of {sorted(chips)} chips")
    parts = [part.name for part in fields(TouchTable)]
    return TouchTable(
        **{name: np.concatenate([getattr(table, name) for table in tables]) for name in parts}
    )
