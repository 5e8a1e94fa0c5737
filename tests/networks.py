"""Networks for tests: of random numbers, and one that has learned a little."""

import itertools
from functools import cache

import numpy as np

from smoskin.sensing.learned.gaussian_process import Metric
from smoskin.sensing.network.model import Layer, NetworkModel
from smoskin.sensing.network.samples import TouchSpread, TrainingEffort
from tables_of_response import reduced_table

TINY = TrainingEffort(
    members=2, width=24, depth=2, epochs=10, steps=25, batch=256, touches=32, rate=3e-2
)


def random_network(drag=0.0, members=3, width=8, depth=2, chips=(1, 2), seed=0, **changes):
    """A model of random numbers, for signals of some millitesla."""
    rng = np.random.default_rng(seed)
    inputs, outputs = 3 * len(chips) + 1, 5 if drag else 3
    sizes = [inputs, *[width] * depth, outputs * (outputs + 3) // 2]
    layers = [
        Layer(
            (rng.normal(size=(members, a, b)) / np.sqrt(a)).astype(np.float32),
            rng.normal(size=(members, 1, b)).astype(np.float32),
        )
        for a, b in itertools.pairwise(sizes)
    ]
    values = {
        "design_hash": "0" * 64,
        "chips": chips,
        "layers": tuple(layers),
        "centre": np.array([*rng.normal(size=inputs - 1), -6.0]),
        "scale": rng.uniform(0.5, 2, inputs),
        "middle": np.array([0.06, 0.08, *([0.0, 0.0] if drag else []), 5.0]),
        "size": np.array([0.01, 0.02, *([30.0, 40.0] if drag else []), 0.3]),
        "stretch": rng.uniform(0.8, 1.5, outputs),
        "whitener": rng.normal(size=(inputs, inputs)),
        "reach": 10.0,
        "forces": (0.05, 1.15),
        "drag": drag,
        "floor": 1e-6,
        "softening": 0.003,
        "data_sha256": "1" * 64,
        "split": "none",
        "metrics": (Metric("mean distance of the place", 0.001, "m"),),
    }
    return NetworkModel(**(values | changes))


@cache
def tiny_network(design, drag=0.0, chips=None):
    """What some seconds of training make of the reduced model's table."""
    from smoskin.sensing.network.training import train_network

    table = reduced_table(design) if chips is None else reduced_table(design).of_chips(chips)
    return train_network(design, table, spread=TouchSpread(drag=drag), effort=TINY).model
