"""The routing template: chips lie as the design says, and what cannot be made is refused."""

from dataclasses import replace

import numpy as np
import pytest

from fabrication.boards.designs import CURVED, LOWER, PLANAR, UPPER, arranged, random_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.boards.check import layout_faults
from smoskin.fabrication.boards.files import layouts_of
from smoskin.fabrication.boards.parts import MLX90393
from smoskin.fabrication.boards.template import skin_layout
from smoskin.origami.geometry import geometry

AXES = {"+x": (1, 0), "-x": (-1, 0), "+y": (0, 1), "-y": (0, -1)}


@pytest.mark.parametrize("turn", range(4))
def test_chips_lie_where_and_as_the_design_says(turn: int) -> None:
    design = arranged([(4, 4), (4, 2), (2, 4), (1, 1)], [turn, turn, (turn + 1) % 4, 0])
    layout = skin_layout(design)
    chips = {p.component.reference: p for p in layout.placed if p.component.part is MLX90393}
    for k, site in enumerate(design.halls):
        chip = chips[f"U{k + 1}"]
        at = geometry(design).chips[k] * 1e3
        assert (chip.x, chip.y) == pytest.approx(tuple(at[:2]), abs=1e-3)
        assert chip.face == ("B" if k == 0 else "F")
        pads = {pad.number: np.array([pad.x, pad.y]) for pad in chip.on_board(MLX90393.pads)}
        # With pin 1 at the upper left the chip senses x to the right and y up: from pins 1-4 to
        # 9-12, and from pins 5-8 to 13-16.
        along_x = pads["11"] - pads["2"]
        along_y = pads["14"] - pads["7"]
        assert along_x / np.linalg.norm(along_x) == pytest.approx(AXES[site.axes[0]], abs=1e-9)
        assert along_y / np.linalg.norm(along_y) == pytest.approx(AXES[site.axes[1]], abs=1e-9)
        assert chip.component.address == site.address


def test_a_limbs_circuit_is_laid_out_as_its_shell_is_long(curved: SkinDesign) -> None:
    """Arcs on the shell are shorter than on the skin, by the ratio of the radii."""
    layout = skin_layout(curved)
    assert layout.flexible
    assert not layout_faults(layout)
    radius = curved.columns.height + layout.thickness * 1e-3 / 2
    share = 1 - radius * curved.curvature
    middle = geometry(curved).roll.middle
    chips = [p for p in layout.placed if p.component.part is MLX90393]
    places = geometry(curved).roll.developed(geometry(curved).chips)
    for chip, place in zip(chips, places, strict=True):
        assert chip.x == pytest.approx(1e3 * place[0], abs=1e-3)
        assert chip.y == pytest.approx(1e3 * (middle + share * (place[1] - middle)), abs=1e-3)
    feet = np.array([(k.x, k.y) for k in layout.keep_outs if k.what == "a column's foot"])
    assert np.ptp(feet[:, 1]) == pytest.approx(
        1e3 * share * np.ptp(geometry(curved).developed[geometry(curved).sheet.columns][..., 1]),
        abs=1e-3,
    )


def test_a_cones_circuit_is_a_sector_with_parallel_chips(small_cone: SkinDesign) -> None:
    """Chips and feet lie on it as its film is rolled, a row's lines along its generator."""
    layout, roll = skin_layout(small_cone), geometry(small_cone).roll
    level = -small_cone.columns.height - layout.thickness * 1e-3 / 2
    chips = [p for p in layout.placed if p.component.part is MLX90393]
    developed = roll.developed(geometry(small_cone).chips)
    flat = 1e3 * roll.flat(developed[:, :2], level)
    assert [(chip.x, chip.y) for chip in chips] == [pytest.approx(at, abs=1e-3) for at in flat]
    assert len({chip.turn for chip in chips if chip.face == "F"}) == 1
    feet = np.array([(k.x, k.y) for k in layout.keep_outs if k.what == "a column's foot"])
    skin = geometry(small_cone)
    assert feet == pytest.approx(
        1e3 * roll.flat(skin.developed[skin.sheet.columns.ravel(), :2], level), abs=1e-3
    )
    long = [
        np.subtract(t.end, t.start)
        for t in layout.tracks
        if t.net == "SDA" and abs(t.end[0] - t.start[0]) > 10.0
    ]
    slopes = {round(float(y / x), 6) for x, y in long}
    rows = {round(float(np.tan(turn)), 6) for turn in roll.flat_turn(developed[:, 1])}
    assert slopes - {0.0} == rows


