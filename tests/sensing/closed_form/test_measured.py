"""Sheets read cell by cell: subspaces against least squares, and answers of response tables."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ModelError
from smoskin.mechanics.sheet.touches import vertex_shares
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.measured import MeasuredSheet, Subspaces, cell_answers
from tables import ideal_answers
from tables_of_response import plain, reduced_table

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
    for motion in np.random.default_rng(1).normal(size=(200, MOTIONS)):
        tried = [misfit(motion, answers) for answers in ANSWERS]
        pressing = [c for c in range(CELLS) if tried[c][1][0] > 0]
        match = cells.match(motion)
        if not pressing:
            assert match is None
            continue
        best = min(pressing, key=lambda c: tried[c][0])
        assert match[0] == best
        np.testing.assert_allclose(match[1], tried[best][1], atol=1e-9)


def test_loads_come_back_and_their_spread_is_the_noise_s():
    cells = Subspaces(ANSWERS, NOISE)
    load = np.array([2.0, -1.0, 0.5])
    for cell, motion in enumerate(ANSWERS @ load):
        number, seen, *_ = cells.match(motion)
        assert number == cell
        np.testing.assert_allclose(seen, load)
    rng = np.random.default_rng(2)
    noisy = ANSWERS[3] @ load + rng.multivariate_normal(np.zeros(MOTIONS), NOISE, 20000)
    seen = noisy @ cells.loads[3].T
    np.testing.assert_allclose(np.cov(seen.T), cells.spread[3], rtol=0.05, atol=1e-6)


def test_where_nothing_presses_there_is_no_cell():
    cells = Subspaces(ANSWERS[:1], NOISE)
    assert cells.match(-ANSWERS[0, :, 0]) is None
    assert cells.match(np.zeros(MOTIONS)) is None


@pytest.mark.parametrize(("deviations", "rate"), [(1.0, 0.1587), (2.0, 0.0228)])
def test_confidence_is_how_often_noise_errs(deviations, rate):
    """Two cells much alike; a press at so many standard deviations from the boundary."""
    near = ANSWERS[0] + 0.03 * ANSWERS[1]
    pair = Subspaces(np.stack([ANSWERS[0], near]), NOISE)
    # Half the distance of a newton's press on the first cell from the second's subspace.
    force = deviations / (np.sqrt(misfit(ANSWERS[0, :, 0], near)[0]) / 2)
    rng = np.random.default_rng(3)
    noise = rng.multivariate_normal(np.zeros(MOTIONS), NOISE, 40000)
    press = force * ANSWERS[0, :, 0]
    numbers = [pair.match(press + error)[0] for error in noise]
    # The boundary is bent: the rate of a plane is near, not exact.
    assert np.mean(numbers) == pytest.approx(rate, rel=0.1)
    assert 1 - pair.match(press)[2] == pytest.approx(rate, abs=1e-4)


def test_cells_of_one_answer_share_the_doubt():
    twins = Subspaces(np.stack([ANSWERS[0], ANSWERS[0], ANSWERS[1]]), NOISE)
    cell, _, confidence, _ = twins.match(1e3 * ANSWERS[0, :, 0])
    assert cell == 0
    assert confidence == pytest.approx(0.5)


def test_units_do_not_matter():
    scale = 10.0 ** np.arange(-4, 5)
    scaled = Subspaces(ANSWERS * scale[:, None], NOISE * np.outer(scale, scale))
    plain = Subspaces(ANSWERS, NOISE)
    for motion in np.random.default_rng(4).normal(size=(50, MOTIONS)):
        match, other = plain.match(motion), scaled.match(motion * scale)
        assert match[0] == other[0]
        np.testing.assert_allclose(match[1], other[1], rtol=1e-7)
        assert match[2] == pytest.approx(other[2], abs=1e-7)


# Answers by a response table


def test_a_table_gives_the_answers_of_its_skin(planar):
    """The reduced model's own answers, by a table that was fitted to its presses."""
    skin = plain(planar)
    measured, exact = cell_answers(skin, reduced_table(skin)), ideal_answers(skin)
    upper = np.r_[3:9]
    size = np.abs(exact.motions[..., upper, :]).max(axis=(0, 1, 2))
    off = np.abs(measured.motions - exact.motions)[..., upper, :].max(axis=(0, 1, 2))
    assert (off < 0.06 * size).all(), off / size
    np.testing.assert_allclose(measured.motions[..., 0, 1], exact.motions[..., 0, 1], rtol=0.05)
    # The design has been freed of stiffening, v_f = 1 MN: none to speak of is found.
    assert measured.folding.min() > 5.0


