"""What tests of the search for designs share: coarse grids, a short search, and its clock."""

import itertools

from smoskin.commands.optimise import Limits, Objective, SearchEffort

COARSE = (3, 5)
PLACED = SearchEffort(seconds=9.5)
"""Time, by a ticking clock, for gains and magnets' places on the first sheet."""
AIM, WITHIN = Objective(places=COARSE), Limits(made_skins=2)


def ticking():
    """A clock that goes on by a second whenever it is looked at."""
    ticks = itertools.count()
    return lambda: float(next(ticks))
