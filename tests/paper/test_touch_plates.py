"""What the report shows of estimators: shear (Figure S11), bounds and errors, two touches."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from paper.beyond.touch_bound import blind_regions
from paper.beyond.touch_pairs import touch_error_rows
from paper.figure_s11 import shear_learning_rows
from paper.shared.setting import Setting, TrialSkin, bench_signals
from paper.shared.shear_learning import (
    DRAGS,
    SHOWN,
    Jointly,
    read_jointly,
    shear_learning,
)
from paper.shared.touch_errors import (
    DISTANCES,
    FORCES,
    PairErrors,
    TouchErrors,
)
from smoskin.errors import ModelError
from smoskin.records import Motion
from smoskin.sensing.response.bound import bound_map, bound_of_slopes
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.readout import Readout
from tables_of_response import plain, reduced_table

pytest.importorskip("jax")
pytest.importorskip("matplotlib")
pytestmark = pytest.mark.slow


def texts(figure) -> str:
    """All that is written on a figure."""
    return "\n".join(
        artist.get_text() for artist in figure.findobj(lambda a: hasattr(a, "get_text"))
    )


def test_bench_signals_are_those_of_the_readout_in_noise(planar):
    rng = np.random.default_rng(0)
    magnets = np.zeros((400, 3, 6))
    magnets[:, 1:, 0] = 1e-4
    motion = Motion(magnets=magnets, board=np.zeros((400, 6)))
    simulated = bench_signals(planar, Readout(planar), motion, rng)
    still = Motion.rest(3, (1,))
    expected = Readout(planar).field(motion)[0] - Readout(planar).field(still)[0]
    noise = np.sqrt(np.diag(signal_noise(planar))).reshape(3, 3)
    assert_allclose(simulated.mean(axis=0), expected, atol=2 * noise.max())
    assert_allclose(simulated.std(axis=0), noise, rtol=0.5)


def test_a_table_of_other_chips_is_refused(planar):
    with pytest.raises(
        ModelError, match=r"table must be of all chips of the design 'planar'.*1, 2"
    ):
        Setting(planar, reduced_table(planar).of_chips((1, 2)))


# Figure S11


@pytest.fixture(scope="module")
def twin(planar):
    from smoskin.twin.whole import Twin

    return Twin(planar, seed=1, manufactured=True)


@pytest.fixture(scope="module")
def shear(twin):
    return shear_learning(twin)


@pytest.fixture(scope="module")
def jointly(shear):
    """As good as the model reads theory's sheet."""
    x, y = (
        Jointly(readings=sheared.preprocessed, drag_error=np.full(len(DRAGS), 4e-3))
        for sheared in (shear.theory.x, shear.theory.y)
    )
    return x, y


def test_without_shear_the_model_reads_both_sheets(shear):
    for sheet in (shear.whole, shear.theory):
        for sheared in (sheet.x, sheet.y):
            assert sheared.raw.distance[0].mean() < 1e-3
            assert sheared.raw.force_error(sheared.true)[0] < 0.01


def test_preprocessing_mends_theorys_sheet(shear):
    for sheared in (shear.theory.x, shear.theory.y):
        errors = sheared.preprocessed.distance.mean(axis=1)
        assert errors[SHOWN] < 1.2e-3 < 0.1 * sheared.raw.distance[SHOWN].mean()
        assert (
            sheared.preprocessed.force_error(sheared.true)[-1]
            < 0.05
            < sheared.raw.force_error(sheared.true)[-1]
        )
        assert sheared.deducted.force_error(sheared.true)[-1] > 0.2  # without 1 + |F_p| / v_f
        assert sheared.nearer > 0.9
    assert shear.theory.unasked < 1e-3


