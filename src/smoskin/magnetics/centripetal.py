"""Ideal centripetal magnet and its closed inverse (S3 to S6).

Decides how one field becomes one displacement: the field of the real four-sector magnet is
corrected axis by axis (S6) towards that of a sinusoidal magnetisation (S4), which inverts in
closed form (S5). Hides the fit of that correction and its usable range. Magnet frame, but z
is counted from the face that the chip looks at, negative towards the chip: -z is the distance.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats, freeze
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics.sector import VACUUM_PERMEABILITY, field

_N = TypeVar("_N", float, Floats)


class _Functions(NamedTuple):
    """Functions that an equation needs beside arithmetic, for arrays or for plain numbers."""

    arctan2: Callable[..., Any]
    hypot: Callable[..., Any]
    log: Callable[..., Any]


_OF_ARRAYS: Final = _Functions(np.arctan2, np.hypot, np.log)
_OF_NUMBERS: Final = _Functions(math.atan2, math.hypot, math.log)
_RAYS: Final = 12
"""Polar angles at which the usable range is searched."""
_STEPS: Final = 200
"""Radii at which the usable range is searched."""


def amplitude(remanence: float, wave_number: float, thickness: float) -> float:
    """Amplitude K of the ideal field at the magnet's face.

    Parameters
    ----------
    remanence : float
        m_0, A/m.
    wave_number : float
        k, 1/m.
    thickness : float
        d, m.

    Returns
    -------
    float
        K = mu_0 m_0 (1 - exp(-k d)) / 2, T.

    Raises
    ------
    ArgumentError
        If `wave_number` or `thickness` is not positive.

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


def ideal_field(points: ArrayLike, amplitude: float, wave_number: float) -> Floats:
    """Flux density of a plate magnetised m = m_0 (sin kx, sin ky, 0), below its lower face.

    Parameters
    ----------
    points : array_like, shape (..., 3)
        Where, m; z = 0 is the plate's lower face.
    amplitude : float
        K, T.
    wave_number : float
        k, 1/m.

    Returns
    -------
    Floats, shape (..., 3)
        K exp(kz) (-sin kx, -sin ky, cos kx + cos ky), T.

    Raises
    ------
    ArgumentError
        If `points` is not (..., 3).

    Notes
    -----
    Source: SI Eqs. (S3), (S4). Valid for z <= 0. With K > 0 the magnetisation printed in S3
    points away from the axis; towards it, K < 0.
    """
    where = floats("points", points, (3,))
    phase = wave_number * where
    decay = amplitude * np.exp(phase[..., 2])
    result = np.empty_like(where)
    result[..., 0] = -decay * np.sin(phase[..., 0])
    result[..., 1] = -decay * np.sin(phase[..., 1])
    result[..., 2] = decay * (np.cos(phase[..., 0]) + np.cos(phase[..., 1]))
    return result


