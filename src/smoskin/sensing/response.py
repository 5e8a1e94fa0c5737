"""What a skin's chips read under a touch, as a table: smooth in place and force, with slopes.

A table is made from presses (`smoskin.sensing.response_fit`) of a twin or a real skin, and is all
that an estimator knows of the skin. Besides the likeliest answer it carries the modes in which
skins of the design differ from it, the change with the rubber's temperature, and what two touches
at once do beyond adding up. Decides what a table holds and its file; hides the fast evaluation of
single touches. Files carry no code; they need `safetensors`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats, frozen
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics.material import REFERENCE_TEMPERATURE
from smoskin.sensing.tensor_file import TensorFile
from smoskin.sensing.touch_basis import PointLine, TouchBasis

_FILE: Final = TensorFile("a response table", "smoskin_response_table", 1)
_TENSORS: Final = ("mean", "warmth", "modes", "coupling", "misfit", "pair_misfit")
_LINES: Final = ("extent", "lines_x", "lines_y")
_CHUNK: Final = 2048
"""Touches whose functions are laid out at once."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResponseTable:
    """Signals of S chips for touches with D products of forces on P x Q functions of place.

    A signal is what a chip reads, turned into the skin's axes as designed, at the magnets'
    reference temperature, less what it reads untouched. C = 3 S of them stand in a row.

    Raises
    ------
    ModelError
        If arrays do not fit each other or are not finite.
    """

    design_hash: str
    """Content hash of the design."""
    basis: TouchBasis
    chips: tuple[int, ...]
    """(S,): which of the skin's chips, by their place in a reading."""
    forces: tuple[float, float]
    """N: normal forces from and to which it was fitted."""
    mean: Floats
    """(P, Q, D, C), T/N^k: coefficients of the likeliest answer."""
    softening: float
    """1/K: how much stiffer a degree makes the rubber, which takes that share off every force."""
    warmth: Floats
    """(P, Q, D, C): what a degree changes besides."""
    modes: Floats
    """(K, P, Q, D, C): how skins differ from it, each by one standard deviation."""
    coupling: Floats
    """(2, H, H, C), H = N M vertices: what a newton on one vertex adds while another vertex is
    touched as well, T/N, and what the product of both forces adds, T/N^2; see `together`."""
    misfit: Floats
    """(C, C), T^2/N^2: covariance of what the table misses, for a touch of a newton."""
    pair_misfit: Floats
    """(C, C), T^2/N^2: what it misses more with two touches, for a newton each."""

    def __post_init__(self) -> None:
        p, q, d = self.basis.shape
        count = 3 * len(self.chips)
        vertices = len(self.basis.lines_x) * len(self.basis.lines_y)
        shapes: dict[str, tuple[int | None, ...]] = {
            "mean": (p, q, d, count),
            "warmth": (p, q, d, count),
            "modes": (None, p, q, d, count),
            "coupling": (2, vertices, vertices, count),
            "misfit": (count, count),
            "pair_misfit": (count, count),
        }
        for name, shape in shapes.items():
            try:
                array = frozen(name, getattr(self, name), shape)
            except ArgumentError as error:
                raise ModelError(f"response table: {error}") from error
            if not np.isfinite(array).all():
                raise ModelError(f"response table: {name} must be finite")
            object.__setattr__(self, name, array)
        if not self.chips or not 0 < self.forces[0] < self.forces[1]:
            raise ModelError("response table: must have chips and rising positive forces")

    def signals(
        self, position: ArrayLike, force: ArrayLike, temperature: ArrayLike = REFERENCE_TEMPERATURE
    ) -> Floats:
        """What the chips read under each of B touches.

        Parameters
        ----------
        position : array_like, shape (B, 2)
            m.
        force : array_like, shape (B, 3)
            N, on the skin; pressing is negative z.
        temperature : array_like, shape (B,) or (), optional
            Of the rubber, degC.

        Returns
        -------
        Floats, shape (B, C)
            T.
        """
        where, push = _touches(position, force)
        warmer = np.broadcast_to(
            floats("temperature", temperature) - REFERENCE_TEMPERATURE, len(where)
        )
        push = push / (1 + self.softening * warmer)[:, None]
        both = np.concatenate([self.mean, self.warmth], axis=-1).reshape(-1, 2 * self.count)
        out = np.concatenate(
            [self.basis.rows(where[k], push[k]) @ both for k in _chunks(len(where))]
        )
        return np.asarray(out[:, : self.count] + warmer[:, None] * out[:, self.count :])

    def mode_signals(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What each mode adds to that, shape (B, K, C), T."""
        where, push = _touches(position, force)
        functions = int(np.prod(self.basis.shape))
        flat = self.modes.reshape(-1, functions, self.count).transpose(1, 0, 2)
        out = [
            self.basis.rows(where[k], push[k])
            @ flat.reshape(functions, len(self.modes) * self.count)
            for k in _chunks(len(where))
        ]
        return np.concatenate(out).reshape(len(where), len(self.modes), self.count)

    def slopes(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """Derivatives of the signals by (x, y, Fx, Fy, Fz), shape (B, C, 5), T/m and T/N."""
        where, push = _touches(position, force)
        table = self.point_table()
        places = where.tolist()
        return np.stack([table.at(x, y, f)[1].T for (x, y), f in zip(places, push, strict=True)])

    def together(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """What B pairs of touches read at once, (B, 2, 2) m and (B, 2, 3) N; shape (B, C).

        Each touch that sticks holds the sheet in the plane under the other, and the field is not
        linear in motion: to the sum of both comes what each newton of one adds because of the
        other, and what their product adds.
        """
        where, push = floats("position", position, (2, 2)), floats("force", force, (2, 3))
        hats = [self.vertex_shares(where[:, k]) for k in (0, 1)]
        both = self.signals(where[:, 0], push[:, 0]) + self.signals(where[:, 1], push[:, 1])
        flat = self.coupling.reshape(2, -1, self.count)
        for one, other in ((0, 1), (1, 0)):
            pairs = (hats[one][:, :, None] * hats[other][:, None, :]).reshape(len(where), -1)
            press, beside = -push[:, one, 2:], -push[:, other, 2:]
            both += press * (pairs @ flat[0] + beside * (pairs @ flat[1]))
        return both

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
            coupling=self.coupling[..., at],
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
        arrays = {
            name: np.asarray(getattr(self, name), np.float32 if name == "modes" else np.float64)
            for name in _TENSORS
        }
        arrays |= {name: getattr(self.basis, name) for name in _LINES}
        arrays["exponents"] = self.basis.exponents
        header = {
            "design": self.design_hash,
            "chips": list(self.chips),
            "forces_N": list(self.forces),
            "softening_per_K": self.softening,
            "radius_m": self.basis.radius,
            "signals": "x, y, z of each chip in turn, in the skin's axes, T, less the rest field",
        }
        _FILE.write(path, arrays, header)


def load_response_table(path: Path | str) -> ResponseTable:
    """Read a response table's file.

    Raises
    ------
    ModelError
        If it cannot be read, is no response table or of a later format, or is damaged.
    MissingExtraError
        If `safetensors` is not installed.
    """
    return _FILE.read(path, (*_TENSORS, *_LINES, "exponents"), _table)


def _table(arrays: dict[str, Floats], header: dict[str, Any]) -> ResponseTable:
    """The table of a file's arrays and header."""
    low, high = (float(one) for one in header["forces_N"])
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
        p, q, d, self._count = coefficients.shape
        self._flat = np.ascontiguousarray(coefficients).reshape(p, q * d * self._count)
        self._shape = (q, d * self._count)
        self._lines = PointLine(basis.lines_x, basis.radius), PointLine(basis.lines_y, basis.radius)
        # Which powers make each product and its slopes by each force, and their factors.
        e = basis.exponents
        self._orders = np.arange(int(e.max()) + 1)
        lower = np.repeat(e[None], 4, axis=0)
        self._factors = np.ones((4, d))
        for axis in range(3):
            lower[axis + 1, :, axis] = np.maximum(e[:, axis] - 1, 0)
            self._factors[axis + 1] = e[:, axis]
        self._powers = [axis * len(self._orders) + lower[..., axis] for axis in range(3)]

    def at(self, x: float, y: float, force: Floats) -> tuple[Floats, Floats]:
        """Signals (C,) and their slopes by x, y, Fx, Fy, Fz, (5, C)."""
        by_x, by_y = self._lines[0].at(x), self._lines[1].at(y)
        powers = (force[:, None] ** self._orders).ravel()
        i, j, k = self._powers
        g = self._factors * powers[i] * powers[j] * powers[k]
        value, slope = (by_x @ self._flat).reshape(2, *self._shape)
        held, across = (by_y @ value).reshape(2, -1, self._count)
        along = (by_y[0] @ slope).reshape(-1, self._count)
        both = g @ held
        out = np.empty((5, self._count))
        out[0], out[1], out[2:] = g[0] @ along, g[0] @ across, both[1:]
        return both[0], out

    def scan(self, x: Floats, y: Floats, force: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) and slopes (B, 5, C) at many places under one force."""
        basis = self.basis
        on_x, by_x = basis.along_x(x)
        on_y, by_y = basis.along_y(y)
        g, by_force = basis.products(force)
        mixed = np.concatenate([g[None], by_force]) @ self._flat.reshape(-1, len(g), self._count)
        flat = mixed.reshape(len(self._flat), self._shape[0], 4 * self._count)
        # (P, Q, 4 C): contract along y, then along x.
        held = np.einsum("bq,pqc->bpc", on_y, flat)
        across = np.einsum("bq,pqc->bpc", by_y, flat[..., : self._count])
        value = np.einsum("bp,bpc->bc", on_x, held).reshape(len(x), 4, self._count)
        out = np.empty((len(x), 5, self._count))
        out[:, 0] = np.einsum("bp,bpc->bc", by_x, held[..., : self._count])
        out[:, 1] = np.einsum("bp,bpc->bc", on_x, across)
        out[:, 2:] = value[:, 1:]
        return value[:, 0], out


def _touches(position: ArrayLike, force: ArrayLike) -> tuple[Floats, Floats]:
    """Places and forces of B touches each."""
    where, push = floats("position", position, (None, 2)), floats("force", force, (None, 3))
    if where.ndim != 2 or push.shape != (len(where), 3):
        raise ArgumentError(
            f"position and force must have shapes (B, 2) and (B, 3); got {where.shape} and "
            f"{push.shape}"
        )
    return where, push


def _chunks(rows: int) -> list[slice]:
    """Parts of a batch that are laid out at once."""
    return [slice(k, k + _CHUNK) for k in range(0, max(rows, 1), _CHUNK)]
