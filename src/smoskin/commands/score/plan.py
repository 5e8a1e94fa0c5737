"""What an exam asks: which made skins are pressed, where, how hard and how warm."""

from dataclasses import asdict, dataclass
from typing import Final

from smoskin.errors import ArgumentError

FORCES: Final = tuple(k / 10 for k in range(1, 11))
"""Normal forces of an exam, N."""
HEADLINE: Final = 0.3
"""Least force of the headline, N."""
_UNSEEN: Final = 1_000_000
"""First of the seeds that response tables are made of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exam:
    """Touches of one force after the other, 0.1 to 1 N, on made skins at 15 to 35 degC.

    Raises
    ------
    ArgumentError
        If a number is out of its range.
    """

    skins: tuple[int, ...] = (1, 2)
    """Seeds of the made skins, and of all that is drawn for each."""
    touches: int = 60
    """Labelled touches that calibrate each skin; 0: the file is taken as it is."""
    places: tuple[int, int] = (25, 33)
    """Places of the grid from rim to rim, along x and y."""
    count: int | None = 200
    """Number of these places that are pressed, drawn anew for each force; None: all of them."""
    drag: float = 0.0
    """Largest drag of a second round of touches, N, in any direction; 0: no such round. With it
    the first round is also read by the estimator that may not take touches to be straight."""
    pairs: int = 40
    """Pairs of straight touches at once on each skin, 0.3 to 1 N, at least 40 mm apart."""
    chips: tuple[int, ...] | None = None
    """Chips that are read; None: all that the file has."""

    def __post_init__(self) -> None:
        if not self.skins or self.touches < 0 or self.pairs < 0:
            raise ArgumentError(
                "skins must be at least 1, touches and pairs at least 0; got "
                f"{len(self.skins)}, {self.touches} and {self.pairs}"
            )
        if min(self.places) < 2 or not (self.count is None or self.count >= 1):
            raise ArgumentError(
                "places must be at least 2 along each axis and count at least 1; got "
                f"{self.places} and {self.count}"
            )
        if not 0 <= self.drag < float("inf"):
            raise ArgumentError(f"drag must be finite and >= 0 N; got {self.drag}")
        if not 0 <= min(self.skins) <= max(self.skins) < _UNSEEN:
            raise ArgumentError(
                f"seeds must lie in 0..{_UNSEEN - 1}, where no table has seen them; got "
                f"{min(self.skins)} to {max(self.skins)}"
            )

    @property
    def sessions(self) -> int:
        """Number of sessions of each skin."""
        return len(FORCES) * (3 if self.drag else 1) + (self.pairs > 0)

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        settings = asdict(self)
        settings["drag_N"] = settings.pop("drag")
        seeds = list(self.skins)
        counts = {"skins": len(seeds), "seed": seeds[0], "seeds": seeds}
        return settings | counts | {"forces_N": list(FORCES)}


def parse_places(text: str) -> tuple[int, int]:
    """Places of a grid as people write them.

    Raises
    ------
    ArgumentError
        If it is not two whole numbers.

    Examples
    --------
    >>> parse_places("25x33")
    (25, 33)
    """
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise ArgumentError(f"places must be two whole numbers such as 25x33; got {text!r}")
    return int(parts[0]), int(parts[1])
