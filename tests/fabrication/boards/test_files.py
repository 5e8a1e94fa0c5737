"""Files of boards: read by other people's parsers, equal for equal designs."""

import csv
import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sexpdata

from fabrication.boards.designs import CURVED, PLANAR
from fabrication.boards.gerbers import area
from smoskin.errors import FileError
from smoskin.fabrication.boards.circuit import Circuit
from smoskin.fabrication.boards.files import board_files, layouts_of, write
from smoskin.origami.outline import board_box

FILES = {file.path: file.content.decode() for file in board_files(PLANAR)}


def parsed(path: str) -> list[Any]:
    def plain(tree: Any) -> Any:
        if isinstance(tree, list):
            return [plain(branch) for branch in tree]
        return tree.value() if isinstance(tree, sexpdata.Symbol) else tree

    tree: list[Any] = plain(sexpdata.loads(FILES[path]))
    return tree


def under(tree: list[Any], name: str) -> list[list[Any]]:
    return [branch for branch in tree if isinstance(branch, list) and branch[0] == name]


def nets(circuit: Circuit) -> dict[str, str]:
    return {f"{c.reference}.{pin}": net for c, pin, net in circuit.pins()}


@pytest.mark.parametrize("layout", layouts_of(PLANAR), ids=lambda layout: layout.name)
def test_pads_are_on_the_nets_of_the_circuit(layout: Any) -> None:
    board = parsed(f"boards/{layout.name}/{layout.name}.kicad_pcb")
    by_pad = {}
    for footprint in under(board, "footprint"):
        reference = next(t[2] for t in under(footprint, "fp_text") if t[1] == "reference")
        for pad in under(footprint, "pad"):
            for net in under(pad, "net"):
                by_pad[f"{reference}.{pad[1]}"] = net[2]
    assert by_pad == nets(layout.circuit)


@pytest.mark.parametrize("layout", layouts_of(PLANAR), ids=lambda layout: layout.name)
def test_the_schematic_says_the_same_nets(layout: Any) -> None:
    sheet = parsed(f"boards/{layout.name}/{layout.name}.kicad_sch")
    library = {symbol[1]: symbol for symbol in under(under(sheet, "lib_symbols")[0], "symbol")}
    labels = {tuple(label[2][1:3]): label[1] for label in under(sheet, "label")}
    by_pin, flags = {}, set()
    for symbol in under(sheet, "symbol"):
        kind = under(symbol, "lib_id")[0][1]
        x, y = under(symbol, "at")[0][1:3]
        reference = next(p[2] for p in under(symbol, "property") if p[1] == "Reference")
        for body in under(library[kind], "symbol"):
            for pin in under(body, "pin"):
                u, v = under(pin, "at")[0][1:3]
                number = under(pin, "number")[0][1]
                label = labels.get((round(x + u, 6), round(y - v, 6)))
                if reference.startswith("#"):
                    flags.add(label)
                elif label is not None:
                    by_pin[f"{reference}.{number}"] = label
                else:
                    assert pin[1] == "no_connect", (reference, number)
    assert by_pin == nets(layout.circuit)
    assert flags == {"+3V3", "GND"}
    ids = [under(symbol, "uuid")[0][1] for symbol in under(sheet, "symbol")]
    paths = [row[1] for row in under(under(sheet, "symbol_instances")[0], "path")]
    assert sorted(paths) == sorted(f"/{i}" for i in ids)


def test_footprints_are_linked_to_their_symbols() -> None:
    board, sheet = parsed("boards/skin/skin.kicad_pcb"), parsed("boards/skin/skin.kicad_sch")
    rows = under(under(sheet, "symbol_instances")[0], "path")
    symbols = {row[1]: under(row, "reference")[0][1] for row in rows}
    for footprint in under(board, "footprint"):
        reference = next(t[2] for t in under(footprint, "fp_text") if t[1] == "reference")
        if not reference.startswith("H"):
            assert symbols[under(footprint, "path")[0][1]] == reference


def test_headers_are_kicad_6s_and_name_another_generator() -> None:
    board, sheet = parsed("boards/skin/skin.kicad_pcb"), parsed("boards/skin/skin.kicad_sch")
    assert board[:3] == ["kicad_pcb", ["version", 20211014], ["generator", "smoskin"]]
    assert sheet[:3] == ["kicad_sch", ["version", 20211123], ["generator", "smoskin"]]


