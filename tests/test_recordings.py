"""The benchmark on recordings: made-up ones of the same layout, then the real ones."""

import json

import numpy as np
import pytest
from rich.console import Console

from smoskin.apps.recordings import bench_recordings
from smoskin.errors import ArgumentError, RecordingError
from smoskin.sensing.training import Effort

LITTLE = Effort(rows=300, evidence_rows=100, iterations=8)
CHIPS = np.array([[0.0, 0.0], [10.0, 0.0], [5.0, 10.0], [400.0, 400.0]])
"""mm; the last is far away."""


def field(place, depth):
    """uT: of a press at (T, 2) mm, flat over chips and axes; two chips are needed to tell where."""
    away = np.concatenate(
        [place[:, None, :] - CHIPS, np.full((len(place), len(CHIPS), 1), 6.0)], axis=2
    )
    fall = np.linalg.norm(away, axis=2, keepdims=True) ** 3
    away[:, :, 2] = 0.0
    return (4e4 * depth[:, None, None] * away / fall).reshape(len(place), -1)


def save(folder, time, values, states):
    folder.mkdir(parents=True)
    tables = {
        "sensor": np.column_stack([time, values + 900.0]),
        "sensor_post_baselines": np.column_stack([time, values]),
        "states": np.column_stack([time, states]),
    }
    for name, table in tables.items():
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", fmt="%.6f")


def save_location(root, side=7):
    rng = np.random.default_rng(0)
    axis = np.linspace(0.0, 10.0, side)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    place = np.tile(grid, (3, 1))
    values = field(place, rng.uniform(1, 2, len(place))) + rng.normal(size=(len(place), 12))
    values[:, 9:] = 300.0 * rng.normal(size=(len(place), 3))
    states = np.column_stack([place, np.zeros(len(place))])
    save(root / "spatial_resolution" / "1_probe", 4.0 * np.arange(len(place)), values, states)


def save_force(root, name, runs):
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 40.0, 0.1)
    depth = np.sin(time * np.pi / 4) ** 2
    for k in range(runs):
        values = field(np.full((400, 2), 5.0), depth) + rng.normal(size=(400, 12))
        load = np.where(np.arange(400) % 2, -1.0, 2000.0 * depth**1.5)
        states = np.column_stack([np.zeros((400, 3)), load])
        save(root / name / f"{k}_probe", 100.0 * k + time, values, states)


@pytest.fixture(scope="module")
def made_up(tmp_path_factory):
    root = tmp_path_factory.mktemp("eflesh") / "datasets"
    save_location(root)
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


def test_every_test_is_scored_for_every_model(benchmark_of_all):
    rows = [(s.set, s.test, s.chips, s.metric, s.unit) for s in benchmark_of_all.scores]
    location = [
        ("spatial_resolution", "held-out places", chips, "mean_error", "mm") for chips in (4, 2)
    ]
    normal = [
        ("normal_force", test, 4, "rmse", "N")
        for test in ("other run", "other run", "last fifth", "last fifth")
    ]
    shear = [("shear_force", "last fifth", 4, "rmse", "N")]
    assert rows == [row for row in (*location, *normal, *shear) for _ in range(3)]
    models = [score.model for score in benchmark_of_all.scores]
    assert models == ["smoskin", "ridge", "5-nearest"] * 7
    assert "shear_force: one run; not judged on another" in benchmark_of_all.notes


def test_the_figures_are_sane(benchmark_of_all):
    scores = benchmark_of_all.scores
    for ours, *others in (scores[k : k + 3] for k in range(0, len(scores), 3)):
        assert all(0 < score.value < np.inf for score in (ours, *others))
        if ours.unit == "N":
            assert ours.value < 0.3  # of 20 N
        else:
            # Better than the spacing of places, the noisy chip included, and than the baselines.
            assert ours.value < 10.0 / 6
            assert ours.value < min(other.value for other in others)


def test_a_chip_of_noise_alone_is_not_chosen(benchmark_of_all):
    (note,) = [note for note in benchmark_of_all.notes if "best 2 chips" in note]
    assert "3" not in note.split(":")[-1]


def test_progress_rises_to_the_whole(benchmark_of_all, heard):
    assert benchmark_of_all.scores
    assert heard == sorted(heard)
    assert heard[-1] == 1.0


def test_it_goes_out_as_json_and_as_a_table(benchmark_of_all):
    sent = json.loads(json.dumps(benchmark_of_all.as_json()))
    keys = ["set", "test", "split", "chips", "model", "metric", "value", "unit"]
    assert all(list(row) == keys for row in sent["results"])
    console = Console(width=250, record=True, file=None, quiet=False)
    with console.capture() as said:
        console.print(benchmark_of_all.table())
    assert "trained on 0_probe, judged on 1_probe" in said.get()


def test_absent_sets_are_left_out_with_a_word(tmp_path):
    save_force(tmp_path, "normal_force", 1)
    found = bench_recordings(tmp_path, effort=LITTLE)
    assert {score.set for score in found.scores} == {"normal_force"}
    assert {score.test for score in found.scores} == {"last fifth"}
    assert [note.split(":")[0] for note in found.notes] == [
        "spatial_resolution",
        "normal_force",
        "shear_force",
    ]


def test_too_little_is_left_out_with_a_word(tmp_path):
    save_location(tmp_path, side=3)
    found = bench_recordings(tmp_path, effort=LITTLE)
    assert found.scores == ()
    assert "spatial_resolution: 9 places; location needs 10" in found.notes


def test_the_same_seed_gives_the_same_figures(tmp_path):
    save_force(tmp_path, "shear_force", 1)
    one, other = (bench_recordings(tmp_path, seed=3, effort=LITTLE) for _ in range(2))
    assert one == other


def test_wrong_use(made_up, tmp_path):
    with pytest.raises(ArgumentError, match="chips must be 1 to 4, as recorded; got 5"):
        bench_recordings(made_up, chips=5, effort=LITTLE)
    with pytest.raises(RecordingError, match="must hold one of"):
        bench_recordings(tmp_path)


@pytest.mark.slow
@pytest.mark.recordings
@pytest.mark.timeout(900)
def test_the_published_recordings(recordings):
    scores = bench_recordings(recordings).scores
    ours = [score for score in scores if score.model == "smoskin"]
    location = {score.chips: score.value for score in ours if score.unit == "mm"}
    assert location[5] <= 0.42
    assert location[2] <= 0.92
    force = [score.value for score in ours if score.test == "other run"]
    assert len(force) == 2
    assert max(force) <= 0.65
