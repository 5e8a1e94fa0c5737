"""Examples for learned models: presses on a pad, and load cycles with hysteresis."""

import numpy as np

from smoskin.sensing.learned.gaussian_process import Output
from smoskin.sensing.learned.training import Examples

CHIPS = np.array([[0.0, 0.0], [0.02, 0.0], [0.01, 0.02]])


def press_field(place, depth):
    """Field of a press under each chip, T: along the line to it, falling with distance."""
    away = np.concatenate(
        [place[:, None, :] - CHIPS, np.full((len(place), len(CHIPS), 1), 0.01)], axis=2
    )
    fall = np.linalg.norm(away, axis=2, keepdims=True) ** 3
    return 4e-8 * depth[:, None, None] * away / fall


def presses(passes=3, side=9, seed=0, noise=1e-6):
    """Presses of random depth on a grid of places, a group a place."""
    rng = np.random.default_rng(seed)
    axis = np.linspace(0.0, 0.02, side)
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    place = np.tile(grid, (passes, 1))
    field = press_field(place, rng.uniform(1.0, 3.0, len(place)))
    return Examples(
        time=np.arange(len(place), dtype=float),
        field=field + noise * rng.normal(size=field.shape),
        targets=place,
        outputs=(Output.X, Output.Y),
        group=np.tile(np.arange(len(grid)), passes),
        run=np.zeros(len(place), dtype=int),
    )


def cycles(runs=2, seed=0):
    """Load cycles whose force lags behind the field, one place; every third row unread."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.1)
    swing = np.sin(time * 2 * np.pi / 12) ** 2
    rate = np.gradient(swing, time)
    fields, forces = [], []
    for _ in range(runs):
        push = swing[:, None, None] * press_field(np.full((1, 2), 0.01), np.full(1, 3.0))
        fields.append(push + 1e-6 * rng.normal(size=push.shape))
        forces.append(-(10 * swing + 2 * rate))
    targets = np.concatenate(forces)[:, None]
    targets[::3] = np.nan
    return Examples(
        time=np.tile(time, runs),
        field=np.concatenate(fields),
        targets=targets,
        outputs=(Output.FZ,),
        group=np.repeat(np.arange(5 * runs), len(time) // 5),
        run=np.repeat(np.arange(runs), len(time)),
    )