def test_equal_designs_give_equal_bytes_and_others_other_ids() -> None:
    again = {file.path: file.content.decode() for file in board_files(PLANAR)}
    assert again == FILES
    renamed = replace(PLANAR, name="another name")
    assert {file.path: file.content.decode() for file in board_files(renamed)} == FILES
    other = {file.path: file.content.decode() for file in board_files(CURVED)}
    path = "boards/base/base.kicad_pcb"  # the same board with another design's ids
    assert other[path] != FILES[path]


def test_the_outline_is_the_designs() -> None:
    layout = layouts_of(PLANAR)[0]
    box = board_box(PLANAR)
    x, y = layout.outline.T
    assert (x.max(), y.min(), y.max()) == pytest.approx(
        (1e3 * box.right, 1e3 * box.low, 1e3 * box.high), abs=1e-3
    )
    assert x.min() == pytest.approx(1e3 * box.left - 14.5, abs=1e-3)  # the tab
    body = x[np.abs(y - y.min()) < 1e-3]
    assert body.min() - 2.0 == pytest.approx(1e3 * box.left, abs=1e-3)


def test_the_gerbers_outline_is_the_designs(tmp_path: Path) -> None:
    for layout in layouts_of(PLANAR):
        path = tmp_path / "outline.gbr"
        path.write_text(FILES[f"boards/{layout.name}/gerber/{layout.name}-Edge_Cuts.gbr"])
        left, low, right, high = area(path).bounds
        corners = [*layout.outline.min(axis=0), *layout.outline.max(axis=0)]
        assert [left + 0.025, low + 0.025, right - 0.025, high - 0.025] == pytest.approx(
            corners, abs=1e-3
        )


def test_the_gerbers_are_a_whole_stack(tmp_path: Path) -> None:
    import warnings

    from gerbonara import LayerStack

    for path, text in FILES.items():
        if path.startswith("boards/skin/gerber/"):
            (tmp_path / Path(path).name).write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        stack = LayerStack.open(tmp_path)
    layers = {(side, use) for (side, use), layer in stack.graphic_layers.items() if layer.objects}
    assert ("top", "copper") in layers
    assert ("bottom", "copper") in layers
    assert ("mechanical", "outline") in layers
    holes = len(layouts_of(PLANAR)[0].vias) + len(layouts_of(PLANAR)[0].holes)
    assert sum(len(layer.objects) for layer in stack.drill_layers) == holes


def test_nothing_magnetic_is_bought_for_a_place_beside_a_chip() -> None:
    rows = list(csv.DictReader(io.StringIO(FILES["boards/bill_of_materials.csv"])))
    beside = [row for row in rows if row["value"].startswith("100 nF")]
    assert [row["quantity"] for row in beside] == ["6"]
    assert beside[0]["magnetic"] == "no"
    assert "nickel barrier disturbs" in beside[0]["remark"]
    assert {row["magnetic"] for row in rows if "R1" in row["references"]} == {"nickel barrier"}
    assert next(row for row in rows if "Pico" in row["value"])["board"] == "base"
    assert any("nylon" in row["package"] for row in rows)
    placed = list(csv.DictReader(io.StringIO(FILES["boards/skin/skin-placements.csv"])))
    assert [row["Ref"] for row in placed if row["Side"] == "bottom"] == ["U1", "C1", "C2"]
    assert "J1" not in [row["Ref"] for row in placed]


def test_boards_larger_than_the_house_makes_are_remarked_on() -> None:
    large = replace(PLANAR, cells=(16, 18))
    text = next(file for file in board_files(large) if file.kind == "csv").content.decode()
    assert "larger than the house's 400 x 500 mm" in text
    assert "larger" not in FILES["boards/bill_of_materials.csv"]


def test_files_are_written_once(tmp_path: Path) -> None:
    files = write(PLANAR, tmp_path)
    assert {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()} == {
        file.path for file in files
    }
    assert {file.kind for file in files} == {
        "kicad_pcb",
        "kicad_sch",
        "kicad_pro",
        "gerber",
        "drill",
        "csv",
        "text",
    }
    assert {file.units for file in files} == {"mm"}
    with pytest.raises(FileError, match="exists"):
        write(PLANAR, tmp_path)
    write(PLANAR, tmp_path, force=True)
