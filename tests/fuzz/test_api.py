"""Wrong arguments of the public functions and classes: refused by one of the package's errors."""

import contextlib
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import partial
from itertools import cycle, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import smoskin as smo
from fuzzing import Began, broken, check_error, working_folder
from learned_examples import presses
from networks import random_network
from smoskin.errors import SmoskinError
from smoskin.roles import Source
from smoskin.sensing.learned.inputs import Encoding
from smoskin.sensing.learned.training import FittingEffort
from smoskin.sensing.network import training
from tables_of_response import random_table

QUICK = FittingEffort(iterations=1)
WILD: tuple[Any, ...] = (
    *(None, 0, -1, 1e300, 10**400, float("nan"), float("inf"), True, 1j, b"x", object(), len),
    *("", "x", "1", "\x1b[2J", "ß" * 1000, Path("none"), [], [1], [[1, 2], [3]], {}, (), {"a": 1}),
    *(np.zeros((2, 2)), np.full((3, 3), np.nan), np.ones((3, 3)) * 1j, np.array(["a"]), [object()]),
    *(np.full((3, 3), 1e300), np.zeros((0, 3)), np.zeros((3, 3, 3)), np.zeros(3, bool)),
)


class Readings(Source):
    """A source of one reading, over and over."""

    chips = 3

    def __init__(self, reading: Any) -> None:
        self._coming = cycle([reading, None])

    def read(self, timeout: float = 1.0) -> Any:
        return next(self._coming)

    def close(self) -> None:
        pass


def begin(*_: object) -> None:
    """Stand for work of minutes, or listen to it."""
    raise Began


def recorded(reading: Any, **arguments: Any) -> None:
    """A recording of a reading, wherever it is."""
    with smo.Recorder(**arguments) as recorder:
        recorder.write(reading)
    Path(arguments["path"]).unlink()


def looped(call: Callable[..., Any], **arguments: Any) -> None:
    """All estimates of a loop."""
    assert len(list(call(**arguments))) == 1


