"""How well the SI's reduced, attenuated sheet stands for the whole one, and with which v_a.

Decides how the two are compared: by what a small press on each cell moves in the plane, per metre
that it sinks the loaded vertex (S7-S11), by what the magnets do (S12), and by the stiffness that
the press meets (S22-S25), each by least squares. Hides the search. NumPy and SciPy alone; the
presses themselves are put to a `smoskin.mechanics.sheet.model.BarHinge`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.reduced.attenuation import Profiles, magnet_displacements, profiles
from smoskin.mechanics.reduced.stiffness import (
    cell_layers,
    column_stiffness,
    relative_stiffness_map,
)
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.location import decide, ideal_rule, unit_press

if TYPE_CHECKING:
    from smoskin.mechanics.sheet.model import BarHinge

LEAST_ATTENUATION: Final = 1e-3
"""Lower end of the search for v_a: a neighbour that hardly moves at all."""
_POINT: Final = 1e-6
"""m: radius of a touch that presses one vertex."""
_STARTS: Final = (0.2, 0.6, 0.95)
"""Values from which the search for v_a begins, along each axis."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnitPresses:
    """What small presses on each cell's top vertex do, per metre that the vertex sinks."""

    design: SkinDesign
    """N x M cells, G magnets."""
    columns: Floats
    """(N, M, 2N + 1, M + 1, 3), m/m: motion of each column's top over the board."""
    magnets: Floats
    """(N, M, G, 6), m/m and rad/m: motion of each magnet; zero on the base."""
    stiffness: Floats
    """(N, M), N/m: force on the vertex over its sink."""

    @property
    def folding(self) -> Floats:
        """(N, M): share of the sink that folds the pressed cell; the rest sinks its six columns."""
        sunk = -self.columns[..., 2]
        share = np.empty(self.stiffness.shape)
        for n, m in np.ndindex(share.shape):
            share[n, m] = 1 - sunk[n, m, 2 * n : 2 * n + 3, m : m + 2].mean()
        return share

    @property
    def on_sheet(self) -> Floats:
        """(N, M, H, 2), m/m: motion in the plane of the H magnets that the sheet carries."""
        carried = [magnet.mount == "sheet" for magnet in self.design.magnets]
        return self.magnets[:, :, carried, :2]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reduction:
    """The reduced model that comes nearest to a whole sheet, and what it leaves."""

    attenuation: tuple[float, float]
    """(v_aX, v_aY)."""
    scale: float
    """Factor on the reduced model: 1 if every metre of press folds the cell as S7 says; of a
    stiffness it is v_s."""
    measured: Floats
    """(N, M, ...): of the whole sheet, for a press on each cell."""
    expected: Floats
    """(N, M, ...): of the reduced one."""

    @property
    def residual(self) -> float:
        """Norm of what is left over the norm of what was measured; 1 explains nothing."""
        left = np.linalg.norm(self.measured - self.expected)
        return float(left / np.linalg.norm(self.measured))

    @property
    def cell_residual(self) -> Floats:
        """(N, M): the same for a press on each cell."""
        cells = self.measured.shape[:2]
        left = (self.measured - self.expected).reshape(*cells, -1)
        whole = self.measured.reshape(*cells, -1)
        return np.asarray(np.linalg.norm(left, axis=-1) / np.linalg.norm(whole, axis=-1))


def magnet_motion(design: SkinDesign, displacements: Floats) -> Floats:
    """Translation, m, and rotation vector, rad, of every magnet over the board, (..., G, 6).

    The displacements are those of the sheet's vertices over the board, (..., V, 3), m.
    """
    matrix = holder_matrix(design)
    flat = displacements.reshape(*displacements.shape[:-2], -1)
    motion = flat @ matrix.reshape(-1, flat.shape[-1]).T
    return np.asarray(motion.reshape(*flat.shape[:-1], len(design.magnets), 6))


def unit_presses(sheet: "BarHinge", *, force: float = 5e-3) -> UnitPresses:
    """Press every cell's top vertex of a whole sheet in turn.

    Parameters
    ----------
    sheet : BarHinge
        Its grip decides what holds the vertex: a finger that sticks to it while the board gives
        way on its shear layer, or, as the SI assumes, a guide along z (`contact.Covered`).
    force : float
        N; small, so that the answer is that of a linear sheet.

    Raises
    ------
    ArgumentError
        If the force does not press.
    ModelError
        If some press finds no equilibrium.
    """
    if not 0.0 < force < np.inf:
        raise ArgumentError(f"force must be positive and finite; got {force} N")
    design, mesh = sheet.design, geometry(sheet.design).sheet
    places = geometry(design).tops.reshape(-1, 1, 2)
    push = np.broadcast_to([0.0, 0.0, -force], (len(places), 1, 3))
    # Stiff sheets answer the tiny press with motions near the rounding of their own forces.
    pressed = sheet.press(Touches(position=places, force=push, radius=_POINT), tolerance=1e-5)
    if not pressed.converged.all():
        lost = ", ".join(
            f"({n + 1},{m + 1})"
            for n, m in np.argwhere(~pressed.converged.reshape(design.cells)).tolist()
        )
        raise ModelError(f"sheet must find an equilibrium for a press on each cell; not on {lost}")
    moved = pressed.displacements
    sink = -moved[np.arange(len(moved)), mesh.loaded.ravel(), 2]
    unit = (moved / sink[:, None, None]).reshape(*design.cells, -1, 3)
    return UnitPresses(
        design=design,
        columns=unit[:, :, mesh.columns],
        magnets=magnet_motion(design, unit),
        stiffness=(force / sink).reshape(design.cells),
    )


