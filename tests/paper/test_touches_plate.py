"""The curve of calibration touches against error, and its figure."""

import numpy as np
import pytest

from paper.models.touch_curve import CurveEffort, TouchCurve
from smoskin.errors import ArgumentError


@pytest.fixture
def curve():
    rng = np.random.default_rng(0)
    counts = (2, 5, 10)
    place = 1e-3 / np.array(counts) * rng.uniform(0.8, 1.2, (2, 3))
    return TouchCurve(
        counts=counts,
        chips=(1, 2),
        planned=place,
        random=2 * place,
        planned_force=0.1 * place / 1e-3,
        random_force=0.2 * place / 1e-3,
        inside=np.full((2, 3), 0.9),
        expected=place.mean(axis=0),
        bound=5e-5,
    )


def test_rows_are_means_and_worst_skins(curve):
    first = curve.rows()[0]
    assert first["touches"] == 2
    assert first["planned_mm"] == pytest.approx(1e3 * curve.planned[:, 0].mean())
    assert first["random_worst_skin_mm"] == pytest.approx(1e3 * curve.random[:, 0].max())
    assert first["planned_force_percent"] == pytest.approx(100 * curve.planned_force[:, 0].mean())
    assert first["inside_percent"] == pytest.approx(90)


def test_efforts_that_judge_nothing_are_refused():
    for wrong in ({"counts": (5, 2)}, {"counts": ()}, {"seeds": ()}, {"places": 0}):
        with pytest.raises(ArgumentError, match="counts rise from 1"):
            CurveEffort(**wrong)


def test_the_curve_is_drawn_with_its_numbers(curve, tmp_path):
    pytest.importorskip("matplotlib")
    from paper.beyond.calibration_touches import draw

    plate = draw(curve)
    place, force = plate.figure.axes
    planned = next(line for line in place.lines if line.get_label() == "planned touches")
    assert np.allclose(planned.get_ydata(), 1e3 * curve.planned.mean(axis=0))
    random = next(line for line in force.lines if line.get_label() == "random touches")
    assert np.allclose(random.get_ydata(), 100 * curve.random_force.mean(axis=0))
    assert f"{1e3 * curve.planned[:, -1].mean():.2f} mm" in plate.caption
    assert "6 signals on 2 made skins" in plate.caption
    path = plate.write(tmp_path)
    assert path.read_bytes() == draw(curve).write(tmp_path).read_bytes()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_more_touches_make_better_estimates(planar):
    pytest.importorskip("jax")
    from paper.models.touch_curve import touch_curve
    from smoskin.commands.table import Effort, make_table

    small = Effort(presses=4000, pairs=0, skins=10, draws=3, presses_a_skin=200)
    table = make_table(planar, small).of_chips((1, 2))
    shares = []
    curve = touch_curve(
        planar,
        table,
        CurveEffort(seeds=(1,), counts=(1, 30), forces=(0.5,), places=40),
        progress=lambda what, share: shares.append(share),
    )
    assert shares == [0.0]
    assert curve.planned[0, 1] < 0.7 * curve.planned[0, 0]
    assert curve.bound < curve.planned[0, 1] < 1.9e-3
    assert curve.expected[1] < curve.expected[0]
