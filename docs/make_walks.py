"""Writes the walks of a value through the files into docs/architecture.md, from real traces.

Run ``python docs/make_walks.py`` after moving code; a test fails while the page differs or a value
comes back to a file more often than it may.
"""

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import smoskin as smo

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "architecture.md"
PACKAGE = Path(smo.__file__).parent
RECORDS = (
    "__init__",
    "arguments",
    "arrays",
    "errors",
    "records",
    "roles",
    "units",
    "design/skin",
    "origami/geometry",
)
"""Files of plain data and its checks, which every file reads."""


@dataclass
class Walk:
    """Files that a value passes, in the order in which control first enters each."""

    title: str
    callers: dict[str, list[str]] = field(default_factory=dict)
    """Files from which each file is entered, in order; ``""`` stands for the user."""
    above: set[tuple[str, str]] = field(default_factory=set)
    """Pairs of a file and one below it in the walk that calls it again."""

    def returns(self, name: str) -> int:
        """How often a value comes back to a file after its first visit."""
        return len(self.callers[name]) - 1

    def lines(self) -> list[str]:
        """The walk as a tree: each file under the one from which it is first entered."""
        return list(self._below("", 0))

    def _below(self, caller: str, depth: int) -> list[str]:
        out = []
        for name, callers in self.callers.items():
            if callers[0] == caller:
                again = f"   (again from {', '.join(callers[1:])})" if callers[1:] else ""
                out.append("   " * depth + ("└─ " if depth else "") + name + again)
                out += self._below(name, depth + 1)
        return out


def walk(title: str, action: Callable[[], object]) -> Walk:
    """What one call of the package's user passes through."""
    seen = Walk(title)
    stack: list[str] = [""]

    def profile(frame: FrameType, event: str, _: Any) -> None:
        name = _name(frame)
        if name is None:
            return
        if event == "call":
            if name != stack[-1]:
                callers = seen.callers.setdefault(name, [])
                if stack[-1] not in callers:
                    callers.append(stack[-1])
                if name in stack:
                    seen.above.add((name, stack[-1]))
            stack.append(name)
        elif event == "return" and len(stack) > 1:
            stack.pop()

    sys.setprofile(profile)
    try:
        action()
    finally:
        sys.setprofile(None)
    return seen


def _name(frame: FrameType) -> str | None:
    """File of a frame in the package, such as `sensing/bayes/solver`; None for all others."""
    path = Path(frame.f_code.co_filename)
    if not path.is_relative_to(PACKAGE):
        return None
    name = str(path.relative_to(PACKAGE).with_suffix(""))
    return None if name in RECORDS else name


def walks() -> list[Walk]:
    """A contact to its reading and a reading to its estimate, after one of each to warm up."""
    design = smo.load_design("planar")
    twin = smo.Twin(design, seed=0)
    estimator = smo.BayesEstimator(design, smo.load_response_table("planar"))
    rest = [twin.read(time=0.01 * k) for k in range(5)]
    estimator.zero(rest)
    touches = [
        smo.Contact(position=(0.045, 0.080), force=(0.0, 0.0, -0.5 - 0.1 * k)) for k in range(2)
    ]
    estimator.step(twin.read(touches[:1], time=1.0))
    reading = twin.read(touches[1:], time=1.01)
    return [
        walk("A `Contact` to its `Reading`: `Twin.read`",
             lambda: twin.read([smo.Contact(position=(0.07, 0.05), force=(0.1, 0.0, -0.4))])),
        walk("A `Reading` to its `Estimate`: `BayesEstimator.step`",
             lambda: estimator.step(reading)),
    ]  # fmt: skip


def section(traced: list[Walk]) -> str:
    """The part of the page between its two marks."""
    return "\n\n".join(
        f"{trace.title}\n\n```text\n" + "\n".join(trace.lines()) + "\n```" for trace in traced
    )


def page(traced: list[Walk]) -> str:
    """The whole page with the walks as they are."""
    text = PAGE.read_text(encoding="utf-8")
    marks = r"(<!-- walks -->\n).*?(<!-- end of walks -->)"
    return re.sub(marks, lambda m: f"{m[1]}{section(traced)}\n{m[2]}", text, flags=re.S)


if __name__ == "__main__":
    PAGE.write_text(page(walks()), encoding="utf-8")
