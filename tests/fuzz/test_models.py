"""Tables, networks, learned models and calibrations as disks spoil them: the same, or refused."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from fuzzing import broken, cases, changed_toml, check_error, mutated, working_folder
from learned_examples import presses
from networks import random_network
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, ModelError
from smoskin.origami.geometry import geometry
from smoskin.outputs import sealed
from smoskin.records import Reading
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.calibration import (
    Calibration,
    Evidence,
    ResidualSummary,
    Uncertainty,
    format_calibration,
    read_calibration,
)
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import load_estimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, LearnedModel, load_model
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.training import FittingEffort, train_model
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import NetworkModel, load_network
from smoskin.sensing.response.table import ResponseTable, load_response_table
from tables_of_response import random_table, reduced_table

DESIGN = read_design("planar")
NAME = "m.bin"
EXTENT = geometry(DESIGN).extent
WILD = (0.0, -1.0, 1e-300, 1e30, -1e30, 1e300, np.nan, np.inf)


class Kind(NamedTuple):
    """A kind of file: what is written, and how it is written and read."""

    content: Any
    write: Callable[[Any, str], None]
    read: Callable[[str], Any]


def calibration() -> Calibration:
    """A calibration with everything that one can have."""
    nominal = Calibration.nominal(DESIGN)
    rows = len(DESIGN.coefficients.folding_correction_x)
    chips = len(DESIGN.halls)
    uncertainty = Uncertainty(
        attenuation=(0.01, 0.02),
        stiffness_variation=0.1,
        folding_correction_x=(0.3,) * rows,
        folding_correction_y=(float("nan"),) * len(DESIGN.coefficients.folding_correction_y),
        board_stiffness=12.5,
        sheet_stiffness=13.5,
        chip_rotation=((0.01, 0.02, 0.03),) * chips,
        field_factor=(0.01,) * chips,
        field_offset=((1e-6, 2e-6, 3e-6),) * chips,
    )
    evidence = Evidence(
        date="2026-01-31",
        data_sha256="0" * 64,
        touches=60,
        freedom=300,
        uncertainty=uncertainty,
        residuals=(ResidualSummary(group="force_z", unit="N", values=60, rms=0.02),),
    )
    return replace(nominal, field_factor=(1.01, 0.99, 1.02), evidence=evidence)


def learned() -> LearnedModel:
    examples = presses(passes=1, side=5)
    return train_model(examples, Encoding(chips=(0, 1, 2)), effort=FittingEffort(iterations=1))


@pytest.fixture(scope="module")
def kinds() -> dict[str, Kind]:
    """All kinds of files that hold what was learned of a skin."""

    def save(record: Any, path: str) -> None:
        record.save(path)

    def save_text(record: Calibration, path: str) -> None:
        Path(path).write_text(sealed(format_calibration(record)), encoding="utf-8")

    return {
        "table": Kind(random_table(modes=1, chips=(0, 1)), save, load_response_table),
        "network": Kind(random_network(), save, load_network),
        "learned": Kind(learned(), save, load_model),
        "calibration": Kind(calibration(), save_text, lambda p: read_calibration(p, DESIGN)),
    }


def same(mine: Any, its: Any) -> bool:
    """Whether two records hold the same to the last bit."""
    if is_dataclass(mine) and type(mine) is type(its):
        return all(same(getattr(mine, f.name), getattr(its, f.name)) for f in fields(mine))
    if isinstance(mine, np.ndarray):
        return np.array_equal(mine, its, equal_nan=True)
    if isinstance(mine, tuple):
        return len(mine) == len(its) and all(map(same, mine, its))
    return bool(mine == its or (mine != mine and its != its))


def same_or_refused(kind: Kind, content: bytes, whole: Any) -> None:
    """A spoilt file is what it was, or a model's error by name."""
    Path(NAME).write_bytes(content)
    try:
        read = kind.read(NAME)
    except ModelError as error:
        check_error(error, NAME)
    else:
        assert same(read, whole), "read, but it is another"
    try:
        load_estimator(NAME, DESIGN)
    except (ModelError, ArgumentError) as error:
        check_error(error)


