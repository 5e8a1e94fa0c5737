"""A board without hardware, from a design: the twin behind a pseudo-terminal."""

import time
from collections.abc import Callable

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.hardware.board import VirtualBoard
from smoskin.service.source import TwinSource
from smoskin.twin.hand import scripted_hand
from smoskin.twin.reduced import ReducedTwin


@typed
def run_board(
    design: SkinDesign,
    *,
    format: str = "smoskin",
    rate: float = 100.0,
    seed: int = 0,
    hand: bool = True,
    seconds: float | None = None,
    on_start: Callable[[str], object] = lambda port: None,
) -> VirtualBoard:
    """Send a virtual skin's readings until stopped, or for so many seconds; the closed board.

    The skin is the paper's model of this design, with a seed of its noise and of the scripted hand
    that touches it unless `hand` is false. `on_start` is told the name of the port.
    """
    touches = scripted_hand(design, 60.0, seed) if hand else ()
    source = TwinSource(ReducedTwin(design, seed=seed), rate=rate, hand=touches)
    with VirtualBoard(source, format=format) as board:
        on_start(board.port)
        end = time.monotonic() + (float("inf") if seconds is None else seconds)
        while time.monotonic() < end and board.step():
            pass
    return board
