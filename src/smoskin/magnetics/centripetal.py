"""Closed inverse of the ideal centripetal magnet, corrected for the real one (S4 to S6).

Decides how one field becomes one displacement: the four-sector magnet's field is corrected axis
by axis towards that of a sinusoidal magnetisation, which inverts in closed form. Hides the fit of
that correction. Magnet frame, but z counts from the face that the chip looks at, negative to it.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats, freeze
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics.sector import VACUUM_PERMEABILITY, field

_N = TypeVar("_N", float, Floats)
Functions: TypeAlias = tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]]
"""Two-argument arctangent, hypotenuse and logarithm, of arrays or of plain numbers."""
OF_ARRAYS: Final[Functions] = (np.arctan2, np.hypot, np.log)
OF_NUMBERS: Final[Functions] = (math.atan2, math.hypot, math.log)
_RAYS: Final = 12
"""Polar angles at which the usable range is searched."""
_STEPS: Final = 200
"""Radii at which the usable range is searched."""


def amplitude(remanence: float, wave_number: float, thickness: float) -> float:
    """Amplitude K = mu_0 m_0 (1 - exp(-k d)) / 2 of the ideal field at the magnet's face, T.

    Remanence m_0 is in A/m, wave number k in 1/m, thickness d in m. It raises an `ArgumentError` if
    `wave_number` or `thickness` is not positive.

    Notes
    -----
    Source: SI Eq. (S4), erratum E2: the printed K lacks mu_0.
    Valid for a plate that is wide against 1/k.

    Examples
    --------
    >>> round(amplitude(8.04e5, 200.0, 2e-3), 4)
    0.1665
    """
    for name, value in (("wave_number", wave_number), ("thickness", thickness)):
        if not value > 0.0:
            raise ArgumentError(f"{name} must be positive; got {value}")
    return 0.5 * VACUUM_PERMEABILITY * remanence * -math.expm1(-wave_number * thickness)


def ideal_inverse(bx: _N, by: _N, bz: _N, functions: Functions = OF_ARRAYS) -> tuple[_N, _N, _N]:
    """Phases kx and ky, rad, and strength abs(K) exp(kz), T, of an ideal field, T.

    Components are arrays of one shape or, with `OF_NUMBERS`, plain numbers; Bz is not zero.

    Notes
    -----
    Source: SI Eq. (S5), erratum E3: the third line has lost a minus sign. Valid for
    abs(kx) and abs(ky) < pi/2; in two-argument arctangents it holds until Bz vanishes, at
    abs(kx) + abs(ky) = pi.
    """
    arctan2, hypot, _ = functions
    square = bz * bz
    skew = bx * bx - by * by
    q = square + skew  # 2 Bz q; with the other sign 2 Bz p
    twice = -2.0 * bz
    return arctan2(twice * bx, square - skew), arctan2(twice * by, q), hypot(q / twice, by)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearCorrection:
    """Correction of a four-sector magnet's field to the ideal one: B_ideal = k_c B + c_c (S6).

    It is that of one magnet, or those of S magnets stacked by `stack_corrections`.
    """

    k_c: Floats
    """(3,) or (S, 3): factor of each component."""
    c_c: Floats
    """(3,) or (S, 3), T: offset added to each component."""
    wave_number: Floats
    """() or (S,), 1/m: k of the ideal field."""
    amplitude: Floats
    """() or (S,), T: abs(K) of the ideal field at the magnet's face."""
    gap: Floats
    """() or (S,), m: gap from that face to the chip at rest."""
    side: Floats
    """() or (S,): -1, the chip lies below the magnet; +1, above it."""

    def __post_init__(self) -> None:
        many = np.shape(self.k_c)[:-1]
        freeze(self, k_c=(*many, 3), c_c=(*many, 3))
        freeze(self, wave_number=many, amplitude=many, gap=many, side=many)
        for name in ("wave_number", "amplitude", "gap"):
            if not np.all(getattr(self, name) > 0.0):
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name)}")
        if not np.all(np.abs(self.side) == 1.0):
            raise ArgumentError(f"side must be -1 (chip below) or +1 (above); got {self.side}")

    @property
    def numbers(self) -> tuple[Floats, ...]:
        """All ten numbers, one array () or (S,) each, as `displaced` takes them."""
        k_c, c_c = np.moveaxis(self.k_c, -1, 0), np.moveaxis(self.c_c, -1, 0)
        return (*k_c, *c_c, self.wave_number, self.amplitude, self.gap, self.side)


def stack_corrections(corrections: Sequence[LinearCorrection]) -> LinearCorrection:
    """Corrections of S magnets as one, for fields of shape (..., S, 3)."""
    return LinearCorrection(
        **{
            part.name: np.stack([getattr(each, part.name) for each in corrections])
            for part in dataclasses.fields(LinearCorrection)
        }
    )


