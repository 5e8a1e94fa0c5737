"""A virtual bench: touches of known load on a skin that differs from its design.

Decides which touches a person would measure in an hour, how noisy gauge and stage are, and how a
made skin of the reduced model differs from the designed one; a made skin of the whole sheet is
`smoskin.twin.whole.Twin`'s. The table that comes out is what a real bench writes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from smoskin.arrays import Floats, Ints, frozen
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.temperature import temperature_factor
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.stiffness import cell_layers, sheet_stiffness
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact, Reading
from smoskin.twin.reduced import ReducedTwin

if TYPE_CHECKING:
    from smoskin.twin.whole import Twin

GAUGE_NOISE: Final = 0.02
"""Of force and of depth, relative: the project's assumption of a hand-held gauge and stage."""
_FORCE_STEP: Final = 1e-3
"""N, of the gauge's display."""
_DEPTH_STEP: Final = 1e-6
"""m, of the stage's."""
_STRAIGHT_FORCES: Final = (0.2, 0.4, 0.6, 0.8, 1.0)
_STRAIGHT_REPEATS: Final = 4
_SLANTED_FORCES: Final = (0.3, 0.5)
_SLANTED_REPEATS: Final = 6
_OTHER_FORCE: Final = 0.5
_OTHER_REPEATS: Final = 2
_TABLE_PRESS: Final = 0.3
_TABLE_DRAG: Final = 0.2
"""N: so light that no chip of a made skin stands at the end of its range."""
_UNTOUCHED: Final = 20
_WARMING: Final = (24.0, 27.0)
"""degC, from the first to the last touch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What the bench applies; no cell leaves the skin untouched."""

    cell: tuple[int, int] | None
    """(n, m), from 0."""
    force: tuple[float, float, float]
    """N, on the skin."""


class BenchSkin(Protocol):
    """A skin that a bench can measure."""

    @property
    def design(self) -> SkinDesign:
        """With the cells and chips that it has."""
        ...

    def depths(self, loads: Sequence[Load]) -> Floats:
        """How far each load pushes the skin down under it, (T,), m."""
        ...

    def sample(
        self, loads: Sequence[Load], rng: np.random.Generator, temperature: Floats
    ) -> mlx90393.HallSample:
        """One conversion of every chip under each load at its temperature (T,), degC."""
        ...


class MadeSkin:
    """A skin of the reduced model as it came out of the workshop.

    Parameters
    ----------
    design : SkinDesign
        With the coefficients, stiffnesses and magnets that it really has.
    chip_rotation : array_like, shape (S, 3)
        Rotation vectors, rad, in the skin's axes: by them a chip's words must be turned to be
        those of a chip mounted as designed.
    chip_offset : array_like, shape (S, 3)
        T, in each chip's axes: what it adds to any field.
    """

    def __init__(self, design: SkinDesign, *, chip_rotation: object, chip_offset: object) -> None:
        from scipy.spatial.transform import Rotation

        chips = len(design.halls)
        self.design = design
        self.chip_rotation = frozen("chip_rotation", chip_rotation, (chips, 3))  # type: ignore[arg-type]
        self.chip_offset = frozen("chip_offset", chip_offset, (chips, 3))  # type: ignore[arg-type]
        mounts = mlx90393.rotations(design.halls)
        self._to_skin = Rotation.from_rotvec(self.chip_rotation.copy()).as_matrix() @ mounts
        self._twin = ReducedTwin(design, seed=None)

    def field(self, contacts: Sequence[Contact] = ()) -> Floats:
        """At the chips, in their own axes, at reference temperature, shape (S, 3), T."""
        field = self._twin.field(self._twin.motion(contacts))
        return np.asarray(np.einsum("sij,si->sj", self._to_skin, field))

    def depths(self, loads: Sequence[Load]) -> Floats:
        """How far each load pushes its cell's vertex down, (T,), m."""
        distinct, place = _distinct(loads)
        depth = [
            0.0
            if load.cell is None
            else float(self._twin.depths(_touching(self.design, load)).sum())
            for load in distinct
        ]
        return np.array(depth)[place]

    def sample(
        self, loads: Sequence[Load], rng: np.random.Generator, temperature: Floats
    ) -> mlx90393.HallSample:
        """One conversion of every chip under each load at its temperature (T,), degC."""
        distinct, place = _distinct(loads)
        fields = np.array([self.field(_touching(self.design, load)) for load in distinct])
        return self._converted(fields[place], rng, temperature)

    def read(
        self,
        contacts: Sequence[Contact],
        rng: np.random.Generator,
        *,
        time: float = 0.0,
        temperature: float = 25.0,
    ) -> Reading:
        """What the chips read, noise and limits included."""
        sample = self._converted(self.field(contacts)[None], rng, np.array([temperature]))
        return Reading(
            time=time,
            field=mlx90393.tesla(sample.counts[0], self.design.hall_setting),
            temperature=mlx90393.degrees(sample.temperature_counts[0]),
            flags=sample.flags[0],
        )

    def _converted(
        self, fields: Floats, rng: np.random.Generator, temperature: Floats
    ) -> mlx90393.HallSample:
        """Fields at reference temperature, (T, S, 3), as the chips answer."""
        seen = fields * temperature_factor(temperature)[:, None, None] + self.chip_offset
        warmth = np.broadcast_to(temperature[:, None], seen.shape[:2])
        return mlx90393.measure(seen, self.design.hall_setting, temperature=warmth, rng=rng)


