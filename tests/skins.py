"""Skins made of the reference design's parts, for tests of other sizes and placements."""

from dataclasses import replace


def with_magnets(design, corners, cells=None):
    """The design with magnets of the sheet at these corners, each over its chip."""
    base, sheet = design.magnets[:2]
    board, upper = design.halls[:2]
    magnets = [replace(sheet, name=f"M{g + 2}", corner=c) for g, c in enumerate(corners)]
    halls = [
        replace(upper, name=f"S{g + 2}", magnet=f"M{g + 2}", address=0x20 + g)
        for g in range(len(corners))
    ]
    return replace(
        design,
        cells=cells or design.cells,
        magnets=(replace(base, corner=(0, 0)), *magnets),
        halls=(board, *halls),
    )
