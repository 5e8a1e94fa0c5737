"""Records that carry arrays keep copies of their own, which nobody changes."""

from dataclasses import fields

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Touches
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.sensing.learned.gaussian_process import Output
from smoskin.sensing.learned.training import Examples
from smoskin.sensing.response.basis import TouchBasis
from smoskin.sensing.response.calibrate import LabelledTouches

RECORDS = {
    "basis": (TouchBasis, {
        "extent": (0.1, 0.2), "lines_x": (0.02, 0.05), "lines_y": (0.03, 0.1),
        "exponents": ((0, 0, 1), (1, 0, 0)),
    }),
    "examples": (Examples, {
        "time": (0.0, 0.1), "field": np.full((2, 3, 3), 1e-4), "targets": ((1e-3,), (2e-3,)),
        "outputs": (Output.X,), "group": (0, 1), "run": (0, 0),
    }),
    "labelled touches": (LabelledTouches, {
        "position": ((0.01, 0.02), (0.03, 0.04)), "force": ((0.0, 0.1, -0.5), (0.0, 0.0, -0.2)),
        "signals": np.full((2, 3, 3), 1e-4), "temperature": (20.0, 21.0),
    }),
    "touches": (Touches, {
        "position": (((0.01, 0.02),), ((0.03, 0.04),)),
        "force": (((0.0, 0.1, -0.5),), ((0.0, 0.0, -0.2),)), "radius": ((4e-3,), (3e-3,)),
    }),
    "creep": (Prony, {"moduli": (0.1, 0.2), "times": (1.0, 10.0)}),
}  # fmt: skip


@pytest.mark.parametrize("name", RECORDS)
def test_arrays_are_read_only_copies_of_what_was_given(name):
    kind, given = RECORDS[name]
    whole = {key: value if key == "outputs" else np.array(value) for key, value in given.items()}
    record = kind(**whole)
    for key, value in whole.items():
        if key == "outputs":
            continue
        value *= 2
        kept = getattr(record, key)
        np.testing.assert_array_equal(kept, given[key])
        assert kept.dtype == (np.int64 if key in ("exponents", "group", "run") else np.float64)
    arrays = [getattr(record, part.name) for part in fields(record)]
    for array in (each for each in arrays if isinstance(each, np.ndarray)):
        assert not array.flags.writeable


@pytest.mark.parametrize("name", RECORDS)
def test_shapes_that_disagree_are_refused(name):
    kind, given = RECORDS[name]
    for key in given:
        if key in ("outputs", "lines_x", "lines_y", "exponents", "radius"):
            continue  # of any length, or one for all
        with pytest.raises(ArgumentError):
            kind(**given | {key: given[key][:1]})