def test_preprocessing_helps_the_whole_sheet_and_leaves_large_errors(shear):
    whole = shear.whole
    for sheared in (whole.x, whole.y):
        raw, after = (way.distance.mean(axis=1) for way in (sheared.raw, sheared.preprocessed))
        assert (np.diff(raw) > 0).all()
        assert sheared.nearer > 0.5
        assert 5e-3 < after[SHOWN] < 0.9 * raw[SHOWN]
        assert after[0] > 5 * raw[0]  # a finger that sticks looks like a drag
    assert whole.unasked > 0.02
    assert whole.fitted_left < whole.left < whole.induced
    assert np.ptp(whole.answers, axis=0).min() > 0.5 * np.abs(whole.slide).min()


def test_the_drag_found_in_straight_presses_is_the_pull_of_a_finger_that_sticks(planar, shear):
    from smoskin.mechanics.sheet.touches import Frictionless
    from smoskin.twin.whole import Twin

    twin = Twin(planar, seed=1, manufactured=True, grip=Frictionless())
    sliding = shear_learning(twin).whole
    # The board's tilt under the press is what is left.
    assert sliding.unasked < 0.25 * shear.whole.unasked
    for slides, sticks in ((sliding.x, shear.whole.x), (sliding.y, shear.whole.y)):
        spoilt, more = (item.preprocessed.distance[0].mean() for item in (slides, sticks))
        assert spoilt < 0.6 * more
        assert slides.preprocessed.distance[SHOWN].mean() > 5e-3


def test_rows_of_the_shear_tell_what_came_out(shear, jointly):
    rows = {row.id: row for row in shear_learning_rows(shear, jointly)}
    assert list(rows) == [
        "figure_s11.without",
        "figure_s11.force",
        "figure_s11.place",
        "figure_s11.open",
    ]
    assert {row.verdict for row in rows.values()} == {"reproduced"}
    assert "by 4 mN" in rows["figure_s11.open"].computed
    both = shear.whole.x.raw.distance[SHOWN].mean(), shear.whole.y.raw.distance[SHOWN].mean()
    assert f"{1e3 * both[0]:.1f} and {1e3 * both[1]:.1f} mm" in rows["figure_s11.place"].computed


def test_the_joint_estimator_reads_the_same_signals(planar, twin, shear):
    # Theory's signals by theory's table, where that can follow theory: without shear.
    skin = TrialSkin(twin=twin, table=reduced_table(plain(planar)), noise=signal_noise(planar))
    straight = tuple(
        replace(sheared, signals=np.broadcast_to(sheared.signals[:1], sheared.signals.shape))
        for sheared in (shear.theory.x, shear.theory.y)
    )
    x, y = read_jointly(skin, replace(shear.theory, x=straight[0], y=straight[1]))
    for joint, sheared in zip((x, y), straight, strict=True):
        assert joint.readings.distance[0].mean() < 2e-3
        assert joint.readings.force_error(sheared.true)[0] < 0.02
        assert joint.drag_error[0] < 5e-3


def test_where_preprocessing_mends_everything_the_row_does_not_hold(shear, jointly):
    mended = replace(shear, whole=shear.theory)
    rows = {row.id: row.verdict for row in shear_learning_rows(mended, jointly)}
    assert rows["figure_s11.place"] == "unresolved"


def test_the_shear_is_drawn_in_the_papers_order(shear, jointly):
    from paper.figure_s11 import draw

    plate = draw(shear, jointly)
    axes = plate.figure.axes
    assert [axis.get_title(loc="left")[:3] for axis in axes] == [
        f"({letter})" for letter in "abcdefghi"
    ]
    raw, after, joint = axes[1].lines
    expected = shear.whole.x.by_cell(np.abs(shear.whole.x.raw.place[SHOWN, :, 0])) * 1e3
    assert_allclose(raw.get_ydata(), expected)
    assert len(after.get_xdata()) == len(joint.get_xdata()) == 36
    assert_allclose(axes[6].lines[0].get_xdata(), DRAGS)
    assert "not in its text" in plate.caption
    assert plate.name == "figure_s11"


# Bounds, errors and pairs


