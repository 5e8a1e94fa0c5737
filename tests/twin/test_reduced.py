"""The twin's laws: superposition, symmetry, balance, and what its chips add."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact
from smoskin.twin.reduced import ReducedTwin


def press(x: float, y: float, force: float = 0.5) -> Contact:
    return Contact(position=(x, y), force=(0.0, 0.0, -force))


@given(x=st.floats(0, 0.1199), y=st.floats(0, 0.1599), force=st.floats(0, 1))
def test_a_press_is_shared_without_loss(planar, x, y, force):
    twin = ReducedTwin(planar, seed=None)
    depths = twin.press_depths(touches_of([[press(x, y, force)]]))[0]
    within = (0.01 <= x <= 0.11) and (0.0134 <= y <= 0.146)
    assert np.all(depths >= 0) or not within  # past the outermost vertices the scales are levers
    assert (depths * twin_stiffness(twin)).sum() == pytest.approx(force, abs=1e-12)


def twin_stiffness(twin: ReducedTwin) -> np.ndarray:
    """Newtons a metre of each cell, from presses on the vertices alone."""
    places = geometry(twin.design).tops.reshape(-1, 2)
    depths = twin.press_depths(touches_of([[press(*place, 1.0)] for place in places]))
    return 1 / np.einsum("kk->k", depths.reshape(len(places), -1)).reshape(twin.design.cells)


def test_two_presses_add_up(planar):
    twin = ReducedTwin(planar, seed=None)
    first, second = press(0.03, 0.04), press(0.09, 0.12, 0.8)
    together, apart = (
        twin.motion([first, second]),
        [twin.motion([each]) for each in (first, second)],
    )
    np.testing.assert_allclose(together.magnets, apart[0].magnets + apart[1].magnets, atol=1e-15)


def test_a_drag_moves_board_and_sheet_by_their_stiffnesses(planar):
    drag = Contact(position=(0.06, 0.08), force=(0.3, -0.2, 0.0))
    motion = ReducedTwin(planar, seed=None).motion([drag])
    magnets, board = motion.magnets, motion.board
    np.testing.assert_allclose(board[:2], np.array([0.3, -0.2]) / board_stiffness(planar))
    by_name = dict(zip([m.name for m in planar.magnets], magnets, strict=True))
    np.testing.assert_array_equal(by_name["M1"], 0)
    np.testing.assert_allclose(by_name["M2"][:2], np.array([0.3, -0.2]) / sheet_stiffness(planar))


def test_a_mirrored_press_on_a_mirrored_skin_gives_mirrored_fields(planar):
    """In x; along y the zigzag makes the two rims differ."""
    mirrored = replace(
        planar,
        magnets=tuple(replace(m, corner=(6 - m.corner[0], m.corner[1])) for m in planar.magnets),
    )
    width = geometry(planar).tops[-1, 0, 0] + geometry(planar).tops[0, 0, 0]
    here = ReducedTwin(planar, seed=None).read([press(0.03, 0.05)]).field
    there = ReducedTwin(mirrored, seed=None).read([press(width - 0.03, 0.05)]).field
    turns = mlx90393.rotations(planar.halls)
    here, there = (np.einsum("sij,sj->si", turns, field) for field in (here, there))
    np.testing.assert_allclose(here * [-1, 1, 1], there, rtol=1e-9, atol=1e-12)


def test_the_same_seed_reads_the_same_and_another_does_not(planar):
    readings = [ReducedTwin(planar, seed=seed).read([press(0.05, 0.05)]) for seed in (1, 1, 2)]
    assert readings[0] == readings[1]
    assert readings[0] != readings[2]


def test_chips_add_noise_and_steps_of_their_setting(planar):
    twin, ideal = ReducedTwin(planar, seed=0), ReducedTwin(planar, seed=None).read()
    samples = np.stack([twin.read().field for _ in range(2000)])
    step = mlx90393.sensitivity(planar.hall_setting)
    whole = samples / step
    np.testing.assert_allclose(whole, np.rint(whole), atol=1e-6)
    # The word's lowest bits are cut, not rounded, so that a reading lies about half a step low;
    # with noise of less than a step the rest of the rounding does not average out.
    off = (samples.mean(axis=0) - ideal.field) / step
    assert np.all((off > -0.9) & (off < -0.1))
    expected = np.sqrt(mlx90393.noise(planar.hall_setting) ** 2 + step**2 / 12)
    np.testing.assert_allclose(samples.std(axis=0), np.tile(expected, (3, 1)), rtol=0.3)


def test_heat_weakens_the_magnets_and_is_reported(planar):
    cold, warm = (ReducedTwin(planar, seed=None).read(temperature=t) for t in (25.0, 35.0))
    np.testing.assert_allclose(warm.field, 0.95 * cold.field)
    assert warm.temperature.tolist() == [35.0] * 3


def test_a_press_past_the_range_saturates_the_chip(planar):
    reading = ReducedTwin(planar, seed=0).read([press(0.05, 0.0667, 40.0)])
    assert np.any(reading.flags & ChipFlag.SATURATED) or np.abs(reading.field).max() < 0.063


def test_the_shown_sheet_sinks_under_the_finger(planar):
    twin = ReducedTwin(planar, seed=None)
    place = geometry(planar).tops[2, 3]
    rest, pressed = twin.sheet_vertices(), twin.sheet_vertices([press(*place)])
    sunk = rest[:, 2] - pressed[:, 2]
    deepest = int(np.argmax(sunk))
    np.testing.assert_allclose(rest[deepest, :2], place)
    assert sunk[deepest] == pytest.approx(twin.depths([press(*place)])[0])


def test_the_shown_sheet_fades_along_each_axis_by_its_own_attenuation(planar):
    coefficients = replace(planar.coefficients, attenuation=(0.2, 0.5))
    twin = ReducedTwin(replace(planar, coefficients=coefficients), seed=None)
    place = geometry(planar).tops[2, 3]
    moved = twin.sheet_vertices([press(*place)]) - twin.sheet_vertices()
    moved = moved.reshape(13, 13, 3)
    sunk = -moved[1::2, 1::2, 2] / -moved[5, 7, 2]
    assert sunk[[2, 3, 2, 1, 3], [3, 3, 4, 3, 4]] == pytest.approx([1.0, 0.2, 0.5, 0.2, 0.1])
    assert not moved[:, ::2, 2].any()
    # In the plane a top vertex goes with the middle of the two bottom ones beside it.
    assert np.abs(moved[..., :2]).max() > 1e-5
    between = (moved[:, :-1:2, :2] + moved[:, 2::2, :2]) / 2
    np.testing.assert_allclose(moved[:, 1::2, :2], between, atol=1e-12)


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        (
            press(-0.01, 0.05),
            r"position must lie on the skin, \(0..120.0, 0..160.0\) mm; got \(-10",
        ),
        (press(0.05, 0.2), "position must lie on the skin"),
        (press(0.05, 0.05, -0.1), "force must be finite and press"),
        (press(0.05, 0.05, float("nan")), "force must be finite and press"),
    ],
)
def test_impossible_touches_are_refused(planar, contact, message):
    with pytest.raises(ArgumentError, match=message):
        ReducedTwin(planar).read([contact])
