"""The reference design's pressed sheet, and a short search from it."""

import pytest

from searches_of_designs import AIM, COARSE, PLACED, WITHIN, Told
from smoskin.commands.optimise import optimise
from smoskin.commands.optimise.pressed import PressedSheet


@pytest.fixture(scope="module")
def sheet(planar):
    return PressedSheet(planar, places=COARSE)


@pytest.fixture(scope="module")
def optimised(planar):
    listener = Told()
    return optimise(
        planar,
        objective=AIM,
        limits=WITHIN,
        effort=PLACED,
        places=COARSE,
        progress=listener,
        clock=listener.clock,
    )
