"""What is off where a skin is made, and what touches it: contact, fingers, glue, a lost column."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.touches import Touches
from smoskin.roles import ContactLaw
from smoskin.twin.manufacture import Deviations, Tolerances
from smoskin.twin.world.effect import Effect
from smoskin.twin.world.strangers import STRANGERS

_HELD = 0.2
"""Share of a press by which a finger holds the sheet where it presses straight."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Contact(Effect):
    """Contact laws outside the family that tables are drawn from, one skin after the other."""

    laws: tuple[str, ...] = ("smoothstep-half", "half-lever", "tight", "smoothstep")
    """Names among `STRANGERS`. Those that leave the rim blind are worlds of their own: no estimator
    can do anything about them."""

    def law(self, number: int) -> ContactLaw | None:
        """As `Effect.law`."""
        return STRANGERS[self.laws[number % len(self.laws)]]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cover(Effect):
    """An elastomer cover as finite elements have it, drawn for each skin."""

    def tolerances(self, usual: Tolerances) -> Tolerances:
        """As `Effect.tolerances`."""
        return replace(usual, contact=1.0)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fingers(Effect):
    """Fingers of several sizes, by Hertz on the rubber, that drag no more than friction lets them.

    One table knows a single patch of 4 mm. Straight presses stick: what they hold by themselves
    takes 0.12 to 0.19 of friction, and a finger has more.
    """

    radii: tuple[float, float] = (2e-3, 8e-3)
    """Least and largest radius of a fingertip, m: a probe's, and a thumb's."""
    modulus: float = 1.0e5
    """E*, Pa: Ecoflex 00-30's 75 kPa over 1 - nu^2."""
    friction: tuple[float, float] = (0.4, 1.0)
    """Least and largest friction of a fingertip: greased, and dry."""

    def fingers(self, touches: Touches, rng: np.random.Generator) -> Touches:
        """As `Effect.fingers`: patches under a newton, ``(3 R F / (4 E*))^(1/3)``."""
        radius = rng.uniform(*self.radii, touches.radius.shape)
        most = (rng.uniform(*self.friction, touches.radius.shape) - _HELD) * -touches.force[..., 2]
        drag = np.hypot(touches.force[..., 0], touches.force[..., 1])
        share = np.divide(most, drag, out=np.ones_like(drag), where=drag > most)
        force = touches.force * np.stack([share, share, np.ones_like(share)], axis=-1)
        return replace(touches, force=force, radius=np.cbrt(0.75 * radius / self.modulus))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Glue(Effect):
    """Magnets, columns and chips that are placed and glued worse than toleranced."""

    factor: float = 2.0
    """Their tolerances over the usual ones: a first skin made by hand."""

    def tolerances(self, usual: Tolerances) -> Tolerances:
        """As `Effect.tolerances`."""
        names = ("magnet_place", "magnet_tilt", "column_height", "column_stiffness", "chip_place",
                 "chip_tilt")  # fmt: skip
        return replace(usual, **{name: self.factor * getattr(usual, name) for name in names})


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Debonded(Effect):
    """Columns that have come off their base, anywhere, and bear nothing."""

    columns: int = 1
    """Their number."""
    left: float = 1e-3
    """Share of their stiffness that is left, lest the sheet float."""

    def skin(self, design: SkinDesign, made: Deviations, rng: np.random.Generator) -> Deviations:
        """As `Effect.skin`."""
        columns = made.columns.copy()
        columns.flat[rng.choice(columns.size, self.columns, replace=False)] *= self.left
        return replace(made, columns=columns)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sectors(Effect):
    """Magnets whose four sectors are of unequal strength."""

    strength: float = 0.05
    """Standard deviation of each, relative: sectors are magnetised one after the other, by hand."""

    def tolerances(self, usual: Tolerances) -> Tolerances:
        """As `Effect.tolerances`."""
        return replace(usual, sector_strength=self.strength)
