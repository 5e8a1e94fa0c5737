"""How heavy a skin is, and how far its weight moves it: by hand, from its plates and springs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.mechanics.board import board_of
from smoskin.mechanics.sheet.lattice import column_beam
from smoskin.mechanics.weight import (
    board_load,
    board_mass,
    column_mass,
    frame_mass,
    hung_masses,
    magnet_masses,
    panel_masses,
    sags,
    scale_mass,
)
from smoskin.origami.geometry import geometry


def test_panels_weigh_what_acrylic_of_their_size_does(planar):
    cell = planar.cell
    area = cell.panel_a * cell.panel_b * math.sin(cell.sector_angle)
    masses = panel_masses(planar)
    assert len(masses) == 4 * math.prod(planar.cells)
    np.testing.assert_allclose(masses, 1190.0 * planar.panels.thickness * area, rtol=1e-9)


def test_only_magnets_on_the_sheet_weigh_on_it(planar):
    masses = magnet_masses(planar)
    for magnet, mass in zip(planar.magnets, masses, strict=True):
        volume = math.pi * magnet.radius**2 * magnet.height
        expected = 5500.0 * volume if magnet.mount == "sheet" else 0.0
        assert mass == pytest.approx(expected, rel=1e-12)
    assert 0.0 in masses
    assert max(masses) > 0.0


def test_a_board_weighs_as_glass_fibre_does(planar):
    """With what stands round the sheet: columns, the frame with its clearance, and a margin."""
    columns = geometry(planar).sheet.vertices[geometry(planar).sheet.columns][..., :2]
    out = planar.columns.radius + planar.frame.clearance + 3e-3 + 2e-3
    length, width = np.ptp(columns, axis=(0, 1)) + 2 * out
    assert board_mass(planar) == pytest.approx(1850.0 * length * width * planar.board.thickness)
    thick = replace(planar, board=replace(planar.board, thickness=2 * planar.board.thickness))
    assert board_mass(thick) == pytest.approx(2 * board_mass(planar))


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_all_that_moves_weighs_what_the_bill_says(name):
    pytest.importorskip("shapely")
    from smoskin.fabrication.materials import bill
    from smoskin.fabrication.moulds.assembly import frame
    from smoskin.fabrication.workshop import Workshop

    design = read_design(name)
    listed = {item.part: 1e-3 * item.mass_g for item in bill(design, Workshop())}
    assert listed["top scale"] == pytest.approx(36 * scale_mass(design), rel=2e-3)
    assert listed["support column"] == pytest.approx(91 * column_mass(design))
    if design.limb is None:
        assert listed["circuit board"] == pytest.approx(board_mass(design))
    # A limb's frame is rolled from what it is flat at its upper edge.
    solid = 1240.0 * float(frame(design).solid.volume())
    assert frame_mass(design) == pytest.approx(solid, rel=0.01 if design.limb is None else 0.05)
    hung = hung_masses(design).sum() - panel_masses(design).sum()
    assert hung == pytest.approx(listed["top scale"] + listed["support column"] / 2, rel=1e-3)


def test_a_skin_that_hangs_sags_by_its_weight_over_its_springs(planar):
    sheet = hung_masses(planar).sum() + sum(magnet_masses(planar))
    sagged, columns = sags(planar), geometry(planar).sheet.columns.size
    beam = column_beam(planar)
    for axis, stiffness in enumerate((beam.lateral, beam.lateral, beam.axial)):
        # Rims sag otherwise than the middle, where the magnets are.
        sunk = sagged.magnets[1:, axis, axis] * columns * stiffness
        np.testing.assert_allclose(sunk, 9.81 * sheet, rtol=0.06)
    feet = columns * column_mass(planar) / 2
    whole = 9.81 * (sheet + feet + board_mass(planar) + frame_mass(planar))
    board = board_of(planar)
    for axis in range(3):
        assert sagged.board[axis, axis] * board.stiffness[axis] == pytest.approx(whole)


def test_a_frame_on_the_base_weighs_on_nothing(planar):
    apart = replace(planar, frame=replace(planar.frame, stands_on="base"))
    load = board_load(planar)[2, 2] - board_load(apart)[2, 2]
    assert load == pytest.approx(frame_mass(planar))


def test_a_board_tilts_by_the_height_of_what_it_bears(planar):
    """About y as the skin is pulled along x: the sheet's mass on high columns, its own near by."""
    sagged, board = sags(planar), board_of(planar)
    thick, high = planar.board.thickness, planar.columns.height
    up = high + thick
    heights = geometry(planar).sheet.vertices[:, 2]
    moment = hung_masses(planar) @ (up + heights)
    moment += magnet_masses(planar) @ (up + geometry(planar).magnets[:, 2])
    moment += board_mass(planar) * thick / 2
    moment += geometry(planar).sheet.columns.size * column_mass(planar) / 2 * thick
    moment += frame_mass(planar) * (thick + planar.frame.held_height / 2)
    assert sagged.board[4, 0] * board.stiffness[4] == pytest.approx(9.81 * moment, rel=1e-9)
    assert sagged.board[3, 1] * board.stiffness[3] == pytest.approx(-9.81 * moment, rel=1e-9)
