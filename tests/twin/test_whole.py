"""The whole twin: touches to readings, as designed and as made."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.mechanics.reduced.stiffness import board_stiffness
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Frictionless, Touches
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact
from smoskin.twin.manufacture import Tolerances
from smoskin.twin.surroundings import Surroundings
from smoskin.twin.whole import Twin


def press(x: float, y: float, force: float = 0.5, drag=(0.0, 0.0)) -> Contact:
    return Contact(position=(x, y), force=(*drag, -force))


@pytest.fixture(scope="module")
def ideal(planar) -> Twin:
    return Twin(planar, seed=None)


# ------------------------------------------------------------- mechanics


def test_untouched_the_skin_is_at_rest(ideal, planar):
    motion = ideal.motion()
    assert motion.magnets.shape == (3, 6)
    assert bool(motion.valid)
    assert not motion.magnets.any()
    assert not motion.board.any()
    assert_allclose(ideal.sheet_vertices(), geometry(planar).sheet.vertices)


def test_motions_of_many_states_are_those_of_each(ideal):
    contacts = [press(0.03, 0.05), press(0.08, 0.12, 0.8)]
    touches = Touches(
        position=[[contact.position] for contact in contacts],
        force=[[contact.force] for contact in contacts],
    )
    many = ideal.motions(touches)
    assert many.magnets.shape == (2, 3, 6)
    assert many.valid.all()
    for row, contact in enumerate(contacts):
        alone = ideal.motion([contact])
        scale = np.abs(many.magnets[row]).max()
        assert_allclose(many.magnets[row], alone.magnets, atol=1e-4 * scale)
        assert_allclose(many.board[row], alone.board, atol=1e-7)


def test_magnets_go_with_the_columns_that_hold_them(ideal, planar):
    touched = [press(0.05, 0.07)]
    moved = ideal.sheet_vertices(touched) - ideal.sheet_vertices()
    magnets = np.einsum("gkvd,vd->gk", holder_matrix(planar), moved)
    assert_allclose(ideal.motion(touched).magnets, magnets, atol=1e-12)


def test_small_touches_add_up(ideal):
    """Held patches are one system, so that two that stick add only where nothing holds them."""
    skin = Twin(ideal.design, seed=None, grip=Frictionless())
    first, second = press(0.03, 0.04, 1e-3), press(0.09, 0.12, 2e-3)
    apart = skin.motion([first]).magnets + skin.motion([second]).magnets
    together = skin.motion([first, second]).magnets
    assert_allclose(together, apart, atol=1e-3 * np.abs(together).max())


def test_the_skin_sinks_under_the_finger(ideal, planar):
    place = geometry(planar).tops[2, 3]
    depth = ideal.depths([press(*place)])
    assert depth.shape == (1,)
    assert 1e-5 < depth[0] < 2e-3
    sunk = ideal.sheet_vertices()[:, 2] - ideal.sheet_vertices([press(*place)])[:, 2]
    tops = geometry(planar).sheet.loaded
    near = sunk[tops[1:4, 2:5]]
    assert sunk.mean() < depth[0] <= near.max()
    assert depth[0] == pytest.approx(0.8 * near[1, 1] + 0.2 * near.mean(), rel=0.1)


def test_a_mirrored_touch_on_a_mirrored_skin_gives_mirrored_fields(planar, ideal):
    """In x; along y the zigzag makes the two rims differ."""
    mirrored = replace(
        planar,
        magnets=tuple(replace(m, corner=(6 - m.corner[0], m.corner[1])) for m in planar.magnets),
    )
    here = ideal.field(ideal.motion([press(0.03, 0.05, drag=(0.1, 0.05))]))
    other = Twin(mirrored, seed=None)
    there = other.field(other.motion([press(0.12 - 0.03, 0.05, drag=(-0.1, 0.05))]))
    assert_allclose(here * [-1, 1, 1], there, rtol=1e-5, atol=1e-9)


def test_a_drag_moves_the_board_by_its_stiffness(ideal, planar):
    dragged = ideal.motion([press(0.06, 0.08, drag=(0.2, -0.1))]).board
    straight = ideal.motion([press(0.06, 0.08)]).board
    assert_allclose(
        (dragged - straight)[:2], np.array([0.2, -0.1]) / board_stiffness(planar), rtol=1e-3
    )


def test_held_touches_are_not_solved_again_and_others_start_from_the_last(planar, monkeypatch):
    starts = []
    press_sheet = BarHinge.press

    def counted(solver, touches, **options):
        starts.append(options["start"])
        return press_sheet(solver, touches, **options)

    monkeypatch.setattr(BarHinge, "press", counted)
    skin = Twin(planar, seed=None)
    first, second = press(0.05, 0.07), press(0.05, 0.071)
    for held in ([], [first], [first], [second], [first], [press(0.05, 0.07)]):
        skin.motion(held)
        skin.sheet_vertices(held)
    assert len(starts) == 2
    still = geometry(planar).sheet.vertices
    assert_array_equal(starts[0], np.zeros((1, *still.shape)))  # the untouched skin came first
    assert_allclose(still + starts[1][0], skin.sheet_vertices([first]), atol=1e-15)


# ------------------------------------------------------------- readings


def test_readings_add_what_the_chips_add(planar, ideal):
    reading, bare = Twin(planar, seed=0).read([press(0.05, 0.07)]), ideal.read([press(0.05, 0.07)])
    counts = reading.field / mlx90393.sensitivity(planar.hall_setting)
    assert_allclose(counts, np.rint(counts), atol=1e-6)
    assert_allclose(reading.field, bare.field, atol=1e-4)
    assert reading.flags.tolist() == [int(ChipFlag.GOOD)] * 3
    assert_allclose(reading.temperature, 25.0, atol=0.05)


def test_the_same_seed_is_the_same_skin_with_the_same_noise(planar):
    first, same, other = (Twin(planar, seed=seed, manufactured=True) for seed in (1, 1, 2))
    touched = [press(0.05, 0.05)]
    readings = [[skin.read(touched) for _ in range(3)] for skin in (first, same, other)]
    assert readings[0] == readings[1]
    assert readings[0] != readings[2]
    # Noise and skin come from streams of their own.
    assert np.abs(first.field(first.motion()) - other.field(other.motion())).max() > 1e-4
    designed = Twin(planar, seed=1)
    assert_array_equal(designed.deviations.columns, 1.0)


def test_a_made_skin_differs_from_the_designed_one(planar, ideal):
    wide = Tolerances(stiffness_variation=0.2)
    made = Twin(planar, seed=4, manufactured=True, tolerances=wide)
    touched = [press(0.05, 0.05)]
    here, there = ideal.motion(touched).magnets[1:, :3], made.motion(touched).magnets[1:, :3]
    assert np.abs(there - here).max() > 0.01 * np.abs(here).max()


def test_a_batch_of_readings_has_the_noise_of_its_generator(ideal):
    touches = Touches(position=np.full((4, 1, 2), 0.06), force=np.tile([0.0, 0.0, -0.3], (4, 1, 1)))
    motion = ideal.motions(touches)
    first, same, other = (ideal.sample(motion, np.random.default_rng(k)).counts for k in (7, 7, 8))
    assert first.shape == (4, 3, 3)
    assert_array_equal(first, same)
    assert (first != other).any()


def test_the_surroundings_are_felt(planar, ideal):
    earth = np.array([20e-6, 0.0, -45e-6])
    there = Twin(planar, seed=None, surroundings=Surroundings(earth=earth))
    assert_allclose(
        there.field(there.motion()) - ideal.field(ideal.motion()), [earth] * 3, atol=1e-15
    )


def test_warm_rubber_yields_less_and_warm_magnets_are_weaker(planar, ideal):
    """By less than the rubber stiffens: film and frame do not."""
    touched = [press(0.05, 0.07)]
    cold, warm = ideal.motion(touched), ideal.motion(touched, temperature=45.0)
    stiffer = float(modulus_factor(planar.columns.material, 45.0))
    ratio = cold.magnets[1, 2] / warm.magnets[1, 2]
    assert 1.02 < ratio < stiffer * 1.001
    reading = ideal.read(temperature=45.0)
    assert_allclose(reading.field, 0.9 * ideal.read().field, atol=1e-12)
    assert reading.temperature.tolist() == [45.0] * 3


@pytest.mark.parametrize("degrees", [80.0, -60.0])
def test_a_temperature_that_no_skin_stands_is_refused(ideal, degrees):
    with pytest.raises(ArgumentError, match=r"temperature must lie in .*75 degC"):
        ideal.motion([press(0.05, 0.05)], temperature=degrees)


# ------------------------------------------------------------- wrong use and lost answers


def test_what_is_no_equilibrium_is_a_bad_measurement(planar):
    """A force that no skin stands: the solver says so, and the chips' numbers say so."""
    skin = Twin(planar, seed=0)
    absurd = [press(0.05, 0.07, 5000.0)]
    assert not skin.motion(absurd).valid
    reading = skin.read(absurd, time=3.0)
    assert reading.time == 3.0
    assert reading.flags.tolist() == [int(ChipFlag.INVALID)] * 3
    # And the next touch is answered as if nothing had been.
    assert skin.read([press(0.05, 0.07)]).flags.tolist() == [int(ChipFlag.GOOD)] * 3