def test_axes_of_this_test_cover_every_turn() -> None:
    assert len({axes[0] for axes in UPPER}) == len({axes[0] for axes in LOWER}) == 4


@pytest.mark.parametrize("seed", [pytest.param(s, marks=pytest.mark.slow) for s in range(20)])
def test_random_arrangements_are_routed(seed: int) -> None:
    for layout in layouts_of(random_design(100 + seed)):
        assert layout_faults(layout) == ()


def with_columns(radius: float) -> SkinDesign:
    return replace(PLANAR, columns=replace(PLANAR.columns, radius=radius))


def test_lands_on_columns_feet_are_refused() -> None:
    with pytest.raises(
        DesignError, match=r"must be 0\.2 mm clear of a column's foot at .* mm; got -?0\.\d+ mm"
    ):
        skin_layout(with_columns(5.5e-3))
    with pytest.raises(DesignError, match=r"pad 1 of U3 must be 0\.2 mm clear of a column's foot"):
        skin_layout(with_columns(8e-3))


def test_chips_too_near_each_other_are_refused() -> None:
    with pytest.raises(
        DesignError, match=r"chips 'S1' and 'S2' must stand 10\.7 mm apart .*; got 0 mm"
    ):
        skin_layout(arranged([(4, 4), (4, 4), (2, 4)], [0, 0, 0]))


def test_chips_off_the_board_are_refused() -> None:
    layout = skin_layout(PLANAR)
    placed = tuple(
        replace(p, x=140.0) if p.component.reference == "U2" else p for p in layout.placed
    )
    faults = layout_faults(replace(layout, placed=placed))
    assert "pad 1 of U2 must lie 0.3 mm inside the board's edge; got" in faults[0]
    assert "off the board" in faults[0]


def test_a_chip_that_cannot_lie_flat_is_refused() -> None:
    first = replace(PLANAR.halls[0], axes=("+x", "+y", "+z"))
    with pytest.raises(DesignError, match=r"'S1'\.axes must have -z last"):
        skin_layout(replace(PLANAR, halls=(first, *PLANAR.halls[1:])))
    second = replace(PLANAR.halls[1], axes=("+y", "+z", "+x"))
    with pytest.raises(DesignError, match=r"'S2'\.axes must have \+z last"):
        skin_layout(replace(PLANAR, halls=(PLANAR.halls[0], second, PLANAR.halls[2])))


def test_a_board_between_rigid_and_flexible_is_refused() -> None:
    board = replace(PLANAR.board, thickness=0.5e-3)
    with pytest.raises(DesignError, match=r"at most 0\.3 mm.*at least 0\.8 mm.*got 0\.5 mm"):
        skin_layout(replace(PLANAR, board=board))


def test_the_flexible_circuit_is_stiff_under_its_solder() -> None:
    skin = layouts_of(CURVED)[0]
    assert skin.flexible
    assert len(skin.stiffeners) == 5  # four chips and the tab
    assert [s.face for s in skin.stiffeners] == ["F", "B", "B", "B", "B"]


def test_magnets_in_place_of_columns_leave_no_foot() -> None:
    magnets = tuple(
        replace(m, driver="vertex") if m.mount == "sheet" else m for m in PLANAR.magnets
    )
    layout = skin_layout(replace(PLANAR, magnets=magnets))
    feet = [area for area in layout.keep_outs if area.face == "F"]
    assert len(feet) == len([a for a in skin_layout(PLANAR).keep_outs if a.face == "F"]) - 2