def running(design: Any) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Estimators, rigs, loops and long work with arguments that are right."""
    twin, table = smo.ReducedTwin(design, seed=0), smo.load_response_table("planar")
    network = random_network(chips=(0, 1, 2), design_hash=design.content_hash)
    learned = smo.train_model(presses(passes=1, side=5), Encoding(chips=(0, 1, 2)), effort=QUICK)
    closed, reading = smo.ClosedFormEstimator(design), twin.read()
    made = {
        "closed": closed,
        "bayes": smo.BayesEstimator(design, table),
        "network": smo.NetworkEstimator(design, network),
        "learned": smo.LearnedEstimator(learned),
        "zero first": smo.ZeroFirst(smo.ClosedFormEstimator(design)),
    }
    known: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {}
    for kind, estimator in made.items():
        known[f"{kind}.step"] = estimator.step, {"reading": reading}
        known[f"{kind}.zero"] = estimator.zero, {"readings": [reading] * 3, "force": True}
    common = {"tracking": None, "creep": None, "false_alarms": 1e-6}
    rig, contact = smo.VirtualRig(twin), smo.Contact(position=(0.05, 0.06), force=(0, 0, -0.5))
    spoilt = {"drift": 0.0, "stage": 1e-5, "gauge": 1e-3, "seed": 0, "temperature": 25.0}
    touch, hooks = rig.press(contact), {"progress": begin}
    source = {"source": Readings(reading), "estimator": closed, "sinks": (), "deadline": 1.0}
    asked = {"touches": rig, "design": design, "count": 2, "until": 0.0, "force": 0.8, "drag": 0.3}
    sizes = {"place_spread": 1e-4, "force_spread": 1e-2, "recording": None, "accept_bad_fit": True}
    training = {"minutes": 1.0, "seed": 0, "design": design, "chips": None, "drag": 0.0}
    exam = {"skins": [1], "touches": 5, "count": 5, "places": None, "chips": None, "pairs": 0}
    world = {"world": "plain", "effect": None, "contact": None, "out": None, "drag": 0.0}
    return known | {
        "ZeroFirst": (smo.ZeroFirst, {"estimator": closed, "count": 20}),
        "load_estimator": (
            smo.load_estimator,
            {"path": "none", "design": design, "uncalibrated": True},
        ),
        "ClosedForm": (
            smo.ClosedFormEstimator,
            {"design": design, "known": None, "idle_field": 4e-5, "least_confidence": 0.5},
        ),
        "Bayes": (smo.BayesEstimator, {"design": design, "table": table, "priors": None, **common}),
        "Network": (smo.NetworkEstimator, {"design": design, "model": network, **common}),
        "Learned": (
            smo.LearnedEstimator,
            {"model": learned, "zero": None, "tracking": None, "idle_field": 4e-5},
        ),
        "Recorder": (
            partial(recorded, reading),
            {"path": "r.mcap", "design": design, "flush_interval": 1.0},
        ),
        "VirtualRig": (smo.VirtualRig, {"skin": twin, "rng": None, "creep": True, **spoilt}),
        "VirtualRig.press": (rig.press, {"contact": contact, "timeout": 30.0}),
        "HeldTouch": (
            smo.records.HeldTouch,
            {name: getattr(touch, name) for name in ("contact", "readings", "rest", "held")},
        ),
        "Loop": (partial(looped, smo.Loop), source),
        "run": (partial(looped, smo.run), source),
        "calibrate": (partial(smo.calibrate, **hooks), {"table": table, **asked, **sizes}),
        "train": (partial(smo.train, **hooks), {"table": table, "members": 1, **training}),
        "make_table": (
            partial(smo.make_table, **hooks),
            {"design": design, "effort": None, "tolerances": None, "folder": None, "engine": None},
        ),
        "score": (
            partial(smo.score, **hooks),
            {"file_or_model": table, "design": design, **exam, **world},
        ),
        "Twin.read": (twin.read, {"contacts": [contact], "time": 0.0, "temperature": 25.0}),
        **skins(design, twin, contact),
    }


def skins(design: Any, twin: Any, contact: Any) -> dict[str, tuple[Callable[..., Any], Any]]:
    """Designs, skins made of them, what chips read of their motion, and a training on examples."""
    examples = presses(passes=1, side=5)
    motion = twin.motion([contact])
    parts = {field.name: getattr(design, field.name) for field in fields(design)}
    records = [part for part in parts.values() if is_dataclass(part)]
    records += [design, design.magnets[0], design.halls[0]]
    world = {"contact": None, "surroundings": None, "deviations": None}
    made = {"manufactured": False, "tolerances": None, "grip": None, **world}
    taught = {"seed": 0, "effort": QUICK, "place": (0.0, 0.0), "touch_field": 3e-5}
    learned = {"examples": examples, "encoding": Encoding(chips=(0, 1, 2)), **taught}
    sample = {"motion": motion, "rng": np.random.default_rng(0), "temperature": 25.0}
    return {
        **{
            type(record).__name__: (
                type(record),
                {field.name: getattr(record, field.name) for field in fields(record)},
            )
            for record in records
        },
        "ReducedTwin": (smo.ReducedTwin, {"design": design, "seed": 0, "deviations": None}),
        "Twin": (smo.Twin, {"design": design, "seed": 0, **made}),
        "train_model": (partial(smo.train_model, progress=begin), learned),
        "Twin.motion": (twin.motion, {"contacts": [contact], "temperature": 25.0}),
        "Twin.sample": (twin.sample, {**sample, "around": None}),
    }


def calls(design: Any) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Public functions and classes with arguments that are right."""
    field, push = np.zeros((3, 3)), (0.0, 0.0, -0.5)
    contact = smo.Contact(position=(0.05, 0.06), force=push)
    reading = {"time": 0.0, "field": field, "temperature": [25.0] * 3, "flags": [0, 0, 0]}
    examples = presses(passes=1, side=3)
    learned = {name: getattr(examples, name) for name in ("time", "field", "targets")}
    others = {name: getattr(examples, name) for name in ("outputs", "group", "run")}
    nominal = smo.Calibration.nominal(design)
    numbers = ("board_stiffness", "sheet_stiffness", "chip_rotation", "field_factor")
    plain = {name: getattr(nominal, name) for name in (*numbers, "field_offset")}
    whole = {"design_hash": "x", "coefficients": design.coefficients}
    twin = smo.ReducedTwin(design, seed=0)
    network = random_network(chips=(0, 1, 2), design_hash=design.content_hash)
    return {
        "Contact": (smo.Contact, {"position": (0.0, 0.0), "force": push}),
        "Reading": (smo.Reading, reading),
        "Estimate": (
            smo.Estimate,
            {
                "time": 0.0,
                "status": smo.Status.CONTACT,
                "contacts": (contact,),
                "covariance": np.eye(5)[None],
            },
        ),
        "Examples": (smo.Examples, learned | others),
        "Calibration": (partial(smo.Calibration, **whole), plain),
        "load_design": (smo.load_design, {"name_or_path": "planar"}),
        "load_model": (smo.load_model, {"path": "none"}),
        "load_network": (smo.load_network, {"path": "none"}),
        "load_response_table": (smo.load_response_table, {"name_or_path": "none"}),
        "open_recording": (smo.open_recording, {"path": "none"}),
        "open_dataset": (smo.open_dataset, {"path": "none"}),
        "open_source": (smo.open_source, {"url": "replay:none"}),
        "Twin.read": (twin.read, {"time": 0.0}),
        "network": (network.predict, {"signals": np.zeros((2, 9)), "temperature": 25.0}),
        "signals": (
            random_table().signals,
            {"position": [[0.05, 0.03]], "force": [push], "temperature": 25.0},
        ),
    }


def refused_or_done(function: Callable[..., Any], arguments: dict[str, Any]) -> None:
    """A call with an argument that is wrong ends well, or by an error that says so."""
    try:
        with contextlib.suppress(Began):
            function(**arguments)
    except SmoskinError as error:
        check_error(error)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that overflow
@pytest.mark.parametrize("count", [80, pytest.param(None, marks=pytest.mark.slow)])
def test_a_wrong_argument_is_refused_by_name(count, planar, tmp_path, monkeypatch):
    """Every argument with every wrong value, some 7,000, or so many of these."""
    monkeypatch.setattr(training, "Lessons", begin)

    def drawn():
        known = calls(planar) | running(planar)
        some = [(name, argument) for name in known for argument in known[name][1]]
        pairs = list(product(some, WILD))
        for k in np.random.default_rng(6).permutation(len(pairs))[:count]:
            (name, argument), wild = pairs[k]
            function, arguments = known[name]
            given = {**arguments, argument: wild}
            yield f"{k}: {name}({argument}={wild!r:.60})", partial(refused_or_done, function, given)

    with working_folder(tmp_path):
        assert broken(drawn()) == []


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: smo.Reading(time="0", field=np.zeros((3, 3))),
        lambda: smo.Reading(time=0.0, field=np.zeros((3, 3)), flags=["a"] * 3),
        lambda: smo.Reading(time=0.0, field=np.zeros((3, 3)) + 1j),
        lambda: smo.Contact(position=(0.0, 1j), force=(0, 0, -1)),
        lambda: smo.open_source(Path("no/such/file.mcap")),
    ],
)
def test_known_wrong_arguments_are_refused(wrong):
    with pytest.raises(SmoskinError) as refused:
        wrong()
    check_error(refused.value)
