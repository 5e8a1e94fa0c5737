"""A virtual bench: touches of known load on a skin that differs from its design.

Decides which touches a person would measure in an hour, how noisy gauge and stage are, and how a
made skin of the reduced model differs from the designed one.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.stiffness import cell_layers
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact
from smoskin.roles import Progress, VirtualSkin, unheard
from smoskin.twin.manufacture import as_designed
from smoskin.twin.reduced import ReducedTwin

GAUGE_NOISE: Final = 0.02
"""Noise of force and depth, relative: this project's assumption of a hand-held gauge and stage."""
_FORCE_STEP: Final = 1e-3
"""N: smallest step of the gauge's display."""
_DEPTH_STEP: Final = 1e-6
"""m: smallest step of the stage's display."""
_STRAIGHT_FORCES: Final = (0.2, 0.4, 0.6, 0.8, 1.0)
_STRAIGHT_REPEATS: Final = 4
_SLANTED_FORCES: Final = (0.3, 0.5)
_SLANTED_REPEATS: Final = 6
_OTHER_FORCE: Final = 0.5
_OTHER_REPEATS: Final = 2
_TABLE_PRESS: Final = 0.3
_TABLE_DRAG: Final = 0.2
"""N: so light that no chip of a made skin stands at the end of its range."""
_CELLS_A_REST: Final = 3
"""Cells after which the untouched skin is read again."""
_UNTOUCHED: Final = 20
"""Readings of the untouched skin before the touches of the paper's calibration."""
_WARMING: Final = (24.0, 27.0)
"""degC, from the first to the last touch."""