def test_stiffening_by_drags_is_read_off_the_table(planar):
    """A table whose presses move a quarter less under 0.2 N of drag in y, and as much in x."""
    skin = plain(planar)
    table = reduced_table(skin)
    exponents = table.basis.exponents.tolist()
    mean = np.array(table.mean)
    press = mean[:, :, exponents.index([0, 0, 1])]
    mean[:, :, exponents.index([0, 2, 1])] -= 0.25 * press / 0.2**2
    base = cell_answers(skin, table).folding
    stiff = cell_answers(skin, replace(table, mean=mean)).folding
    np.testing.assert_allclose(stiff[..., 0], base[..., 0], rtol=1e-6)
    # 1 / (1 - 0.25) = 1 + 0.2 / v_f, but for the curvature of the field.
    np.testing.assert_allclose(np.median(stiff[..., 1]), 0.6, rtol=0.1)


def test_tables_that_cannot_be_read_by_cells_are_refused(planar):
    skin = plain(planar)
    table = reduced_table(skin)
    with pytest.raises(ModelError, match="table must be of all 3 chips"):
        cell_answers(skin, table.of_chips((1, 2)))
    with pytest.raises(ModelError, match="table must be of the design"):
        cell_answers(planar, table)
    straight = np.array(table.mean)
    straight[:, :, [e[0] > 0 for e in table.basis.exponents.tolist()]] = 0.0
    with pytest.raises(ModelError, match="table must answer a press, a drag in x and a drag in y"):
        cell_answers(skin, replace(table, mean=straight))
    with pytest.raises(ModelError, match="within the stroke"):
        cell_answers(skin, replace(table, mean=50 * table.mean))


def test_the_sheet_s_places_scatter_on_every_cell(planar):
    sheet = MeasuredSheet(planar, ideal_answers(planar))
    assert sheet.noise.shape == sheet.place.shape == (6, 6, 3, 3)
    assert (np.linalg.eigvalsh(sheet.noise) > 0).all()
    assert (sheet.place[..., 2, 2] > 0).all()


def test_the_misfit_is_what_more_than_noise_leaves_of_a_motion():
    # Away from a lone cell's subspace by d standard deviations, of which noise leaves 40 squared.
    cell = Subspaces(ANSWERS[:1], NOISE)
    press = 50 * ANSWERS[0, :, 0]
    root = np.linalg.cholesky(NOISE)
    inside = np.linalg.qr(np.linalg.inv(root) @ ANSWERS[0])[0]
    away = np.linalg.svd(inside.T)[2][-1]
    whole = press @ np.linalg.solve(NOISE, press)
    for squared in (0.0, 39.0, 41.0, 400.0):
        match = cell.match(press + root @ away * np.sqrt(squared))
        assert match[3] == pytest.approx(max(squared - 40, 0) / (whole + squared), abs=1e-9)
        np.testing.assert_allclose(match[1], [50, 0, 0], atol=1e-6)


def test_a_touch_between_vertices_may_misfit_twice_as_much_as_a_press_there(planar):
    answers = ideal_answers(planar)
    sheet = MeasuredSheet(planar, answers)
    tops = geometry(planar).tops
    pitch = tops[1, 1] - tops[0, 0]
    worst = 0.0
    # 25 places of each cell: middles and up to 0.4 of a cell away.
    for cell in np.ndindex(6, 6):
        for step in np.ndindex(5, 5):
            place = tops[cell] + (np.array(step) - 2) * 0.2 * pitch
            motion = np.einsum("nm,nmk->k", vertex_shares(planar, place), answers.motions[..., 0])
            worst = max(worst, sheet.solve(motion).misfit)
    assert sheet.most_misfit == pytest.approx(2 * worst)
    assert worst > 0.01
