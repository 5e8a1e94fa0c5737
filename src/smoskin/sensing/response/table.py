"""What a skin's chips read under a touch, as a table: smooth in place and force, with slopes.

A table is made from presses (`smoskin.sensing.response.fit`) of a twin or a real skin, and is all
that an estimator knows of the skin. Besides the likeliest answer it carries the modes in which
skins of the design differ from it, the change with the rubber's temperature, and what two touches
at once do beyond adding up. Decides what a table holds and its file; hides the fast evaluation of
single touches. Files carry no code; they need `safetensors`.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints, floats, freeze
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics.nonlinearity import cross_signals
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.files import RESPONSE_TABLE, TensorFile
from smoskin.sensing.response.basis import PointLine, TouchBasis, touch_arrays
from smoskin.sensing.response.pairs import mutual_drags

_FILE: Final = TensorFile("a response table", RESPONSE_TABLE, 3, older=(2,))
_TENSORS: Final = (
    "mean",
    "warmth",
    "modes",
    "grip",
    "grip_modes",
    "curvature",
    "misfit",
    "pair_misfit",
)
_LINES: Final = ("extent", "lines_x", "lines_y")
_HALVES: Final = ("modes", "grip_modes")
"""Arrays that files hold in half precision, each in steps of its own: they fill the file, and what
rounding changes, 0.03 uT of 200, is a hundredth of the misfit."""
_LARGEST_HALF: Final = 6e4
"""Steps of the largest number, near the largest that half precision knows."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResponseTable:
    """Signals of S chips for touches with D products of forces on P x Q functions of place.

    A signal is what a chip reads, turned into the skin's axes as designed, at the magnets'
    reference temperature, less what it reads untouched. C = 3 S of them stand in a row.

    Raises
    ------
    ModelError
        If arrays do not fit each other or are not finite.

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
    """G, (H, 2, H, 3), H = N M vertices, m/N: motion of each in the plane by a force on each, along
    x, y and down (`mechanics.sheet.compliance`); zero where touches are taken not to hold the
    sheet."""
    grip_modes: Floats
    """(K, H, 2, H, 3): change of the grip with each of the modes."""
    curvature: Floats
    """kappa, (S, 3, 3, 3), 1/T: what two touches add to the sum of their signals at a chip; by
    signal of one, signal of the other (in either order), and signal that it adds to."""
    misfit: Floats
    """E, (C, C), T^2/N^2: covariance of what the table misses, for a touch of a newton."""
    pair_misfit: Floats
    """(C, C), T^2/N^2: what it misses more with two touches, for a newton of both squared."""
    origin: Mapping[str, Any] = field(default_factory=dict)
    """How the table was made, in plain values: version of the package, effort, seed; empty where
    nobody said."""

    def __post_init__(self) -> None:
        functions, count, vertices = self.basis.shape, 3 * len(self.chips), self.basis.vertices
        try:
            freeze(
                self,
                mean=(*functions, count),
                warmth=(*functions, count),
                modes=(None, *functions, count),
                grip=(vertices, 2, vertices, 3),
                grip_modes=(len(self.modes), vertices, 2, vertices, 3),
                curvature=(len(self.chips), 3, 3, 3),
                misfit=(count, count),
                pair_misfit=(count, count),
            )
        except ArgumentError as error:
            raise ModelError(f"response table: {error}") from error
        for name in _TENSORS:
            if not np.isfinite(getattr(self, name)).all():
                raise ModelError(f"response table: {name} must be finite")
        if not self.chips or not 0 < self.forces[0] < self.forces[1]:
            raise ModelError("response table: must have chips and rising positive forces")

    def signals(
        self, position: ArrayLike, force: ArrayLike, temperature: ArrayLike = REFERENCE_TEMPERATURE
    ) -> Floats:
        """What the chips read under each of B touches, s + Delta u.

        Parameters
        ----------
        position : array_like, shape (B, 2)
            m.
        force : array_like, shape (B, 3)
            N, on the skin; pressing is negative z.
        temperature : array_like, shape (B,) or (), optional
            Rubber temperature, degC.

        Returns
        -------
        Floats, shape (B, C)
            T.
        """
        place, push = touch_arrays(position, force)
        warmer = np.broadcast_to(
            floats("temperature", temperature) - REFERENCE_TEMPERATURE, len(place)
        )
        push = push / (1 + self.softening * warmer)[:, None]
        both = np.concatenate([self.mean, self.warmth], axis=-1)
        out = self.basis.sums(both, place, push)
        return np.asarray(out[:, : self.count] + warmer[:, None] * out[:, self.count :])

    def mode_signals(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What each mode adds to that, m_k, shape (B, K, C), T."""
        out = self.basis.sums(np.moveaxis(self.modes, 0, -2), position, force)
        return out.reshape(len(out), len(self.modes), self.count)

    def slopes(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """Derivatives J of the signals by (x, y, Fx, Fy, Fz), shape (B, C, 5), T/m and T/N."""
        return self.basis.sums_and_slopes(self.mean, position, force)[1].swapaxes(1, 2)

    def together(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What B pairs of touches read at once, (B, 2, 2) m and (B, 2, 3) N; shape (B, C).

        Each touch that sticks holds the sheet in the plane under the other, so that they drag each
        other, and the field is not linear in motion: "Pairs" in `docs/derivations.md`.
        """
        one, other = self.dragged(position, force)
        return np.asarray(one + other + cross_signals(self.curvature, one, other))

    def dragged(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What each touch of B pairs reads with the drags of the other, shape (2, B, C)."""
        place, push = floats("position", position, (2, 2)), floats("force", force, (2, 3))
        drags = mutual_drags(self.grip, self.vertex_shares(place), -push[..., 2])
        push = np.concatenate([push[..., :2] + drags, push[..., 2:]], axis=-1)
        return np.stack([self.signals(place[:, k], push[:, k]) for k in (0, 1)])

    def vertex_shares(self, position: Floats) -> Floats:
        """Share of each vertex in touches at (..., 2), shape (..., H)."""
        n, m = len(self.basis.lines_x), len(self.basis.lines_y)
        x = self.basis.along_x(position[..., 0])[0][..., :n]
        y = self.basis.along_y(position[..., 1])[0][..., :m]
        return (x[..., :, None] * y[..., None, :]).reshape(*position.shape[:-1], n * m)

    @property
    def count(self) -> int:
        """How many signals, C."""
        return 3 * len(self.chips)

    def of_chips(self, chips: Sequence[int]) -> "ResponseTable":
        """The table of these chips alone.

        Raises
        ------
        ArgumentError
            If the table has not all of them.
        """
        if not chips or not set(chips) <= set(self.chips):
            raise ArgumentError(f"chips must be among {self.chips}; got {tuple(chips)}")
        at = [3 * self.chips.index(chip) + axis for chip in chips for axis in range(3)]
        return replace(
            self,
            chips=tuple(chips),
            mean=self.mean[..., at],
            warmth=self.warmth[..., at],
            modes=self.modes[..., at],
            curvature=self.curvature[[self.chips.index(chip) for chip in chips]],
            misfit=self.misfit[np.ix_(at, at)],
            pair_misfit=self.pair_misfit[np.ix_(at, at)],
        )

    def point_table(self, temperature: float = REFERENCE_TEMPERATURE) -> "PointTable":
        """The same for one touch at a time, fast, with the rubber at this temperature."""
        warmer = temperature - REFERENCE_TEMPERATURE
        order = self.basis.exponents.sum(axis=1)[:, None]
        both = self.mean + warmer * self.warmth
        return PointTable(self.basis, both / (1 + self.softening * warmer) ** order)

    def save(self, path: Path | str) -> None:
        """Write the table's file.

        Raises
        ------
        MissingExtraError
            If `safetensors` is not installed.
        """
        arrays = {name: np.asarray(getattr(self, name)) for name in _TENSORS}
        steps = {name: float(np.abs(arrays[name]).max(initial=0.0)) for name in _HALVES}
        steps = {name: (size or 1.0) / _LARGEST_HALF for name, size in steps.items()}
        halves = {name: (arrays[name] / step).astype(np.float16) for name, step in steps.items()}
        lines = {name: getattr(self.basis, name) for name in _LINES}
        header = {
            "design": self.design_hash,
            "chips": list(self.chips),
            "forces_N": list(self.forces),
            "softening_per_K": self.softening,
            "radius_m": self.basis.radius,
            "signals": "x, y, z of each chip in turn, in the skin's axes, T, less the rest field",
            "steps": steps,
            "origin": dict(self.origin),
        }
        _FILE.write(path, arrays | halves | lines | {"exponents": self.basis.exponents}, header)


def load_response_table(name_or_path: str | os.PathLike[str]) -> ResponseTable:
    """Read a response table.

    Parameters
    ----------
    name_or_path : str or path
        The table of a design shipped with the package, such as ``"planar"``, or a file's path.

    Raises
    ------
    ModelError
        If there is no such table, or it cannot be read, is no response table or of a later format,
        or is damaged.
    MissingExtraError
        If `safetensors` is not installed.

    Examples
    --------
    >>> load_response_table("planar").chips
    (0, 1, 2)
    """
    given = os.fspath(name_or_path)
    folder = resources.files("smoskin.sensing.response")
    shipped = {f.name[:-6]: f for f in folder.iterdir() if f.name.endswith(".table")}
    names = (*_TENSORS, *_LINES, "exponents")
    if given in shipped:
        with resources.as_file(shipped[given]) as file:
            return _FILE.read(file, names, _table)
    if not Path(given).exists():
        raise ModelError(
            f"table must be that of a shipped design ({', '.join(sorted(shipped))}) or the path of "
            f"a response table; got {given!r}"
        )
    return _FILE.read(given, names, _table)


def _table(arrays: dict[str, Any], header: dict[str, Any]) -> ResponseTable:
    """The table of a file's arrays and header."""
    low, high = (float(one) for one in header["forces_N"])
    for name, step in header.get("steps", {}).items():
        arrays[name] = arrays[name].astype(np.float64) * step
    return ResponseTable(
        design_hash=str(header["design"]),
        basis=TouchBasis(
            radius=float(header["radius_m"]),
            exponents=arrays["exponents"],
            **{name: arrays[name] for name in _LINES},
        ),
        chips=tuple(int(chip) for chip in header["chips"]),
        forces=(low, high),
        softening=float(header["softening_per_K"]),
        origin=header.get("origin", {}),
        **{name: arrays[name] for name in _TENSORS},
    )


class PointTable:
    """Coefficients laid out for one touch at a time.

    Parameters
    ----------
    basis : TouchBasis
    coefficients : Floats, shape (P, Q, D, C)
    """

    def __init__(self, basis: TouchBasis, coefficients: Floats) -> None:
        self.basis = basis
        self._coefficients = coefficients
        self._lines = PointLine(basis.lines_x, basis.radius), PointLine(basis.lines_y, basis.radius)
        # Vertices and products of neighbours in turn: what a touch needs stands together.
        orders = [_in_turn(len(line)) for line in (basis.lines_x, basis.lines_y)]
        p, q, *_ = coefficients.shape
        self._block = np.ascontiguousarray(coefficients[np.ix_(*orders)].reshape(p, q, -1))
        # Which powers make each product and its slopes by each force, and their factors.
        e = basis.exponents
        self._highest = int(e.max())
        lower = np.repeat(e[None], 4, axis=0)
        self._factors = np.ones((4, len(e)))
        for axis in range(3):
            lower[axis + 1, :, axis] = np.maximum(e[:, axis] - 1, 0)
            self._factors[axis + 1] = e[:, axis]
        self._powers = np.stack(
            [axis * (self._highest + 1) + lower[..., axis] for axis in range(3)]
        )

    def at(self, x: float, y: float, force: Floats) -> tuple[Floats, Floats]:
        """Signals (C,) and their slopes by x, y, Fx, Fy, Fz, (5, C)."""
        (i, phi), (j, psi) = self._lines[0].near(x), self._lines[1].near(y)
        a, b, d = phi.shape[1], psi.shape[1], len(self.basis.exponents)
        part = self._block[2 * i : 2 * i + a, 2 * j : 2 * j + b].reshape(a, -1)
        here, steep = (phi @ part).reshape(2, b, -1)
        value, by_y = (psi @ here).reshape(2, d, -1)
        by_x = (psi[0] @ steep).reshape(d, -1)
        powers = []
        for component in force.tolist():
            power = 1.0
            powers.append(power)
            for _ in range(self._highest):
                power *= component
                powers.append(power)
        g = self._factors * np.array(powers)[self._powers].prod(axis=0)
        both = g @ value
        out = np.empty((5, both.shape[1]))
        out[0], out[1], out[2:] = g[0] @ by_x, g[0] @ by_y, both[1:]
        return both[0], out

    def scan(self, x: Floats, y: Floats, force: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) and slopes (B, 5, C) at many places under one force."""
        return self.basis.sums_and_slopes(
            self._coefficients, np.stack([x, y], axis=-1), np.broadcast_to(force, (len(x), 3))
        )


def _in_turn(vertices: int) -> Ints:
    """Order of a line's functions in which each vertex is followed by its product with the next."""
    order = np.arange(2 * vertices - 1)
    return np.where(order % 2 == 0, order // 2, vertices + order // 2)
