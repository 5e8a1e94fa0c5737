"""Touches made by hand one after the other, each recorded as soon as it is held still.

Decides when a skin rests, is touched and held, and is let go again, from its readings alone, so
that nobody has to press a key with the other hand.
"""

from collections import deque
from collections.abc import Callable
from typing import Final, final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.measurement import TouchTable
from smoskin.records import Contact, Reading
from smoskin.roles import Source

_STILL: Final = 0.5
"""Seconds for which a rest or a touch is held still, at least."""
_LEAST: Final = 10
"""Readings for which it is, at least; slow boards need longer for them."""
_QUIET: Final = 8e-6
"""Standard deviation of a field that is still, T, at least; chips may be louder by themselves."""
_LOUDER: Final = 2.5
"""Spread of a touch that is held still, over that of the first rest."""
_MOVING: Final = 2e-6
"""Change from one half of that time to the other by which a field still moves, T."""
_CREEP: Final = 0.02
"""The same, over the change by the touch: rubber creeps under it."""
_TOUCHED: Final = 30e-6
"""Change of the field by which a skin is touched, T."""
_RELEASED: Final = 0.25
"""Share of a touch's change below which it is let go."""
_PATIENCE: Final = 10.0
"""Seconds without a step forward after which what is waited for is said again."""


@final
class GuidedTouches:
    """The touches of a plan, recorded from readings in the plan's order.

    `say` is told what to do next, and after 10 s without a step forward why not. The table grows
    by a row of the untouched skin and a row of the touch, again and again; it is whole at any
    moment.

    Parameters
    ----------
    plan : TouchTable
        Touches to make; rows of the untouched skin are left out, since one comes before each.
    say : callable
        Takes a sentence.
    touched : float
        Change of the field by which a skin is touched, T.

    Raises
    ------
    ArgumentError
        If the plan has no touch.
    """

    @typed
    def __init__(
        self,
        plan: TouchTable,
        *,
        say: Callable[[str], object] = lambda sentence: None,
        touched: float = _TOUCHED,
    ) -> None:
        self._targets = plan.contacts
        if not self._targets:
            raise ArgumentError("plan must hold at least one touch; got none")
        self._say, self._touched = say, touched
        self._window: deque[Reading] = deque()
        self._rows: list[tuple[Contact | None, Floats, Floats, tuple[float, float]]] = []
        self._rest: Floats | None = None
        self._change = 0.0
        self._quiet = 0.0
        self._resting = True
        self._since: float | None = None
        say("Let nothing touch the skin.")

    @property
    def made(self) -> int:
        """Touches that have been recorded."""
        return sum(contact is not None for contact, *_ in self._rows)

    @property
    def done(self) -> bool:
        """Whether every touch of the plan has been recorded."""
        return self.made == len(self._targets)

    @property
    def table(self) -> TouchTable:
        """What has been recorded so far; `ArgumentError` before the first rest."""
        if not self._rows:
            raise ArgumentError("no rest has been recorded yet")
        contacts, fields, degrees, held = zip(*self._rows, strict=True)
        nowhere, nothing = np.full(2, np.nan), np.zeros(3)
        return TouchTable(
            position=[nowhere if c is None else c.position for c in contacts],
            force=[nothing if c is None else c.force for c in contacts],
            field=np.array(fields),
            temperature=np.array(degrees),
            held=np.array(held),
        )

    def step(self, reading: Reading) -> None:
        """Take the next reading; one with a faulty chip begins the stillness anew."""
        self._since = reading.time if self._since is None else self._since
        if reading.time - self._since > _PATIENCE:
            self._since = reading.time
            self._say(self._hindrance(reading))
        if reading.flags.any() or not np.isfinite(reading.field).all():
            self._window.clear()
            return
        self._window.append(reading)
        while len(self._window) > _LEAST and reading.time - self._window[1].time >= _STILL:
            self._window.popleft()
        if self._resting:
            self._rested(reading)
        elif self._change:
            self._released(reading)
        else:
            self._held(reading)

    def _rested(self, reading: Reading) -> None:
        """Record a rest that is still."""
        mean = self._still()
        if mean is None:
            return
        self._rest, self._resting = mean, False
        self._keep(None, mean)
        self._say(self._order())

    def _order(self) -> str:
        """What is to be pressed next."""
        number, target = self.made + 1, self._targets[self.made]
        x, y = (1e3 * target.position).tolist()
        force = f" with {np.linalg.norm(target.force):.2f} N" if target.force.any() else ""
        return (
            f"{number} of {len(self._targets)}: press at x {x:.1f} mm, y {y:.1f} mm{force}, and "
            "hold still."
        )

    def _hindrance(self, reading: Reading) -> str:
        """What keeps the next step from being made."""
        faulty = np.flatnonzero(reading.flags) + 1
        if faulty.size:
            chips = ", ".join(map(str, faulty))
            return f"Chip {chips} has a fault: smoskin doctor says what to do."
        if self._resting:
            return "The skin does not rest yet: let nothing touch or move it."
        if self._change:
            return "The skin is touched still: let go."
        assert self._rest is not None
        change = 1e6 * np.abs(reading.field - self._rest).max()
        return (
            f"{self._order()} The field is {change:.0f} uT from rest; a touch changes it by "
            f"{1e6 * self._touched:.0f} uT or more."
        )

    def _held(self, reading: Reading) -> None:
        """Record a touch that is held still."""
        mean = self._still()
        assert self._rest is not None
        if mean is None or np.abs(mean - self._rest).max() < self._touched:
            return
        self._change = float(np.abs(mean - self._rest).max())
        self._keep(self._targets[self.made], mean)
        self._say("Got it: let go." if not self.done else "Got it: that was the last one.")

    def _released(self, reading: Reading) -> None:
        """Begin the next rest once the skin is let go."""
        assert self._rest is not None
        if np.abs(reading.field - self._rest).max() < _RELEASED * self._change:
            self._change, self._resting, self._since = 0.0, True, reading.time
            self._window.clear()

    def _still(self) -> Floats | None:
        """Mean field since half a second and ten readings ago if it was still; None otherwise."""
        if len(self._window) < _LEAST or self._window[-1].time - self._window[0].time < _STILL:
            return None
        fields = np.array([reading.field for reading in self._window])
        spread = float(fields.std(axis=0).max())
        if spread > max(_QUIET, _LOUDER * self._quiet) and self._rows:
            return None
        # Half against half tells what still moves; a touch may creep a little.
        half = len(fields) // 2
        mean = np.asarray(fields.mean(axis=0))
        change = 0.0 if self._rest is None else float(np.abs(mean - self._rest).max())
        noise = float(np.diff(fields, axis=0).std(axis=0).max()) / 2**0.5
        allowed = max(_MOVING, _CREEP * change, 4 * noise * (2 / half) ** 0.5)
        if np.abs(fields[:half].mean(axis=0) - fields[half:].mean(axis=0)).max() > allowed:
            return None
        self._quiet = self._quiet or spread
        return mean

    def _keep(self, contact: Contact | None, field: Floats) -> None:
        times = [reading.time for reading in self._window]
        degrees = np.mean([reading.temperature for reading in self._window], axis=0)
        self._rows.append((contact, field, degrees, (times[0], times[-1])))
        self._since = times[-1]
        self._window.clear()


