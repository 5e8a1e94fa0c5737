"""Films that would lie flatter than the fold, and frames on either body: rest, presses, slopes."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Sticking, Touches
from textbook_sheet import inner_force, outer_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet.model import STIFFNESSES, BarHinge


def opened(small, *, stands_on="board", clearance=0.1e-3):
    """The small skin with film that keeps half its fold, in a close frame."""
    creases = replace(small.creases, set_fraction=0.5)
    frame = replace(small.frame, clearance=clearance, stands_on=stands_on)
    return replace(small, creases=creases, frame=frame)


@pytest.fixture(scope="module")
def flat(small):
    return BarHinge(opened(small))


def test_film_that_lies_flat_opens_the_sheet_on_to_the_frame(flat, small):
    rest = flat.rest
    assert (rest.outward > 0).all()
    assert (rest.stop_force > 0).any()
    lattice = flat.lattice
    unbalanced = inner_force(lattice, rest.displacements)
    assert np.abs(unbalanced).max() < 1e-9
    # The harder the film is set, the less the rim stands out.
    outward = []
    for share in (0.5, 0.8, 0.9, 1.0):
        free = opened(small, clearance=5e-3)
        made = replace(free, creases=replace(free.creases, set_fraction=share))
        outward.append(BarHinge(made).rest.outward.max())
    assert (np.diff(outward) < 0).all()
    assert outward[-1] == 0.0


def test_presses_are_measured_from_rest_and_balance(flat, cases):
    pressed = flat.press(cases, tolerance=1e-8)
    assert pressed.converged.all()
    for row in range(3):
        motion = flat.rest.displacements + pressed.displacements[row]
        loads = outer_force(flat, cases, pressed, row)
        unbalanced = inner_force(flat.lattice, motion) - loads
        assert np.linalg.norm(unbalanced) <= 3e-8 * np.linalg.norm(loads)
    nothing = flat.press(Touches(position=np.zeros((1, 1, 2)), force=np.zeros((1, 1, 3))))
    assert not nothing.displacements.any()


@pytest.mark.parametrize("grip", [Sticking(), Covered()])
def test_touches_hold_the_opened_sheet_where_it_rests(small, grip):
    """Small presses move it in proportion: nothing pulls it back to its fold."""
    model = BarHinge(opened(small), grip=grip)
    force = np.zeros((2, 1, 3))
    force[:, 0, 2] = [-1e-3, -2e-3]
    pressed = model.press(Touches(position=[[(0.03, 0.04)]] * 2, force=force), tolerance=1e-7)
    single, double = pressed.displacements
    np.testing.assert_allclose(double, 2 * single, atol=0.02 * np.abs(double).max())


def test_a_frame_on_the_base_takes_its_force_past_the_pillars(small):
    """A drag far into the stops: on the base the board moves by less than the whole drag."""
    touches = Touches(position=[[(0.03, 0.04)]], force=[[(0.35, 0.0, -0.3)]])
    board = board_of(small).stiffness[0]
    moved = {}
    for body in ("board", "base"):
        model = BarHinge(replace(opened(small, stands_on=body), creases=small.creases))
        pressed = model.press(touches)
        assert pressed.converged.all()
        push = 0.35 + pressed.reaction[0, 0, 0]
        stops = model.lattice.stops
        sway = (pressed.displacements[0, stops.nodes] * stops.normal).sum(axis=1)
        if body == "base":
            shift = carried(model.board, stops.places) @ pressed.board[0]
            sway += (shift * stops.normal).sum(axis=1) / stops.lever
        past = np.clip(sway - stops.free, 0, None)
        taken = (stops.stiffness * past / stops.lever * stops.normal[:, 0]).sum()
        moved[body] = pressed.board[0, 0]
        carry = push - (taken if body == "base" else 0.0)
        assert pressed.board[0, 0] * board == pytest.approx(carry, rel=2e-2)
        assert taken > 0.02
    assert moved["base"] < moved["board"]


@pytest.mark.parametrize(("body", "grip"), [("board", Sticking()), ("base", Covered())])
def test_derivatives_hold_for_opened_sheets_in_frames(small, body, grip):
    design = opened(small, stands_on=body)
    touches = Touches(position=[[(0.0213, 0.0312)]], force=[[(0.15, -0.05, -0.4)]])
    model = BarHinge(design, grip=grip)
    slopes = model.sensitivity(touches)

    def moved(lattice):
        pressed = BarHinge(design, grip=grip, lattice=lattice).press(touches, tolerance=3e-11)
        assert pressed.converged.all()
        return np.concatenate([pressed.displacements[0].ravel(), pressed.board[0]])

    springs = springs_of(design)
    for index, name in enumerate(STIFFNESSES):
        ends = [
            moved(build_lattice(design, replace(springs, **{name: getattr(springs, name) * by})))
            for by in (1 + 3e-4, 1 - 3e-4)
        ]
        slope = (ends[0] - ends[1]) / 6e-4
        exact = np.concatenate(
            [
                slopes.displacements_by_stiffness[0, index].ravel(),
                slopes.board_by_stiffness[0, index],
            ]
        )
        np.testing.assert_allclose(exact, slope, atol=1e-5 * max(np.abs(slope).max(), 1e-6))
