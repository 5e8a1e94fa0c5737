"""What the paper says of its device's mechanics, and how far a whole sheet is from it.

Decides how each printed or implied observation is read off a sheet, and what counts as met.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from paper.models.press_energy import EnergyShares, energy_shares
from paper.models.reduction import (
    UnitPresses,
    cells_named,
    fit_magnets,
    magnet_motion,
    signs_agree,
    unit_presses,
)
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError, SmoskinError
from smoskin.mechanics.reduced.stiffness import cell_layers
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sticking, Touches
from smoskin.origami.geometry import geometry

_POINT: Final = 1e-6
"""m: radius of a touch that presses one vertex."""
_LIGHT: Final = 5e-3
"""N: press of a linear sheet."""
_NEWTON: Final = 1.0
"""N: press, and drag, of the SI's tests."""
_SHEARED: Final = 0.5
"""N: drag at which v_f is read; the SI does not print its own."""
_RATIO: Final = 0.919
"""U_3x over U_2x, and U_2y over U_3y, of a press on cell (1,1): Text S4's example."""
_MOTIONS: Final = (0.7313, 0.8709, 0.6721, 0.9476)
"""m/m: U_2x, U_2y, U_3x and U_3y of that press, per metre of it."""
_STIFFNESSES: Final = (1.0, 0.985, 1.004)
"""K11 : K22 : K33 for which the SI's v_a = 0.2285 stands, which it fitted to measured ones."""
_FOLDING: Final = ((0.6, 0.75, 0.9), (0.9, 1.0, 1.1))
"""N: v_f of the outer, mid and inner layer, for shear in X and in Y: Text S5."""
_SOFTENING: Final = 1.3
"""Stiffness of a light press over the secant at 1 N that counts as "decreases dramatically"."""
_NEGLIGIBLE: Final = 0.1
"""Energy of panels and creases over the columns' that counts as negligible."""
_FARTHEST: Final = 100.0
"""Miss of what cannot be read off a sheet at all."""


class Pressing(NamedTuple):
    """A sheet pressed in all the ways that the observations ask for."""

    guided: UnitPresses
    """Light presses of vertices guided along z, as the SI assumes."""
    sticking: UnitPresses
    """Light presses of a finger that sticks."""
    unguided: Floats
    """(N, M, 2): how far the magnets move under a guided press over that with the guide along x,
    or along y, taken away."""
    slips: Floats
    """(N, M), m/m: motion in the plane, per sink, of a vertex that nothing guides."""
    softening: float
    """Stiffness of cell (1,1) under a light press over its secant at 1 N, for the softer grip."""
    energy: EnergyShares
    """Shares of energy in guided presses."""
    margin: float
    """Least buckling margin on cells (1,1), (2,2) and (3,3) under 1 N with a drag of as much; 0
    where a touch has no equilibrium."""


def press_all(design: SkinDesign) -> Pressing:
    """Press a design's whole sheet in all the ways that the observations ask for.

    Raises
    ------
    ModelError
        If a light press finds no equilibrium.
    DesignError
        If the sheet cannot rest.
    """
    covered, finger = BarHinge(design, grip=Covered()), BarHinge(design, grip=Sticking())
    guided, sticking = unit_presses(covered), unit_presses(finger)
    unguided, slips = _without_guides(design)
    soft = (guided.stiffness[0, 0] / _secant(covered), sticking.stiffness[0, 0] / _secant(finger))
    return Pressing(
        guided=guided,
        sticking=sticking,
        unguided=unguided,
        slips=slips,
        softening=max(soft),
        energy=energy_shares(covered),
        margin=_margin(finger),
    )


