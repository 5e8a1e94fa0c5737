"""Rows of the report: a printed value beside the computed one.

Decides the verdict. Rows of numbers judge themselves: within `TOLERANCE` a value counts as
reproduced, else it is unresolved. Only an erratum is `corrected`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, get_args

Verdict = Literal["reproduced", "corrected", "unresolved"]

TOLERANCE: Final = 1e-3
"""Relative: what still counts as reproduced."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One printed value beside the computed one."""

    id: str
    """Names the row for ever; errata have their numbers, E1 or U1."""
    place: str
    """Place in the print."""
    printed: float | str
    """As printed; a float where it is a number."""
    computed: float | str
    """What this package computes."""
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


def summary(rows: Sequence[Row]) -> str:
    """How many rows have which verdict, as a sentence."""
    counts = [
        f"{sum(row.verdict == verdict for row in rows)} {verdict}" for verdict in get_args(Verdict)
    ]
    return f"{len(rows)} rows: {', '.join(counts)}."


def table(rows: Sequence[Row]) -> str:
    """Printed and computed values one below the other, as people read them.

    Examples
    --------
    >>> print(table([compared("pi", "a table", 3.0, 3.14159, "by its series")]))
    pi (a table): unresolved
      printed   3
      computed  3.14159
      why       by its series
    """
    return "\n".join(
        f"{row.id} ({row.place}): {row.verdict}\n  printed   {_text(row.printed)}\n"
        f"  computed  {_text(row.computed)}\n  why       {row.why}"
        for row in rows
    )


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.8g}"
