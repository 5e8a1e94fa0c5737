"""Wrong arguments of the public functions and classes: refused by one of the package's errors."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import smoskin as smo
from fuzzing import broken, cases, check_error, working_folder
from learned_examples import presses
from networks import random_network
from smoskin.errors import SmoskinError
from tables_of_response import random_table

WILD: tuple[Any, ...] = (
    *(None, 0, -1, 1e300, 10**400, float("nan"), float("inf"), True, 1j, b"x", object(), len),
    *("", "x", "1", "\x1b[2J", "ß" * 1000, Path("none"), [], [1], [[1, 2], [3]], {}, (), {"a": 1}),
    *(np.zeros((2, 2)), np.full((3, 3), np.nan), np.ones((3, 3)) * 1j, np.array(["a"]), [object()]),
    *(np.full((3, 3), 1e300), np.zeros((0, 3)), np.zeros((3, 3, 3)), np.zeros(3, bool)),
)


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
            partial(smo.Estimate, contacts=(contact,)),
            {
                "time": 0.0,
                "status": smo.Status.CONTACT,
                "covariance": np.eye(5)[None],
            },
        ),
        "Examples": (partial(smo.Examples, **others), learned),
        "Calibration": (partial(smo.Calibration, **whole), plain),
        "load_design": (smo.load_design, {"name_or_path": "planar"}),
        "load_model": (smo.load_model, {"path": "none"}),
        "load_network": (smo.load_network, {"path": "none"}),
        "load_response_table": (smo.load_response_table, {"name_or_path": "none"}),
        "open_recording": (smo.open_recording, {"path": "none"}),
        "open_dataset": (smo.open_dataset, {"path": "none"}),
        "open_source": (smo.open_source, {"url": "replay:none"}),
        "Twin.read": (twin.read, {"time": 0.0}),
        "network": (network.predict, {"signals": np.zeros((2, 9))}),
        "signals": (random_table().signals, {"position": [[0.05, 0.03]], "force": [push]}),
    }


def refused_or_done(function: Callable[..., Any], arguments: dict[str, Any]) -> None:
    """A call with an argument that is wrong ends well, or by an error that says so."""
    try:
        function(**arguments)
    except SmoskinError as error:
        check_error(error)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that overflow
@cases(60, 1500)
def test_a_wrong_argument_is_refused_by_name(count, planar, tmp_path):
    def drawn():
        rng = np.random.default_rng(6)
        known = calls(planar)
        some = [(name, argument) for name in known for argument in known[name][1]]
        for k in range(count):
            name, argument = some[k % len(some)]
            wild = WILD[int(rng.integers(len(WILD)))]
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
