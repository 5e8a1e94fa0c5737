"""The benchmark on recordings: made-up ones of the same layout, then the real ones."""

import itertools
import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from smoskin.errors import ArgumentError, RecordingError
from smoskin.sensing.learned.training import FittingEffort
from studies.recordings import bench_recordings
from studies.recordings import trial as trial_module
from studies.recordings.touches import moments, places

LITTLE = FittingEffort(rows=300, evidence_rows=100, iterations=8)
CHIPS = np.array([[0.0, 0.0], [10.0, 0.0], [5.0, 10.0], [400.0, 400.0]])
"""mm; the last is far away."""


GRID = np.array([[5.0, 5.0], [0.0, 0.0], [10.0, 0.0], [0.0, 10.0], [10.0, 10.0]])
"""mm; chips under a grid of cells that are 5 mm wide."""
KEYS = ["set", "test", "split", "chips", "model", "metric", "value", "unit", "target"]


def field(place, depth, chips=CHIPS):
    """uT: of a press at (T, 2) mm, flat over chips and axes; two chips are needed to tell where."""
    away = np.concatenate(
        [place[:, None, :] - chips, np.full((len(place), len(chips), 1), 6.0)], axis=2
    )
    fall = np.linalg.norm(away, axis=2, keepdims=True) ** 3
    away[:, :, 2] = 0.0
    return (4e4 * depth[:, None, None] * away / fall).reshape(len(place), -1)


def save(folder, time, values, states, drift=0.0):
    folder.mkdir(parents=True)
    tables = {
        "sensor": np.column_stack([time, values + 900.0 + drift * (time - time[0])[:, None]]),
        "sensor_post_baselines": np.column_stack([time, values]),
        "states": np.column_stack([time, states]),
    }
    for name, table in tables.items():
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", fmt="%.6f")


def save_location(root, side=7, drift=0.0):
    rng = np.random.default_rng(0)
    axis = np.linspace(0.0, 10.0, side)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    place = np.tile(grid, (3, 1))
    values = field(place, rng.uniform(1, 2, len(place))) + rng.normal(size=(len(place), 12))
    values[:, 9:] = 300.0 * rng.normal(size=(len(place), 3))
    states = np.column_stack([place, np.zeros(len(place))])
    time = 4.0 * np.arange(len(place))
    save(root / "spatial_resolution" / "1_probe", time, values, states, drift)


def save_force(root, name, runs):
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 40.0, 0.1)
    depth = np.sin(time * np.pi / 4) ** 2
    for k in range(runs):
        values = field(np.full((400, 2), 5.0), depth) + rng.normal(size=(400, 12))
        load = np.where(np.arange(400) % 2, -1.0, 2000.0 * depth**1.5)
        states = np.column_stack([np.zeros((400, 3)), load])
        save(root / name / f"{k}_probe", 100.0 * k + time, values, states)