def displacement(correction: LinearCorrection, field: ArrayLike) -> Floats:
    """Displacement of a magnet from its rest opposite its chip, (..., 3), m, by the field there.

    The field, (..., 3), T, is in the magnet's axes; not finite where the corrected Bz = 0. It
    raises an `ArgumentError` if `field` is not (..., 3).

    Notes
    -----
    Source: SI Eqs. (S5), (S6). Valid for displacements within the `usable_range`.
    """
    bx, by, bz = np.moveaxis(floats("field", field, (3,)), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack(displaced(bx, by, bz, correction.numbers), axis=-1)


def displaced(
    bx: _N, by: _N, bz: _N, numbers: Sequence[_N], functions: Functions = OF_ARRAYS
) -> tuple[_N, _N, _N]:
    """Components of `displacement`, of arrays or, with `OF_NUMBERS`, of plain numbers.

    Plain numbers are faster for one reading of few chips, and raise where the corrected Bz = 0.
    """
    k_x, k_y, k_z, c_x, c_y, c_z, wave_number, amplitude, gap, side = numbers
    corrected = k_x * bx + c_x, k_y * by + c_y, k_z * bz + c_z
    phase_x, phase_y, strength = ideal_inverse(*corrected, functions)
    depth = functions[2](strength / amplitude) / wave_number
    return -phase_x / wave_number, -phase_y / wave_number, side * (depth + gap)


def fit_correction(magnet: Magnet, gap: float, stroke: float) -> LinearCorrection:
    """Correction that makes the closed inverse true to the exact field, in least squares.

    The fit covers a ball of displacements with the radius `stroke`, m, of a magnet whose nearer
    face is a `gap`, m, from its chip at rest; the chip lies below a magnet of the sheet, above one
    of the base. The wave number has the least displacement error; by symmetry x and y share their
    factor and have no offset. It raises an `ArgumentError` if `gap` or `stroke` is not positive or
    the stroke reaches the magnet.

    Notes
    -----
    Source: SI Eq. (S6). Valid for displacements up to `stroke`.
    """
    # Here, so that whoever only imports the package does not wait for it.
    from scipy.optimize import least_squares

    if not 0.0 < stroke < gap:
        raise ArgumentError(f"stroke must lie in (0, gap) = (0, {gap:.4g}) m; got {stroke}")
    side = -1.0 if magnet.mount == "sheet" else 1.0
    moves = np.concatenate([_ball(stroke * part) for part in (0.25, 0.5, 0.75, 1.0)])
    measured = _field_at(magnet, gap, side, moves)

    def errors(values: Floats) -> Floats:
        inverted = displacement(_correction_of(values, magnet, gap, side), measured)
        return np.ravel((inverted - moves) / stroke)

    wave = 1.5
    face = amplitude(magnet.remanence, wave / gap, magnet.height)
    still = float(np.abs(_field_at(magnet, gap, side, np.zeros(3))[2]))
    factor = math.log(2.0 * face * math.exp(-wave) / still)
    fit = least_squares(errors, [math.log(wave), factor, factor, 0.0], x_scale="jac")
    return _correction_of(fit.x, magnet, gap, side)


def _correction_of(values: Floats, magnet: Magnet, gap: float, side: float) -> LinearCorrection:
    """Correction of log(k gap), log k_c lateral and axial, and c_c over the field at rest."""
    wave, lateral, axial = np.exp(values[:3])
    wave /= gap
    face = amplitude(magnet.remanence, wave, magnet.height)
    rest = 2.0 * face * math.exp(-wave * gap)
    # Below, K has the sign of -polarity; above, Bz changes sign and Bx, By do not.
    sign = np.array([-magnet.polarity, -magnet.polarity, side * magnet.polarity])
    return LinearCorrection(
        k_c=sign * [lateral, lateral, axial],
        c_c=np.array([0.0, 0.0, values[3] * rest]),
        wave_number=np.asarray(wave),
        amplitude=np.asarray(face),
        gap=np.asarray(gap),
        side=np.asarray(side),
    )


def usable_range(
    magnet: Magnet, gap: float, correction: LinearCorrection, tolerance: float
) -> float:
    """Radius about rest, m, within which the corrected inverse errs by at most `tolerance`, m.

    Every shorter displacement, in any direction, is found so well; zero if not even rest is, and at
    most 0.95 of the gap. Magnet, gap and correction are those of `fit_correction`. It raises an
    `ArgumentError` if `gap` or `tolerance` is not positive.

    Notes
    -----
    Source: SI Text S2, the "usable range". Valid for the magnet alone, without noise.
    """
    for name, value in (("gap", gap), ("tolerance", tolerance)):
        if not value > 0.0:
            raise ArgumentError(f"{name} must be positive; got {value}")
    radii = np.linspace(0.0, 0.95 * gap, _STEPS + 1)
    moves = radii[:, None, None] * _ball(1.0)
    inverted = displacement(correction, _field_at(magnet, gap, float(correction.side), moves))
    error = np.linalg.norm(inverted - moves, axis=-1).max(axis=-1)
    beyond = ~(error <= tolerance)
    if not beyond.any():
        return float(radii[-1])
    first = int(np.argmax(beyond))
    return float(radii[first - 1]) if first else 0.0


def _field_at(magnet: Magnet, gap: float, side: float, moves: Floats) -> Floats:
    """Exact field at the chip when the magnet has moved."""
    rest = np.array([0.0, 0.0, side * (0.5 * magnet.height + gap)])
    return field(magnet, rest - moves)


def _ball(radius: float) -> Floats:
    """Directions times radius; an eighth of the azimuths stands for all by symmetry."""
    polar = np.linspace(0.0, np.pi, _RAYS + 1)
    azimuth = np.linspace(0.0, 0.25 * np.pi, 4)
    tilt, around = (angle.ravel() for angle in np.meshgrid(polar, azimuth, indexing="ij"))
    return radius * np.stack(
        [np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)], axis=-1
    )
