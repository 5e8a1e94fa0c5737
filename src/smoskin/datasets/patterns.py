"""What to press: sweeps over places, forces, temperatures and made skins.

Decides the order of presses and where chunks begin and end, from the sweep alone: a chunk holds
the same rows whoever computes it, whenever, and beside whom. Hides random draws, which each chunk
makes from the sweep's seed and its own number, and the sweep's written form, which is hashed.
Every record raises `ArgumentError` where a number is out of bounds.
"""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.documents import Form
from smoskin.errors import ArgumentError, RecordingError
from smoskin.magnetics.temperature import SERVICE_LIMITS
from smoskin.mechanics.sheet.touches import FINGERTIP, Grip, Sticking, Touches
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.twin.manufacture import Tolerances

LARGEST_FORCE: Final = 50.0
"""N: any more would tear a skin; the model is meant for presses of a few newtons."""
_FORCE: Final = (0.0, LARGEST_FORCE, "N")
_MOST_ROWS: Final = 100_000_000
"""Rows of a sweep: a day's work of a cluster."""
_RADIUS: Final = (1e-4, 0.05, "m")

Mechanics = Literal["whole", "reduced"]

_STICKING: Final = Sticking()
_PRESSES, _NOISE = 0, 1
"""Streams of what a chunk draws."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Every force and drag at every place of a grid, one touch a press.

    Examples
    --------
    The SI's sweep:

    >>> Grid(forces=tuple(k / 10 for k in range(1, 11))).count
    8250
    """

    forces: tuple[float, ...]
    """N, how hard each press pushes down, from 0 to `LARGEST_FORCE`."""
    drags: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    """N, sideways along x and y; each with every force."""
    places: tuple[int, int] = (25, 33)
    """Places along x and y, evenly from rim to rim: 5 mm apart on the reference skin."""
    radius: float = FINGERTIP
    """m, radius of the touch."""

    def __post_init__(self) -> None:
        _check_bounds(self, forces=_FORCE, drags=(-LARGEST_FORCE, *_FORCE[1:]), radius=_RADIUS)
        _check_places(self.places)

    @property
    def count(self) -> int:
        """Number of presses."""
        return math.prod(self.places) * len(self.forces) * len(self.drags)

    def touches(self, design: SkinDesign, index: Ints, rng: np.random.Generator) -> Touches:
        """The presses of these numbers; places change fastest, forces slowest."""
        force, drag, place = np.unravel_index(
            index, (len(self.forces), len(self.drags), math.prod(self.places))
        )
        push = np.empty((len(index), 1, 3))
        push[:, 0, :2] = np.array(self.drags)[drag]
        push[:, 0, 2] = -np.array(self.forces)[force]
        places = places_to_the_rim(geometry(design).extent, self.places)
        return Touches(position=places[place][:, None], force=push, radius=self.radius)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairs:
    """Every pair of places of a grid touched at once, each of both with every force."""

    forces: tuple[float, ...]
    """N, how hard each of both pushes down, from 0 to `LARGEST_FORCE`."""
    places: tuple[int, int] = (25, 33)
    """Places along x and y, evenly from rim to rim."""
    radius: float = FINGERTIP
    """m, radius of both touches."""

    def __post_init__(self) -> None:
        _check_bounds(self, forces=_FORCE, radius=_RADIUS)
        _check_places(self.places)

    @property
    def count(self) -> int:
        """Number of presses."""
        return (math.prod(self.places) * len(self.forces)) ** 2

    def touches(self, design: SkinDesign, index: Ints, rng: np.random.Generator) -> Touches:
        """The presses of these numbers; the second place changes fastest, then the first."""
        forces, places = len(self.forces), math.prod(self.places)
        shape = (forces, forces, places, places)
        weak, strong, first, second = np.unravel_index(index, shape)
        push = np.zeros((len(index), 2, 3))
        push[..., 2] = -np.array(self.forces)[np.stack([weak, strong], axis=1)]
        place = places_to_the_rim(geometry(design).extent, self.places)
        position = place[np.stack([first, second], axis=1)]
        return Touches(position=position, force=push, radius=self.radius)


