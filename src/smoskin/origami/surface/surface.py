"""The role of a surface, and what its first and second derivatives say about it.

Decides the chart's convention: parameters in metres, the middle of the sheet at (0, 0), where the
first parameter runs along the sheet's x, the second along its y, and the normal is z.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from smoskin.arrays import Bools, Floats, cross


class Jet(NamedTuple):
    """Places of a surface with their first and second derivatives by the parameters."""

    places: Floats
    """(..., 3), m."""
    slopes: Floats
    """(..., 3, 2): derivatives of the places."""
    bends: Floats
    """(..., 3, 2, 2), 1/m: derivatives of the slopes."""


class Surface(Protocol):
    """A smooth chart: parameters in metres to places."""

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""

    def holds(self, parameters: Floats) -> Bools:
        """Whether parameters (..., 2) lie where the chart is known and one to one."""


class Forms(NamedTuple):
    """Both fundamental forms of a surface, and how its normal turns."""

    places: Floats
    """(..., 3), m."""
    slopes: Floats
    """(..., 3, 2)."""
    normals: Floats
    """(..., 3): unit normals."""
    turns: Floats
    """(..., 3, 2), 1/m: derivatives of the normals by the parameters."""
    metric: Floats
    """(..., 2, 2): first fundamental form."""
    second: Floats
    """(..., 2, 2), 1/m: second fundamental form, by the normal; a cylinder seen from outside has
    a negative one."""


def forms(surface: Surface, parameters: Floats) -> Forms:
    r"""Fundamental forms at parameters (..., 2).

    With the slopes :math:`\mathbf x_{,\alpha}` and the normal :math:`\mathbf n`,

    .. math:: g_{\alpha\beta} = \mathbf x_{,\alpha} \cdot \mathbf x_{,\beta}, \quad
        B_{\alpha\beta} = \mathbf x_{,\alpha\beta} \cdot \mathbf n, \quad
        \mathbf n_{,\alpha} = -\mathbf x_{,\gamma}\, g^{\gamma\beta} B_{\beta\alpha} .
    """
    places, slopes, bends = surface.jet(parameters)
    normals = cross(slopes[..., 0], slopes[..., 1])
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    metric = np.swapaxes(slopes, -1, -2) @ slopes
    second = np.einsum("...iab,...i->...ab", bends, normals)
    turns = -slopes @ np.linalg.solve(metric, second)
    return Forms(places, slopes, normals, turns, metric, second)


def curvatures(at: Forms) -> Floats:
    """Principal curvatures (..., 2), 1/m, the lesser first; those of a sphere are negative."""
    shape = np.linalg.solve(at.metric, at.second)
    mean = (shape[..., 0, 0] + shape[..., 1, 1]) / 2
    gauss = np.linalg.det(shape)
    half = np.sqrt(np.maximum(mean**2 - gauss, 0.0))
    return np.stack([mean - half, mean + half], axis=-1)


@dataclass(frozen=True, slots=True)
class Turned:
    """A surface whose chart is turned about its middle."""

    surface: Surface
    angle: float
    """rad: from the surface's first parameter to this chart's."""

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        turn = self._turn
        places, slopes, bends = self.surface.jet(parameters @ turn.T)
        return Jet(places, slopes @ turn, np.einsum("...iab,ac,bd->...icd", bends, turn, turn))

    def holds(self, parameters: Floats) -> Bools:
        """Whether parameters (..., 2) lie where the surface's chart does."""
        return self.surface.holds(parameters @ self._turn.T)

    @property
    def _turn(self) -> Floats:
        """Parameters of the surface by those of this chart, (2, 2)."""
        sine, cosine = np.sin(self.angle), np.cos(self.angle)
        return np.array([[cosine, -sine], [sine, cosine]])


def straight_way(surface: Surface) -> float:
    """Angle from a surface's first parameter to a line in its middle that is not bent, rad.

    The lesser of two on a saddle, and 0 elsewhere; the chart keeps lengths in its middle.
    """
    (low, high), axes = np.linalg.eigh(forms(surface, np.zeros(2)).second)
    if not low < 0.0 < high:
        return 0.0
    first = np.arctan2(axes[1, 0], axes[0, 0])
    ways = first + np.array([1.0, -1.0]) * np.arctan(np.sqrt(-low / high))
    return float(min((ways + np.pi / 2) % np.pi - np.pi / 2, key=abs))