def _without_guides(design: SkinDesign) -> tuple[Floats, Floats]:
    """Fields `unguided` and `slips` of `Pressing`.

    A light sheet answers linearly: what guides a vertex is the force in the plane that holds it,
    and guides are taken away by leaving out parts of that force.
    """
    sheet = geometry(design).sheet
    count = sheet.loaded.size
    loads = [(0.0, 0.0, -_LIGHT), (_LIGHT, 0.0, -_LIGHT), (0.0, _LIGHT, -_LIGHT)]
    touches = Touches(
        position=np.tile(geometry(design).tops.reshape(-1, 1, 2), (3, 1, 1)),
        force=np.repeat(loads, count, axis=0)[:, None],
        radius=_POINT,
    )
    pressed = BarHinge(design, grip=Frictionless()).press(touches, tolerance=1e-5)
    if not pressed.converged.all():
        raise ModelError("sheet must find an equilibrium for a light press that nothing guides")
    moved = pressed.displacements.reshape(3, count, -1, 3)
    vertex = moved[:, np.arange(count), sheet.loaded.ravel()]
    carried = [magnet.mount == "sheet" for magnet in design.magnets]
    magnets = magnet_motion(design, moved)[:, :, carried, :2].reshape(3, count, -1)
    free, give = vertex[0, :, :2], np.moveaxis(vertex[1:, :, :2] - vertex[0, :, :2], 0, -1)
    by_hold = np.moveaxis(magnets[1:] - magnets[0], 0, -1)

    def moves(hold: Floats) -> Floats:
        """Motion of the magnets, (cells, 2 H), under the forces that hold, (cells, 2)."""
        return np.asarray(magnets[0] + (by_hold @ hold[..., None])[..., 0])

    guided = moves(np.asarray(-np.linalg.solve(give, free[..., None])[..., 0]))
    alone = -free / give[:, [0, 1], [0, 1]]  # the force of a guide along one axis and no other
    ratio = [
        (guided**2).sum(axis=-1) / (moves(np.asarray(alone * left)) * guided).sum(axis=-1)
        for left in ((0.0, 1.0), (1.0, 0.0))
    ]
    slips = np.linalg.norm(free, axis=-1) / -vertex[0, :, 2]
    return np.stack(ratio, axis=-1).reshape(*design.cells, 2), slips.reshape(design.cells)


def _secant(sheet: BarHinge) -> float:
    """Stiffness of cell (1,1) by its sink under 1 N, N/m; nearly none without an equilibrium."""
    where = geometry(sheet.design).tops[0, 0]
    pressed = sheet.press(
        Touches(position=[[where]], force=[[(0.0, 0.0, -_NEWTON)]], radius=_POINT), tolerance=1e-5
    )
    sunk = -pressed.displacements[0, geometry(sheet.design).sheet.loaded[0, 0], 2]
    return float(_NEWTON / sunk) if pressed.converged[0] else np.inf


def _margin(finger: BarHinge) -> float:
    """Field `margin` of `Pressing`."""
    layers = np.arange(int(cell_layers(finger.design.cells).max()) + 1)
    where = geometry(finger.design).tops[layers, layers]
    drags = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
    push = [(x * _NEWTON, y * _NEWTON, -_NEWTON) for x, y in drags]
    pressed = finger.press(
        Touches(
            position=np.tile(where, (len(push), 1))[:, None],
            force=np.repeat(push, len(where), axis=0)[:, None],
        ),
        tolerance=1e-5,
    )
    return float(pressed.buckling_margin.min()) if pressed.converged.all() else 0.0


class Observation(NamedTuple):
    """One statement of the SI, and how a sheet is held against it."""

    name: str
    source: str
    """Place in the SI."""
    kind: str
    """`printed`, `used` in the SI's theory, or `implied` by what it prints."""
    read: Callable[[Pressing], tuple[float, ...]]
    """What the sheet shows."""
    asked: str
    """What the SI shows, in words."""
    miss: Callable[[tuple[float, ...]], float]
    """Distance from the statement in tolerances, at most 1 where it is met."""


def _cells(asked: int, tolerance: float) -> Callable[[tuple[float, ...]], float]:
    """Miss of counts of cells: all of them must reach the number asked."""
    return lambda counts: max(0.0, (asked - min(counts)) / tolerance)


def _near(*asked: float, factor: float) -> Callable[[tuple[float, ...]], float]:
    """Miss of numbers that may differ by a factor, the worst of them."""

    def miss(values: tuple[float, ...]) -> float:
        if not all(0.0 < value < np.inf for value in values):
            return _FARTHEST
        return float(np.abs(np.log(np.divide(values, asked))).max() / np.log(factor))

    return miss


def _above(asked: float, tolerance: float) -> Callable[[tuple[float, ...]], float]:
    """Miss of a number that must reach another: 1 there, less beyond, and more short of it."""
    return lambda values: max(0.0, 1.0 + (asked - values[0]) / tolerance)


def _corner(pressing: Pressing) -> tuple[float, ...]:
    """Magnitudes of U_2x, U_2y, U_3x and U_3y of a guided press on cell (1,1)."""
    return tuple(np.abs(pressing.guided.on_sheet[0, 0]).ravel().tolist())


def _corner_ratios(pressing: Pressing) -> tuple[float, ...]:
    """U_3x over U_2x and U_2y over U_3y, of a guided press on cell (1,1)."""
    along, across, other, own = _corner(pressing)
    return other / along, across / own


