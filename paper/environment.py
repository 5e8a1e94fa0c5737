"""What time and warmth do to the chips' readings, as arrays: Figures S9 and S15.

Decides the courses of load and temperature; how the rubber creeps is
`smoskin.mechanics.viscoelasticity`'s, how magnets weaken `smoskin.magnetics.temperature`'s, and
what a chip makes of a field `smoskin.magnetics.mlx90393`'s.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from paper.models.recovery import recovery_time
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393, sector
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.mechanics.sheet.touches import Touches
from smoskin.mechanics.viscoelasticity import creep, elastomer_prony
from smoskin.origami.geometry import geometry
from smoskin.twin.whole import Twin

FORCE: Final = 1.0
"""N, as printed."""
HELD: Final = 10.0
"""s for which the load rests before it is taken away. Assumed."""
PARTS: Final = (0.1, 0.05, 0.01)
"""Of the loaded signal that may be left."""
BESIDE: Final = (1.0e-3, 0.7e-3)
"""m: how far beside its chip the magnet of Figure S15 sits, so that all three axes read it."""
_POINT: Final = 1e-6
"""m: radius of a touch on one vertex."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recovery:
    """Readings after a load is taken from one cell after the other (Figure S9); K cells."""

    cells: tuple[tuple[int, int], ...]
    """From 1, as the SI counts."""
    times: Floats
    """(T,), s from the release."""
    signal: Floats
    """(K, T, S), T: how far each chip's field is from its rest; chips under the sheet's magnets."""
    settled: Floats
    """(K, 3), s until no more than `PARTS` of all chips' signal is left; 0 if at once."""
    noise: float
    """T: of one reading, standard deviation over the three axes."""

    @property
    def left(self) -> Floats:
        """(K, T): all chips' signal over what it was under load."""
        whole = np.linalg.norm(self.signal, axis=-1)
        return np.asarray(whole / whole.max(axis=1, keepdims=True))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Warmth:
    """A magnet's field as its chip reads it at several temperatures (Figure S15)."""

    temperature: Floats
    """(T,), degC, of the oven."""
    field: Floats
    """(T, 3), T: of the magnet at the chip."""
    read: Floats
    """(T, 3), T: one reading each."""
    chip_temperature: Floats
    """(T,), degC, as the chip says."""
    corrected: Floats
    """(T, 3), T: readings over the magnet's factor at the chip's temperature."""

    @property
    def loss(self) -> Floats:
        """(3,): relative loss of the reading per 10 degC, by the best straight line."""
        slope = np.polynomial.polynomial.polyfit(self.temperature, self.read, 1)[1]
        return np.asarray(-10 * slope / self.field[0])

    @property
    def bend(self) -> float:
        """Largest distance of a reading from its axis's straight line, over the reading."""
        line = np.polynomial.polynomial.polyfit(self.temperature, self.read, 1)
        off = self.read - np.polynomial.polynomial.polyval(self.temperature, line).T
        return float(np.abs(off / self.read).max())

    @property
    def left(self) -> float:
        """Largest relative error of a corrected reading."""
        return float(np.abs(self.corrected / self.field[0] - 1).max())


def recovery(design: SkinDesign) -> Recovery:
    """Press each cell of the diagonal, hold, let go."""
    count = min(design.cells)
    vertices = geometry(design).tops[np.arange(count), np.arange(count)]
    twin = Twin(design, seed=None)
    settled = twin.motions(
        Touches(
            position=vertices[:, None],
            force=np.broadcast_to([0.0, 0.0, -FORCE], (count, 1, 3)),
            radius=_POINT,
        )
    )
    after = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 181)])
    times = np.concatenate([[-HELD, -HELD], np.linspace(-HELD, 0.0, 101)[1:], after])
    load = (times <= 0.0).astype(np.float64)
    load[0], load[len(times) - len(after)] = 0.0, 0.0
    # Magnets hang on the columns, the board on the shear layer.
    course = [
        creep(elastomer_prony(part.material), times, load)
        for part in (design.columns, design.shear_layer)
    ]
    motion = settled[:, None].scaled(*course)
    watched = [design.magnet(site.magnet).mount == "sheet" for site in design.halls]
    field = twin.field(motion)[:, :, watched]
    signal = np.linalg.norm(field - field[:, :1], axis=-1)
    whole = np.linalg.norm(signal, axis=-1).T
    return Recovery(
        cells=tuple((k + 1, k + 1) for k in range(count)),
        times=times,
        signal=signal,
        settled=np.stack([recovery_time(times, whole, 0.0, within=part) for part in PARTS], axis=1),
        noise=float(np.sqrt(np.square(mlx90393.noise(design.hall_setting)).mean())),
    )


def warmth(design: SkinDesign) -> Warmth:
    """Heat one magnet over its chip from 25 to 75 degC."""
    mounts = [design.magnet(site.magnet).mount for site in design.halls]
    chip = mounts.index("sheet")
    site = design.halls[chip]
    magnet = design.magnet(site.magnet)
    temperature = np.linspace(REFERENCE_TEMPERATURE, 75.0, 11)
    at_rest = sector.field(magnet, geometry(design).rest[chip] - [*BESIDE, 0.0])
    turn = mlx90393.rotation(site)
    field = temperature_factor(temperature)[:, None] * (at_rest @ turn)
    sample = mlx90393.measure(
        field,
        design.hall_setting,
        temperature=temperature,
        rng=np.random.default_rng(0),
    )
    read = mlx90393.tesla(sample.counts, design.hall_setting)
    degrees = mlx90393.degrees(sample.temperature_counts)
    return Warmth(
        temperature=temperature,
        field=field,
        read=read,
        chip_temperature=degrees,
        corrected=read / temperature_factor(degrees)[:, None],
    )
