"""Which of several encodings suits examples: the one that errs least on stretches not trained on.

Decides what is held out for the choice: parts of each run, consecutive in time.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from smoskin.arrays import Ints
from smoskin.errors import ArgumentError
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.training import Examples, FittingEffort, train_model

_STRETCHES: Final = 3
"""Parts of a run that are held out in turn."""


def choose_encoding(
    examples: Examples,
    encodings: Sequence[Encoding],
    *,
    seed: int = 0,
    effort: FittingEffort | None = None,
) -> Encoding:
    """The encoding that errs least on stretches of time that training did not see.

    Parameters
    ----------
    examples : Examples
        Examples of one run or several, each of at least three groups one after the other.
    encodings : sequence of Encoding
        Encodings to choose from; the first of equals is taken.
    seed : int, optional
        Seed of each training.
    effort : FittingEffort, optional
        Effort of each training, of which there are three for every encoding.

    Raises
    ------
    ArgumentError
        If there is no encoding, or no group to hold out.

    Notes
    -----
    A third of each run's groups, consecutive in time, is held out in turn. The first group of a
    run is always trained on: histories start empty there, as they do wherever a model is used.
    """
    if not encodings:
        raise ArgumentError("encodings must hold at least one; got none")
    if len(encodings) == 1:
        return encodings[0]
    stretch = _stretches(examples)
    held = [stretch == k for k in range(_STRETCHES) if (stretch == k).any()]
    if len(held) < 2:
        raise ArgumentError("examples must hold runs of at least three groups with known answers")

    def error(encoding: Encoding) -> float:
        inputs = examples.encode(encoding)
        errors = []
        for rows in held:
            model = train_model(examples.where(~rows), encoding, seed=seed, effort=effort)
            miss = model.predict(inputs[rows]).values - examples.targets[rows]
            errors.append(np.sqrt((miss**2).mean(axis=0)))
        return float((np.mean(errors, axis=0) / np.nanstd(examples.targets, axis=0)).mean())

    return min(encodings, key=error)


def _stretches(examples: Examples) -> Ints:
    """Which stretch of its run a row with a known answer belongs to; -1 is never held out."""
    stretch = np.full(len(examples.time), -1)
    for run in np.unique(examples.run):
        rows = np.flatnonzero((examples.run == run) & examples.known)
        groups, first, member = np.unique(
            examples.group[rows], return_index=True, return_inverse=True
        )
        order = np.argsort(np.argsort(first))[member.reshape(-1)]
        stretch[rows] = (order - 1) * _STRETCHES // max(len(groups) - 1, 1)
    return stretch
