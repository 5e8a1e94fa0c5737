"""How heavy a skin is, and how far its weight moves it: by hand, from its plates and springs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.mechanics.board import board_of
from smoskin.mechanics.sheet.lattice import column_beam
from smoskin.mechanics.weight import board_mass, magnet_masses, panel_masses, sags
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


def test_the_board_weighs_what_the_bill_says(planar):
    pytest.importorskip("shapely")
    from smoskin.fabrication.materials import bill
    from smoskin.fabrication.workshop import Workshop

    listed = next(item for item in bill(planar, Workshop()) if item.part == "circuit board")
    assert listed.mass_g == pytest.approx(1e3 * board_mass(planar))


def test_a_skin_that_hangs_sags_by_its_weight_over_its_springs(planar):
    sheet = panel_masses(planar).sum() + sum(magnet_masses(planar))
    sagged, columns = sags(planar), geometry(planar).sheet.columns.size
    beam = column_beam(planar)
    for axis, stiffness in enumerate((beam.lateral, beam.lateral, beam.axial)):
        assert sagged.sheet[axis] * columns * stiffness == pytest.approx(9.81 * sheet)
    whole = 9.81 * (sheet + board_mass(planar))
    board = board_of(planar)
    for axis in range(3):
        assert sagged.board[axis, axis] * board.stiffness[axis] == pytest.approx(whole)


def test_a_board_tilts_by_the_height_of_what_it_bears(planar):
    """About y as the skin is pulled along x: the sheet's mass on high columns, its own near by."""
    sagged, board = sags(planar), board_of(planar)
    magnets = sum(magnet_masses(planar))
    up = planar.columns.height + planar.board.thickness
    sheet = geometry(planar).sheet
    middle = sheet.vertices[sheet.facets].mean(axis=(0, 1))[2]
    moment = panel_masses(planar).sum() * (up + middle) + magnets * up
    moment += board_mass(planar) * planar.board.thickness / 2
    assert sagged.board[4, 0] * board.stiffness[4] == pytest.approx(9.81 * moment, rel=1e-9)
    assert sagged.board[3, 1] * board.stiffness[3] == pytest.approx(-9.81 * moment, rel=1e-9)
