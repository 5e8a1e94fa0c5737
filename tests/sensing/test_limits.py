"""Numbers that files may hold: far past what skins have, and no further."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ModelError
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.learned import gaussian_process
from smoskin.sensing.network import model as networks
from smoskin.sensing.response import table as tables

NETWORK = {
    "centre": (-1e3, 1e3), "scale": (1e-9, 1e6), "stretch": (1e-6, 1e6), "whitener": (-1e9, 1e9),
    "reach": (1e-9, 1e9), "forces": (1e-6, 1e3), "drag": (0.0, 1e3), "floor": (1e-15, 1.0),
    "softening": (-1.0, 1.0),
}  # fmt: skip
LEARNED = {
    "centre": (-1e4, 1e4), "intercept": (-1e4, 1e4), "support": (-1e9, 1e9),
    "weights": (-1e9, 1e9), "slope": (-1e9, 1e9), "place": (-10.0, 10.0), "scale": (1e-12, 1e9),
    "residual": (-1e9, 1e9), "noise": (0.0, 1e9), "touch_field": (0.0, 1.0), "reach": (1e-9, 1e9),
}  # fmt: skip
TABLE = {
    "mean": (-1.0, 1.0), "warmth": (-1.0, 1.0), "modes": (-1.0, 1.0), "curvature": (-1e6, 1e6),
    "softening": (-1.0, 1.0), "forces": (1e-6, 1e3),
}  # fmt: skip


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        (networks._LIMITS, NETWORK),
        (gaussian_process._LIMITS, LEARNED),
        (tables._LIMITS, TABLE),
    ],
    ids=["network", "learned", "table"],
)
def test_files_hold_numbers_of_magnets_in_tesla_newton_and_metres(limits, expected):
    # Fields of up to 1 T, forces of up to 1 kN, places of up to 10 m, and factors of up to 1e9.
    assert {name: limits[name] for name in expected} == expected


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("board_stiffness", 1e-3, 1e7),
        ("sheet_stiffness", 1e-3, 1e7),
        ("chip_rotation", -2 * math.pi, 2 * math.pi),
        ("field_factor", 1e-3, 1e3),
        ("field_offset", -1.0, 1.0),
    ],
)
def test_a_calibration_holds_numbers_of_skins(planar, name, least, most):
    nominal = Calibration.nominal(planar)
    shape = np.shape(getattr(nominal, name))
    for end in (least, most):
        for value in (end - 1e-3 * abs(end), end + 1e-3 * abs(end)):
            given = {name: np.full(shape, value).tolist()}
            if least <= value <= most:
                replace(nominal, **given)
            else:
                with pytest.raises(ModelError, match=name):
                    replace(nominal, **given)
