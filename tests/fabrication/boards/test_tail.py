"""The slack tail: its stiffness against closed forms, and its limits."""

from dataclasses import replace

import numpy as np
import pytest

from fabrication.boards.designs import CURVED, PLANAR
from smoskin.errors import DesignError
from smoskin.fabrication.boards import tail as module
from smoskin.fabrication.boards.rules import BEND_RATIO
from smoskin.fabrication.boards.tail import (
    SHARE,
    THICKNESS,
    section,
    strip_stiffness,
    tail_layout,
    tail_of,
    tail_stiffness,
)
from smoskin.mechanics.board import board_of

EI = 1e-6


def test_a_straight_strip_bends_as_a_guided_beam() -> None:
    stiffness = strip_stiffness([(0, 20e-3, "straight")], (EI, 40 * EI, EI))
    assert stiffness[2, 2] == pytest.approx(12 * EI / 20e-3**3, rel=1e-4)
    assert stiffness[1, 1] == pytest.approx(12 * 40 * EI / 20e-3**3, rel=1e-4)


def test_a_half_circle_is_as_stiff_along_its_chord_as_castigliano_says() -> None:
    # Both ends held from turning: u = F R^3 / EI (pi/2 - 4/pi).
    radius = 5e-3
    stiffness = strip_stiffness([(180, radius, "face")], (EI, 1e6 * EI, EI))
    assert stiffness[2, 2] == pytest.approx(EI / radius**3 / (np.pi / 2 - 4 / np.pi), rel=2e-3)


def test_a_quarter_in_the_plane_bends_over_its_edge() -> None:
    # A quarter circle, clamped and guided, loaded in its plane: 2 x 2 flexibility by hand.
    radius, edge = 8e-3, 3e-6
    stiffness = strip_stiffness([(90, radius, "plane")], (1.0, edge, 1.0))[:2, :2]
    angle = (np.arange(20000) + 0.5) * np.pi / 2 / 20000
    x, y = -radius * np.sin(angle), -radius * (1 - np.cos(angle))
    rows = np.stack([y, -x, np.ones_like(x)])  # moment about z of a pull along x, y and of a turn
    flexibility = rows @ rows.T * radius * np.pi / 2 / 20000 / edge
    assert stiffness == pytest.approx(np.linalg.inv(flexibility)[:2, :2], rel=2e-3)


def test_the_section_is_film_and_copper_about_their_common_axis() -> None:
    film = 2.5e9 * 3.7e-3 * 0.11e-3**3 / 12
    face, edge, _ = section()
    assert film < face < film + 117e9 * 6 * 0.2e-3 * 12e-6 * (33.5e-6) ** 2 * 1.05
    assert edge > 100 * face


def test_the_tail_is_soft_both_ways_and_softer_with_wider_humps() -> None:
    tight, wide = tail_stiffness(4e-3), tail_stiffness(8e-3)
    assert tight[0, 0] == pytest.approx(tight[1, 1], rel=0.05)  # two equal legs at a right angle
    assert np.linalg.eigvalsh(wide)[-1] < np.linalg.eigvalsh(tight)[-1] / 4


@pytest.mark.parametrize("design", [PLANAR, CURVED])
def test_the_tail_holds_the_board_with_at_most_a_twentieth(design: object) -> None:
    tail = tail_of(design)  # type: ignore[arg-type]
    layer = board_of(design).stiffness[0]  # type: ignore[arg-type]
    assert tail.share == pytest.approx(tail.stiffness / layer)
    assert tail.share <= SHARE == 0.05
    assert tail.radius >= BEND_RATIO * THICKNESS


def test_a_layer_too_soft_for_any_tail_is_refused() -> None:
    layer = replace(PLANAR.shear_layer, pillars=1, radius=0.3e-3, height=10e-3)
    with pytest.raises(DesignError, match=r"at most 5% of the shear layer's .* N/m; got .* N/m"):
        tail_of(replace(PLANAR, shear_layer=layer))


def test_its_lines_run_along_the_legs_where_they_bend() -> None:
    layout = tail_layout(tail_of(PLANAR))
    for left, low, right, high in layout.bends:
        assert max(right - left, high - low) >= 2 * np.pi * 4.0 - 1e-6
        for track in layout.tracks:
            (x, y), (u, v) = track.start, track.end
            over = min(x, u) < right and max(x, u) > left and min(y, v) < high and max(y, v) > low
            assert not over or x == u or y == v
    assert {t.face for t in layout.tracks if t.net != "GND"} == {"B"}
    assert module.SHARE == 0.05