def save_touches(folder, pairs, rows=30):
    """Files of one and two touches, their loads from 0 to 6 N, a row in fifteen dropped out."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(2)
    magnets = [f"mag{chip}_{axis}" for chip in range(len(GRID)) for axis in "xyz"]
    cells = list(itertools.product((1, 2, 3), repeat=2))
    for held in [(cell,) for cell in cells] + list(itertools.combinations(cells, 2))[:pairs]:
        load = np.linspace(0.0, 6.0, rows)
        values = sum(
            field(np.tile(5.0 * np.array(cell) - 5.0, (rows, 1)), load / len(held) / 6, GRID)
            for cell in held
        )
        values = values + rng.normal(size=values.shape)
        values[::15] = 0.0
        numbers = [3 * y + x - 3 for x, y in held]
        if len(held) == 1:
            head = ["timestamp", "position", "x_pos", "y_pos", "fx", "fy", "fz", "tx", "ty", "tz"]
            known = [numbers[0], *held[0], 0, 0, None, 0, 0, 0]
            name = f"position_{numbers[0]}_20250101_000000.csv"
        else:
            head = ["timestamp", "fz", "ty", "pos1_x", "pos1_y", "pos2_x", "pos2_y"]
            known = [None, 0, *held[0], *held[1]]
            name = f"multi_touch_{numbers[0]}_{numbers[1]}_20250101_000000.csv"
        columns = [-load if value is None else np.full(rows, value) for value in known]
        table = np.column_stack([1.7e9 + 0.1 * np.arange(rows), *columns, values])
        header = ",".join([*head, *magnets])
        np.savetxt(folder / name, table, delimiter=",", fmt="%.17g", header=header, comments="")


@pytest.fixture(scope="module")
def made_up(tmp_path_factory):
    root = tmp_path_factory.mktemp("eflesh") / "datasets"
    save_location(root, drift=0.5)
    save_force(root, "normal_force", 2)
    save_force(root, "shear_force", 1)
    return root


@pytest.fixture(scope="module")
def heard():
    return []


@pytest.fixture(scope="module")
def benchmark_of_all(made_up, heard):
    return bench_recordings(
        made_up, effort=LITTLE, progress=lambda what, share: heard.append(share)
    )


def rows_of(test, chips):
    """Scores of one question about places: errors under three zeros, then ratios to the first."""
    zeros = ["", ", raw: zero taken once", ", raw: zero followed"]
    errors = [(test + zero, chips, "mean_error", "mm") for zero in zeros]
    return errors + [(test + zero, chips, "ratio", "") for zero in zeros[1:]]


def test_every_test_is_scored_for_every_model(benchmark_of_all):
    rows = [(s.test, s.chips, s.metric, s.unit) for s in benchmark_of_all.scores]
    location = [
        *rows_of("held-out places", 4),
        *rows_of("held-out places", 2),
        *rows_of("held-out places, later", 4),
    ]
    force = [
        (test, 4, "rmse", "N")
        for test in ("other run", "other run", "last fifth", "last fifth", "last fifth")
    ]
    assert rows == [row for row in (*location, *force) for _ in range(3)]
    models = [score.model for score in benchmark_of_all.scores]
    assert models == ["smoskin", "ridge", "5-nearest"] * 20
    assert "shear_force: one run; not judged on another" in benchmark_of_all.notes


def test_the_figures_are_sane(benchmark_of_all):
    scores = benchmark_of_all.scores
    for ours, *others in (scores[k : k + 3] for k in range(0, len(scores), 3)):
        assert all(0 < score.value < np.inf for score in (ours, *others))
        if ours.unit == "N":
            assert ours.value < 0.3  # of 20 N
        elif ours.test == "held-out places":
            # Better than the spacing of places, the noisy chip included, and than the baselines.
            assert ours.value < 10.0 / 6
            assert ours.value < min(other.value for other in others)


def test_a_followed_zero_makes_up_for_drift_that_one_zero_does_not(benchmark_of_all):
    ours = [s for s in benchmark_of_all.scores if s.model == "smoskin" and s.chips == 4]
    once, followed = (s.value for s in ours if s.metric == "ratio" and "later" not in s.test)
    assert followed < 1.3 < once
    (note,) = [note for note in benchmark_of_all.notes if "idle readings" in note]
    assert "of 147 idle readings 0 were taken for touches, of as many presses 0 for idle" in note


def test_targets_stand_where_they_were_set(benchmark_of_all):
    targets = {(s.test, s.chips, s.metric): s.target for s in benchmark_of_all.scores if s.target}
    assert targets == {
        ("held-out places", 2, "mean_error"): 0.92,
        ("held-out places, raw: zero followed", 4, "ratio"): 1.3,
        ("held-out places, raw: zero followed", 2, "ratio"): 1.3,
        ("held-out places, later, raw: zero followed", 4, "ratio"): 1.3,
        ("other run", 4, "rmse"): 0.5,
    }


def test_a_chip_of_noise_alone_is_not_chosen(benchmark_of_all):
    (note,) = [note for note in benchmark_of_all.notes if "best 2 chips" in note]
    assert "3" not in note.split(":")[-1]


def test_progress_rises_to_the_whole(benchmark_of_all, heard):
    assert benchmark_of_all.scores
    assert heard == sorted(heard)
    assert heard[-1] == 1.0


def test_it_goes_out_as_json_and_as_a_table(benchmark_of_all):
    sent = json.loads(json.dumps(benchmark_of_all.as_json()))
    assert all(list(row) == KEYS for row in sent["results"])
    console = Console(width=250, record=True, file=None, quiet=False)
    with console.capture() as captured:
        console.print(benchmark_of_all.table())
    assert "trained on 0_probe, judged on 1_probe" in captured.get()
    assert "0.500 N" in captured.get()


def test_absent_sets_are_left_out_with_a_word(tmp_path):
    save_force(tmp_path, "normal_force", 1)
    benchmark = bench_recordings(tmp_path, effort=LITTLE)
    assert {score.set for score in benchmark.scores} == {"normal_force"}
    assert {score.test for score in benchmark.scores} == {"last fifth"}
    assert [note.split(":")[0] for note in benchmark.notes if "left out" in note] == [
        "spatial_resolution",
        "shear_force",
    ]


def test_too_little_is_left_out_with_a_word(tmp_path):
    save_location(tmp_path, side=3)
    benchmark = bench_recordings(tmp_path, effort=LITTLE)
    assert benchmark.scores == ()
    assert "spatial_resolution: 9 places; location needs 10" in benchmark.notes


def test_the_same_seed_gives_the_same_figures(tmp_path):
    save_force(tmp_path, "shear_force", 1)
    first, second = (bench_recordings(tmp_path, seed=3, effort=LITTLE) for _ in range(2))
    assert first == second


def test_wrong_use(made_up, tmp_path):
    with pytest.raises(ArgumentError, match="chips must be 1 to 4, as recorded; got 5"):
        bench_recordings(made_up, chips=5, effort=LITTLE)
    with pytest.raises(RecordingError, match="must hold one of"):
        bench_recordings(tmp_path)


@pytest.fixture(scope="module")
def touches(tmp_path_factory):
    root = tmp_path_factory.mktemp("touches") / "data"
    save_touches(root, pairs=36)
    return bench_recordings(root, effort=FittingEffort(rows=800, evidence_rows=250, iterations=12))


def test_touches_are_counted_and_placed_on_pairs_never_trained_on(touches):
    ours = {score.test: score.value for score in touches.scores if score.model == "smoskin"}
    assert ours["count of touches, 1 or 2"] > 0.97
    assert ours["both places"] < 0.1
    assert ours["one place"] < 0.1
    assert {score.split for score in touches.scores} == {
        "5 folds of 36 pairs of cells, all files of a pair together, and of fifths in time of "
        "files of 9 single cells"
    }
    assert (
        "touches: 45 files; 90 of 1350 rows were dropouts; of the rest 1080 bore"
        in (touches.notes[0])
    )


def test_a_pair_is_one_in_whichever_order_its_cells_stand(tmp_path):
    save_touches(tmp_path / "one", pairs=6)
    files = tmp_path / "one"
    first = next(files.glob("multi_touch_1_4_*.csv"))
    names, *rows = first.read_text().splitlines()
    swapped = names.replace("pos1", "posx").replace("pos2", "pos1").replace("posx", "pos2")
    (files / "multi_touch_4_1_a.csv").write_text("\n".join([swapped, *rows, ""]))
    (score, *_) = bench_recordings(files, effort=LITTLE).scores
    assert "5 folds of 6 pairs of cells" in score.split


def test_too_few_touches_are_left_out_with_a_word(tmp_path):
    save_touches(tmp_path / "data", pairs=4)
    benchmark = bench_recordings(tmp_path, effort=LITTLE)
    assert benchmark.scores == ()
    assert benchmark.notes[-1] == (
        "touches: 4 pairs of cells and 9 single cells; a test needs two cells, and 5 pairs or none"
    )


def test_single_touches_alone_are_placed_but_not_counted(tmp_path):
    save_touches(tmp_path / "data", pairs=0)
    tests = {score.test for score in bench_recordings(tmp_path, effort=LITTLE).scores}
    assert tests == {"one place"}


@given(st.lists(st.floats(-10, 10), min_size=4, max_size=4))
def test_moments_say_two_places_whatever_their_order(numbers):
    pair = np.array(numbers).reshape(2, 2)
    np.testing.assert_allclose(moments(pair), moments(pair[::-1]), atol=1e-12)
    recovered = places(moments(pair))
    ways = [np.abs(recovered - order).max() for order in (pair, pair[::-1])]
    assert min(ways) < 1e-6


def test_three_touches_in_a_file_are_refused(tmp_path):
    names = ["timestamp", "fz"] + [f"pos{k}_{a}" for k in (1, 2, 3) for a in "xy"]
    names += [f"mag0_{a}" for a in "xyz"]
    row = ",".join(["1.0", "-2.0", *"112233", "5.0", "6.0", "7.0"])
    (tmp_path / "multi_touch_1.csv").write_text(",".join(names) + f"\n{row}\n")
    with pytest.raises(RecordingError, match="must hold one or two touches"):
        bench_recordings(tmp_path)


@pytest.fixture(scope="module")
def published(recordings):
    return [s for s in bench_recordings(recordings).scores if s.model == "smoskin"]


@pytest.mark.slow
@pytest.mark.recordings
@pytest.mark.timeout(1800)
def test_every_target_is_met_on_the_published_recordings(published):
    asked = {(s.test, s.split, s.chips): (s.value, s.target) for s in published if s.target}
    assert len(asked) == 7
    missed = {question: both for question, both in asked.items() if not both[0] <= both[1]}
    assert not missed


def test_a_folder_that_is_not_there_is_refused_in_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "studies.recordings", "nowhere"],
        capture_output=True,
        text=True,
        timeout=60.0,
    )
    assert done.returncode == 1
    assert "nowhere" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("targets", [1, 2])
def test_ridge_is_least_squares_with_its_penalty_over_the_mean(targets):
    rng = np.random.default_rng(0)
    x, asked = rng.normal(size=(200, 3)), rng.normal(size=(7, 3))
    slope, level = rng.normal(size=(3, targets)), rng.normal(size=targets)
    exact = x @ slope + level
    answer = trial_module._ridge(x, exact, np.arange(200) // 20, asked, seed=0)
    assert answer.shape == (7, targets)
    np.testing.assert_allclose(answer, asked @ slope + level, rtol=1e-5, atol=1e-6)
    # Of noise alone the strongest penalty wins, which leaves little but the mean.
    noise = rng.normal(size=(200, targets)) + 5.0
    answer = trial_module._ridge(x, noise, np.arange(200) // 20, asked, seed=0)
    assert np.abs(answer - noise.mean(axis=0)).max() < 0.5
    strength = 1.0 * len(x)
    moved = x - x.mean(axis=0)
    best = np.linalg.solve(
        moved.T @ moved + strength * np.eye(3), moved.T @ (noise - noise.mean(0))
    )
    expected = (asked - x.mean(axis=0)) @ best + noise.mean(axis=0)
    np.testing.assert_allclose(answer, expected, rtol=1e-9)