def fit_columns(presses: UnitPresses, *, scale: float | None = None) -> Reduction:
    """The reduced model whose columns move in the plane most nearly as the sheet's do.

    Parameters
    ----------
    presses : UnitPresses
    scale : float, optional
        Held at this if given: 1 takes the SI at its word. By default it is fitted as well.

    Notes
    -----
    Source: SI Eqs. (S7)-(S11), fitted. Valid for small presses.
    """
    design = presses.design

    def columns(attenuation: tuple[float, float]) -> Floats:
        return _all_columns(profiles(design.cell, design.cells, attenuation, -1.0))

    return _fit(presses.columns[..., :2], columns, scale)


def fit_magnets(presses: UnitPresses, *, scale: float | None = None) -> Reduction:
    """As `fit_columns`, of the magnets on the sheet alone: what the chips could tell."""
    design = presses.design
    corners = [magnet.corner for magnet in design.magnets if magnet.mount == "sheet"]

    def magnets(attenuation: tuple[float, float]) -> Floats:
        parts = profiles(design.cell, design.cells, attenuation, -1.0)
        return np.stack([magnet_displacements(parts, corner) for corner in corners], axis=2)

    return _fit(presses.on_sheet, magnets, scale)


def fit_stiffness(presses: UnitPresses) -> Reduction:
    """v_a, alike along both axes, and v_s as the SI finds them: from one cell of each layer.

    Notes
    -----
    Source: SI Text S5: v_a gives "a most closely matched stiffness distribution" on cells (1,1),
    (2,2) and (3,3); the columns alone carry. The residual is that of all cells.
    """
    from scipy.optimize import minimize_scalar

    design, stiffness = presses.design, presses.stiffness
    layer = np.arange(int(cell_layers(design.cells).max()) + 1)
    asked = stiffness[layer, layer]

    def carried(v: float) -> Floats:
        return column_stiffness(design) * relative_stiffness_map(design.cell, design.cells, (v, v))

    def ratio(v: float) -> tuple[float, float]:
        """v_s, and what it leaves of the cells asked."""
        share = carried(v)[layer, layer] / asked
        variation = float(share.sum() / (share @ share))
        return variation, float(np.linalg.norm(variation * share - 1))

    tried = np.linspace(LEAST_ATTENUATION, 1.0, 60)
    best = int(np.argmin([ratio(v)[1] for v in tried]))
    bracket = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
    result = minimize_scalar(lambda v: ratio(float(v))[1], bounds=bracket, method="bounded")
    v = float(result.x)
    variation = ratio(v)[0]
    return Reduction(
        attenuation=(v, v),
        scale=variation,
        measured=stiffness,
        expected=variation * carried(v),
    )


def signs_agree(presses: UnitPresses) -> Bools:
    """Tell whether each magnet of the sheet moves as the reduced model says, (N, M, H, 2).

    Notes
    -----
    Source: SI Table S1, whose signs hang on no attenuation.
    """
    design = presses.design
    parts = profiles(design.cell, design.cells, design.coefficients.attenuation, -1.0)
    corners = [magnet.corner for magnet in design.magnets if magnet.mount == "sheet"]
    theory = np.stack([magnet_displacements(parts, corner) for corner in corners], axis=2)
    return np.asarray(np.sign(theory) == np.sign(presses.on_sheet))


def _all_columns(parts: Profiles) -> Floats:
    """Displacement of every column for every load, (N, M, 2N + 1, M + 1, 2)."""
    y = parts.y[:, None, :] + parts.zigzag[:, None, :, None]
    x = parts.x[:, None, :, None]
    return np.stack(np.broadcast_arrays(x, y), axis=-1)


def _fit(
    measured: Floats, model: Callable[[tuple[float, float]], Floats], scale: float | None
) -> Reduction:
    """Least squares over v_a; the best scale follows from it."""
    from scipy.optimize import least_squares

    def scaled(attenuation: Floats) -> tuple[float, Floats]:
        along, across = attenuation.tolist()
        shape = model((along, across))
        best = scale
        if best is None:
            best = float(np.vdot(shape, measured) / np.vdot(shape, shape))
        return best, best * shape

    def left(attenuation: Floats) -> Floats:
        return np.asarray((scaled(attenuation)[1] - measured).ravel())

    starts = np.stack(np.meshgrid(_STARTS, _STARTS), axis=-1).reshape(-1, 2)
    start = min(starts, key=lambda item: float(np.linalg.norm(left(item))))
    result = least_squares(left, start, bounds=(LEAST_ATTENUATION, 1.0), xtol=1e-12, ftol=1e-12)
    best, expected = scaled(result.x)
    return Reduction(
        attenuation=(float(result.x[0]), float(result.x[1])),
        scale=best,
        measured=measured,
        expected=expected,
    )


def cells_named(presses: UnitPresses, attenuation: tuple[float, float]) -> int:
    """Cells that the rule of S12 with this v_a names right by the magnets' motion."""
    design = presses.design
    rule = ideal_rule(unit_press(design, replace(design.coefficients, attenuation=attenuation)))
    cells = np.moveaxis(np.indices(design.cells), 0, -1)
    return int((decide(rule, presses.on_sheet) == cells).all(axis=-1).sum())