@typed
def record_touches(
    source: Source,
    plan: TouchTable,
    *,
    say: Callable[[str], object] = lambda sentence: None,
    keep: Callable[[TouchTable], object] = lambda table: None,
) -> TouchTable:
    """The touches of a plan, made by hand on a source; `keep` gets the table after each.

    It ends with what there is if the source does; it raises a `SourceError` if the source falls
    silent, after which `keep` still has all touches up to there.
    """
    guided = GuidedTouches(plan, say=say)
    made = 0
    for reading in source:
        guided.step(reading)
        if guided.made > made:
            made = guided.made
            keep(guided.table)
        if guided.done:
            break
    return guided.table


def grid_plan(
    width: float, height: float, count: int, *, force: float = 0.5, seed: int = 0
) -> TouchTable:
    """About so many touches on a grid over a pad, in random order, all as hard.

    The pad reaches from (0, 0) to (width, height), m; the outermost touches are half a step from
    its rim. The force is in N.

    Raises
    ------
    ArgumentError
        If a size, the count or the force is not positive.

    Examples
    --------
    >>> len(grid_plan(30e-3, 20e-3, 24).contacts)
    24
    """
    if not (0.0 < width <= 10.0 and 0.0 < height <= 10.0):
        raise ArgumentError(f"width and height must be above 0 m; got {width}, {height}")
    if count < 1 or not force > 0.0:
        raise ArgumentError(f"count and force must be positive; got {count}, {force} N")
    columns = max(1, round((count * width / height) ** 0.5))
    rows = max(1, round(count / columns))
    x = (np.arange(columns) + 0.5) * width / columns
    y = (np.arange(rows) + 0.5) * height / rows
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    order = np.random.default_rng(seed).permutation(len(places))
    return TouchTable(
        position=places[order].round(5),
        force=np.tile([0.0, 0.0, -force], (len(places), 1)),
        field=np.full((len(places), 0, 3), np.nan),
    )
