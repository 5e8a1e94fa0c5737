"""Faults seeded into a layout, what the own check says of each, and KiCad's kinds of violation."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from smoskin.fabrication.boards.layout import Layout, Track, Via


def _track(layout: Layout, **fields: Any) -> int:
    return next(
        k
        for k, track in enumerate(layout.tracks)
        if all(getattr(track, name) == value for name, value in fields.items())
        and np.hypot(*np.subtract(track.start, track.end)) > 20.0
    )


def _with_track(layout: Layout, k: int, *new: Track) -> Layout:
    return replace(layout, tracks=(*layout.tracks[:k], *new, *layout.tracks[k + 1 :]))


def cut_line(layout: Layout) -> Layout:
    return _with_track(layout, _track(layout, net="SDA", face="F"))


def missing_via(layout: Layout) -> Layout:
    return replace(layout, vias=layout.vias[1:])


def line_across(layout: Layout) -> Layout:
    line = layout.tracks[_track(layout, net="SCL", face="F")]
    x, y = (float(c) for c in np.mean([line.start, line.end], axis=0))
    short = replace(
        line, start=(x, y), end=(x, y - 1.0) if line.start[1] == line.end[1] else (x - 1.0, y)
    )
    return replace(layout, tracks=(*layout.tracks, short))


def lines_too_close(layout: Layout) -> Layout:
    k = _track(layout, net="SCL", face="B")
    line = layout.tracks[k]
    near = [(x, y + 0.42) for x, y in (line.start, line.end)]
    extra = replace(line, start=near[0], end=near[1])
    link = replace(line, start=line.start, end=near[0])
    return _with_track(layout, k, line, extra, link)


def thin_line(layout: Layout) -> Layout:
    k = _track(layout, net="TRIG", face="B")
    return _with_track(layout, k, replace(layout.tracks[k], width=0.1))


def _moved(layout: Layout, reference: str, x: float, y: float) -> Layout:
    return replace(
        layout,
        placed=tuple(
            replace(p, x=x, y=y) if p.component.reference == reference else p for p in layout.placed
        ),
    )


def part_on_a_foot(layout: Layout) -> Layout:
    foot = next(k for k in layout.keep_outs if k.face == "F")
    return _moved(layout, "C3", foot.x, foot.y)


def part_off_the_board(layout: Layout) -> Layout:
    return _moved(layout, "R1", float(layout.outline[:, 0].min()) - 5.0, 20.0)


def chip_moved(layout: Layout) -> Layout:
    chip = next(p for p in layout.placed if p.component.reference == "U3")
    return _moved(layout, "U3", chip.x + 0.4, chip.y)


def hole_in_a_line(layout: Layout) -> Layout:
    line = layout.tracks[_track(layout, net="GND", face="F")]
    x, y = np.mean([line.start, line.end], axis=0)
    return replace(layout, holes=(*layout.holes, (float(x), float(y), 2.2)))


def holes_too_close(layout: Layout) -> Layout:
    via = layout.vias[0]
    return replace(layout, vias=(*layout.vias, Via(net=via.net, x=via.x + 0.55, y=via.y)))


def board_too_small(layout: Layout) -> Layout:
    outline = layout.outline.copy()
    left = float(outline[:, 0].min())
    outline[outline[:, 0] < left + 3.0, 0] += 2.0
    return replace(layout, outline=outline)


def swapped_pins(layout: Layout) -> Layout:
    def swap(placed: Any) -> Any:
        component = placed.component
        if component.reference != "U2":
            return placed
        nets = dict(component.nets) | {"3": component.nets["5"], "5": component.nets["3"]}
        return replace(placed, component=replace(component, nets=nets))

    return replace(layout, placed=tuple(map(swap, layout.placed)))


SEEDS: dict[str, tuple[Callable[[Layout], Layout], str, tuple[str, ...]]] = {
    "cut line": (cut_line, "SDA must be in one piece", ("unconnected_items",)),
    "missing via": (missing_via, "must be in one piece", ("unconnected_items", "track_dangling")),
    "line across": (line_across, "must be 0.127 mm from", ("tracks_crossing", "clearance")),
    "lines too close": (lines_too_close, "must be 0.127 mm from", ("clearance",)),
    "thin line": (thin_line, "must be 0.127 mm wide; got 0.100", ("track_width",)),
    "part on a foot": (part_on_a_foot, "clear of a column's foot", ("items_not_allowed",)),
    "part off the board": (part_off_the_board, "off the board", ("unconnected_items",)),
    "chip moved": (chip_moved, "must be 0.127 mm from", ("shorting_items", "clearance")),
    "hole in a line": (hole_in_a_line, "from the screw's hole", ("hole_clearance",)),
    "holes too close": (holes_too_close, "must be 0.5 mm from the hole of", ("hole_near_hole",)),
    "board too small": (board_too_small, "inside the board's edge", ("copper_edge_clearance",)),
    "swapped pins": (swapped_pins, "must be 0.127 mm from", ("clearance",)),
}
"""Change, words of the own check's sentence, and kinds of which KiCad names at least one."""
