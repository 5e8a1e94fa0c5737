"""Real recordings by the doors of boards: an AnySkin's wire, and touches by hand to learn from."""

import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boards import Line
from smoskin.hardware.serial import SerialSource
from smoskin.hardware.wire.foreign import AnySkinDecoder, anyskin_frame
from smoskin.measurement import TouchTable
from smoskin.records import Estimate, Reading, Status
from smoskin.sensing.learned.courses import Course, judge_courses, learn_courses
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, Metric, Output
from smoskin.sensing.learned.inputs import Encoding, Form, Past
from smoskin.sensing.learned.touches import learn_touches
from smoskin.sensing.learned.training import Examples, FittingEffort, train_model
from studies.recordings.eflesh import ProbeRun, read_eflesh

LITTLE = FittingEffort(rows=400, evidence_rows=150, iterations=8)
FIRST = 2880
"""Readings of the first four fifths of a run of load cycles."""
ROWS = 400
"""Readings of a recording that are sent."""


def estimator_of(run: ProbeRun, *, force: bool) -> tuple[LearnedEstimator, list[Reading]]:
    """An estimator trained roughly on a run, and the run's first readings."""
    zero = (run.field - run.field_rezeroed)[0]
    chips = tuple(range(run.field.shape[1]))
    lags: dict[str, object] = {"time_constants": (3.0, 20.0), "past": Past.STRENGTH}
    examples = Examples(
        time=run.time - run.time[0],
        field=run.field - zero,
        targets=-run.load[:, None] if force else run.position[:, :2],
        outputs=(Output.FZ,) if force else (Output.X, Output.Y),
        group=np.arange(len(run.time)) // 20,
        run=np.zeros(len(run.time), dtype=int),
    )
    encoding = Encoding(chips=chips, form=Form.DIRECTION, **(lags if force else {}))
    model = train_model(examples, encoding, effort=LITTLE)
    warmth = np.full(len(chips), 25.0)
    readings = [
        Reading(time=time - run.time[0], field=field, temperature=warmth)
        for time, field in zip(run.time[:ROWS], run.field[:ROWS], strict=True)
    ]
    return LearnedEstimator(model, zero), readings


def estimates(estimator: LearnedEstimator, readings: list[Reading]) -> list[Estimate]:
    estimator.reset()
    return [estimator.step(reading) for reading in readings]


def frames(readings: list[Reading]) -> list[bytes]:
    return [anyskin_frame(reading.field, reading.temperature) for reading in readings]


@pytest.mark.parametrize("force", [False, True])
def test_estimates_are_the_same_to_the_bit(recordings: Path, force: bool) -> None:
    wanted_set = "normal_force" if force else "spatial_resolution"
    run = next(run for run in read_eflesh(recordings) if run.set == wanted_set)
    estimator, readings = estimator_of(run, force=force)
    decoder = AnySkinDecoder(run.field.shape[1])
    packets = [packet for frame in frames(readings) for packet in decoder.feed(frame)]
    assert (len(packets), decoder.corrupt) == (len(readings), 0)
    wired = [
        replace(reading, field=packet.field, temperature=packet.temperature, flags=packet.flags)
        for reading, packet in zip(readings, packets, strict=True)
    ]
    batch = estimates(estimator, readings)
    assert sum(estimate.status is Status.CONTACT for estimate in batch) > ROWS / 4
    for expected, actual in zip(batch, estimates(estimator, wired), strict=True):
        assert expected == actual
    # And the same as the whole recording at once.
    zeroed = np.stack([reading.field for reading in readings]) - (run.field - run.field_rezeroed)[0]
    encoding = estimator.model.encoding
    whole = estimator.model.predict(encoding.encode(run.time[:ROWS] - run.time[0], zeroed))
    for estimate, values in zip(batch, whole.values, strict=True):
        for contact in estimate.contacts:
            answer = contact.force[2:] if force else contact.position
            np.testing.assert_array_equal(answer, values)


def test_estimates_over_a_port_are_the_same_places(recordings: Path) -> None:
    pytest.importorskip("serial")
    run = next(run for run in read_eflesh(recordings) if run.set == "spatial_resolution")
    estimator, readings = estimator_of(run, force=False)
    with Line() as line, SerialSource(line.port, format="anyskin") as source:
        wired = []
        for frame in frames(readings):
            line.send(frame)
            reading = source.read(10.0)
            assert reading is not None
            wired.append(reading)
    batch = estimates(estimator, readings)
    for expected, actual in zip(batch, estimates(estimator, wired), strict=True):
        assert expected.status is actual.status
        for here, there in zip(expected.contacts, actual.contacts, strict=True):
            np.testing.assert_array_equal(here.position, there.position)