def _layers(values: Floats) -> Floats:
    """Values of the cells (1,1), (2,2) and (3,3)."""
    layer = np.arange(3)
    return np.asarray(values[layer, layer])


def _named(pressing: Pressing) -> tuple[float, ...]:
    """Cells that S12 names, by the v_a of their own magnets' motion, for both grips."""
    both = pressing.guided, pressing.sticking
    return tuple(float(cells_named(item, fit_magnets(item).attenuation)) for item in both)


def _signs(pressing: Pressing) -> tuple[float, ...]:
    """Cells with Table S1's signs, for both grips."""
    both = pressing.guided, pressing.sticking
    return tuple(float(signs_agree(item).all(axis=(2, 3)).sum()) for item in both)


def _folding(pressing: Pressing) -> tuple[float, ...]:
    """v_f by layer for shear in X, then in Y, N, where 1 + F_p / v_f is what a lost guide costs."""
    cost = np.concatenate([_layers(pressing.unguided[..., axis]) for axis in (0, 1)]) - 1.0
    return tuple((_SHEARED / np.where(cost > 0.0, cost, np.nan)).tolist())


def _relative_stiffness(pressing: Pressing) -> tuple[float, ...]:
    """K11, K22 and K33 of guided presses over K11."""
    stiffness = _layers(pressing.guided.stiffness)
    return tuple((stiffness / stiffness[0]).tolist())


def _energies(pressing: Pressing) -> tuple[float, ...]:
    """Energy of creases, and of panels, over the columns'."""
    energy = pressing.energy
    columns = energy.sway + energy.sink
    return energy.creases / columns, energy.panels / columns


def _edge_slip(pressing: Pressing) -> tuple[float, ...]:
    """Slip of unguided vertices: mean of the edge's cells over that of the inner ones."""
    edge = cell_layers(pressing.slips.shape) == 0
    return (float(pressing.slips[edge].mean() / pressing.slips[~edge].mean()),)


OBSERVATIONS: Final = (
    Observation("signs", "Table S1", "used", _signs, "36 of 36 cells", _cells(36, 0.5)),
    Observation("cells named", "S12", "used", _named, "in practice all", _cells(36, 2.0)),
    Observation(
        "motion ratios at (1,1)", "Text S4", "used", _corner_ratios, "0.919, 0.919",
        _near(_RATIO, _RATIO, factor=1.1),
    ),
    Observation(
        "motions at (1,1)", "Text S4", "used", _corner, "0.73, 0.87, 0.67, 0.95",
        _near(*_MOTIONS, factor=1.25),
    ),
    Observation(
        "K11 : K22 : K33", "Text S5", "implied",
        _relative_stiffness,
        "1 : 0.985 : 1.004", _near(*_STIFFNESSES, factor=1.1),
    ),
    Observation(
        "centre stiffer than edge", "Figure S7", "printed",
        lambda pressing: _relative_stiffness(pressing)[2:],
        "above 1", _above(1.0, 0.1),
    ),
    Observation(
        "edge softens at large press", "Text S1", "printed",
        lambda pressing: (pressing.softening,), "dramatically", _above(_SOFTENING, 0.1),
    ),
    Observation(
        "edge vertices slip most", "Text S5", "printed", _edge_slip, "above 1", _above(1.0, 0.1)
    ),
    Observation(
        "v_f by layer, X then Y (N)", "Text S5", "printed", _folding,
        "0.6, 0.75, 0.9; 0.9, 1.0, 1.1",
        _near(*_FOLDING[0], *_FOLDING[1], factor=1.25),
    ),
    Observation(
        "creases, panels negligible", "S25", "printed", _energies, "below a tenth",
        lambda shares: max(shares) / _NEGLIGIBLE,
    ),
    Observation(
        "1 N at 45 deg on any cell", "Text S5", "printed",
        lambda pressing: (pressing.margin,), "done", _above(1.0, 0.2),
    ),
)  # fmt: skip
"""Eleven of the SI's twelve; its recovery times (Figure S9) are drawn, and not in its text."""


def misses(design: SkinDesign) -> tuple[float, ...]:
    """How far a design's whole sheet is from each of `OBSERVATIONS`, in tolerances.

    All are far where the sheet cannot rest, or some light press finds no equilibrium.
    """
    try:
        pressing = press_all(design)
    except SmoskinError:
        return (_FARTHEST,) * len(OBSERVATIONS)
    return tuple(min(float(item.miss(item.read(pressing))), _FARTHEST) for item in OBSERVATIONS)