@pytest.fixture(scope="module")
def touches(planar) -> TouchErrors:
    bound = bound_map(reduced_table(planar), signal_noise(planar), places=(5, 7))
    return TouchErrors(
        bound=bound,
        distance=1.5 * bound.location,
        squared=4 * bound.location**2,
        force=2 * bound.force,
        drag=0 * bound.force + 3e-3,
        counted=0.99,
        idle=1.0,
    )


@pytest.fixture(scope="module")
def pairs() -> PairErrors:
    rng = np.random.default_rng(0)
    shape = (len(DISTANCES) - 1, len(FORCES) - 1, 4)
    each = rng.uniform(1e-3, 9e-3, shape)
    each[0, 0] = np.nan
    counted = np.isfinite(each).mean(axis=2)
    distance = np.full(shape[:2], np.nan)
    distance[counted > 0] = each[counted > 0].mean(axis=1)
    bound = rng.uniform(1e-4, 2e-3, shape)
    return PairErrors(
        counted=counted,
        distance=distance,
        bound=np.median(bound, axis=2),
        each=each,
        each_bound=bound,
        identifiable=1.0,
    )


def test_ratio_and_super_resolution_follow_their_definitions(touches):
    assert touches.over_bound == pytest.approx(2.0)
    taxel = 0.12 * 0.16 / 3
    reached = touches.super_resolution
    assert reached.area == pytest.approx(taxel / touches.squared.mean(), rel=1e-4)
    assert reached.spacing == pytest.approx(np.sqrt(taxel) / touches.distance.mean(), rel=1e-4)


def test_bounds_and_errors_share_a_scale(touches):
    from paper.beyond.touch_bound import draw

    plate = draw(touches)
    maps = [axis for axis in plate.figure.axes if axis.get_title(loc="left").startswith("(")]
    assert len(maps) == 6
    for above, below in zip(maps[:3], maps[3:], strict=True):
        assert above.collections[0].norm is below.collections[0].norm
    assert_allclose(maps[3].collections[0].get_array().T, touches.distance * 1e3, rtol=0.05)
    assert "over bound: 2.0" in plate.caption
    assert "area a chip over mean square error" in plate.caption


def test_pairs_are_drawn_with_their_numbers(pairs, touches):
    from paper.beyond.touch_pairs import draw

    plate = draw(pairs, touches)
    written = texts(plate.figure)
    assert "0 %" in written
    assert "none" in written
    for value in pairs.distance[np.isfinite(pairs.distance)]:
        assert f"{1e3 * value:.1f}" in written
    assert "leaves several touches open" in plate.caption


def test_rows_of_two_touches_judge_counts_and_rank(touches, pairs):
    solved, switch = touch_error_rows(touches, pairs)
    assert (solved.verdict, switch.verdict) == ("reproduced", "reproduced")
    solved, switch = touch_error_rows(replace(touches, idle=0.5), replace(pairs, identifiable=0.9))
    assert (solved.verdict, switch.verdict) == ("unresolved", "unresolved")
    assert "50 % of the moments" in switch.computed


def test_blind_strips_and_patches_are_named():
    x, y = np.linspace(0.0, 0.1, 11), np.linspace(0.0, 0.2, 21)
    slopes = np.zeros((11, 21, 3, 5))
    slopes[..., 0, 0] = slopes[..., 1, 1] = slopes[..., 2, 4] = 1.0
    slopes[0, :, 0, 0] = slopes[:, 19:, 1, 1] = slopes[5, 5, 0, 0] = 0.0
    bound = bound_of_slopes(x, y, slopes, 1e-12 * np.eye(3), drags=False)
    assert blind_regions(bound) == ["x <= 0 mm", "y >= 190 mm", "0.4% of the skin elsewhere"]
    bound = bound_of_slopes(x, y, 0 * slopes, 1e-12 * np.eye(3), drags=False)
    assert blind_regions(bound) == ["the whole skin"]