@dataclass(frozen=True, slots=True, kw_only=True)
class Random:
    """Presses drawn evenly: places over the skin, forces, drags and radii within bounds."""

    count: int
    """Number of presses."""
    forces: tuple[float, float] = (0.1, 1.0)
    """N, from and to: how hard each touch pushes down."""
    drags: tuple[float, float] = (0.0, 0.0)
    """N, from and to: sideways, in any direction."""
    radius: tuple[float, float] = (FINGERTIP, FINGERTIP)
    """m, from and to: radius of each touch."""
    touches_at_once: tuple[int, int] = (1, 1)
    """Fewest and most touches in a press."""
    margin: float = 0.0
    """m: how far within the rim the places lie."""

    def __post_init__(self) -> None:
        _check_bounds(
            self,
            count=(1, math.inf, ""),
            forces=_FORCE,
            drags=_FORCE,
            radius=_RADIUS,
            touches_at_once=(1, math.inf, ""),
            margin=(0.0, math.inf, "m"),
        )
        _check_rising(self, "forces", "drags", "radius", "touches_at_once")

    def touches(self, design: SkinDesign, index: Ints, rng: np.random.Generator) -> Touches:
        """As many presses as numbers are given."""
        extent = geometry(design).extent
        if 2 * self.margin > extent.min():
            raise ArgumentError(
                f"margin must be at most half the skin, {extent.min() / 2} m; got {self.margin}"
            )
        most = self.touches_at_once[1]
        shape = (len(index), most)
        position = rng.uniform(self.margin, extent - self.margin, (*shape, 2))
        push = np.empty((*shape, 3))
        push[..., 2] = -rng.uniform(*self.forces, shape)
        push[..., :2] = _turned(rng.uniform(*self.drags, shape), rng)
        radius = rng.uniform(*self.radius, shape)
        present = rng.integers(self.touches_at_once[0], most, len(index), endpoint=True)
        push[np.arange(most) >= present[:, None]] = 0.0
        return Touches(position=position, force=push, radius=radius)


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeated:
    """Presses drawn evenly, the same on every skin and at every temperature, as for a table."""

    count: int
    """Number of presses."""
    forces: tuple[float, float]
    """N, from and to: how hard each touch pushes down."""
    drag: float = 0.0
    """N, largest; drags fill the disc evenly, and two presses in five are straight."""
    apart: float | None = None
    """m, least distance of the two touches of a press; None: one touch a press."""
    seed: int = 0
    """Seed of the presses."""

    def __post_init__(self) -> None:
        _check_bounds(
            self, count=(1, math.inf, ""), forces=_FORCE, drag=_FORCE, seed=(0, math.inf, "")
        )
        _check_rising(self, "forces")

    def touches(self, design: SkinDesign, index: Ints, rng: np.random.Generator) -> Touches:
        """The presses of these numbers."""
        extent, drawn = geometry(design).extent, np.random.default_rng(self.seed)
        if self.apart is None:
            place = drawn.uniform(0, extent, (self.count, 1, 2))
        else:
            place = far_pairs(extent, self.apart, self.count, drawn)
        shape = place.shape[:2]
        drag = self.drag * np.sqrt(drawn.uniform(0, 1, shape)) * (drawn.uniform(0, 1, shape) > 0.4)
        sideways = _turned(drag, drawn)
        down = -drawn.uniform(*self.forces, (*shape, 1))
        return Touches(
            position=place[index], force=np.concatenate([sideways, down], axis=-1)[index]
        )


Presses = Grid | Pairs | Random | Repeated


