"""The own check of layouts: seeded faults are found, on every kind of board."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from fabrication.boards.designs import CURVED, PLANAR
from fabrication.boards.seeds import SEEDS
from smoskin.fabrication.boards.check import layout_faults
from smoskin.fabrication.boards.files import layouts_of
from smoskin.fabrication.boards.layout import Layout

PLANAR_SKIN = layouts_of(PLANAR)[0]


@pytest.mark.parametrize("name", SEEDS)
def test_seeded_faults_are_found(name: str) -> None:
    change, complaint, _ = SEEDS[name]
    faults = layout_faults(change(PLANAR_SKIN))
    assert any(complaint in fault for fault in faults), faults


def moved(reference: str, x: float, y: float) -> Callable[[Layout], Layout]:
    return lambda layout: replace(
        layout,
        placed=tuple(
            replace(p, x=x, y=y) if p.component.reference == reference else p for p in layout.placed
        ),
    )


def test_magnetic_parts_near_a_chip_are_found() -> None:
    chip = next(p for p in PLANAR_SKIN.placed if p.component.reference == "U2")
    faults = layout_faults(moved("R1", chip.x + 8.0, chip.y)(PLANAR_SKIN))
    assert any(
        fault.startswith("R1 (nickel barrier) must be 10 mm from U2; got 7.5 mm")
        for fault in faults
    )


def test_a_capacitor_away_from_its_chip_is_found() -> None:
    chip = next(p for p in PLANAR_SKIN.placed if p.component.reference == "U2")
    faults = layout_faults(moved("C3", chip.x, chip.y + 6.0)(PLANAR_SKIN))
    assert any("C3 must stand within 4.5 mm of U2; got 6.0 mm" in fault for fault in faults)


def test_parts_off_the_stiffeners_of_a_flexible_circuit_are_found() -> None:
    skin, tail, _ = layouts_of(CURVED)
    assert skin.flexible
    assert tail.flexible
    bare = replace(skin, stiffeners=skin.stiffeners[1:])
    assert any("of U1 must lie over a stiffener" in fault for fault in layout_faults(bare))


def test_vias_where_the_tail_bends_are_found() -> None:
    from smoskin.fabrication.boards.layout import Via

    _, tail, _ = layouts_of(PLANAR)
    left, low, right, high = tail.bends[0]
    via = Via(net="SDA", x=(left + right) / 2, y=(low + high) / 2 - 0.25)
    faults = layout_faults(replace(tail, vias=(via,)))
    assert any("a via of SDA lies where the circuit bends" in fault for fault in faults)
