"""A simulated skin in a physics simulation of others: its contacts, readings and estimates.

Decides the order in which a policy's world goes on: MuJoCo's contacts press the twin, the twin's
rubber creeps, its chips read, the estimator answers. Readings and estimates become observations by
the names that exported recordings have, so that a policy meets the same numbers on a real skin.
"""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final, final

import numpy as np
from numpy.typing import NDArray

from smoskin.errors import ArgumentError
from smoskin.records import Contact, Estimate, Reading
from smoskin.robot.contacts import SkinContacts
from smoskin.roles import Estimator
from smoskin.service.source import TwinSource
from smoskin.twin.creep import Creep
from smoskin.twin.readout import MagneticSkin

if TYPE_CHECKING:
    import mujoco

_ZEROING: Final = 20
"""Readings of the untouched skin that are its zero."""
_ROOM: Final = 2
"""Touches of an observation; estimators tell no more of them apart."""

Observation = Mapping[str, NDArray[np.float32]]
"""Vectors by the names of LeRobot's features."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Felt:
    """A skin at one moment."""

    touches: tuple[Contact, ...]
    """What really touches it."""
    reading: Reading
    estimate: Estimate
    observation: Observation


def observe(readings: Sequence[Reading], estimate: Estimate) -> Observation:
    """What a policy sees of the latest readings, the oldest first, and the last one's estimate.

    By the names and units of `smoskin.service.exchange.export_lerobot`, with room for two touches:
    ``observation.tactile.field`` (T; reading by reading, chip by chip, x, y, z; of a chip that gave
    none that of the reading before, or zero), ``missing`` (1 for such a chip in the last reading),
    ``contact``, ``position`` (m) and ``force`` (N), zero where nothing touches. Pure: it
    remembers nothing. It raises an `ArgumentError` if there are no readings.
    """
    if not readings:
        raise ArgumentError("readings must be at least one; got none")
    fields = np.array([reading.field for reading in readings])
    missing = np.isnan(fields[-1]).any(axis=1)
    for before, row in pairwise(fields):
        np.copyto(row, before, where=np.isnan(row))
    there, places, forces = np.zeros(_ROOM), np.zeros((_ROOM, 2)), np.zeros((_ROOM, 3))
    for k, contact in enumerate(estimate.contacts[:_ROOM]):
        there[k], places[k], forces[k] = 1.0, contact.position, contact.force
    vectors = {
        "field": np.nan_to_num(fields),
        "missing": missing,
        "contact": there,
        "position": places,
        "force": forces,
    }
    return {
        f"observation.tactile.{name}": values.ravel().astype(np.float32)
        for name, values in vectors.items()
    }


@final
class TactileSkin:
    """A skin on a geom of a MuJoCo model, felt by a twin's chips and an estimator.

    Parameters
    ----------
    twin : MagneticSkin
        Simulated skin, whose noise begins anew with every `reset`.
    estimator : Estimator
        Estimator for it, such as a `BayesEstimator` with the skin's table.
    contacts : SkinContacts
        What touches it.
    rate : float
        Readings a second of the simulation's time, Hz.
    window : int
        Readings in an observation.

    Raises
    ------
    ArgumentError
        If the rate or the window is out of its range.

    Examples
    --------
    ::

        skin = TactileSkin(Twin(design), estimator, SkinContacts(design, model))
        skin.reset(seed=0)
        while True:
            mujoco.mj_step(model, data, nstep=round(1.0 / skin.rate / model.opt.timestep))
            action = policy(skin.step(data).observation)
    """

    def __init__(
        self,
        twin: MagneticSkin,
        estimator: Estimator,
        contacts: SkinContacts,
        *,
        rate: float = 100.0,
        window: int = 4,
    ) -> None:
        if not 1 <= window <= _ZEROING:
            raise ArgumentError(f"window must be from 1 to {_ZEROING}; got {window}")
        self.twin, self.rate = twin, rate
        self._estimator, self._contacts = estimator, contacts
        self._latest: deque[Reading] = deque(maxlen=window)
        self._source = self._opened()
        twin.prepare()

    def reset(self, seed: int | None = None) -> Felt:
        """Begin with a skin that has long been untouched, zeroed anew, and its noise by a seed.

        The same seed, and the same contacts thereafter, give the same readings; without one the
        noise goes on.
        """
        if seed is not None and self.twin.noise is not None:
            self.twin.noise = np.random.default_rng(seed)
        self.twin.forget()
        self._source = self._opened()
        self._estimator.reset()
        untouched = [self._read(()) for _ in range(_ZEROING)]
        self._estimator.zero(untouched, force=True)
        return self._felt(())

    def step(self, data: "mujoco.MjData") -> Felt:
        """Feel what touches the skin now; the twin's time goes on by one reading."""
        return self._felt(self._contacts.touches(data))

    def _opened(self) -> TwinSource:
        creep = Creep(self.twin.design)
        return TwinSource(self.twin, rate=self.rate, speed=math.inf, creep=creep)

    def _felt(self, touches: tuple[Contact, ...]) -> Felt:
        reading = self._read(touches)
        estimate = self._estimator.step(reading)
        seen = observe(tuple(self._latest), estimate)
        return Felt(touches=touches, reading=reading, estimate=estimate, observation=seen)

    def _read(self, touches: tuple[Contact, ...]) -> Reading:
        self._source.touch(touches)
        reading = self._source.read()
        assert reading is not None  # nobody closes it
        self._latest.append(reading)
        return reading
