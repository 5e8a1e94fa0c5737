"""Made skins of the reduced model, quickly pressed, for tests of rigs and of what they measure."""

import numpy as np

from smoskin.magnetics.mlx90393 import HallSample
from smoskin.records import ChipFlag
from smoskin.twin.manufacture import draw
from smoskin.twin.reduced import ReducedTwin


class MadeTwin(ReducedTwin):
    """A reduced twin with magnets and chips of its own."""

    def __init__(self, design, seed=0):
        made = draw(design, np.random.default_rng([77, seed]))
        super().__init__(design, seed=seed, deviations=made)


class Saturating(MadeTwin):
    """The same, with a second chip that ends its range where its field changes by more, T."""

    def __init__(self, design, limit, seed=0):
        super().__init__(design, seed)
        self.limit = limit

    def sample(self, motion, rng, *, temperature=25.0):
        read = super().sample(motion, rng, temperature=temperature)
        change = self.readout.seen(motion) - self.readout.seen(self.motion())
        flags = np.array(read.flags)
        flags[np.abs(change[:, 1]).max(axis=1) > self.limit, 1] = ChipFlag.SATURATED
        return HallSample(
            counts=read.counts, temperature_counts=read.temperature_counts, flags=flags
        )
