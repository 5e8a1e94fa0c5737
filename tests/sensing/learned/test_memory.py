"""The choice among encodings: what errs least on stretches of time that training did not see."""

from dataclasses import replace

import numpy as np
import pytest

from learned_examples import cycles
from smoskin.errors import ArgumentError
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.memory import choose_encoding
from smoskin.sensing.learned.training import FittingEffort

LITTLE = FittingEffort(rows=200, evidence_rows=80, iterations=8)


def test_the_encoding_that_knows_what_matters_is_chosen():
    examples = cycles(runs=1)
    chips = (0, 2)
    blind, seeing, other = (
        Encoding(chips=chips, time_constants=times) for times in ((), (1.0,), (50.0,))
    )
    for order in ((blind, seeing, other), (other, seeing, blind)):
        assert choose_encoding(examples, order, effort=LITTLE) is seeing
    assert choose_encoding(examples, (blind,), effort=LITTLE) is blind


def test_rows_without_an_answer_and_other_runs_have_no_say_in_the_choice():
    examples = cycles(runs=2)
    wrong = np.where(examples.run[:, None] == 1, np.nan, examples.targets)
    encodings = [Encoding(chips=(0, 2), time_constants=times) for times in ((), (1.0,))]
    assert (
        choose_encoding(replace(examples, targets=wrong), encodings, effort=LITTLE)
        is (encodings[1])
    )


def test_nothing_to_choose_from_is_refused():
    examples = cycles(runs=1)
    two = [Encoding(chips=(0,)), Encoding(chips=(1,))]
    with pytest.raises(ArgumentError, match="encodings must hold at least one; got none"):
        choose_encoding(examples, [])
    with pytest.raises(ArgumentError, match="runs of at least three groups"):
        choose_encoding(replace(examples, group=np.minimum(examples.group, 1)), two)
