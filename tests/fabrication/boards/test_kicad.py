"""Boards in KiCad 6's own engine: no violation, every seeded one found, equal nets and plots."""

import json
import subprocess
import warnings
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from fabrication.boards.designs import CURVED, MANY, PLANAR, random_design
from fabrication.boards.gerbers import area_apart
from fabrication.boards.seeds import SEEDS
from smoskin.design.skin import Limb, SkinDesign
from smoskin.fabrication.boards.check import layout_faults
from smoskin.fabrication.boards.circuit import skin_circuit
from smoskin.fabrication.boards.files import layouts_of, write
from smoskin.fabrication.boards.kicad import board_file
from smoskin.fabrication.boards.layout import Layout
from smoskin.fabrication.boards.rules import project_file, rule_file
from smoskin.fabrication.boards.template import _Router, _rows, _sides

ENGINE = Path(__file__).with_name("kicad_engine.py")
PYTHON = "/usr/bin/python3"


def has_kicad() -> bool:
    if not Path(PYTHON).exists():
        return False
    return subprocess.run([PYTHON, "-c", "import pcbnew"], capture_output=True).returncode == 0


pytestmark = pytest.mark.skipif(
    not has_kicad(), reason="needs KiCad's pcbnew in the system's Python (apt-get install kicad)"
)


def run(boards: list[Path]) -> list[dict[str, Any]]:
    done = subprocess.run(
        [PYTHON, str(ENGINE), *map(str, boards)], capture_output=True, text=True, timeout=200
    )
    assert done.returncode == 0, done.stderr[-2000:]
    answers: list[dict[str, Any]] = json.loads(done.stdout.splitlines()[-1])
    return answers


def test_the_planar_boards_pass_with_the_houses_rules(tmp_path: Path) -> None:
    files = write(PLANAR, tmp_path)
    boards = [tmp_path / file.path for file in files if file.kind == "kicad_pcb"]
    assert len(boards) == 3
    for board, answer in zip(boards, run(boards), strict=True):
        assert (answer["violations"], answer["unconnected"]) == (0, 0), answer["report"]
        assert (answer["clearance"], answer["hole_to_hole"]) == (0.127, 0.5)  # the file's rules
        project = json.loads(board.with_suffix(".kicad_pro").read_text())
        settings = project["board"]["design_settings"]
        assert settings["drc_exclusions"] == []
        assert set(settings["rule_severities"].values()) == {"error"}
        assert project["text_variables"]["BOARD_HOUSE"].startswith("JLCPCB")


@pytest.mark.slow
def test_curved_and_random_boards_pass(tmp_path: Path, curved: SkinDesign) -> None:
    boards = []
    cone = replace(curved, limb=Limb(skin_radius=0.07, far_radius=0.09))
    for k, design in enumerate((CURVED, cone, MANY, *map(random_design, range(3)))):
        files = write(design, tmp_path / str(k))
        boards += [tmp_path / str(k) / file.path for file in files if file.kind == "kicad_pcb"]
    for answer in run(boards):
        assert (answer["violations"], answer["unconnected"]) == (0, 0), answer["report"]


def put(layouts: list[Layout], folder: Path) -> list[Path]:
    """Boards and their rules, written without the package's own check."""
    boards = []
    for k, layout in enumerate(layouts):
        (folder / str(k)).mkdir()
        boards.append(folder / str(k) / "skin.kicad_pcb")
        boards[-1].write_text(board_file(layout, PLANAR.content_hash))
        boards[-1].with_suffix(".kicad_pro").write_text(project_file(layout))
        boards[-1].with_suffix(".kicad_dru").write_text(rule_file(layout))
    return boards


@pytest.mark.slow
def test_the_own_check_and_kicad_agree_on_every_choice_of_the_template(tmp_path: Path) -> None:
    layouts = [
        _Router(PLANAR, skin_circuit(PLANAR), sides, edge).layout(1.6)
        for sides, edge in product(_sides(sorted(set(_rows(PLANAR)))), (-1, 1))
    ]
    clean = [not layout_faults(layout) for layout in layouts]
    assert 0 < sum(clean) < len(clean)
    answers = run(put(layouts, tmp_path))
    assert [a["violations"] + a["unconnected"] == 0 for a in answers] == clean


@pytest.mark.slow
def test_seeded_faults_are_found(tmp_path: Path) -> None:
    layout = layouts_of(PLANAR)[0]
    boards = put([change(layout) for change, _, _ in SEEDS.values()], tmp_path)
    for (name, (_, _, kinds)), answer in zip(SEEDS.items(), run(boards), strict=True):
        assert answer["violations"] + answer["unconnected"] > 0, name
        assert set(kinds) & set(answer["kinds"]), (name, answer["kinds"])
        assert answer["severities"] in ([], ["error"]), name


@pytest.mark.slow
@pytest.mark.parametrize("design", [PLANAR, CURVED], ids=["planar", "curved"])
def test_nets_places_and_plots_are_kicads(design: Any, tmp_path: Path) -> None:
    files = write(design, tmp_path)
    boards = [tmp_path / file.path for file in files if file.kind == "kicad_pcb"]
    for board, layout, answer in zip(boards, layouts_of(design), run(boards), strict=True):
        ours = {f"{c.reference}.{pin}": net for c, pin, net in layout.circuit.pins()}
        theirs = {pad: net for pad, net in answer["nets"].items() if net}
        assert theirs == ours
        for placed in layout.placed:
            x, y, angle, side = answer["places"][placed.component.reference]
            assert (x, y) == pytest.approx((placed.x, placed.y), abs=1e-4)
            assert (angle - 90 * placed.turn) % 360 == 0
            assert side == {"F": "top", "B": "bottom"}[placed.face]
        mine = sorted((board.parent / "gerber").glob("*.gbr"))
        assert len(mine) == 9
        for file in mine:
            apart, whole = area_apart(file, board.parent / "plots" / file.name)
            # KiCad rounds the corners of mask openings by their margin of 0.05 mm.
            assert apart <= 4e-3 * whole + 1e-3, (file.name, apart, whole)
        for file in (board.parent / "gerber").glob("*.drl"):
            assert holes(file) == holes(board.parent / "plots" / file.name)


def holes(path: Path) -> list[tuple[float, float, float]]:
    from gerbonara import ExcellonFile

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # gerbonara wonders at KiCad's G90 too
        drill_file = ExcellonFile.open(path)
    return sorted(
        (round(o.x, 2), round(o.y, 2), round(o.aperture.diameter, 2)) for o in drill_file.objects
    )
