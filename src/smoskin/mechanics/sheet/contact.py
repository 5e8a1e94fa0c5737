"""How a touch is shared out among the vertices that can be loaded: the role of a contact law.

Decides what a law must answer and what is refused of its answers. The SI loads top vertices only;
between them the elastomer on the sheet decides, which nobody has measured. So laws can be changed.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ContractError
from smoskin.mechanics.sheet.touches import (
    Covered,
    Grip,
    Touches,
    check_on_skin,
    cover_shares,
    mean_shares,
    patch_points,
    patch_shares,
    patch_slopes,
)
from smoskin.origami.geometry import geometry

_STEP: Final = 5e-7
"""m: step of the differences that slopes are; a place on the rim stays on the skin."""
_PUSH: Final = 1e-6
"""N: likewise of forces."""
_WHOLE: Final = 1e-6
"""Largest distance of a sum of shares from 1."""


class ContactLaw(ABC):
    """A rule by which the vertices that can be loaded share touches; `shares` is all it needs.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> class Nearest(ContactLaw):
    ...     def shares(self, design, touches):
    ...         tops = geometry(design).tops
    ...         away = np.linalg.norm(touches.position[:, :, None, None] - tops, axis=-1)
    ...         return away == away.min(axis=(2, 3), keepdims=True)
    >>> press = Touches(position=[[[0.05, 0.07]]], force=[[[0.0, 0.0, -0.5]]])
    >>> np.argwhere(shares_by(Nearest(), read_design("planar"), press)).tolist()
    [[0, 0, 2, 2]]
    """

    @abstractmethod
    def shares(self, design: SkinDesign, touches: Touches) -> Floats:
        """Share of each touch that the top vertex of each cell takes, (B, K, N, M).

        Finite and with the sum 1 where something touches; anything elsewhere. A share multiplies
        the whole force of its touch. It may depend on the touch's place, force and radius.
        """

    def slopes(self, design: SkinDesign, touches: Touches) -> Floats:
        """Derivative of the shares by the touches' places, (B, K, 2, N, M), 1/m.

        It is found by differences unless a law knows better.
        """
        slopes = []
        for step in _STEP * np.eye(2):
            more, less = (
                shares_by(self, design, replace(touches, position=touches.position + there))
                for there in (step, -step)
            )
            slopes.append((more - less) / (2 * _STEP))
        return np.stack(slopes, axis=2)


@final
@dataclass(frozen=True, slots=True)
class Bilinear(ContactLaw):
    """Shares linear along each axis between vertices, with a lever past the rim.

    They keep a touch's force and moment: `smoskin.mechanics.sheet.touches.patch_shares`.
    """

    def shares(self, design: SkinDesign, touches: Touches) -> Floats:
        """As `ContactLaw.shares`."""
        return patch_shares(design, touches)

    def slopes(self, design: SkinDesign, touches: Touches) -> Floats:
        """As `ContactLaw.slopes`."""
        return patch_slopes(design, touches)


@final
@dataclass(frozen=True, slots=True)
class CoverPanels(ContactLaw):
    """Panels above the cells, each of which takes all touches of its cell to its own vertex."""

    def shares(self, design: SkinDesign, touches: Touches) -> Floats:
        """As `ContactLaw.shares`."""
        return cover_shares(design, touches)

    def slopes(self, design: SkinDesign, touches: Touches) -> Floats:
        """As `ContactLaw.slopes`: a touch that stays on its panel changes nothing."""
        return np.zeros((*touches.pressed.shape, 2, *design.cells))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleContact(ContactLaw):
    """Shares under an elastomer cover bonded to the facets, with what its making leaves open.

    Bilinear shares of a disc of radius ``sqrt((a F^p)^2 + 4 s^2)``, with a the touch's radius, F
    its normal force in newtons, p `patch` and s `spread`, whose middle a drag moves by `tilt` times
    drag over normal force, at most one. Past the outermost vertices the lever is `rim` as long.

    Notes
    -----
    Source: finite elements of a cover of 1 to 4 mm on rigid facets (`python -m studies.scales`),
    which gave spreads of 4 to 6 mm and rims of 0.9 to 1.1 on a sheet of stiff columns; Hertz for
    the patch, a third. On the reference's columns, which bend, it misses 12 to 26 % of the motion.
    It raises an `ArgumentError` if a number is negative or not finite.
    """

    spread: float = 5e-3
    """Standard deviation of the rubber's own spreading along each axis, m."""
    rim: float = 1.0
    """Length of the lever past the outermost vertices over the whole one; 0: shares are level."""
    patch: float = 1 / 3
    """Power of the normal force with which the patch grows."""
    tilt: float = 2e-3
    """Height of the touched face over the vertices, m: a drag turns the cover by it."""

    def __post_init__(self) -> None:
        for name in ("spread", "rim", "patch", "tilt"):
            if not 0.0 <= (value := getattr(self, name)) < np.inf:
                raise ArgumentError(f"{name} must be finite and >= 0; got {value}")

    def shares(self, design: SkinDesign, touches: Touches) -> Floats:
        """As `ContactLaw.shares`."""
        check_on_skin(design, touches)
        drag, normal = touches.force[..., :2], -touches.force[..., 2]
        radius = np.hypot(touches.radius * normal**self.patch, 2 * self.spread)
        most = np.maximum(normal, np.hypot(drag[..., 0], drag[..., 1]))[..., None]
        lean = np.divide(drag, most, out=np.zeros_like(drag), where=most > 0)
        points = patch_points(touches, radius) + self.tilt * lean[..., None, :]
        x, y = geometry(design).lines
        inside = np.clip(points, [x[0], y[0]], [x[-1], y[-1]])
        return mean_shares(design, inside + self.rim * (points - inside))


