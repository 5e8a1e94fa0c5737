"""Signals of two touches at once and their slopes, one pair at a time and fast.

The same as `ResponseTable.together`, with the derivatives that a descent needs. Decides nothing;
hides how drags that two touches cause each other change with where both are. The equations are
those of "Pairs" in `docs/derivations.md`.
"""

from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.sensing.response.basis import PointLine
from smoskin.sensing.response.pairs import PAD
from smoskin.sensing.response.table import PointTable, ResponseTable

_SLOPES: Final = np.array([1, 2, 4, 5])
"""Rows that are slopes along x and y, of both touches' (shares, slopes by x, slopes by y)."""
_BY_PLACE: Final = np.array([0, 1, 3, 4])
"""Rows that are places, of both touches' unknowns (x, y, force)."""
_OF: Final = np.array([0, 0, 1, 1])
"""Touch that each of those rows belongs to."""
_EACH: Final = np.arange(4)


class Paired(NamedTuple):
    """What two touches read at once."""

    values: Floats
    """(C,), T."""
    slopes: Floats
    """(6, C): slopes by x, y and the normal force of each, T/m and T/N."""


class PairPoint:
    """Signals ``y = s_1 + s_2 + kappa(s_1, s_2)`` of one pair of straight touches, with slopes.

    Parameters
    ----------
    table : ResponseTable
    point : PointTable
        The same table at the rubber's temperature.
    """

    def __init__(self, table: ResponseTable, point: PointTable) -> None:
        basis = table.basis
        self._point = point
        self._lines = tuple(
            PointLine(line, basis.radius) for line in (basis.lines_x, basis.lines_y)
        )
        vertices = len(table.grip)
        # (H, 6 H) by the vertex that moves, then (6 rows, 2, 3, H) by the one that is pushed.
        self._grip = np.ascontiguousarray(table.grip.swapaxes(2, 3).reshape(vertices, -1))
        self._vertices = vertices
        self._chips = len(table.chips)
        self._curvature = table.curvature

    def at(self, place: Floats, press: Floats) -> Paired:
        """The pair at (2, 2), m, that presses with (2,), N, positive."""
        drags, rates = self._drags(place, press)
        chips = self._chips
        values, slopes = [], np.zeros((2, 6, 3 * chips))
        for k in (0, 1):
            force = np.array([drags[k, 0], drags[k, 1], -press[k]])
            signals, by = self._point.at(float(place[k, 0]), float(place[k, 1]), force)
            values.append(signals)
            slopes[k] = rates[:, k] @ by[2:4]
            slopes[k, 3 * k : 3 * k + 2] += by[:2]
            slopes[k, 3 * k + 2] -= by[4]
        total, by_all = values[0] + values[1], slopes[0] + slopes[1]
        for k in (0, 1):
            other = values[1 - k].reshape(chips, 1, 3, 1)
            bent = (self._curvature * other).sum(axis=2)
            by_all += (slopes[k].reshape(6, chips, 1, 3) @ bent).reshape(6, -1)
        total = total + (values[1].reshape(chips, 1, 3) @ bent).ravel()
        return Paired(total, by_all)

    def _drags(self, place: Floats, press: Floats) -> tuple[Floats, Floats]:
        """What the touches pull at each other, t (2, 2), and its slopes (6, 2, 2)."""
        rows = np.concatenate([self._rates(float(x), float(y)) for x, y in place])
        half = (rows @ self._grip).reshape(36, self._vertices)
        # (6, 2, 3, 6): rows are each touch's shares and their slopes along x and y.
        moved = (half @ rows.T).reshape(6, 2, 3, 6)
        middle = moved[::3][..., ::3]
        c = middle[:, :, :2].transpose(0, 1, 3, 2).reshape(4, 4) + PAD * np.eye(4)
        s = middle[:, :, 2].reshape(4, 2)
        inverse = np.linalg.inv(c)
        both = -inverse @ (s @ press)
        drags, slopes = both.reshape(2, 2).copy(), np.zeros((6, 2, 2))
        # What moves where a touch is elsewhere: its own patch by all forces, all by its force.
        there, back = moved[_SLOPES][..., ::3], moved[::3][..., _SLOPES]
        load = np.array([both[::2], both[1::2], press])
        gaps = (back * load[:, _OF]).sum(axis=2)
        gaps[_OF, :, _EACH] += there.reshape(4, 2, 6) @ load.ravel()
        slopes[_BY_PLACE] = -(inverse @ gaps.reshape(4, 4)).T.reshape(4, 2, 2)
        own = there[_EACH, :, :, _OF] + back[_OF, :, :, _EACH]
        for k in (0, 1):
            part = slice(2 * k, 2 * k + 2)
            stiff = np.linalg.inv(c[part, part])
            alone = -stiff @ s[part, k] * press[k]
            drags[k] -= alone
            slopes[3 * k + 2] = -(inverse @ s[:, k]).reshape(2, 2)
            slopes[3 * k + 2, k] -= alone / press[k]
            slopes[3 * k : 3 * k + 2, k] += own[part] @ np.append(alone, press[k]) @ stiff.T
        return drags, slopes

    def _rates(self, x: float, y: float) -> Floats:
        """Shares of the vertices and their slopes along x and y, (3, H)."""
        on_x, by_x = self._lines[0].shares(x)
        on_y, by_y = self._lines[1].shares(y)
        pairs = [np.outer(on_x, on_y), np.outer(by_x, on_y), np.outer(on_x, by_y)]
        return np.stack(pairs).reshape(3, -1)
