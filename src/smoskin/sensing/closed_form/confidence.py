"""How surely the chips' noise lets a press be located: one decision, and a whole design.

Every rule of `smoskin.sensing.closed_form.location` gives a cell all displacements within a cone,
which faces through the origin part from its neighbours. The chances that noise carries a
displacement over the faces add up to the doubt in one decision; solved for the force they say from
which press on two cells are told apart.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final, Literal, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.mechanics.reduced.stiffness import stiffness_map
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.location import (
    Divisions,
    Rule,
    directions,
    ideal_rule,
    readout,
    unit_press,
)
from smoskin.sensing.signals.signals import chip_noise

Axis = Literal["x", "y"]

_ALIKE: Final = 1e-6
"""rad: directions closer than this are one; their cosines differ by less than rounding."""


def motion_noise(design: SkinDesign) -> Floats:
    """Variance that one reading's noise makes in the chips' motions, shape (3S,), m^2."""
    of_chip = chip_noise(design) ** 2
    turned = np.stack([np.abs(mlx90393.rotation(site)) @ of_chip for site in design.halls])
    magnets = [design.magnet(site.magnet) for site in design.halls]
    rest = geometry(design).rest
    slope = charge_field_and_gradient(*point_charges(magnets), rest)[1]
    return np.asarray((turned / np.einsum("sii->si", slope) ** 2).ravel())


def readout_noise(design: SkinDesign, matrix: Floats) -> Floats:
    """Covariance that one reading's noise makes in the magnets' displacements and the drag.

    The matrix (3S, 2G + 2) is `location.readout`, of which columns may be left out; the covariance
    is (2G + 2, 2G + 2), m^2, and of the drag N^2. The drag is taken off all magnets alike, so that
    the lower chip's noise is common to them.
    """
    return np.asarray((matrix.T * motion_noise(design)) @ matrix)


class Cones(NamedTuple):
    """The cone of displacements of each of N x M cells."""

    faces: list[list[Floats]]
    """Faces of each cell, (F, 2G), 1/m: times a displacement, how many standard deviations it lies
    inside."""
    share: Floats
    """(N, M): chance of the cell among those of the very same direction."""

    def confidence(self, cell: tuple[int, int], displacements: Floats) -> float:
        """Probability that without noise the same cell would have been decided on.

        Notes
        -----
        A displacement U, (2G,), m, across a face lies U sin(angle) from it: with noise sigma the
        true one is on the other side with probability Phi(-U sin(angle) / sigma). The sum over the
        faces is at least the doubt, and all of it where two faces meet at a wide angle.
        Valid for a true direction of which nothing is known beforehand: presses on top vertices
        alone, whose directions lie well inside their cones, are right more often than this says.
        """
        n, m = cell
        doubt = total_tail(self.faces[n][m] @ displacements)
        return max(1.0 - doubt, 0.0) * float(self.share[cell])


def total_tail(distances: Floats) -> float:
    """Sum of the chances 1 - Phi(d) of a standard normal to exceed each of these distances."""
    # Plain numbers: for so few NumPy takes longer to start than Python to finish.
    return sum(map(math.erfc, (distances * 0.5**0.5).tolist())) / 2


def cones(rule: Rule, unit: Floats, noise: Floats) -> Cones:
    """The cones that a rule gives the cells, measured in the displacements' noise.

    The rule was made from displacements (N, M, G, 2), whose noise, (2G, 2G), m^2, is the first part
    of `readout_noise`.
    """
    columns, rows = unit.shape[:2]
    normals: list[list[Floats]] = [[] for _ in range(columns * rows)]
    share = np.ones(columns * rows)
    for part in _partings(rule, unit, noise):
        for wall in part.walls:
            for cell in part.members[wall.own].tolist():
                normals[cell].append(wall.normal)
        share[part.members] /= part.alike.sum(axis=1)[:, None]
    faces = [np.reshape(normal, (-1, len(noise))) for normal in normals]
    by_column = [faces[n * rows : (n + 1) * rows] for n in range(columns)]
    return Cones(by_column, share.reshape(columns, rows))


@dataclass(frozen=True, slots=True, kw_only=True)
class Ambiguity:
    """Two cells that a press of the stated force does not tell apart."""

    axis: Axis
    """Axis whose displacements tell two columns apart, x, or two rows, y."""
    pair: tuple[tuple[int, int], tuple[int, int]]
    """Cells (n, m) of the two columns or rows where they are hardest to tell apart."""
    same_signs: bool
    """Whether all magnets move the same ways along the axis."""
    ratios: tuple[float, float]
    """First over second magnet's displacement along the axis; NaN unless there are two."""
    force: float
    """N, from which they are told apart at the stated error rate; inf where never."""

    @property
    def ratio_gap(self) -> float:
        """How far apart the ratios are; NaN unless there are two magnets."""
        return abs(self.ratios[1] - self.ratios[0])

    def __str__(self) -> str:
        index, kind = (0, "columns") if self.axis == "x" else (1, "rows")
        first, second = (cell[index] + 1 for cell in self.pair)
        signs = "the same signs" if self.same_signs else "different signs"
        ratios = ""
        if not math.isnan(self.ratio_gap):
            ratios = f" and ratios {self.ratios[0]:.4g} and {self.ratios[1]:.4g}"
        when = "never" if math.isinf(self.force) else f"from {self.force:.3g} N"
        return f"{kind} {first} and {second}: {signs}{ratios}, told apart {when}"


