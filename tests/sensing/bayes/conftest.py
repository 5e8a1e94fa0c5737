"""The skin of the estimator's tests, and its table."""

from dataclasses import replace

import pytest

from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.sensing.response.fit import table_curvature
from tables_of_response import plain, reduced_table


@pytest.fixture(scope="package")
def skin(planar):
    return plain(planar)


@pytest.fixture(scope="package")
def table(skin):
    """The reduced model's table, whose two touches lean on each other as on the sheet."""
    coupled = replace(reduced_table(skin), grip=grip_compliance(skin))
    return replace(coupled, curvature=table_curvature(coupled))
