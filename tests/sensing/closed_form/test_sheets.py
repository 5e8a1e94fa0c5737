"""The two ways to read motions, on motions that each knows, and how well they say they read."""

import numpy as np
import pytest

from smoskin.mechanics.sheet.touches import vertex_shares
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import motion_noise
from smoskin.sensing.closed_form.location import decide
from smoskin.sensing.closed_form.measured import MeasuredSheet
from smoskin.sensing.closed_form.sheets import IdealSheet
from tables import ideal_answers, solve_all

STRAIGHT = np.array([0.0, 0.0, -0.4])


def sheets(design):
    """Both ways, and the answers that both believe in."""
    answers = ideal_answers(design)
    calibration = Calibration.nominal(design)
    measured = MeasuredSheet(design, answers)
    return {"ideal": IdealSheet(design, calibration), "measured": measured}, answers


def motions(answers, force):
    """Motions under this force on each cell, (N M, 3S); S27 left out."""
    load = np.array([-force[2], force[0], force[1]])
    return (answers.motions @ load).reshape(-1, answers.motions.shape[2])


@pytest.mark.parametrize("way", ["ideal", "measured"])
def test_a_press_on_each_cell_is_read_as_it_is(planar, way):
    ways, answers = sheets(planar)
    solved = solve_all(ways[way], motions(answers, STRAIGHT))
    np.testing.assert_array_equal(solved.cell, list(np.ndindex(6, 6)))
    np.testing.assert_allclose(solved.force, np.tile(STRAIGHT, (36, 1)), atol=1e-9)
    assert (solved.confidence > 0.999).all()


@pytest.mark.parametrize("way", ["ideal", "measured"])
def test_a_drag_stiffens_by_s27(planar, way):
    ways, answers = sheets(planar)
    dragged = np.array([0.3, 0.0, -0.4])
    solved = solve_all(ways[way], motions(answers, dragged))
    v_f = np.array(planar.coefficients.folding_correction_x)[[0, 1, 2, 2, 1, 0]]
    force = solved.force.reshape(6, 6, 3)
    np.testing.assert_allclose(force[..., :2], np.broadcast_to((0.3, 0.0), (6, 6, 2)), atol=1e-9)
    np.testing.assert_allclose(force[[0, 1, 2], [0, 1, 2], 2], -0.4 * (1 + 0.3 / v_f[:3]))


@pytest.mark.parametrize("way", ["ideal", "measured"])
def test_forces_scatter_by_the_noise_as_stated(planar, way):
    ways, answers = sheets(planar)
    rng = np.random.default_rng(0)
    clean = np.repeat(motions(answers, STRAIGHT)[14:15], 20000, axis=0)
    noisy = clean + rng.normal(size=clean.shape) * np.sqrt(motion_noise(planar))
    solved = solve_all(ways[way], noisy)
    stated = ways[way].noise[2, 2]
    seen = np.cov(solved.force.T)
    np.testing.assert_allclose(seen[:2, :2], stated[:2, :2], rtol=0.05, atol=5e-9)
    # A drag that is noise stiffens too, by its size alone.
    assert seen[2, 2] == pytest.approx(stated[2, 2], rel=0.2)


@pytest.mark.parametrize("way", ["ideal", "measured"])
def test_forces_scatter_by_the_place_as_stated(planar, way):
    ways, answers = sheets(planar)
    rng = np.random.default_rng(1)
    off = rng.uniform(-0.4, 0.4, (2000, 2)) * (0.02, 0.16 / 6)
    places = geometry(planar).tops[3, 2] + off
    press = answers.motions[..., 0] * -STRAIGHT[2]
    seen = np.einsum("tnm,nmk->tk", vertex_shares(planar, places), press)
    solved = solve_all(ways[way], seen)
    inside = (solved.cell == (3, 2)).all(axis=1)
    error = solved.force[inside] - STRAIGHT
    rms = np.sqrt(np.diag(ways[way].place[3, 2])) * -STRAIGHT[2]
    assert inside.mean() > 0.6
    assert np.sqrt(np.mean(error[:, 2] ** 2)) == pytest.approx(rms[2], rel=0.5)


def test_cells_that_no_drag_stiffens_read_another_force(planar):
    _, answers = sheets(planar)
    stiff = answers._replace(folding=np.full((6, 6, 2), np.inf))
    other = MeasuredSheet(planar, stiff)
    seen = motions(answers, np.array([0.3, 0.0, -0.4]))
    press = solve_all(other, seen).force[:, 2]
    np.testing.assert_allclose(press, -0.4)


def test_the_ideal_misfit_is_what_lies_across_the_press(planar):
    """Of a motion's squared length, the share that no press on its cell makes."""
    ways, answers = sheets(planar)
    rng, read = np.random.default_rng(4), [3, 4, 6, 7]  # x and y of the upper magnets
    for noise in (0.0, 0.1, 0.3):
        motion = np.zeros(9)
        motion[read] = answers.motions[2, 3, read, 0]
        motion[read] += noise * np.linalg.norm(motion) * rng.normal(size=4)
        solution = ways["ideal"].solve(motion)
        press = answers.motions[(*solution.cell, read, 0)]
        along = (press @ motion[read]) ** 2 / (press @ press)
        assert solution.misfit == pytest.approx(1 - along / (motion @ motion), abs=1e-9)
        assert (solution.misfit > 1e-3) == (noise > 0)


def test_motions_that_no_cell_makes_along_one_axis_are_no_touch(planar):
    """A press turns all magnets away from it: along one axis these read as a press, not both."""
    ways, answers = sheets(planar)
    press = answers.motions[..., 0]
    rng, sheet = np.random.default_rng(5), ways["ideal"]
    nobodys = {(False, True): 0, (True, False): 0}
    for n, m in rng.integers(0, 6, (200, 2)):
        motion = press[n, m].copy()
        axis = int(rng.integers(2))
        motion[[3 + axis, 6 + axis]] = rng.normal(size=2) * np.abs(motion).max()
        cell = decide(sheet._rule, (motion @ sheet._readout)[:4].reshape(2, 2))
        if (cell < 0).any():
            nobodys[tuple((cell < 0).tolist())] += 1
            assert sheet.solve(motion) is None
    assert min(nobodys.values()) > 5


def test_touches_anywhere_are_believed_by_the_ideal_sheet_and_little_else(planar):
    ways, answers = sheets(planar)
    rng, sheet = np.random.default_rng(6), ways["ideal"]
    places = rng.uniform(0.0, 1.0, (500, 2)) * geometry(planar).extent
    load = np.column_stack([np.full(500, 0.5), rng.uniform(-0.3, 0.3, (500, 2))])
    shares = vertex_shares(planar, places)
    seen = np.einsum("tnm,nmkf,tf->tk", shares, answers.motions, load)
    misfits = [solution.misfit for solution in map(sheet.solve, seen) if solution is not None]
    assert max(misfits) < sheet.most_misfit < 2 * max(misfits)