def ideal_inverse(field: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Phases and strength of the ideal field from its three components.

    Parameters
    ----------
    field : array_like, shape (..., 3)
        B, T.

    Returns
    -------
    phase_x, phase_y : Floats, shape (...)
        kx and ky, rad.
    strength : Floats, shape (...)
        abs(K) exp(kz), T. All three are NaN where Bz = 0.

    Raises
    ------
    ArgumentError
        If `field` is not (..., 3).

    Notes
    -----
    Source: SI Eq. (S5), erratum E3: the third line has lost a minus sign. Valid for
    abs(kx) and abs(ky) < pi/2; in two-argument arctangents it holds until Bz vanishes, at
    abs(kx) + abs(ky) = pi.

    Examples
    --------
    >>> B = ideal_field([1e-3, -2e-3, -4e-3], amplitude=0.2, wave_number=250.0)
    >>> x, y, strength = ideal_inverse(B)
    >>> float(round(x, 9)), float(round(y, 9))
    (0.25, -0.5)
    """
    seen = floats("field", field, (3,))
    bz = seen[..., 2]
    return _invert(seen[..., 0], seen[..., 1], np.where(bz == 0.0, np.nan, bz), _OF_ARRAYS)


def _invert(bx: _N, by: _N, bz: _N, of: _Functions) -> tuple[_N, _N, _N]:
    """S5 of three components, arrays or plain numbers; Bz is not zero."""
    square = bz * bz
    skew = bx * bx - by * by
    q = square + skew  # 2 Bz q; with the other sign 2 Bz p
    twice = -2.0 * bz
    strength = of.hypot(q / twice, by)
    return of.arctan2(twice * bx, square - skew), of.arctan2(twice * by, q), strength


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


def stack_corrections(corrections: Sequence[LinearCorrection]) -> LinearCorrection:
    """Corrections of S magnets as one, for fields of shape (..., S, 3)."""
    return LinearCorrection(
        **{
            part.name: np.stack([getattr(each, part.name) for each in corrections])
            for part in dataclasses.fields(LinearCorrection)
        }
    )


def displacement(correction: LinearCorrection, field: ArrayLike) -> Floats:
    """Displacement of the magnet from rest that explains a field.

    Parameters
    ----------
    correction : LinearCorrection
        Correction of the magnet that the chip watches.
    field : array_like, shape (..., 3)
        B at the chip, in the magnet's axes, T.

    Returns
    -------
    Floats, shape (..., 3)
        How far the magnet stands from where it rests opposite the chip, m; not finite where
        the corrected Bz = 0.

    Raises
    ------
    ArgumentError
        If `field` is not (..., 3).

    Notes
    -----
    Source: SI Eqs. (S5), (S6). Valid for displacements within the `usable_range`.
    """
    seen = floats("field", field, (3,))
    result = np.empty_like(seen)
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = _displace(
            seen[..., 0], seen[..., 1], seen[..., 2], _numbers(correction), _OF_ARRAYS
        )
    result[..., 0], result[..., 1], result[..., 2] = moved
    return result


def displacements_of_one(
    corrections: Sequence[tuple[float, ...]], field: Floats
) -> list[tuple[float, float, float]] | None:
    """`displacement` for one reading of S chips, in plain numbers, which are faster for so few.

    Parameters
    ----------
    corrections : sequence of tuple of float
        Corrections as `plain_corrections` gives them.
    field : Floats, shape (S, 3)
        T.

    Returns
    -------
    list of tuple of float, or None
        m; None where a corrected Bz is zero.
    """
    try:
        return [
            _displace(bx, by, bz, numbers, _OF_NUMBERS)
            for (bx, by, bz), numbers in zip(field.tolist(), corrections, strict=True)
        ]
    except (ArithmeticError, ValueError):
        return None


def plain_corrections(correction: LinearCorrection) -> tuple[tuple[float, ...], ...]:
    """Stacked corrections as plain numbers, a tuple for each of the S magnets."""
    return tuple(zip(*(number.tolist() for number in _numbers(correction)), strict=True))


def _numbers(correction: LinearCorrection) -> tuple[Floats, ...]:
    """All numbers of a correction, one after the other."""
    return (
        *np.moveaxis(correction.k_c, -1, 0),
        *np.moveaxis(correction.c_c, -1, 0),
        correction.wave_number,
        correction.amplitude,
        correction.gap,
        correction.side,
    )


def _displace(bx: _N, by: _N, bz: _N, numbers: tuple[_N, ...], of: _Functions) -> tuple[_N, _N, _N]:
    """S6, then S5, of arrays or plain numbers."""
    k_x, k_y, k_z, c_x, c_y, c_z, wave_number, amplitude, gap, side = numbers
    phase_x, phase_y, strength = _invert(k_x * bx + c_x, k_y * by + c_y, k_z * bz + c_z, of)
    depth = of.log(strength / amplitude) / wave_number
    return -phase_x / wave_number, -phase_y / wave_number, side * (depth + gap)


def fit_correction(magnet: Magnet, gap: float, stroke: float) -> LinearCorrection:
    """Correction that makes the closed inverse true to the exact field, in least squares.

    Parameters
    ----------
    magnet : Magnet
        On the sheet it has its chip below, on the base above.
    gap : float
        From the magnet's nearer face to the chip at rest, m.
    stroke : float
        Radius of the ball of displacements that the fit covers, m; less than the gap.

    Returns
    -------
    LinearCorrection
        With the wave number of least displacement error. By symmetry x and y share their
        factor and have no offset.

    Raises
    ------
    ArgumentError
        If `gap` or `stroke` is not positive or the stroke reaches the magnet.

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
    """Radius about rest within which the corrected inverse errs less than the tolerance.

    Parameters
    ----------
    magnet : Magnet
        Magnet as it is built.
    gap : float
        From the magnet's nearer face to the chip at rest, m.
    correction : LinearCorrection
        Correction that `fit_correction` gives.
    tolerance : float
        Largest error of a displacement, m.

    Returns
    -------
    float
        m; every shorter displacement, in any direction, is found to within `tolerance`. Zero
        if not even rest is; at most 0.95 of the gap.

    Raises
    ------
    ArgumentError
        If `gap` or `tolerance` is not positive.

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
