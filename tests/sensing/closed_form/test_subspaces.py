"""The likeliest of subspaces, against least squares written out and how often noise errs."""

import numpy as np
import pytest

from smoskin.sensing.closed_form.subspaces import Subspaces

CELLS, MOTIONS = 7, 9
RNG = np.random.default_rng(0)
ANSWERS = RNG.normal(size=(CELLS, MOTIONS, 3))
SPREAD = RNG.normal(size=(MOTIONS, MOTIONS))
NOISE = 1e-4 * (SPREAD @ SPREAD.T + np.eye(MOTIONS))


def misfit(motion, answers):
    """Squared distance from a subspace in the noise, and the loads there, written out."""
    weight = np.linalg.inv(NOISE)
    load = np.linalg.solve(answers.T @ weight @ answers, answers.T @ weight @ motion)
    left = motion - answers @ load
    return left @ weight @ left, load


def test_the_match_is_the_least_misfit_of_those_that_press():
    cells = Subspaces(ANSWERS, NOISE)
    motions = np.random.default_rng(1).normal(size=(200, MOTIONS))
    found = cells.match(motions)
    for k, motion in enumerate(motions):
        tried = [misfit(motion, answers) for answers in ANSWERS]
        pressing = [c for c in range(CELLS) if tried[c][1][0] > 0]
        best = min(pressing, key=lambda c: tried[c][0], default=-1)
        assert found.cell[k] == best
        if best >= 0:
            np.testing.assert_allclose(found.load[k], tried[best][1], atol=1e-9)


def test_loads_come_back_and_their_spread_is_the_noise_s():
    cells = Subspaces(ANSWERS, NOISE)
    load = np.array([2.0, -1.0, 0.5])
    clean = cells.match(ANSWERS @ load)
    np.testing.assert_array_equal(clean.cell, np.arange(CELLS))
    np.testing.assert_allclose(clean.load, np.tile(load, (CELLS, 1)))
    rng = np.random.default_rng(2)
    noisy = ANSWERS[3] @ load + rng.multivariate_normal(np.zeros(MOTIONS), NOISE, 20000)
    seen = noisy @ cells.loads[3].T
    np.testing.assert_allclose(np.cov(seen.T), cells.spread[3], rtol=0.05, atol=1e-6)


def test_where_nothing_presses_there_is_no_cell():
    cells = Subspaces(ANSWERS[:1], NOISE)
    found = cells.match(np.stack([-ANSWERS[0, :, 0], np.zeros(MOTIONS)]))
    assert found.cell.tolist() == [-1, -1]
    assert found.confidence.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("deviations", [1.0, 2.0])
def test_confidence_and_separation_are_how_often_noise_errs(deviations):
    """Two cells much alike; a press at so many standard deviations from the boundary."""
    near = ANSWERS[0] + 0.03 * ANSWERS[1]
    pair = Subspaces(np.stack([ANSWERS[0], near]), NOISE)
    apart, alike = pair.separations()
    assert not alike[0, 1]
    force = deviations / apart[0, 1]
    rng = np.random.default_rng(3)
    noise = rng.multivariate_normal(np.zeros(MOTIONS), NOISE, 40000)
    found = pair.match(force * ANSWERS[0, :, 0] + noise)
    wrong = (found.cell == 1).mean()
    normal = {1.0: 0.1587, 2.0: 0.0228}[deviations]
    # The boundary is bent: the rate of a plane is near, not exact.
    assert wrong == pytest.approx(normal, rel=0.1)
    clean = pair.match(force * ANSWERS[:1, :, 0])
    assert 1 - clean.confidence[0] == pytest.approx(normal, abs=1e-4)


def test_cells_of_one_answer_are_alike_and_share_the_doubt():
    twins = Subspaces(np.stack([ANSWERS[0], ANSWERS[0], ANSWERS[1]]), NOISE)
    _, alike = twins.separations()
    np.testing.assert_array_equal(alike, [[1, 1, 0], [1, 1, 0], [0, 0, 1]])
    found = twins.match(1e3 * ANSWERS[:1, :, 0])
    assert found.cell[0] == 0
    assert found.confidence[0] == pytest.approx(0.5)


def test_units_do_not_matter():
    scale = 10.0 ** np.arange(-4, 5)
    scaled = Subspaces(ANSWERS * scale[:, None], NOISE * np.outer(scale, scale))
    plain = Subspaces(ANSWERS, NOISE)
    motions = np.random.default_rng(4).normal(size=(50, MOTIONS))
    one, other = plain.match(motions), scaled.match(motions * scale)
    np.testing.assert_array_equal(one.cell, other.cell)
    np.testing.assert_allclose(one.load, other.load, rtol=1e-7)
    np.testing.assert_allclose(one.confidence, other.confidence, atol=1e-7)