@pytest.mark.slow
def test_forces_over_a_port_are_the_same_by_the_times_at_which_they_come(recordings: Path) -> None:
    """What rubber remembers, by arrival times: within 0.02 N of the recording's own times."""
    pytest.importorskip("serial")
    run = next(run for run in read_eflesh(recordings) if run.set == "normal_force")
    estimator, readings = estimator_of(run, force=True)
    part = readings[70:170]  # some seconds of the first load, from 4 N on
    with Line() as line, SerialSource(line.port, format="anyskin") as source:

        def send() -> None:
            start = time.monotonic()
            for reading, frame in zip(part, frames(part), strict=True):
                due = start + reading.time - part[0].time
                time.sleep(max(0.0, due - time.monotonic()))
                line.send(frame)

        sending = threading.Thread(target=send)
        sending.start()
        wired = [source.read(10.0) for _ in part]
        sending.join()
    batch, live = estimates(estimator, part), estimates(estimator, wired)
    assert [estimate.status for estimate in live] == [estimate.status for estimate in batch]
    touched = [k for k, estimate in enumerate(batch) if estimate.contacts]
    assert len(touched) > 80
    forces = [[series[k].contacts[0].force[2] for k in touched] for series in (live, batch)]
    assert np.ptp(forces[1]) > 10.0
    # A busy machine may read a few late.
    off = np.abs(np.subtract(*forces))
    assert np.quantile(off, 0.95) < 0.02
    assert off.max() < 0.1


def sheet_of(run: ProbeRun, rows: slice = slice(None)) -> TouchTable:
    """Recorded presses, each with the idle reading before it."""
    field, zeroed, place = run.field[rows], run.field_rezeroed[rows], run.position[rows, :2]

    def turns(rest: np.ndarray, touch: np.ndarray) -> np.ndarray:
        """Rows of the rests, each with that of its touch behind it."""
        return np.stack([rest, touch], axis=1).reshape(-1, *rest.shape[1:])

    force = np.tile([0.0, 0.0, -1.0], (len(field), 1))
    return TouchTable(
        position=turns(np.full_like(place, np.nan), place),
        force=turns(0.0 * force, force),
        field=turns(field - zeroed, field),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("chips", "most"), [(None, 0.40e-3), ((3, 4), 0.80e-3)])
def test_a_sheet_of_recorded_touches_is_learned_as_well_as_the_recording(
    recordings: Path, chips: tuple[int, ...] | None, most: float
) -> None:
    run = next(run for run in read_eflesh(recordings) if run.set == "spatial_resolution")
    learned = learn_touches([sheet_of(run)], chips=chips)
    figures = {metric.name: metric.value for metric in learned.metrics}
    assert figures["mean_error"] < most
    assert 0.85 < figures["inside_90_percent_region"] < 0.95


def course_of(run: ProbeRun) -> Course:
    """A recorded run of load cycles at one place, each with a zero of its own."""
    force = np.where(np.isnan(run.load), np.nan, np.zeros((3, len(run.time)))).T
    force[:, 2] = run.load
    place = np.full((len(run.time), 2), np.nan)
    return Course(
        time=run.time - run.time[0], field=run.field_rezeroed, position=place, force=force
    )


def by_name(metrics: tuple[Metric, ...]) -> dict[str, float]:
    return {metric.name: metric.value for metric in metrics}


@pytest.mark.slow
@pytest.mark.parametrize(("chips", "most"), [(None, (0.33, 0.43)), ((3, 4), (0.29, 0.43))])
def test_force_is_learned_with_its_past_and_holds_on_another_run(
    recordings: Path, chips: tuple[int, ...] | None, most: tuple[float, float]
) -> None:
    runs = [course_of(run) for run in read_eflesh(recordings) if run.set == "normal_force"]
    for own, other, limit in zip(runs, runs[::-1], most, strict=True):
        learned = learn_courses([own], chips=chips)
        figures = by_name(judge_courses(learned, [other]))
        assert figures["rmse_fz"] < limit
        assert 0.85 < figures["inside_90_percent_range_fz"] < 0.95
        assert by_name(learned.metrics)["rmse_fz"] < 0.2


@pytest.mark.slow
@pytest.mark.parametrize(("chips", "most"), [(None, 0.95), ((3, 4), 0.98)])
def test_ranges_of_force_hold_later_in_the_session_that_was_learned(
    recordings: Path, chips: tuple[int, ...] | None, most: float
) -> None:
    """The last fifth of either run, with what was read before it, by the force before it.

    Two chips are stated too wide: the first run's last fifth is its easiest.
    """
    inside = []
    for run in read_eflesh(recordings):
        if run.set == "normal_force":
            whole, late = course_of(run), (np.arange(len(run.time)) >= FIRST)[:, None]
            before = replace(whole, force=np.where(late, np.nan, whole.force))
            learned = learn_courses([before], chips=chips)
            age = -float(whole.time[np.isfinite(before.force[:, 2])].mean())
            rest = replace(whole, force=np.where(late, whole.force, np.nan))
            figures = by_name(judge_courses(learned, [rest], age=age))
            inside.append(figures["inside_90_percent_range_fz"])
            assert figures["rmse_fz"] < 0.19
    assert 0.85 < np.mean(inside) < most
