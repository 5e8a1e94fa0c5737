"""What a rig is asked to press: campaigns as sheets of touches, and what is held out of them.

Decides the order of touches, where the same one is made again and again to tell drift from all
else, and that what is held out follows from the plan's places alone, so that it is known before
the first press and nobody can choose it afterwards.
"""

import hashlib
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.measurement import TouchTable

_FINEST: Final = 1e-5
"""Places are whole multiples of this, m."""
_LEVELS: Final = (0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25)
"""Shares of the largest force in a load cycle."""
_MOST: Final = 100_000
"""Touches of a plan, at most."""


@typed
def campaign_plan(
    kind: str,
    width: float,
    height: float,
    *,
    columns: int = 25,
    rows: int = 33,
    forces: Sequence[float] = (0.3, 0.6, 0.9),
    drag: float = 0.2,
    angles: int = 8,
    repeats: int = 5,
    reference_every: int = 25,
    seed: Seed = 0,
) -> TouchTable:
    """The touches of a campaign over a pad that reaches from (0, 0) to (width, height), m.

    Parameters
    ----------
    kind : str
        ``grid``: every place of a grid with every force; ``random``: as many places anywhere;
        ``shear``: every place with every force, straight and dragged at angles round the circle;
        ``cycles``: at every place the largest force in steps up and down, again and again;
        ``recovery``: at every place the largest force, again and again, each watched as it goes.
        For temperature the same plan is pressed cold and warm.
    columns, rows : int
        Places of the grid, half a step from the rim.
    forces : sequence of float
        How hard it is pressed, N.
    drag, angles : float, int
        Sideways force as a share of the press, and its directions; of ``shear`` alone.
    repeats : int
        Cycles, or touches a place, of ``cycles`` and ``recovery``.
    reference_every : int
        The touch nearest the middle, at a middling force, is made at the beginning, after every so
        many others, and at the end; 0 for none.
    seed : int
        Seed of the order, and of random places.

    Raises
    ------
    ArgumentError
        If there is no such kind, a number is not positive, or touches are over 100,000.

    Examples
    --------
    >>> len(campaign_plan("grid", 0.12, 0.16).contacts)
    2575
    """
    sizes = {"width": width, "height": height, "columns": columns, "rows": rows}
    _check_positive(**sizes, angles=angles, repeats=repeats, drag=drag, forces=forces)
    if not forces or reference_every < 0:
        raise ArgumentError(
            f"there must be forces, and reference_every be none or positive; got {reference_every}"
        )
    if kind not in _KINDS:
        raise ArgumentError(f"kind must be one of {', '.join(_KINDS)}; got {kind!r}")
    if columns * rows * len(forces) * max(angles + 1, len(_LEVELS) * repeats) > 10 * _MOST:
        raise ArgumentError(f"a plan must hold at most {_MOST} touches; give fewer places")
    rng = np.random.default_rng(seed)
    x = (np.arange(columns) + 0.5) * width / columns
    y = (np.arange(rows) + 0.5) * height / rows
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    if kind == "random":
        places = rng.uniform((0.0, 0.0), (width, height), places.shape)
    places = np.round(places / _FINEST) * _FINEST
    pushes = _KINDS[kind](np.sort(np.array(forces, float)), drag, angles, repeats)
    if kind in ("cycles", "recovery"):
        # A place stays until it is done: what it remembers is what is asked.
        position = np.repeat(rng.permutation(places), len(pushes), axis=0)
        force = np.tile(pushes, (len(places), 1))
    else:
        order = rng.permutation(len(places) * len(pushes))
        position = np.repeat(places, len(pushes), axis=0)[order]
        force = np.tile(pushes, (len(places), 1))[order]
    if reference_every:
        middle = places[np.linalg.norm(places - [width / 2, height / 2], axis=1).argmin()]
        usual = np.array([0.0, 0.0, -float(np.median(forces))])
        at = [*range(0, len(position), reference_every), len(position)]
        position = np.insert(position, at, middle, axis=0)
        force = np.insert(force, at, usual, axis=0)
    if len(position) > _MOST:
        raise ArgumentError(f"a plan must hold at most {_MOST} touches; got {len(position)}")
    return TouchTable(position=position, force=force, field=np.full((len(position), 0, 3), np.nan))


def _check_positive(**numbers: float | Sequence[float]) -> None:
    """Raise on the first number that is not positive and finite."""
    for name, value in numbers.items():
        if not ((np.asarray(value) > 0.0) & np.isfinite(value)).all():
            raise ArgumentError(f"{name} must be positive and finite; got {value}")


def _straight(forces: Floats, *_: float) -> Floats:
    return np.stack([0.0 * forces, 0.0 * forces, -forces], axis=1)


def _sheared(forces: Floats, drag: float, angles: int, _: int) -> Floats:
    turns = 2.0 * np.pi * np.arange(angles) / angles
    aside = drag * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ways = np.column_stack([np.concatenate([np.zeros((1, 2)), aside]), -np.ones(angles + 1)])
    return np.asarray((forces[:, None, None] * ways).reshape(-1, 3).round(6))


def _cycled(forces: Floats, _: float, __: int, repeats: int) -> Floats:
    return _straight(np.tile(forces[-1] * np.array(_LEVELS), repeats))


def _repeated(forces: Floats, _: float, __: int, repeats: int) -> Floats:
    return _straight(np.full(repeats, forces[-1]))


_KINDS: Final[dict[str, Callable[[Floats, float, int, int], Floats]]] = {
    "grid": _straight,
    "random": _straight,
    "shear": _sheared,
    "cycles": _cycled,
    "recovery": _repeated,
}
"""Forces at a place, (K, 3), N, of forces (F,), drag, angles and repeats."""


def held_out(plan: TouchTable, share: float) -> tuple[int, ...]:
    """Numbers, from 0, of the plan's touches at places that are held out, about such a share.

    A place is held out if the first eight bytes of the SHA-256 of its coordinates, as whole
    numbers of 0.01 mm with a comma, are below that share of the largest: all touches at it or
    none, whatever else the plan holds. It raises an `ArgumentError` unless the share is from 0 up
    to 0.9.
    """
    if not 0.0 <= share <= 0.9:
        raise ArgumentError(f"share must be from 0 to 0.9; got {share}")
    numbers = []
    for number, contact in enumerate(plan.contacts):
        x, y = np.rint(contact.position / _FINEST).astype(int)
        digest = hashlib.sha256(f"{x},{y}".encode()).digest()
        if int.from_bytes(digest[:8], "big") < share * 2.0**64:
            numbers.append(number)
    return tuple(numbers)
