"""A board without hardware, from a design: the twin behind a pseudo-terminal."""

import time
from collections.abc import Callable
from typing import Final

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.hardware.board import VirtualBoard
from smoskin.service.source import TwinSource
from smoskin.twin.hand import scripted_hand
from smoskin.twin.reduced import ReducedTwin

_LOOK: Final = 0.01
"""Seconds after which a board that nobody reads looks whether somebody does."""


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
    that touches it unless `hand` is false. Whoever opens the port finds it untouched, and the hand
    begins anew. `on_start` is told the name of the port.
    """
    touches = scripted_hand(design, 60.0, seed) if hand else ()
    twin = ReducedTwin(design, seed=seed)

    def untouched() -> TwinSource:
        return TwinSource(twin, rate=rate, hand=touches)

    with VirtualBoard(untouched(), format=format) as board:
        on_start(board.port)
        end = time.monotonic() + (float("inf") if seconds is None else seconds)
        begun = False
        while time.monotonic() < end:
            if not board.watched:
                begun = False
                time.sleep(_LOOK)
            elif not begun:
                begun = True
                board.restart(untouched())
            elif not board.step():
                break
    return board
