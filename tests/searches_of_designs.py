"""What tests of the search for designs share: coarse grids, a short search, and its clock."""

from smoskin.commands.optimise import Limits, Objective, SearchEffort

COARSE = (3, 5)
PLACED = SearchEffort(seconds=8.5)
"""Time, by a told clock, for gains and magnets' places on the first sheet."""
AIM, WITHIN = Objective(places=COARSE), Limits(made_skins=2)


class Told:
    """A listener that is a clock too: it goes on by a second whenever it is told of a design."""

    def __init__(self):
        self.events = []

    def __call__(self, what, share):
        self.events.append((what, share))

    def clock(self):
        """Seconds since the work began; only designs that are tried take any."""
        idle = ("comparison", "made skins", "rounding")
        return float(sum(what not in idle for what, _ in self.events))