def contact_of(grip: Grip) -> ContactLaw:
    """The usual law under a grip."""
    return CoverPanels() if isinstance(grip, Covered) else Bilinear()


def probe_law(law: ContactLaw, design: SkinDesign) -> None:
    """Raise a `ContractError` unless the law shares out a press on the middle of the skin."""
    middle = geometry(design).extent / 2
    shares_by(law, design, Touches(position=[[middle]], force=[[[0.0, 0.0, -0.5]]]))


def shares_by(law: ContactLaw, design: SkinDesign, touches: Touches) -> Floats:
    """Shares of touches by a law, (B, K, N, M).

    It raises a `ContractError` if the law is none, or its answer is not what `ContactLaw.shares`
    promises.
    """
    if not isinstance(law, ContactLaw):
        raise ContractError(f"contact must be a ContactLaw; got {law!r}")
    pressed = touches.pressed
    shape = (*pressed.shape, *design.cells)
    if not pressed.size:
        return np.zeros(shape)
    given = _checked(law, "shares", law.shares(design, touches), shape)
    shares = np.where(np.isfinite(given) | pressed[..., None, None], given, 0.0)
    whole = shares.sum(axis=(2, 3))
    off = pressed & ~(np.abs(whole - 1.0) <= _WHOLE)
    if off.any():
        x, y = touches.position[off][0] * 1e3
        raise ContractError(
            f"{_name(law)}.shares must be finite with the sum 1 where something touches; got the "
            f"sum {whole[off][0]:.6g} at ({x:.1f}, {y:.1f}) mm"
        )
    return shares


def slopes_by(law: ContactLaw, design: SkinDesign, touches: Touches) -> tuple[Floats, Floats]:
    """Derivatives of those shares by place, (B, K, 2, N, M), 1/m, and force, (B, K, 3, N, M), 1/N.

    It raises as `shares_by`.
    """
    pressed = touches.pressed
    given = _checked(law, "slopes", law.slopes(design, touches), (*pressed.shape, 2, *design.cells))
    if not np.isfinite(given[pressed]).all():
        raise ContractError(f"{_name(law)}.slopes must be finite where something touches")
    by_place = np.where(np.isfinite(given), given, 0.0)
    here = shares_by(law, design, touches)
    by_force = []
    for step in _PUSH * np.eye(3):
        # A step that presses harder: one back might pull.
        harder = replace(touches, force=touches.force - step * pressed[..., None])
        by_force.append((here - shares_by(law, design, harder)) / _PUSH)
    return by_place, np.stack(by_force, axis=2)


def _checked(law: ContactLaw, what: str, answer: object, shape: tuple[int, ...]) -> Floats:
    """An answer of a law as an array of this shape."""
    try:
        array = np.asarray(answer, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ContractError(
            f"{_name(law)}.{what} must be an array of numbers; got {answer!r}"
        ) from error
    if array.shape != shape:
        raise ContractError(f"{_name(law)}.{what} must have shape {shape}; got {array.shape}")
    return array


def _name(law: ContactLaw) -> str:
    """The law's name, for people."""
    return type(law).__name__