class TwinSkin:
    """A whole-sheet twin on the bench; warmth acts on its magnets and chips, not on its rubber.

    Parameters
    ----------
    twin : Twin
        Manufactured, for a skin that differs from its design.
    """

    def __init__(self, twin: "Twin") -> None:
        self._twin = twin

    @property
    def design(self) -> SkinDesign:
        """The twin's."""
        return self._twin.design

    def depths(self, loads: Sequence[Load]) -> Floats:
        """How far each load pushes the patch under it down, (T,), m."""
        distinct, place = _distinct(loads)
        touches = [_touching(self.design, load) for load in distinct]
        return np.array([self._twin.depths(one).sum() for one in touches])[place]

    def sample(
        self, loads: Sequence[Load], rng: np.random.Generator, temperature: Floats
    ) -> mlx90393.HallSample:
        """One conversion of every chip under each load at its temperature (T,), degC."""
        distinct, place = _distinct(loads)
        touches = touches_of([_touching(self.design, load) for load in distinct])
        return self._twin.sample(self._twin.motions(touches)[place], rng, temperature=temperature)


def load_contact(design: SkinDesign, load: Load) -> Contact:
    """The load as a touch on the cell's top vertex.

    Raises
    ------
    ArgumentError
        If the load names no cell of the skin.
    """
    columns, rows = design.cells
    if load.cell is None or not (0 <= load.cell[0] < columns and 0 <= load.cell[1] < rows):
        raise ArgumentError(
            f"load.cell must lie in (0..{columns - 1}, 0..{rows - 1}); got {load.cell}"
        )
    return Contact(position=geometry(design).tops[load.cell], force=load.force)


def made_skin(design: SkinDesign, rng: np.random.Generator) -> MadeSkin:
    """A skin as a workshop might make it from the design.

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
        design.shear_layer, radius=design.shear_layer.radius * float(np.sqrt(rng.uniform(0.9, 1.1)))
    )
    # The sheet's stiffness is linear in the frame's; columns give the rest.
    columns = sheet_stiffness(replace(design, frame=replace(design.frame, stiffness=1e-9)))
    whole = sheet_stiffness(design)
    held = (whole * rng.uniform(0.9, 1.1) - columns) / (whole - columns)
    frame = replace(design.frame, stiffness=design.frame.stiffness * float(held))
    direction = rng.normal(size=(chips, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return MadeSkin(
        replace(
            design,
            coefficients=coefficients,
            magnets=magnets,
            shear_layer=pillars,
            frame=frame,
        ),
        chip_rotation=direction * np.radians(rng.uniform(0.0, 2.0, (chips, 1))),
        chip_offset=rng.uniform(-50e-6, 50e-6, (chips, 3)),
    )


def calibration_loads(design: SkinDesign) -> tuple[Load, ...]:
    """What a person applies in about an hour to calibrate a skin.

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
    loads = [Load(cell=None, force=(0.0, 0.0, 0.0))] * _UNTOUCHED
    for cell in diagonal:
        for force in _STRAIGHT_FORCES:
            loads += [Load(cell=cell, force=(0.0, 0.0, -force))] * _STRAIGHT_REPEATS
        for force in _SLANTED_FORCES:
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                slanted = Load(cell=cell, force=(x * force, y * force, -force))
                loads += [slanted] * _SLANTED_REPEATS
    near = sorted(
        {
            (p + n, q + m)
            for p, q in (magnet.corner for magnet in design.magnets if magnet.mount == "sheet")
            for n in (-1, 0)
            for m in (-1, 0)
            if 0 <= p + n < columns and 0 <= q + m < rows
        }
    )
    for cell in near:
        if cell not in diagonal:
            loads += [Load(cell=cell, force=(0.0, 0.0, -_OTHER_FORCE))] * _OTHER_REPEATS
    return tuple(loads)


