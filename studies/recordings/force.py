"""How hard a probe pressed or dragged: on runs never trained on, and on the last fifth of a run.

Decides what a force model may see of the past. A lattice of rubber pushes back less the longer it
is held and after every load, so that one field means several forces; which memories help is chosen
within each training part, on stretches held out.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from smoskin.arrays import Bools
from smoskin.sensing.learned.courses import memories
from smoskin.sensing.learned.gaussian_process import Output
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.training import Examples
from studies.recordings.eflesh import ProbeRun
from studies.recordings.scores import Score
from studies.recordings.trial import Trial, joined

_BLOCKS: Final = 10
"""Parts of a run that count as groups, about a load cycle each."""
_TARGET: Final = 0.5
"""N, of normal force on another run."""


def score_force(trial: Trial, runs: Sequence[ProbeRun]) -> Iterator[Score]:
    """Error of the force, with whole runs and with the ends of runs held out."""
    examples = _examples(runs)
    name = runs[0].set
    if len(runs) == 1:
        trial.notes.append(f"{name}: one run; not judged on another")
    encodings = memories(range(examples.field.shape[1]))
    tests = list(_tests(runs, examples))
    for k, (test, words, trained, judged) in enumerate(tests):
        trial.report(f"{name}, {test}", k / len(tests))
        if min((examples.known & rows).sum() for rows in (trained, judged)) < 2 * _BLOCKS:
            trial.notes.append(f"{name}: {words}: too few rows with a load; left out")
            continue
        rows = judged & examples.known
        encoding = trial.encoding(examples.where(trained), encodings)
        trial.notes.append(f"{name}: {words}: {_described(encoding)}")
        answers = trial.answers(examples.where(trained | judged), rows, encoding)
        for model, answer in answers.items():
            error = answer - examples.targets[rows]
            yield Score(
                set=name,
                test=test,
                split=words,
                chips=len(encoding.chips),
                model=model,
                metric="rmse",
                value=float(np.sqrt(np.mean(error**2))),
                unit="N",
                target=_TARGET if (name, test) == ("normal_force", "other run") else None,
            )


def _tests(runs: Sequence[ProbeRun], examples: Examples) -> Iterator[tuple[str, str, Bools, Bools]]:
    """Name and split of each test, and the rows that are trained on and judged."""
    for k, run in enumerate(runs):
        this = examples.run == k
        if len(runs) > 1:
            others = ", ".join(each.name for each in runs if each is not run)
            yield "other run", f"trained on {others}, judged on {run.name}", ~this, this
    for k, run in enumerate(runs):
        this = examples.run == k
        late = this & (examples.group % _BLOCKS >= _BLOCKS - _BLOCKS // 5)
        words = f"trained on the first four fifths of {run.name}, judged on the last"
        yield "last fifth", words, this & ~late, late


def _described(encoding: Encoding) -> str:
    """What of the past a model was fed, in words."""
    times = " and ".join(f"{time:g} s" for time in encoding.time_constants)
    past = f"{encoding.past.name.lower()} against {times}" if times else "no past"
    return f"fed {encoding.form.name.lower()}, {past}"


def _examples(runs: Sequence[ProbeRun]) -> Examples:
    """Loads over time: pressing is negative z; shear is along the skin's x by convention."""
    field, run = joined([each.field_rezeroed for each in runs], [each.name for each in runs])
    load = np.concatenate([each.load for each in runs])[:, None]
    blocks = [np.arange(len(each.time)) * _BLOCKS // len(each.time) for each in runs]
    shear = runs[0].set == "shear_force"
    return Examples(
        time=np.concatenate([each.time for each in runs]),
        field=field,
        targets=load if shear else -load,
        outputs=(Output.FX if shear else Output.FZ,),
        group=np.concatenate(blocks) + _BLOCKS * run,
        run=run,
    )