@pytest.mark.parametrize("lost", ["not converged", "pulled"])
def test_neither_a_lost_solution_nor_a_pulled_column_is_a_state(planar, monkeypatch, lost):
    solve = BarHinge.press

    def spoilt(solver, touches, **options):
        pressed = solve(solver, touches, **options)
        bad = {"converged": pressed.converged & False} if lost == "not converged" else {}
        return replace(pressed, **bad or {"pulled": pressed.pulled | True})

    monkeypatch.setattr(BarHinge, "press", spoilt)
    skin = Twin(planar, seed=None)
    assert not skin.motion([press(0.05, 0.07)]).valid
    touches = Touches(position=[[(0.05, 0.07)]], force=[[(0.0, 0.0, -0.5)]])
    assert not skin.motions(touches).valid.any()


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        (press(-0.01, 0.05), r"position must lie on the skin"),
        (press(0.05, 0.2), "position must lie on the skin"),
        (press(0.05, 0.05, -0.1), "force must be finite and press"),
        (press(0.05, 0.05, float("nan")), "force must be finite and press"),
    ],
)
def test_impossible_touches_are_refused(ideal, contact, message):
    for act in (ideal.read, ideal.check):
        with pytest.raises(ArgumentError, match=message):
            act([contact])


def test_a_made_skin_needs_a_seed(planar):
    with pytest.raises(ArgumentError, match="seed must be a whole number"):
        Twin(planar, seed=None, manufactured=True)


def test_two_touches_on_one_place_are_one(ideal):
    half = (0.0, 0.0, -0.25)
    whole = ideal.motion([Contact(position=(0.0, 0.0), force=(0.0, 0.0, -0.5))])
    halves = ideal.motion([Contact(position=(0.0, 0.0), force=half)] * 2)
    assert halves.valid
    assert_allclose(halves.magnets, whole.magnets, atol=1e-9)
