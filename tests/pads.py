"""A magnetic pad of five chips that a careful hand presses, as it would an AnySkin board."""

from collections.abc import Iterator

import numpy as np

from smoskin.design.skin import HallSetting
from smoskin.magnetics import mlx90393
from smoskin.measurement import TouchTable
from smoskin.records import Reading

CHIPS = np.array([[0.5, 0.5], [0.1, 0.5], [0.9, 0.5], [0.5, 0.1], [0.5, 0.9]]) * 30e-3
SETTING = HallSetting(gain_selection=6, resolution=0, oversampling=0, digital_filter=2)
REST = np.random.default_rng(7).normal(0.0, 1.5e-3, (5, 3))


def pressed(place: np.ndarray, force: float) -> np.ndarray:
    """Change of the field at the chips, (5, 3), T, by a press at a place, m, N."""
    away = np.concatenate([place - CHIPS, np.full((5, 1), 8e-3)], axis=1)
    return 3e-8 * force * away / np.linalg.norm(away, axis=1, keepdims=True) ** 3


def counted(field: np.ndarray) -> np.ndarray:
    """The field that whole counts of the chips stand for."""
    counts = np.rint(field / mlx90393.sensitivity(SETTING))
    return np.asarray(mlx90393.tesla(counts, SETTING))


def hand(
    plan: TouchTable, rate: float = 60.0, seed: int = 0, start: float = 0.0
) -> Iterator[Reading]:
    """Readings while a hand makes the touches of a plan: a rest, a press, a hold, a release."""
    rng = np.random.default_rng(seed)
    time = start
    for contact in plan.contacts:
        shape = np.concatenate(
            [
                np.zeros(round(1.0 * rate)),
                np.linspace(0, 1, round(0.3 * rate)),
                np.ones(round(1.2 * rate)),
                np.linspace(1, 0, round(0.3 * rate)),
            ]
        )
        place = contact.position + rng.normal(0.0, 0.3e-3, 2)
        change = pressed(place, contact.normal_force * (1 + 0.03 * rng.normal()))
        for share in shape:
            field = REST + share * change + rng.normal(0.0, 1.5e-6, (5, 3))
            time += 1.0 / rate
            yield Reading(time=time, field=counted(field), temperature=np.full(5, 25.0))
