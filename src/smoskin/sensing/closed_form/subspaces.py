"""Which cell a touch is on, where every cell answers in a way of its own.

A press and a drag on a cell move the chips in proportion: their motions lie in the cell's own
three-dimensional subspace of all motions. The likeliest cell is the one whose subspace, measured
in the chips' noise, comes nearest; the press and the drag are then its coordinates.
"""

from typing import NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints

_ALIKE = 1e-6
"""Squared standard deviations: two cells' explanations closer than this are one."""


class Match(NamedTuple):
    """The likeliest cell of each of T motions."""

    cell: Ints
    """(T,): its number; -1 where no cell presses so."""
    load: Floats
    """(T, 3), N: press, drag in x and drag in y."""
    confidence: Floats
    """(T,): chance that noise did not decide the cell; 0 where there is none."""


class Subspaces:
    """The subspaces of C cells among K motions.

    Parameters
    ----------
    answers : Floats, shape (C, K, 3)
        m/N: motions for a press, a drag in x and a drag in y.
    noise : Floats, shape (K, K)
        m^2, of the motions.
    """

    def __init__(self, answers: Floats, noise: Floats) -> None:
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.special import ndtr

        self._ndtr = ndtr
        whiten = np.linalg.inv(np.linalg.cholesky(noise))
        white = whiten @ answers
        self._bases, coordinates = np.linalg.qr(white)
        self._loads = np.linalg.solve(coordinates, np.swapaxes(self._bases, 1, 2) @ whiten)
        self._press = white[..., 0]
        inverse = np.linalg.inv(coordinates)
        self._spread = inverse @ np.swapaxes(inverse, 1, 2)
        # Of a motion, all in one product: first, second and third coordinate in every cell's
        # subspace, and every cell's press. Of a motion in the noise the coordinates alone.
        self._count = len(answers)
        self._across = np.moveaxis(self._bases, 1, 0).transpose(0, 2, 1).reshape(len(noise), -1)
        self._product = np.concatenate([whiten.T @ self._across, self._loads[:, 0].T], axis=1)

    @property
    def press(self) -> Floats:
        """(C, K), standard deviations per newton: the answers to a press in the noise."""
        return self._press

    @property
    def loads(self) -> Floats:
        """(C, 3, K), N/m: times a motion, the load on the cell that explains it best."""
        return self._loads

    @property
    def spread(self) -> Floats:
        """(C, 3, 3), N^2: covariance that the noise makes in the loads."""
        return self._spread

    def match(self, motions: Floats) -> Match:
        """The likeliest cell of each motion.

        Parameters
        ----------
        motions : Floats, shape (T, K)
            m.

        Notes
        -----
        The chance that noise carried a motion over the boundary to another cell is that of its
        distance from the boundary, along the normal there, in standard deviations. The doubts of
        all cells add up to at least the doubt.
        """
        products = motions @ self._product
        inside = products[:, : 3 * self._count].reshape(-1, 3, self._count)
        explained = (inside * inside).sum(axis=1)
        explained *= products[:, 3 * self._count :] > 0
        cell = explained.argmax(axis=1)
        most = explained.max(axis=1)
        own = inside[np.arange(len(cell)), :, cell]
        fitted = (self._bases.take(cell, axis=0) @ own[:, :, None])[..., 0]
        shared = ((fitted @ self._across).reshape(inside.shape) * inside).sum(axis=1)
        apart = np.maximum(explained - 2 * shared + most[:, None], _ALIKE)
        trail = (explained - most[:, None]) / (2 * np.sqrt(apart))
        # Its own distance is zero and counts one half.
        sure = np.maximum(1.5 - self._ndtr(trail).sum(axis=1), 0.0)
        pressed = most > 0
        load = (self._loads.take(cell, axis=0) @ motions[..., None])[..., 0]
        return Match(np.where(pressed, cell, -1), load, sure * pressed)

    def separations(self) -> tuple[Floats, Bools]:
        """How far a straight press on one cell lies from another's boundary.

        Returns
        -------
        deviations : Floats, shape (C, C)
            Standard deviations per newton, of a press on the first from the second.
        alike : Bools, shape (C, C)
            Whether a press on the first is one on the second as well.
        """
        size = np.linalg.norm(self._press, axis=1)
        inside = np.einsum("bki,ak->abi", self._bases, self._press)
        across = self._press[:, None] - np.einsum("bki,abi->abk", self._bases, inside)
        beyond = np.linalg.norm(across, axis=-1)
        return beyond / 2, np.asarray(beyond <= 1e-6 * size[:, None])
