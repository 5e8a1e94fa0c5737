"""How well learned estimators do on recordings of real chips, told without leaks.

Decides what is asked of which recording. Splits are by place, by run and by time, never by row,
and whatever is chosen (chips, encodings, the ridge) is chosen inside the training part. Ridge
regression and nearest neighbours stand beside the package's own model. Each question has a module.
"""

from collections.abc import Sequence
from pathlib import Path

from smoskin.roles import Progress, unheard
from smoskin.sensing.learned.training import FittingEffort
from studies.recordings.eflesh import EFLESH_SETS, ProbeRun, read_recordings
from studies.recordings.force import score_force
from studies.recordings.location import score_location
from studies.recordings.scores import Benchmark, Score
from studies.recordings.touches import score_touches
from studies.recordings.trial import Trial

__all__ = ["Benchmark", "Score", "bench_recordings"]


def bench_recordings(
    directory: Path | str,
    *,
    chips: int | None = None,
    seed: int = 0,
    effort: FittingEffort | None = None,
    progress: Progress = unheard,
) -> Benchmark:
    """Train and judge on the recordings under a folder.

    Parameters
    ----------
    directory : Path or str
        As `studies.recordings.eflesh.read_recordings` takes it.
    chips : int, optional
        Location is judged with all chips and with the best this many; two by default.
    seed : int, optional
        Of folds and training.
    effort : FittingEffort, optional
        Of each training.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Returns
    -------
    Benchmark

    Raises
    ------
    RecordingError
        If the recordings cannot be read.
    ArgumentError
        If there are not that many chips.
    """
    probed, touched = read_recordings(directory)
    trial = Trial(seed, effort or FittingEffort(), progress)
    scores: list[Score] = []
    sets = EFLESH_SETS if probed else ()
    questions = len(sets) + bool(touched)
    for position, name in enumerate(sets):
        trial.share = (position / questions, 1 / questions)
        members = [run for run in probed if run.set == name]
        if members:
            scores.extend(_score_set(trial, members, chips))
        else:
            trial.notes.append(f"{name}: not in {directory}; left out")
    if touched:
        trial.share = (len(sets) / questions, 1 / questions)
        scores.extend(score_touches(trial, touched))
    trial.progress("done", 1.0)
    return Benchmark(scores=tuple(scores), notes=tuple(trial.notes))


def _score_set(trial: Trial, runs: Sequence[ProbeRun], chips: int | None) -> list[Score]:
    """Scores of one set of the eFlesh characterisation."""
    if runs[0].set == "spatial_resolution":
        return list(score_location(trial, runs, chips))
    return list(score_force(trial, runs))
