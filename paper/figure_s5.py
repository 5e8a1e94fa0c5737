"""
Figure S5 and Table S1: zones, signs and dividing lines
=======================================================

What a unit press on each cell does to the two magnets of the sheet (S7-S12): the four displacements
printed under S12, the signs of Table S1, and the lines between the cells of each zone.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from matplotlib.axes import Axes

from paper.models.zones import Zone, zones
from paper.shared.rows import Row, compared, stated
from paper.shared.setting import Setting
from paper.shared.style import BLUE, INK, ORANGE, Plate, canvas, lay_out, note, open_axes, styled
from smoskin.design.skin import SkinDesign
from smoskin.sensing.closed_form.location import unit_press

TABLE_S1: Final = ("----", "--+-", "+-+-", "-+--", "--+-", "+++-", "-+-+", "-+++", "++++")
"""Signs of dS2x, dS2y, dS3x, dS3y of Z.1 to Z.9, as printed."""


def location_rows(design: SkinDesign) -> list[Row]:
    """The four displacements of a unit press on cell (1,1), and their ratios."""
    place = "Text S4, under S12"
    (u2x, u2y), (u3x, u3y) = unit_press(design)[0, 0].tolist()
    why = "from S7-S11; its label stands swapped in print (U2), the cell is inferred (U3)"
    rows = [
        compared(f"location.{name.lower()}", place, printed, value, f"{name[0]}_{name[1:]} {why}")
        for name, printed, value in (
            ("U3x", 0.6721, u3x),
            ("U2x", 0.7313, u2x),
            ("U3y", 0.9476, u3y),
            ("U2y", 0.8709, u2y),
        )
    ]
    ratios = (("x", 0.6721 / 0.7313, u3x / u2x), ("y", 0.9476 / 0.8709, u3y / u2y))
    return rows + [
        compared(f"location.ratio_{k}", place, printed, value, f"U_3{k}/U_2{k}, labels as in U2")
        for k, printed, value in ratios
    ]


def zone_rows(result: Sequence[Zone]) -> list[Row]:
    """Table S1, row by row."""
    rows = []
    for zone, printed in zip(result, TABLE_S1, strict=True):
        signs = signs_text(zone)
        why = "cells " + ", ".join(f"({n + 1},{m + 1})" for m in zone.rows for n in zone.columns)
        name, texts = f"table_s1.z{zone.number}", (" ".join(printed), " ".join(signs))
        row = stated(name, "Table S1", *texts, signs == printed, why)
        if printed in TABLE_S1[: zone.number - 1] and row.verdict == "unresolved":
            why = f"{why}: printed like an earlier zone's (E7)"
            row = replace(row, verdict="corrected", why=why)
        rows.append(row)
    different = len({signs_text(zone) for zone in result})
    return [*rows, compared("table_s1.zones", "Text S4", 9, different, "different rows of signs")]


def signs_text(zone: Zone) -> str:
    """Signs of dS2x, dS2y, dS3x, dS3y such as ``"--+-"``, as Table S1 prints them."""
    return "".join("+" if sign > 0 else "-" for sign in zone.signs)


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figures S5a to S5i: ratios of the four cells of each zone, and the lines between them."""
    result = zones(unit_press(setting.design))
    with styled():
        figure = canvas(7.2, 7.4)
        axes = figure.subplots(3, 3)
        for zone in result:
            row, column = divmod(zone.number - 1, 3)
            axis = axes[2 - row][column]
            _draw_zone(axis, zone)
            signs = " ".join(signs_text(zone)).replace("-", "−")
            axis.set_title(f"({'abcdefghi'[3 * (2 - row) + column]}) zone {zone.number}:   {signs}")
        for axis in axes[-1]:
            axis.set_xlabel("$U_{2x}/U_{3x}$ (no unit)")
        for axis in axes[:, 0]:
            axis.set_ylabel("$U_{2y}/U_{3y}$ (no unit)")
        lay_out(figure)
    return Plate(
        name="figure_s5",
        title="Figures S5a to S5i",
        caption="Figures S5a to S5i, computed here: ratios of the two magnets' displacements for a "
        "press on each cell (dots), and the dividing lines halfway between neighbours (S12). "
        "Titles give the signs of dS2x, dS2y, dS3x, dS3y (Table S1, Z.5 corrected). The line "
        "printed as 1.51 in zone 1 comes out at 1.3248 (U1).",
        figure=figure,
        rows=(*location_rows(setting.design), *zone_rows(result)),
    )


def _draw_zone(axis: Axes, zone: Zone) -> None:
    """One zone: four dots, a line each way, and the values of the lines."""
    x, y = zone.lines_x[0], zone.lines_y[0]
    for colour, n, rx in zip((BLUE, ORANGE), zone.columns, zone.ratios_x, strict=True):
        for m, ry in zip(zone.rows, zone.ratios_y, strict=True):
            axis.plot(rx, ry, "o", color=colour, markersize=5)
            note(axis, f"({n + 1},{m + 1})", (rx, ry), (0, 6), ha="center", fontsize=8)
    half_x = max(abs(ratio - x) for ratio in zone.ratios_x)
    half_y = max(abs(ratio - y) for ratio in zone.ratios_y)
    axis.set(xlim=(x - 2 * half_x, x + 2 * half_x), ylim=(y - 2 * half_y, y + 2 * half_y))
    axis.axvline(x, color=INK, linewidth=0.8, linestyle="--")
    axis.axhline(y, color=INK, linewidth=0.8, linestyle="--")
    names = [f"{line:.4f}".replace("-", "−") for line in (x, y)]
    note(axis, names[0], (x, 1), (3, -9), xycoords=("data", "axes fraction"))
    note(axis, names[1], (1, y), (-3, 3), xycoords=("axes fraction", "data"), ha="right")
    open_axes(axis)


if __name__ == "__main__":
    plate(Setting()).show()
