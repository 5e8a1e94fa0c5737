"""Arguments against annotations: what is refused, and in which words."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from smoskin.arguments import Seed, typed
from smoskin.errors import ArgumentError
from smoskin.records import Contact


@typed
def called(
    force: float = 0.5,
    count: int | None = None,
    path: str | Path = "x",
    cells: tuple[int, int] = (1, 2),
    contacts: Sequence[Contact] = (),
    heard: Callable[[str], None] = print,
    seed: Seed = 0,
    exact: bool = False,
    unread: "NotThere" = None,  # noqa: F821
) -> tuple:
    """What it was given."""
    return force, count, path, cells, contacts, heard, seed, exact, unread


@dataclass(frozen=True)
class Part:
    contact: Contact


CONTACT = Contact(position=(0.0, 0.0), force=(0.0, 0.0, -1.0))


@pytest.mark.parametrize(
    "right",
    [
        {"force": 1, "count": np.int64(3)},
        {"force": np.float32(1), "path": Path("y")},
        {"force": np.array(1.0), "cells": [3, 4]},
        {"contacts": [CONTACT], "exact": np.True_, "unread": object()},
    ],
)
def test_what_annotations_admit_is_passed_on(right):
    assert called(**right) == called.__wrapped__(**right)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"force": "1"}, "force must be a number; got '1'"),
        ({"force": 1j}, "force must be a number; got 1j"),
        ({"force": 10**400}, "force must be a number; got 1"),
        ({"force": True}, "force must be a number; got True"),
        ({"count": 1.0}, "count must be a whole number or None; got 1.0"),
        ({"path": b"x"}, "path must be a text or a path; got b'x'"),
        ({"cells": (1, 2, 3)}, "cells must be (a whole number, a whole number); got (1, 2, 3)"),
        ({"contacts": [None]}, "contacts must be a sequence, each a Contact; got [None]"),
        ({"contacts": CONTACT}, "contacts must be a sequence, each a Contact; got Contact("),
        ({"heard": 1}, "heard must be a function; got 1"),
        ({"seed": -1}, "seed must be a whole number >= 0; got -1"),
        ({"exact": 1}, "exact must be True or False; got 1"),
    ],
)
def test_what_they_do_not_is_refused_by_name(wrong, message):
    with pytest.raises(ArgumentError) as refused:
        called(**wrong)
    assert str(refused.value).startswith(message)


def test_positional_arguments_and_records_are_checked_too():
    with pytest.raises(ArgumentError, match="count must be"):
        called(0.5, "many")
    with pytest.raises(ArgumentError, match="contact must be a Contact; got 1"):
        typed(Part)(contact=1)
    with pytest.raises(TypeError):
        called(power=1)
