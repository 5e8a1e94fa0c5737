"""Streams of whatever chips and buses may send, through every estimator."""

from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzzing import broken, cases, check_error
from learned_examples import presses
from networks import random_network
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.learned.gaussian_process import LearnedEstimator
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.training import FittingEffort, train_model
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import reduced_table

DESIGN = read_design("planar")
EXTENT = geometry(DESIGN).extent
WILD = st.sampled_from([0.0, -0.0, np.nan, np.inf, -np.inf, 1e300, -1e308, 5e-324, 1e-3, 1.0, 1e9])
NUMBER = st.one_of(st.floats(-0.05, 0.05), WILD)
DEGREES = st.one_of(st.floats(-60, 120), WILD, st.just(-273.15))
STEP = st.one_of(st.floats(0.001, 0.1), st.sampled_from([0.0, -1.0, -1e9, 1e9, 1e300, -1e300]))
FAULTS = ("none", "field", "one", "temperature", "flags", "frozen", "rail", "swapped", "offset")


@cache
def twin_readings() -> tuple[np.ndarray, ...]:
    """Fields of the skin at rest and under touches."""
    twin = ReducedTwin(DESIGN, seed=3)
    rng = np.random.default_rng(8)
    touches = [[], []]
    for _ in range(10):
        place, force = rng.uniform(0, EXTENT), (*rng.uniform(-0.2, 0.2, 2), -rng.uniform(0.1, 1))
        touches.append([Contact(position=place, force=force)])
    return tuple(twin.read(contacts).field for contacts in touches)


@st.composite
def streams(draw: Any) -> list[Reading]:
    """Some readings of a touched skin, most of them spoilt."""
    time, made = draw(st.sampled_from([0.0, 5.0, -1e9, 1e12])), []
    fields = twin_readings()
    for _ in range(draw(st.integers(1, 6))):
        field = fields[draw(st.integers(0, len(fields) - 1))].copy()
        degrees, flags = np.full(3, 25.0), np.zeros(3, int)
        chip = draw(st.integers(0, 2))
        match draw(st.sampled_from(FAULTS)):
            case "field":
                field[...] = draw(st.lists(NUMBER, min_size=9, max_size=9).map(np.array)).reshape(
                    3, 3
                )
            case "one":
                field[chip, draw(st.integers(0, 2))] = draw(NUMBER)
            case "temperature":
                degrees[chip] = draw(DEGREES)
            case "flags":
                flags[chip] = draw(st.integers(-(2**62), 2**62) | st.sampled_from([1, 2, 4, 8, 16]))
            case "frozen":
                field[chip] = fields[0][chip]
            case "rail":
                field[chip] = draw(st.sampled_from([-0.05, 0.05]))
            case "swapped":
                field = field[[1, 2, 0]]
            case "offset":
                field += draw(st.floats(-1e-2, 1e-2))
        time += draw(STEP)
        made.append(Reading(time=time, field=field, temperature=degrees, flags=flags))
    return made


@cache
def estimators() -> dict[str, Estimator]:
    """Estimators of the skin, of all kinds; `reset` makes them new."""
    network = random_network(chips=(0, 1, 2), design_hash=DESIGN.content_hash)
    chips = Encoding(chips=(0, 1, 2))
    learned = train_model(presses(passes=1, side=5), chips, effort=FittingEffort(iterations=1))
    closed = ClosedFormEstimator(DESIGN)
    return {
        "closed": closed,
        "bayes": BayesEstimator(DESIGN, reduced_table(DESIGN)),
        "network": NetworkEstimator(DESIGN, network),
        "learned": LearnedEstimator(learned),
        "zero first": ZeroFirst(closed, count=2),
    }


def check_stream(estimator: Estimator, stream: list[Reading], zeroed: bool) -> None:
    """Every reading has an answer that can be: finite, on the skin, with a covariance that fits."""
    estimator.reset()
    if zeroed:
        try:
            estimator.zero(stream[:1])
        except ArgumentError as error:
            check_error(error)
    for reading in stream:
        estimate = estimator.step(reading)
        assert estimate.time == reading.time
        assert isinstance(estimate.status, Status)
        assert not estimate.contacts or estimate.status in (Status.CONTACT, Status.AMBIGUOUS)
        for contact, spread in zip(estimate.contacts, estimate.covariance, strict=True):
            outside = np.abs(contact.position - EXTENT / 2) - EXTENT / 2
            assert outside.max() < 1e-9, f"{estimate.status.name} at {contact.position} m"
            assert not np.isinf(contact.force).any()
            assert np.linalg.norm(np.nan_to_num(contact.force)) < 50.0, f"{contact.force} N"
            assert not np.isinf(spread).any()
            assert (np.nan_to_num(np.diag(spread)) >= 0).all()
        bad = (reading.flags & 23).any() or not np.isfinite(reading.field).all()
        assert not (bad and estimate.contacts), f"{estimate.status.name} of a bad reading"


@pytest.mark.parametrize("kind", ["closed", "bayes", "network", "learned", "zero first"])
@cases(4, 160)
def test_every_stream_is_answered(kind, count):
    @settings(
        max_examples=count,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(stream=streams(), zeroed=st.booleans())
    def answered(stream: list[Reading], zeroed: bool) -> None:
        answers = partial(check_stream, estimators()[kind], stream, zeroed)
        assert broken([(kind, answers)]) == []

    answered()
