"""What a skin's chips read under a touch, as a table: smooth in place and force, with slopes.

A table is made from presses (`smoskin.sensing.response.fit`) of a twin or a real skin, and is all
that an estimator knows of the skin. Decides what it holds, and its file, which carries no code.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, each, floats
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics.nonlinearity import cross_signals
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.origami.geometry import places_to_the_rim
from smoskin.outputs import path_text
from smoskin.sensing.files import RESPONSE_TABLE, TensorFile, check_filled, freeze_model
from smoskin.sensing.response.basis import TouchBasis, touch_arrays
from smoskin.sensing.response.pairs import coupled, held, mutual_drags
from smoskin.sensing.response.point import PointTable
from smoskin.sensing.response.warp import PlaceWarp
from smoskin.sensing.signals.loops import Loops

_FILE: Final = TensorFile("a response table", RESPONSE_TABLE, 4, older=(2, 3))
_OF_MODES: Final = ("modes", "grip_modes")
_HALVES: Final = (*_OF_MODES, "coupling")
"""Arrays that files hold in half precision, each in steps of its own: they fill the file."""
_TENSORS: Final = (
    "mean",
    "warmth",
    "modes",
    "grip_modes",
    "grip",
    "curvature",
    "misfit",
    "pair_misfit",
)
_WARPS: Final = ("warp", "warp_modes")
_NEWER: Final = (*_WARPS, "coupling")
"""Arrays that files of earlier versions have not."""
_LIMITS: Final = dict.fromkeys(_TENSORS, (-1.0, 1.0)) | {
    **dict.fromkeys(_WARPS, (-10.0, 10.0)),
    "curvature": (-1e6, 1e6),
    "coupling": (-1.0, 1.0),
    "softening": (-1.0, 1.0),
    "residue": (0.0, 1.0),
    "forces": (1e-6, 1e3),
}
"""Least and largest numbers, SI: chips read less than a tenth of a tesla."""
_LINES: Final = ("extent", "lines_x", "lines_y")
_LARGEST_HALF: Final = 6e4
"""Steps of the largest number: half precision ends at 65504."""
_OPEN: Final = 0.05
"""Share of a press's signals that modes may leave open in the table of a skin."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResponseTable:
    """Signals of S chips for touches with D products of forces on P x Q functions of place.

    A signal is what a chip reads, turned into the skin's axes as designed, at the magnets'
    reference temperature, less what it reads untouched. C = 3 S of them stand in a row. It raises a
    `ModelError` if arrays do not fit each other or are not finite.

    Notes
    -----
    What a made skin reads of a touch at p with F, its rubber warmer than the reference by D::

        y = s(p, f) + D u(p, f) + sum_k w_k m_k(p, f) + |F| e + n,   f = F / (1 + beta D)

    with weights w_k ~ N(0, 1) of the skin, misfit e ~ N(0, E) of the touch and noise n ~ N(0, N)
    of the reading: "The table" and "Modes" in `docs/derivations.md`.
    """

    design_hash: str
    """Content hash of the design."""
    basis: TouchBasis
    chips: tuple[int, ...]
    """(S,): chips of the skin that the signals come from, by their place in a reading."""
    forces: tuple[float, float]
    """N: normal forces from and to which it was fitted."""
    mean: Floats
    """(P, Q, D, C), T/N^k: coefficients of the likeliest answer s."""
    softening: float
    """beta, 1/K: share by which a degree stiffens the rubber, and that it takes off every force."""
    warmth: Floats
    """(P, Q, D, C), T/N^k/K: coefficients of u, what a degree changes besides."""
    modes: Floats
    """(K, P, Q, D, C): coefficients of the modes m, each by one standard deviation of skins."""
    grip: Floats
    """G, (H, 2, H, 3), m/N: motion of each vertex in the plane by a force on each, along x, y and
    down (`mechanics.sheet.compliance`); zero where touches do not hold the sheet."""
    grip_modes: Floats
    """(K, H, 2, H, 3): change of the grip with each of the modes."""
    curvature: Floats
    """kappa, (S, 3, 3, 3), 1/T: what two touches add to the sum of their signals at a chip; by
    signal of one, signal of the other, and signal that it adds to."""
    misfit: Floats
    """E, (C, C), T^2/N^2: covariance of what the table misses, for a touch of a newton."""
    pair_misfit: Floats
    """(C, C), T^2/N^2: what it misses more with two touches, for a newton of both squared."""
    warp: Floats | None = None
    """a, (W,): coefficients of the warp to where touches load the sheet, `PlaceWarp`; none by
    default."""
    warp_modes: Floats | None = None
    """(K, W): change of the warp with each of the modes; none by default."""
    coupling: Floats | None = None
    """Q, (H, 3, H, 3, C), T/N^2: what forces on two vertices, along x, y and down, add to the sum
    of their signals since columns under load hold less; none by default."""
    residue: float = 0.0
    """h: what a touch leaves in the signals once it is gone, as a share of a newton's."""
    loops: Loops | None = None
    """Hysteresis of the signals; by default none is known."""
    origin: Mapping[str, Any] = field(default_factory=dict)
    """How the table was made, in plain values: version of the package, effort, seed."""

    def __post_init__(self) -> None:
        functions, count, vertices = self.basis.shape, 3 * len(self.chips), self.basis.vertices
        warps = len(self.contact.spread)
        if not self.chips or not 0 < self.forces[0] < self.forces[1]:
            raise ModelError("response table: must have chips and rising positive forces")
        if self.loops is not None and len(self.loops.reach) != count:
            raise ModelError(
                f"response table: loops must be of its {count} signals; got {len(self.loops.reach)}"
            )
        freeze_model(
            self,
            "response table",
            _LIMITS,
            mean=(*functions, count),
            warmth=(*functions, count),
            modes=(None, *functions, count),
            grip=(vertices, 2, vertices, 3),
            grip_modes=(len(self.modes), vertices, 2, vertices, 3),
            curvature=(len(self.chips), 3, 3, 3),
            misfit=(count, count),
            pair_misfit=(count, count),
            **({} if self.warp is None else {"warp": (warps,)}),
            **({} if self.warp_modes is None else {"warp_modes": (len(self.modes), warps)}),
            **({} if self.coupling is None else {"coupling": (vertices, 3, vertices, 3, count)}),
        )
        if not self.mean.any():
            raise ModelError("response table: mean must not be zero everywhere")

    @property
    def contact(self) -> PlaceWarp:
        """The warps that the law of contact may have."""
        return PlaceWarp(self.basis.lines_x, self.basis.lines_y)

    @property
    def warps(self) -> tuple[Floats, Floats]:
        """The warp (W,) and its modes (K, W), zero where there are none."""
        count = len(self.contact.spread)
        warp = np.zeros(count) if self.warp is None else self.warp
        still = np.zeros((len(self.modes), count))
        return warp, still if self.warp_modes is None else self.warp_modes

    @property
    def newton(self) -> Floats:
        """S_1: mean product of the signals of a newton that presses, over the skin, (C, C), T^2."""
        places = places_to_the_rim(self.basis.extent, (7, 9))
        signals = self.signals(places, np.tile([0.0, 0.0, -1.0], (len(places), 1)))
        return np.asarray(signals.T @ signals / len(places))

    @property
    def left(self) -> Floats:
        """L: what a touch leaves, (C, C), T^2.

        Half is like a newton's signals, half of their size at each chip, in any direction.
        """
        whole = self.newton
        each = np.repeat(whole.diagonal().reshape(-1, 3).mean(axis=1), 3)
        return np.asarray(self.residue**2 * (whole + np.diag(each)) / 2)

    @property
    def calibrated(self) -> bool:
        """Whether it is the table of one skin: modes leave open under 5 % of a press's signals.

        They leave 15 % open of the shipped designs' tables, 2 % once a skin has been touched once,
        the law of contact apart.
        """
        places = places_to_the_rim(self.basis.extent, (7, 9))
        press = np.tile([0.0, 0.0, -0.5], (len(places), 1))
        unknown, signals = self._added(self._loads(places)[0], press), self.signals(places, press)
        return float((unknown**2).sum()) < _OPEN**2 * float((signals**2).sum())

    def signals(
        self, position: ArrayLike, force: ArrayLike, temperature: ArrayLike = REFERENCE_TEMPERATURE
    ) -> Floats:
        """What the chips read under each of B touches, ``s + D u``, shape (B, C), T.

        Positions (B, 2), m, and forces (B, 3), N, are on the skin, pressing is negative z; the
        rubber's temperature, (B,) or (), is in degC.
        """
        place, push = touch_arrays(position, force)
        loads = self._loads(place)[0]
        warmer = (each("temperature", temperature, len(place)) - REFERENCE_TEMPERATURE)[:, None]
        both = np.concatenate([self.mean, self.warmth], axis=-1)
        out = self.basis.sums(both, loads, push / (1 + self.softening * warmer))
        return np.asarray(out[:, : self.count] + warmer * out[:, self.count :])

    def mode_signals(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What each mode adds to that, m_k, shape (B, K, C), T."""
        place, push = touch_arrays(position, force)
        loads = self._loads(place)[0]
        out = self._added(loads, push)
        if self.warp_modes is None:
            return out
        moved = self.warp_modes @ self.contact.functions(place)[0]
        by_load = self.basis.sums_and_slopes(self.mean, loads, push)[1][:, :2]
        return np.asarray(out + moved @ by_load)

    def slopes(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """Derivatives J of the signals by (x, y, Fx, Fy, Fz), shape (B, C, 5), T/m and T/N."""
        place, push = touch_arrays(position, force)
        loads, warped = self._loads(place)
        slopes = self.basis.sums_and_slopes(self.mean, loads, push)[1]
        slopes[:, :2] *= warped[..., None]
        return slopes.swapaxes(1, 2)

    def together(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What B pairs of touches read at once, (B, 2, 2) m and (B, 2, 3) N; shape (B, C), T.

        Touches that stick drag each other, columns under load hold less, and the field is not
        linear in motion ("Pairs" in `docs/derivations.md`):
        ``y = s_1 + s_2 + kappa(s_1, s_2) + f_1 Q f_2``.
        """
        first, second = self.dragged(position, force)
        both = first + second + cross_signals(self.curvature, first, second)
        return np.asarray(both + self.coupled(position, force))

    def coupled(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """The part of it that columns under load add, ``f_1 Q f_2``, shape (B, C), T."""
        place, push = floats("position", position, (2, 2)), floats("force", force, (2, 3))
        if self.coupling is None:
            return np.zeros((len(place), self.count))
        loads = self._loads(place.reshape(-1, 2))[0].reshape(place.shape)
        shares, press = self.basis.vertex_shares(loads), -push[..., 2:]
        sideways = held(self.grip, shares, press[..., 0])[0][:, :, 0] + push[..., :2]
        return coupled(self.coupling, shares, np.concatenate([sideways, press], axis=-1))

    def dragged(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What each touch of B pairs reads with the drags of the other, shape (2, B, C)."""
        place, push = floats("position", position, (2, 2)), floats("force", force, (2, 3))
        loads = self._loads(place.reshape(-1, 2))[0].reshape(place.shape)
        shares = self.basis.vertex_shares(loads)
        drags, _ = mutual_drags(self.grip, shares, -push[..., 2])
        push = np.concatenate([push[..., :2] + drags, push[..., 2:]], axis=-1)
        return np.stack([self.signals(place[:, k], push[:, k]) for k in (0, 1)])

    @property
    def count(self) -> int:
        """How many signals, C."""
        return 3 * len(self.chips)

    def of_chips(self, chips: Sequence[int]) -> "ResponseTable":
        """The table of these chips alone; `ArgumentError` if it has not all of them."""
        if not chips or not set(chips) <= set(self.chips):
            raise ArgumentError(f"chips must be among {self.chips}; got {tuple(chips)}")
        places = [self.chips.index(chip) for chip in chips]
        at = [3 * place + axis for place in places for axis in range(3)]
        return replace(
            self,
            chips=tuple(chips),
            mean=self.mean[..., at],
            warmth=self.warmth[..., at],
            modes=self.modes[..., at],
            curvature=self.curvature[places],
            coupling=None if self.coupling is None else self.coupling[..., at],
            misfit=self.misfit[np.ix_(at, at)],
            pair_misfit=self.pair_misfit[np.ix_(at, at)],
            loops=self.loops and self.loops.of_signals(at),
        )

    def moved(self, weights: Floats) -> "ResponseTable":
        """The table with these weights (K,) of its modes, which stay as they are."""
        return replace(
            self,
            mean=self.mean + np.tensordot(weights, self.modes, 1),
            grip=self.grip + np.tensordot(weights, self.grip_modes, 1),
            warp=None if self.warp_modes is None else self.warps[0] + weights @ self.warp_modes,
        )

    def with_open_contact(self) -> "ResponseTable":
        """The table with modes besides for what laws of contact may be."""
        spread = self.contact.spread
        more: dict[str, Any] = {}
        for name, old in (("modes", self.modes), ("grip_modes", self.grip_modes)):
            more[name] = np.concatenate([old, np.zeros((len(spread), *old.shape[1:]))])
        return replace(self, warp_modes=np.concatenate([self.warps[1], np.diag(spread)]), **more)

    def by_loads(self) -> "ResponseTable":
        """The same by where the sheet is loaded, in place of where it is touched."""
        return replace(self, warp=None)

    def point_table(self, temperature: float = REFERENCE_TEMPERATURE) -> PointTable:
        """The same by loads, for one reading at a time and fast, with the rubber so warm."""
        warmer = temperature - REFERENCE_TEMPERATURE
        order = self.basis.exponents.sum(axis=1)[:, None]
        both = self.mean + warmer * self.warmth
        softened = both / (1 + self.softening * warmer) ** order
        return PointTable(self.basis, softened, self.grip, self.curvature, self.coupling)

    def _added(self, loads: Floats, push: Floats) -> Floats:
        """What each mode's coefficients add to signals, (B, K, C), T."""
        out = np.zeros((len(loads), len(self.modes), self.count))
        held = self.modes.any(axis=(1, 2, 3, 4))
        part = self.basis.sums(np.moveaxis(self.modes[held], 0, -2), loads, push)
        out[:, held] = part.reshape(len(loads), int(held.sum()), self.count)
        return out

    def _loads(self, position: Floats) -> tuple[Floats, Floats]:
        """Loads of the sheet by touches at places (B, 2), m, and the slopes of that."""
        if self.warp is None:
            return position, np.ones_like(position)
        return self.contact.loads(position, self.warp)

    @staticmethod
    def check_writer() -> None:
        """Raise `MissingExtraError` unless the library that writes tables is installed."""
        _FILE.check_writer()

    def save(self, path: Path | str) -> None:
        """Write the table's file; `MissingExtraError` if `safetensors` is not installed."""
        arrays = {name: np.asarray(getattr(self, name)) for name in _TENSORS}
        arrays |= {name: getattr(self, name) for name in _NEWER if getattr(self, name) is not None}
        if self.warp_modes is not None:
            # Modes that only warp places, the last ones, hold nothing besides.
            held = np.flatnonzero(self.modes.any(axis=(1, 2, 3, 4)))
            kept = held[-1] + 1 if len(held) else 0
            arrays |= {name: arrays[name][:kept] for name in _OF_MODES}
        halved = [name for name in _HALVES if name in arrays]
        sizes = {name: float(np.abs(arrays[name]).max(initial=0.0)) for name in halved}
        steps = {name: (size or 1.0) / _LARGEST_HALF for name, size in sizes.items()}
        halves = {name: (arrays[name] / step).astype(np.float16) for name, step in steps.items()}
        lines = {name: getattr(self.basis, name) for name in _LINES}
        header = {
            "design": self.design_hash,
            "chips": list(self.chips),
            "forces_N": list(self.forces),
            "softening_per_K": self.softening,
            "residue": self.residue,
            "loops": self.loops and self.loops.as_json(),
            "radius_m": self.basis.radius,
            "signals": "x, y, z of each chip in turn, in the skin's axes, T, less the rest field",
            "steps": steps,
            "origin": dict(self.origin),
        }
        _FILE.write(path, arrays | halves | lines | {"exponents": self.basis.exponents}, header)


def load_response_table(name_or_path: str | os.PathLike[str]) -> ResponseTable:
    """Read the table of a design shipped with the package, such as ``"planar"``, or of a file.

    Raises
    ------
    ModelError
        If there is no such table, it cannot be read, is of another kind or format, or damaged.
    MissingExtraError
        If `safetensors` is not installed.

    Examples
    --------
    >>> load_response_table("planar").chips
    (0, 1, 2)
    """
    given, shipped = path_text(name_or_path), shipped_tables()
    if given not in shipped and not os.path.exists(given):
        raise ModelError(
            f"table must be that of a shipped design ({', '.join(sorted(shipped))}) or the path of "
            f"a response table; got {given!r}"
        )
    names = (*_TENSORS, *_LINES, "exponents")
    return _FILE.read(str(shipped.get(given, given)), names, _table, newer=_NEWER)


def shipped_tables() -> dict[str, Path]:
    """Files of the tables that are shipped with the package, by their designs' names."""
    folder = Path(str(resources.files("smoskin.sensing.response")))
    return {file.stem: file for file in folder.glob("*.table")}


def _table(arrays: dict[str, Any], header: dict[str, Any]) -> ResponseTable:
    """The table of a file's arrays and header."""
    low, high = (float(force) for force in header["forces_N"])
    for name, step in header.get("steps", {}).items():
        arrays[name] = arrays[name].astype(np.float64) * step
    check_filled("response table", arrays, "modes", "misfit")
    warps = arrays.get("warp_modes", np.zeros((0, 0)))
    if 0 < (more := len(warps) - len(arrays["modes"])) <= warps.shape[1]:
        for name in _OF_MODES:
            none = np.zeros((more, *arrays[name].shape[1:]))
            arrays[name] = np.concatenate([arrays[name], none])
    table = ResponseTable(
        design_hash=str(header["design"]),
        basis=TouchBasis(
            radius=float(header["radius_m"]),
            exponents=arrays["exponents"],
            **{name: arrays[name] for name in _LINES},
        ),
        chips=tuple(int(chip) for chip in header["chips"]),
        forces=(low, high),
        softening=float(header["softening_per_K"]),
        residue=float(header.get("residue", 0.0)),
        loops=Loops.from_json(header.get("loops")),
        origin=header.get("origin", {}),
        **{name: array for name, array in arrays.items() if name in (*_TENSORS, *_NEWER)},
    )
    # Earlier versions took the law of contact as known; a skin's own table may stay so.
    is_known = header["format"] == _FILE.format or table.calibrated
    return table if is_known else table.with_open_contact()
