"""What is believed before a reading."""

import math

import pytest

from smoskin.errors import ArgumentError
from smoskin.sensing.bayes.priors import TouchPriors


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"drag_spread": -1e-9}, "drag_spread must be finite and >= 0 N; got -1e-09"),
        ({"drag_spread": math.inf}, "drag_spread must be finite"),
        ({"drag_spread": math.nan}, "drag_spread must be finite"),
        ({"slide": 0.0}, "slide must be positive; got 0.0 m"),
        ({"slide": math.nan}, "slide must be positive"),
        ({"chances": (0.5, 0.5, 0.5)}, "chances must add up to 1"),
        ({"chances": (0.3, 0.3, 0.3)}, "chances must add up to 1"),
        ({"chances": (0.5, 0.5, 1e-6)}, "chances must add up to 1"),
        ({"chances": (1.1, -0.1, 0.0)}, "chances must add up to 1"),
    ],
)
def test_wrong_priors_are_refused(given, words):
    with pytest.raises(ArgumentError, match=words):
        TouchPriors(**given)


def test_limits_that_are_allowed():
    straight = TouchPriors(drag_spread=0.0, slide=math.inf, chances=(0.0, 1.0, 0.0))
    assert straight.drag_spread == 0.0
    assert TouchPriors().chances == (0.5, 0.45, 0.05)
    assert (TouchPriors().drag_spread, TouchPriors().slide) == (0.3, 5e-3)