def far_pairs(extent: Floats, apart: float, count: int, rng: np.random.Generator) -> Floats:
    """Pairs of places on a skin of this extent, (2,), drawn evenly, (count, 2, 2), all in m.

    No two lie nearer to each other than `apart`; `ArgumentError` if none lie so far apart.
    """
    if not apart < np.hypot(*extent):
        raise ArgumentError(f"apart must be below {np.hypot(*extent):g} m; got {apart:g}")
    kept = np.empty((0, 2, 2))
    while len(kept) < count:
        drawn = rng.uniform(0, extent, (4 * count, 2, 2))
        kept = np.concatenate([kept, drawn[np.hypot(*(drawn[:, 0] - drawn[:, 1]).T) >= apart]])
    return kept[:count]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Everything that a data set is made of, but for the skin.

    Each skin is pressed in every way of the pattern at each temperature. Rows are ordered by skin,
    then temperature, then press; a chunk holds presses of one skin at one temperature.

    Examples
    --------
    >>> sweep = Sweep(presses=Grid(forces=(0.5,)), temperatures=(25.0, 35.0), skins=(1, 2, 3))
    >>> sweep.rows, sweep.chunks
    (4950, 24)
    """

    presses: Presses
    """What is pressed."""
    temperatures: tuple[float, ...] = (25.0,)
    """degC, of rubber, magnets and chips, within what they stand."""
    skins: tuple[int, ...] = ()
    """Seeds of manufactured skins; none: one skin, as designed."""
    tolerances: Tolerances | None = None
    """Tolerances that the skins are drawn from; None: `Tolerances()`."""
    mechanics: Mechanics = "whole"
    """The whole sheet, or the reduced model of the SI."""
    grip: Grip = _STICKING
    """How touches hold on to the whole sheet."""
    seed: int = 0
    """Seed of random presses and of the chips' noise."""
    presses_per_chunk: int = 256
    """Most presses in a chunk."""

    def __post_init__(self) -> None:
        for name, kind in (("presses", Presses), ("grip", Grip)):
            if not isinstance(getattr(self, name), kind):
                names = ", ".join(each.__name__ for each in get_args(kind))
                raise ArgumentError(f"{name} must be one of {names}; got {getattr(self, name)!r}")
        _check_bounds(
            self,
            temperatures=(*SERVICE_LIMITS, "degC"),
            presses_per_chunk=(1, math.inf, ""),
            seed=(0, math.inf, ""),
        )
        if self.skins:
            _check_bounds(self, skins=(0, math.inf, ""))
        if self.rows > _MOST_ROWS:
            raise ArgumentError(f"a sweep must have at most {_MOST_ROWS:,} rows; got {self.rows:,}")
        if len(set(self.skins)) < len(self.skins):
            raise ArgumentError(f"skins must differ; got {self.skins}")
        if self.mechanics not in get_args(Mechanics):
            raise ArgumentError(f"mechanics must be whole or reduced; got {self.mechanics!r}")
        for name, usual in (("grip", _STICKING), ("skins", ())):
            if self.mechanics == "reduced" and getattr(self, name) != usual:
                raise ArgumentError(
                    f"{name} must be left out with reduced mechanics, which know the design alone; "
                    f"got {getattr(self, name)}"
                )

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return max(len(self.skins), 1) * len(self.temperatures) * self._parts

    @property
    def rows(self) -> int:
        """Number of rows in all chunks."""
        return max(len(self.skins), 1) * len(self.temperatures) * self.presses.count

    def rows_of(self, chunk: int) -> range:
        """Numbers of the rows that a chunk holds."""
        skin, temperature, presses = self._split(chunk)
        first = (skin * len(self.temperatures) + temperature) * self.presses.count
        return range(first + int(presses[0]), first + int(presses[-1]) + 1)

    def skin(self, chunk: int) -> int | None:
        """Seed of the skin that a chunk presses; None is the skin as designed."""
        return self.skins[self._split(chunk)[0]] if self.skins else None

    def temperature(self, chunk: int) -> float:
        """Temperature of skin, magnets and chips in a chunk, degC."""
        return self.temperatures[self._split(chunk)[1]]

    def touches(self, design: SkinDesign, chunk: int) -> Touches:
        """The presses of a chunk."""
        index = self._split(chunk)[2]
        return self.presses.touches(design, index, self._stream(chunk, _PRESSES))

    def noise(self, chunk: int) -> np.random.Generator:
        """Generator of the chips' noise in a chunk."""
        return self._stream(chunk, _NOISE)

    @property
    def content_hash(self) -> str:
        """SHA-256 over everything that decides the rows."""
        text = json.dumps(format_sweep(self), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def _parts(self) -> int:
        """Chunks of a skin at a temperature."""
        return -(-self.presses.count // self.presses_per_chunk)

    def _split(self, chunk: int) -> tuple[int, int, Ints]:
        """Numbers of a chunk's skin, of its temperature and of its presses."""
        if not 0 <= chunk < self.chunks:
            raise ArgumentError(f"chunk must lie in 0..{self.chunks - 1}; got {chunk}")
        rest, part = divmod(chunk, self._parts)
        skin, temperature = divmod(rest, len(self.temperatures))
        begin = part * self.presses_per_chunk
        end = min(begin + self.presses_per_chunk, self.presses.count)
        return skin, temperature, np.arange(begin, end)

    def _stream(self, chunk: int, purpose: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence([self.seed, chunk, purpose]))


def sideways(sizes: Sequence[float], directions: int) -> tuple[tuple[float, float], ...]:
    """Drags of each size, N, in evenly spread directions, the first along x; for `Grid`.

    Examples
    --------
    >>> sideways([0.2], 2)
    ((0.2, 0.0), (-0.2, 0.0))
    """
    if directions < 1:
        raise ArgumentError(f"directions must be at least 1; got {directions}")
    angles = [2 * math.pi * k / directions for k in range(directions)]
    # Rounded to far below a noticeable force, so that an axis is exactly an axis.
    return tuple(
        (round(size * math.cos(angle), 12) + 0.0, round(size * math.sin(angle), 12) + 0.0)
        for size in sizes
        for angle in angles
    )


_FORM: Final = Form(
    units={
        **dict.fromkeys(("forces", "drags", "drag"), "N"),
        **dict.fromkeys(("radius", "margin", "apart"), "mm"),
        **dict.fromkeys(("column_height", "magnet_place", "chip_place"), "mm"),
        **dict.fromkeys(("magnet_tilt", "chip_tilt"), "deg"),
        **dict.fromkeys(("temperatures", "chip_warmth"), "degC"),
        "chip_zero": "uT",
    },
    error=RecordingError,
)


def format_sweep(sweep: Sweep) -> dict[str, Any]:
    """A sweep in plain values, with units in its keys; `parse_sweep` reads it back."""
    return _FORM.table(sweep)


def parse_sweep(document: Mapping[str, Any]) -> Sweep:
    """The sweep that plain values describe; `RecordingError` where they describe none."""
    return _FORM.record(Sweep, document)


def _turned(sizes: Floats, rng: np.random.Generator) -> Floats:
    """Drags of these sizes, (..., 2), in directions drawn evenly."""
    angle = rng.uniform(0.0, 2 * np.pi, sizes.shape)
    return np.stack([sizes * np.cos(angle), sizes * np.sin(angle)], axis=-1)


def _check_places(places: tuple[int, int]) -> None:
    if len(places) != 2 or min(places) < 2:
        raise ArgumentError(f"places must be two numbers of at least 2; got {places}")


def _check_bounds(record: object, **bounds: tuple[float, float, str]) -> None:
    """Refuse fields without a number, or with one not finite or below the least or above the most.

    Each field comes with its least and most value and their unit.
    """
    for name, (least, most, unit) in bounds.items():
        values = np.ravel(getattr(record, name))
        if not len(values):
            raise ArgumentError(f"{name} must name at least one; got none")
        for value in values:
            if not (math.isfinite(value) and least <= value <= most):
                span = f"lie in {least:g}..{most:g} {unit}" if unit else f"be at least {least:g}"
                raise ArgumentError(f"{name} must {span}; got {value:g}")


def _check_rising(record: object, *names: str) -> None:
    """Refuse fields that are not two numbers of which the second is no less."""
    for name in names:
        pair = getattr(record, name)
        if len(pair) != 2 or pair[0] > pair[1]:
            raise ArgumentError(f"{name} must be from and to, rising; got {pair}")
