"""Skins that every contract holds for."""

import pytest

from smoskin.design.skin import SkinDesign
from smoskin.feasibility import load_design


@pytest.fixture(params=["planar", pytest.param("curved", marks=pytest.mark.slow)])
def design(request) -> SkinDesign:
    """A skin of three chips, or of four whose axes turn round a limb."""
    return load_design(request.param)
