"""Made skins of the reduced model, quickly pressed, for tests of rigs and of what they measure."""

from types import SimpleNamespace

import numpy as np

from smoskin.magnetics.mlx90393 import HallSample
from smoskin.records import ChipFlag
from smoskin.twin.manufacture import draw
from smoskin.twin.readout import Readout
from smoskin.twin.reduced import ReducedTwin


def made_twin(design, seed=0):
    """As much of a twin as rigs and sources need, with magnets and chips of its own."""
    readout = Readout(design, draw(design, np.random.default_rng([77, seed])))
    model = ReducedTwin(design, seed=None)
    noise = np.random.default_rng(seed)
    return SimpleNamespace(
        design=design,
        readout=readout,
        check=model.check,
        motion=lambda contacts, temperature: model.motion(contacts),
        sample=lambda motion, rng, temperature: readout.sample(motion, rng, temperature),
        sense=lambda motion, time, temperature: readout.read(
            motion, noise, time=time, temperature=temperature
        ),
    )


def saturating(twin, limit):
    """The same, with a second chip that ends its range where its field changes by more, T."""
    rest = twin.readout.seen(twin.motion((), 25.0))[1]

    def sample(motion, rng, temperature):
        read = twin.sample(motion, rng, temperature)
        flags = np.array(read.flags)
        beyond = np.abs(twin.readout.seen(motion)[:, 1] - rest).max(axis=1) > limit
        flags[beyond, 1] = ChipFlag.SATURATED
        return HallSample(
            counts=read.counts, temperature_counts=read.temperature_counts, flags=flags
        )

    return SimpleNamespace(design=twin.design, motion=twin.motion, sample=sample)
