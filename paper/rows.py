"""One line of the report: a printed value, the computed one, and the verdict on both.

Rows of numbers judge themselves: within `TOLERANCE` a value counts as reproduced, else it is
unresolved. Only an erratum is `corrected`.
"""

from dataclasses import dataclass
from typing import Final, Literal

Verdict = Literal["reproduced", "corrected", "unresolved"]

TOLERANCE: Final = 1e-3
"""Relative: what still counts as reproduced."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One printed value beside the computed one."""

    id: str
    """Names the row for ever; errata have their numbers, E1 or U1."""
    place: str
    """Where it is printed."""
    printed: float | str
    """As printed; a float where it is a number."""
    computed: float | str
    """By this package."""
    deviation: float | None
    """computed / printed - 1; None where there is no number to compare."""
    verdict: Verdict
    why: str
    """How it is computed, or why it differs."""


def compared(id: str, place: str, printed: float, computed: float, why: str) -> Row:
    """A row of two numbers.

    Examples
    --------
    >>> compared("pi", "a table", 3.14, 3.14159, "").verdict
    'reproduced'
    >>> compared("pi", "a table", 3.0, 3.14159, "").verdict
    'unresolved'
    """
    deviation = float(computed) / printed - 1
    return Row(
        id=id,
        place=place,
        printed=printed,
        computed=float(f"{float(computed):.6g}") if abs(deviation) > 0 else printed,
        deviation=deviation,
        verdict="reproduced" if abs(deviation) <= TOLERANCE else "unresolved",
        why=why,
    )


def stated(id: str, place: str, printed: str, computed: str, holds: bool, why: str) -> Row:
    """A row of words: whether what is said there also holds here."""
    return Row(
        id=id,
        place=place,
        printed=printed,
        computed=computed,
        deviation=None,
        verdict="reproduced" if holds else "unresolved",
        why=why,
    )
