"""
Figure S15: a magnet that warms up
==================================

The field of a magnet of the skin as its chip reads it from 25 to 75 degC, and what is left once
each reading is corrected by the temperature that the chip itself reads.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from paper.shared.rows import Row, stated
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    Look,
    Plate,
    canvas,
    lay_out,
    open_axes,
    styled,
)
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393, sector
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.origami.geometry import geometry

BESIDE: Final = (1.0e-3, 0.7e-3)
"""m: how far beside its chip the magnet sits, so that all three axes read it."""
_AXES: Final = (("x", BLUE, "o"), ("y", ORANGE, "s"), ("z", GREEN, "D"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Warmth:
    """A magnet's field as its chip reads it at several temperatures (Figure S15)."""

    temperature: Floats
    """(T,), degC: the oven's."""
    field: Floats
    """(T, 3), T: the magnet's at the chip."""
    read: Floats
    """(T, 3), T: one reading each."""
    chip_temperature: Floats
    """(T,), degC: as the chip reads it."""
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


def warmth(design: SkinDesign) -> Warmth:
    """Heat one magnet over its chip from 25 to 75 degC."""
    mounts = [design.magnet(site.magnet).mount for site in design.halls]
    chip = mounts.index("sheet")
    site = design.halls[chip]
    magnet = design.magnet(site.magnet)
    temperature = np.linspace(REFERENCE_TEMPERATURE, 75.0, 11)
    at_rest = sector.field(magnet, geometry(design).rest[chip] - [*BESIDE, 0.0])
    rotation = mlx90393.rotation(site)
    field = temperature_factor(temperature)[:, None] * (at_rest @ rotation)
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


# %%
# Printed beside computed


def warmth_rows(result: Warmth) -> list[Row]:
    """What Text S11 says of the figure."""
    place = "Text S11, Figure S15"
    losses = ", ".join(f"{100 * loss:.2f}" for loss in result.loss)
    return [
        stated(
            "figure_s15.loss",
            place,
            "the field falls in all three directions, almost linearly, by about 5 % per 10 degC",
            f"{losses} % in x, y, z; readings off their line by up to {100 * result.bend:.2f} %",
            bool((abs(result.loss - 0.05) < 1e-3).all()) and result.bend < 1e-2,
            "readings of a noisy chip from 25 to 75 degC; the model takes the 5 % in",
        ),
        stated(
            "figure_s15.corrected",
            place,
            "the MLX90393 tells the temperature, with which the signal can be corrected",
            f"right to {100 * result.left:.2f} % of the field up to 75 degC",
            result.left < 1e-2,
            "each reading over the magnet's factor at the temperature that the chip reads; the "
            "factor is the same that weakened the magnet",
        ),
    ]


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figure S15b: a magnet's field over temperature, its losses, and the chip's correction."""
    return draw(warmth(setting.design))


def draw(result: Warmth) -> Plate:
    """Fields, losses and what the correction leaves."""
    with styled():
        figure = canvas(7.2, 2.9)
        fields, losses, rest = figure.subplots(1, 3)
        start, degrees = result.field[0], result.temperature
        for k, (name, colour, marker) in enumerate(_AXES):
            marks: Look = {"marker": marker, "linestyle": "none", "color": colour, "markersize": 3}
            share = result.read[:, k] / start[k]
            left = result.corrected[:, k] / start[k] - 1
            loss = f"$B_{name}$: {100 * result.loss[k]:.2f} % per 10 °C"
            fields.plot(degrees, np.abs(result.field[:, k]) * 1e3, color=colour, linewidth=0.8)
            fields.plot(degrees, np.abs(result.read[:, k]) * 1e3, label=f"$|B_{name}|$", **marks)
            losses.plot(degrees, 100 * (share - 1), label=loss, **marks)
            rest.plot(degrees, 100 * left, label=f"$B_{name}$", **marks)
        printed: Look = {"color": INK, "linewidth": 0.6, "linestyle": "--"}
        span = degrees[[0, -1]]
        losses.plot(span, -0.5 * (span - span[0]), label="printed: 5 % per 10 °C", **printed)
        reach = 400 * result.left
        fields.set(title="(a) field", ylabel="field at the chip (mT)", ylim=(0, None))
        losses.set(title="(b) change", ylabel="change from 25 °C (%)")
        rest.set(title="(c) corrected by the chip's °C", ylabel="error of the field (%)")
        rest.set_ylim(-reach, reach)
        for axis in (fields, losses, rest):
            axis.set_xlabel("temperature (°C)")
            axis.legend(handlelength=1.4)
            open_axes(axis)
        lay_out(figure)
    return Plate(
        name="figure_s15",
        title="Figure S15b",
        caption="Figure S15b, by the model: the field of a magnet of the skin, 1.0 and 0.7 mm "
        "beside its chip, from 25 to 75 °C; lines the model, marks one noisy reading each. The "
        "model takes the printed loss of about 5 % per 10 °C in, alike for all three components; "
        "the paper's own fields are not in its text. (c) divides each reading by the magnet's "
        "factor at the temperature that the chip itself reads.",
        figure=figure,
        rows=tuple(warmth_rows(result)),
    )


if __name__ == "__main__":
    plate(Setting()).show()