def table_loads(design: SkinDesign) -> tuple[Load, ...]:
    """What a person applies in half an hour to have the skin's own answers measured.

    First 20 readings of the untouched skin. Then on every cell a straight press of 0.3 N, the
    same press with a drag of 0.2 N along X and with one along Y; the drag's sign changes from
    cell to cell. On one cell of each layer along the diagonal the opposite drags as well, which
    tell v_f. The reference design takes 114 touches.
    """
    columns, rows = design.cells
    named = len(design.coefficients.folding_correction_x)
    layers = cell_layers(design.cells)
    loads = [Load(cell=None, force=(0.0, 0.0, 0.0))] * _UNTOUCHED
    for n, m in np.ndindex(columns, rows):
        loads.append(Load(cell=(n, m), force=(0.0, 0.0, -_TABLE_PRESS)))
        one = _TABLE_DRAG if (n + m) % 2 else -_TABLE_DRAG
        both_ways = n == m and n < named and layers[n, m] == n
        for drag in (one, -one) if both_ways else (one,):
            loads.append(Load(cell=(n, m), force=(drag, 0.0, -_TABLE_PRESS)))
            loads.append(Load(cell=(n, m), force=(0.0, drag, -_TABLE_PRESS)))
    return tuple(loads)


def measure(
    skin: BenchSkin,
    loads: Sequence[Load],
    rng: np.random.Generator,
    *,
    gauge_noise: float = GAUGE_NOISE,
) -> TouchTable:
    """The table that a bench writes: noisy gauge, noisy stage, noisy chips, slowly warming.

    Parameters
    ----------
    skin : BenchSkin
        `MadeSkin` or `TwinSkin`.
    loads : sequence of Load
    rng : numpy.random.Generator
        Of all noise.
    gauge_noise : float
        Standard deviation of force and depth, relative to their size.
    """
    if not gauge_noise >= 0:
        raise ArgumentError(f"gauge_noise must be >= 0; got {gauge_noise}")
    force = np.array([load.force for load in loads])
    depth = skin.depths(loads)
    force = force * (1 + gauge_noise * rng.normal(size=force.shape))
    depth = depth * (1 + gauge_noise * rng.normal(size=depth.shape))
    warmth = np.linspace(*_WARMING, len(loads))
    sample = skin.sample(loads, rng, warmth)
    field = mlx90393.tesla(sample.counts, skin.design.hall_setting)
    field[(sample.flags & int(ChipFlag.INVALID)) != 0] = np.nan
    return TouchTable(
        cell=[(-1, -1) if load.cell is None else load.cell for load in loads],
        force=np.round(force / _FORCE_STEP) * _FORCE_STEP,
        depth=np.round(depth / _DEPTH_STEP) * _DEPTH_STEP,
        field=field,
        temperature=np.broadcast_to(mlx90393.degrees(sample.temperature_counts), field.shape[:2]),
    )


def _distinct(loads: Sequence[Load]) -> tuple[list[Load], Ints]:
    """Every load once, and where each of them is there."""
    place = {load: k for k, load in enumerate(dict.fromkeys(loads))}
    return list(place), np.array([place[load] for load in loads], dtype=np.int64)


def _touching(design: SkinDesign, load: Load) -> list[Contact]:
    """The load as all that touches the skin."""
    return [] if load.cell is None else [load_contact(design, load)]