def ambiguities(
    design: SkinDesign,
    *,
    calibration: Calibration | None = None,
    force: float = 0.5,
    error_rate: float = 0.01,
) -> tuple[Ambiguity, ...]:
    """Which cells a design cannot tell apart, worst first.

    Parameters
    ----------
    calibration : Calibration, optional
        Coefficients and stiffnesses of the sheet; as designed by default.
    force : float
        N: a pair that a straight press of this force tells apart is left out.
    error_rate : float
        How often noise may take one cell of a pair for the other.

    Raises
    ------
    ArgumentError
        If the force is not positive or the error rate not in (0, 0.5).

    Notes
    -----
    By the SI's lines only neighbours are confused; by directions any two may be.
    Valid for the chips' noise alone: a skin unlike its design confuses more.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> ambiguities(read_design("planar"))
    ()
    >>> print(ambiguities(read_design("planar"), force=1e-3)[0])
    columns 1 and 2: the same signs and ratios 1.088 and 1.562, told apart from 0.0712 N
    """
    if not force > 0:
        raise ArgumentError(f"force must be positive; got {force} N")
    if not 0 < error_rate < 0.5:
        raise ArgumentError(f"error_rate must lie in (0, 0.5); got {error_rate}")
    calibration = calibration or Calibration.nominal(design)
    calibration.check_fits(design)
    least = -NormalDist().inv_cdf(error_rate)
    listed = _pairs(design, calibration, least)
    confused = [pair for pair in listed if pair.force > force]
    return tuple(sorted(confused, key=lambda pair: (-pair.force, pair.axis, pair.pair)))


class _Wall(NamedTuple):
    """A plane between two classes of cells."""

    own: int
    other: int
    normal: Floats
    """(2G,), 1/m: towards its own class, one standard deviation long."""


class _Parting(NamedTuple):
    """Classes of cells that one part of a rule tells apart: columns or rows."""

    axis: Axis
    members: Ints
    """(C, K): cells n M + m of each class."""
    alike: Bools
    """(C, C): whether two classes have one direction."""
    walls: list[_Wall]
    """Walls between classes of different directions; among those alike the first stands for all."""


def _pairs(design: SkinDesign, calibration: Calibration, least: float) -> list[Ambiguity]:
    """Every pair by the rule of an ideal sheet, told apart at so many standard deviations."""
    unit = unit_press(design, calibration.coefficients)
    noise = readout_noise(design, readout(design, calibration)[:, :-2])
    stiffness = stiffness_map(design, calibration.coefficients).ravel()
    flat = unit.reshape(len(stiffness), -1)
    hardest: dict[tuple[Axis, int, int], tuple[float, int, int]] = {}
    for part in _partings(ideal_rule(unit), unit, noise):
        pairs = [(int(a), int(b), np.inf, 0) for a, b in np.argwhere(np.triu(part.alike, 1))]
        for wall in part.walls:
            own = part.members[wall.own]
            forces = least * stiffness[own] / (flat[own] @ wall.normal)
            pairs.append((wall.own, wall.other, float(forces.max()), int(forces.argmax())))
        for a, b, force, k in pairs:
            key = part.axis, min(a, b), max(a, b)
            needed = force, int(part.members[key[1], k]), int(part.members[key[2], k])
            hardest[key] = max(hardest.get(key, needed), needed)
    return [_ambiguity(unit, axis, *needed) for (axis, _, _), needed in hardest.items()]


def _partings(rule: Rule, unit: Floats, noise: Floats) -> list[_Parting]:
    """Every part of a rule."""
    cells = np.arange(unit.shape[0] * unit.shape[1]).reshape(unit.shape[:2])
    columns, rows = directions(unit)
    classes: list[tuple[Axis, Ints, Floats]] = [("x", cells, columns), ("y", cells.T, rows)]
    partings = []
    for axis, members, units in classes:
        alike = np.linalg.norm(units[:, None] - units, axis=-1) < _ALIKE
        if isinstance(rule, Divisions):
            walls = _line_walls(rule, axis)
        else:
            first = np.flatnonzero(~np.tril(alike, -1).any(axis=1)).tolist()
            walls = [
                _Wall(own, other, units[own] - units[other])
                for own in range(len(units))
                for other in first
                if not alike[own, other]
            ]
        scaled = [
            wall._replace(normal=wall.normal / np.sqrt(wall.normal @ noise @ wall.normal))
            for wall in walls
        ]
        partings.append(_Parting(axis, members, alike, scaled))
    return partings


def _line_walls(rule: Divisions, axis: Axis) -> list[_Wall]:
    """The dividing lines of one circle; where beyond a line is nobody, noise cannot have come."""
    of_x = int((rule.lines < 2 * np.pi).sum())
    span = slice(0, of_x) if axis == "x" else slice(of_x, None)
    lines, sectors = rule.lines[span], rule.cells[1:][span][:-1].tolist()
    walls = []
    for k, own in enumerate(sectors):
        for neighbour, line, side in ((k - 1, k, 1.0), ((k + 1) % len(sectors), k + 1, -1.0)):
            other = sectors[neighbour]
            if own >= 0 and other >= 0 and own != other:
                normal = np.zeros((2, 2))
                normal[:, "xy".index(axis)] = np.cos(lines[line]), -np.sin(lines[line])
                walls.append(_Wall(own, other, side * normal.ravel()))
    return walls


def _ambiguity(unit: Floats, axis: Axis, force: float, first: int, second: int) -> Ambiguity:
    """A pair of cells and the force that it needs, described."""
    pair = [divmod(cell, unit.shape[1]) for cell in (first, second)]
    moved, other = (unit[cell][:, "xy".index(axis)] for cell in pair)
    ratios = math.nan, math.nan
    if len(moved) == 2:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = float(moved[0] / moved[1]), float(other[0] / other[1])
    return Ambiguity(
        axis=axis,
        pair=(pair[0], pair[1]),
        same_signs=bool((np.sign(moved) == np.sign(other)).all()),
        ratios=ratios,
        force=force,
    )