@pytest.mark.parametrize("name", ["table", "network", "learned", "calibration"])
@cases(6, 350)
def test_a_spoilt_file_is_the_same_or_refused(count, name, kinds, tmp_path):
    kind = kinds[name]

    def drawn():
        rng = np.random.default_rng(3)
        kind.write(kind.content, NAME)
        raw, whole = Path(NAME).read_bytes(), kind.read(NAME)
        for k in range(count):
            if name == "calibration" and k % 2:
                what, text = changed_toml(raw.decode(), rng)
                content = text.encode()
            else:
                what, content = mutated(raw, rng)
            yield f"{k}: {what}", partial(same_or_refused, kind, content, whole)

    with working_folder(tmp_path):
        assert broken(drawn()) == []


def numbers_of(record: Any) -> dict[str, np.ndarray]:
    """Numbers of a record by their field."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return {
        name: np.array(value, float)
        for name, value in values.items()
        if isinstance(value, np.ndarray | float) or (isinstance(value, tuple) and numeric(value))
    }


def numeric(value: Any) -> bool:
    """Whether a tuple holds floats, or tuples of floats."""
    flat = [part for row in value for part in (row if type(row) is tuple else (row,))]
    return bool(flat) and all(type(part) is float for part in flat)


def spoil(record: Any, rng: np.random.Generator) -> tuple[str, Callable[[], Any]]:
    """A record with one of its numbers, or all of a field, wild."""
    numbers = numbers_of(record)
    name, wild = str(rng.choice(list(numbers))), float(rng.choice(WILD))
    value = numbers[name]
    if rng.random() < 0.5 or not value.size:
        value[...] = wild
        what = f"all {name} = {wild}"
    else:
        at = int(rng.integers(value.size))
        value.flat[at] = wild
        what = f"{name}[{at}] = {wild}"
    given = getattr(record, name)
    if isinstance(given, float):
        spoilt: Any = value.item()
    elif isinstance(given, tuple):
        spoilt = tuple(tuple(row) if value.ndim > 1 else row for row in value.tolist())
    else:
        spoilt = value
    return what, partial(replace, record, **{name: spoilt})


def answers(record: Any) -> None:
    """An estimator of a wild model refuses it, or answers readings by what can be."""
    rng = np.random.default_rng(5)
    match record:
        case ResponseTable():
            estimator: Any = BayesEstimator(DESIGN, record)
        case NetworkModel():
            estimator = NetworkEstimator(DESIGN, record)
        case LearnedModel():
            estimator = LearnedEstimator(record)
        case _:
            estimator = ClosedFormEstimator(DESIGN, record)
    zero = 1e-3 * rng.normal(size=(3, 3))
    estimator.zero([Reading(time=0.0, field=zero)])
    for k in range(6):
        field = zero + 10.0 ** -(2 + k) * rng.normal(size=(3, 3))
        estimate = estimator.step(Reading(time=1.0 + k, field=field, temperature=[30.0] * 3))
        for contact in estimate.contacts:
            assert np.isfinite(contact.position).all()
            assert not np.isinf(contact.force).any()
            if not isinstance(record, LearnedModel):  # which knows no skin
                outside = np.abs(contact.position - EXTENT / 2) - EXTENT / 2
                assert outside.max() < 0.01, f"{contact.position} m is off the skin"


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that no file of ours holds
@cases(8, 400)
def test_a_wild_model_is_refused_or_answers_by_what_can_be(count, kinds):
    network = random_network(chips=(0, 1, 2), design_hash=DESIGN.content_hash)
    others = [network, kinds["learned"].content, kinds["calibration"].content]
    models = [reduced_table(DESIGN), *others, *others, *others]

    def case(make: Callable[[], Any]) -> None:
        try:
            answers(make())
        except (ModelError, ArgumentError) as error:
            check_error(error)

    def drawn():
        rng = np.random.default_rng(4)
        for k in range(count):
            what, make = spoil(models[k % len(models)], rng)
            yield f"{k}: {type(models[k % len(models)]).__name__} {what}", partial(case, make)

    assert broken(drawn()) == []
