"""Files of a skin's boards, as a board house gets them.

Decides which. Each board is checked, electrically and in copper, before its files leave.
"""

from pathlib import Path

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.artifact import Artifact, Kind
from smoskin.fabrication.boards.base import base_layout
from smoskin.fabrication.boards.check import layout_faults
from smoskin.fabrication.boards.circuit import faults
from smoskin.fabrication.boards.gerber import drill_files, gerber_files
from smoskin.fabrication.boards.kicad import (
    SYMBOL_TABLE,
    board_file,
    schematic_file,
    symbol_library,
)
from smoskin.fabrication.boards.layout import Layout
from smoskin.fabrication.boards.lists import bill_of_materials, placements
from smoskin.fabrication.boards.rules import project_file, rule_file
from smoskin.fabrication.boards.tail import tail_layout, tail_of
from smoskin.fabrication.boards.template import skin_layout
from smoskin.outputs import check_output, write_output


def layouts_of(design: SkinDesign) -> tuple[Layout, ...]:
    """Layouts of a design's three boards: ``skin``, ``tail`` and ``base``.

    Raises
    ------
    DesignError
        If a board cannot be made; the message has the measure and the limit.
    """
    skin, tail, base = skin_layout(design), tail_layout(tail_of(design)), base_layout()
    wrong = [*layout_faults(tail), *layout_faults(base)]  # the template has checked the first
    wrong += [fault for layout in (skin, tail, base) for fault in faults(layout.circuit)]
    if wrong:
        raise DesignError(f"the boards of {design.name!r} fail: {wrong[0]}")
    return skin, tail, base


@typed
def board_files(design: SkinDesign) -> tuple[Artifact, ...]:
    """Every file of a design's boards: KiCad projects, Gerbers, drills and lists of parts.

    Raises
    ------
    DesignError
        As `layouts_of`.
    """
    layouts, seed = layouts_of(design), design.content_hash
    texts: list[tuple[str, Kind, str]] = [
        ("boards/bill_of_materials.csv", "csv", bill_of_materials(layouts))
    ]
    for layout in layouts:
        name, folder = layout.name, f"boards/{layout.name}"
        texts += [
            (f"{folder}/{name}.kicad_pcb", "kicad_pcb", board_file(layout, seed)),
            (f"{folder}/{name}.kicad_sch", "kicad_sch", schematic_file(layout.circuit, seed)),
            (f"{folder}/{name}.kicad_pro", "kicad_pro", project_file(layout)),
            (f"{folder}/smoskin.kicad_sym", "text", symbol_library(layout.circuit)),
            (f"{folder}/sym-lib-table", "text", SYMBOL_TABLE),
            (f"{folder}/{name}.kicad_dru", "text", rule_file(layout)),
            (f"{folder}/{name}-placements.csv", "csv", placements(layout)),
        ]
        texts += [
            (f"{folder}/gerber/{file}", "gerber", text)
            for file, text in gerber_files(layout).items()
        ]
        texts += [
            (f"{folder}/gerber/{file}", "drill", text) for file, text in drill_files(layout).items()
        ]
    return tuple(
        Artifact(path=path, kind=kind, units="mm", content=text.encode())
        for path, kind, text in texts
    )


@typed
def write(design: SkinDesign, folder: Path, *, force: bool = False) -> tuple[Artifact, ...]:
    """Write every file of a design's boards into a folder.

    Raises
    ------
    DesignError
        As `layouts_of`.
    FileError
        If files exist already and `force` is not given, or cannot be written.
    """
    files = board_files(design)
    for file in files:
        check_output((folder / file.path).parent, folder=True)
        check_output(folder / file.path, force=force)
    for file in files:
        write_output(folder / file.path, file.content)
    return files