def made_skin(design: SkinDesign, rng: np.random.Generator) -> ReducedTwin:
    """A skin of the reduced model, with ideal chips, as a workshop might make it from the design.

    The twin's own design has the coefficients, stiffnesses and magnets that it really has.

    v_a (X and Y alike) is anywhere in 0.15..0.5, v_s in 0.7..1.4; v_f are off by up to 20 %,
    K_sf and the sheet's stiffness by 10 %, remanences by 3 %; chips are turned by up to 2
    degrees and add up to 50 uT an axis.
    """
    chips = len(design.halls)
    given = design.coefficients
    v_a = float(rng.uniform(0.15, 0.5))
    coefficients = replace(
        given,
        attenuation=(v_a, v_a),
        stiffness_variation=float(rng.uniform(0.7, 1.4)),
        folding_correction_x=tuple(v * rng.uniform(0.8, 1.2) for v in given.folding_correction_x),
        folding_correction_y=tuple(v * rng.uniform(0.8, 1.2) for v in given.folding_correction_y),
    )
    magnets = tuple(
        replace(m, remanence=m.remanence * rng.uniform(0.97, 1.03)) for m in design.magnets
    )
    pillars = replace(
        design.shear_layer, radius=design.shear_layer.radius * float(rng.uniform(0.9, 1.1)) ** 0.25
    )
    # Wider and taller columns sway more easily, while presses, with r^2 / h, stay as they were.
    wide = float(rng.uniform(0.9, 1.1)) ** -0.5
    sheet = replace(
        design.columns, radius=wide * design.columns.radius, height=wide**2 * design.columns.height
    )
    direction = rng.normal(size=(chips, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    made = replace(
        design, coefficients=coefficients, magnets=magnets, shear_layer=pillars, columns=sheet
    )
    deviations = as_designed(made)
    turned = replace(
        deviations.chips,
        turn=direction * np.radians(rng.uniform(0.0, 2.0, (chips, 1))),
        zero=rng.uniform(-50e-6, 50e-6, (chips, 3)),
    )
    return ReducedTwin(made, seed=None, deviations=replace(deviations, chips=turned))


def calibration_loads(design: SkinDesign) -> tuple[Contact | None, ...]:
    """Touches that a person applies in about an hour to calibrate a skin; None is no touch.

    First 20 readings of the untouched skin. Then, on one cell of each layer along the diagonal,
    (1,1), (2,2), (3,3) as in the SI: straight presses of 0.2 to 1 N, four times each, and loads
    slanted by 45 degrees to +-X and +-Y with 0.3 and 0.5 N both ways, six times each. Last, two
    presses of 0.5 N on every other cell next to a magnet. The reference design takes 220 touches.

    Notes
    -----
    Source: SI Text S5, "Calibration Process"; repeats, forces and the cells next to the magnets
    are this project's.
    """
    columns, rows = design.cells
    named = len(design.coefficients.folding_correction_x)
    layers = cell_layers(design.cells)
    diagonal = [(k, k) for k in range(min(columns, rows)) if k < named and layers[k, k] == k]
    loads: list[Contact | None] = [None] * _UNTOUCHED
    for cell in diagonal:
        for force in _STRAIGHT_FORCES:
            loads += [_load(design, cell, force)] * _STRAIGHT_REPEATS
        for force in _SLANTED_FORCES:
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                slanted = _load(design, cell, force, (x * force, y * force))
                loads += [slanted] * _SLANTED_REPEATS
    corners = [magnet.corner for magnet in design.magnets if magnet.mount == "sheet"]
    near = {(p + n, q + m) for p, q in corners for n in (-1, 0) for m in (-1, 0)}
    for n, m in sorted(near - set(diagonal)):
        if 0 <= n < columns and 0 <= m < rows:
            loads += [_load(design, (n, m), _OTHER_FORCE)] * _OTHER_REPEATS
    return tuple(loads)


def table_loads(design: SkinDesign) -> tuple[Contact | None, ...]:
    """Touches that a person makes in half an hour to have the answers of all cells measured.

    On every cell come a straight press of 0.3 N, the same press with a drag of 0.2 N along X and
    with one along Y; the drag's sign changes from cell to cell. Before every three cells the
    untouched skin is read, as its rest field drifts with the warmth of its magnets. The reference
    design takes 108 touches.
    """
    loads: list[Contact | None] = []
    for number, (n, m) in enumerate(np.ndindex(*design.cells)):
        if number % _CELLS_A_REST == 0:
            loads.append(None)
        drag = _TABLE_DRAG if (n + m) % 2 else -_TABLE_DRAG
        for sideways in ((0.0, 0.0), (drag, 0.0), (0.0, drag)):
            loads.append(_load(design, (n, m), _TABLE_PRESS, sideways))
    return tuple(loads)


def measure(
    skin: VirtualSkin,
    loads: Sequence[Contact | None],
    rng: np.random.Generator,
    *,
    gauge_noise: float = GAUGE_NOISE,
    progress: Progress = unheard,
) -> TouchTable:
    """The table that a bench writes: noisy gauge, noisy stage, noisy chips, slowly warming.

    Warmth acts on magnets and chips, not on the rubber. `gauge_noise` is the standard deviation of
    force and depth, relative to their size. It raises an `ArgumentError` if the noise is negative,
    or a load lies off the skin or pulls at it.
    """
    if not gauge_noise >= 0:
        raise ArgumentError(f"gauge_noise must be >= 0; got {gauge_noise}")
    touches = [[] if load is None else [load] for load in loads]
    force = np.array([(0.0, 0.0, 0.0) if load is None else load.force for load in loads])
    depth = np.zeros(len(touches))
    for row, touch in enumerate(touches):
        progress(f"touch {row + 1} of {len(touches)}", row / len(touches))
        depth[row] = skin.depths(touch).sum() if touch else 0.0
    force = force * (1 + gauge_noise * rng.normal(size=force.shape))
    depth = depth * (1 + gauge_noise * rng.normal(size=depth.shape))
    degrees = np.linspace(*_WARMING, len(loads))
    sample = skin.sample(skin.motions(touches_of(touches)), rng, temperature=degrees)
    field = mlx90393.tesla(sample.counts, skin.design.hall_setting)
    field[(sample.flags & int(ChipFlag.INVALID)) != 0] = np.nan
    return TouchTable(
        position=np.array([(np.nan,) * 2 if load is None else load.position for load in loads]),
        force=np.round(force / _FORCE_STEP) * _FORCE_STEP,
        depth=np.round(depth / _DEPTH_STEP) * _DEPTH_STEP,
        field=field,
        temperature=np.broadcast_to(mlx90393.degrees(sample.temperature_counts), field.shape[:2]),
    )


def _load(
    design: SkinDesign, cell: tuple[int, int], press: float, drag: tuple[float, float] = (0.0, 0.0)
) -> Contact:
    """A press, N, with a drag on a cell's top vertex."""
    return Contact(position=geometry(design).tops[cell], force=(*drag, -press))
