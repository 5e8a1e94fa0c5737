"""The HTML, CSS and JavaScript that stand beside these modules, with their values filled in.

Decides the colours of states, which people of every colour vision tell apart, and that they mark
what words say too: text itself has the page's ink.
"""

from collections.abc import Mapping
from functools import cache
from html import escape
from importlib import resources
from string import Template
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import viser

GREY: Final = "#868d9b"
"""Nothing to see: no touch, or no reading yet."""
GREEN: Final = "#30a06b"
"""As it should be."""
AMBER: Final = "#d08700"
"""Worth a look."""
RED: Final = "#c92a2a"
"""Something is wrong."""
BLUE: Final = "#2564b4"
"""Something is being done."""


def html(name: str, **values: str) -> str:
    """A part of the page with its values."""
    return Template(text(f"{name}.html")).substitute(values)


@cache
def text(name: str) -> str:
    """Contents of a file of the page."""
    file = resources.files("smoskin.service.page") / name
    return file.read_text(encoding="utf-8")


def css(color: tuple[int, int, int]) -> str:
    """A colour for a style sheet."""
    return f"rgb{color}"


def first_paint(
    title: str, sentence: str, marks: Mapping[str, tuple[int, int, int]], **values: str
) -> tuple[str, str]:
    """What stands in the page's head and what before its body.

    `marks` are the colours in the picture by what they mean, `values` those of the template.
    """
    mark = '<span class="skin-mark" style="background:{}"></span>{}\n'
    marked = "".join(mark.format(css(color), escape(name)) for name, color in marks.items())
    head = f"<title>{escape(title)}</title>\n<style>\n{text('page.css')}</style>"
    script = f"<script>\n{text('page.js')}</script>"
    sentence = escape(sentence)
    return head, html("page", sentence=sentence, script=script, marks=marked, **values)


def within(slider: "viser.GuiSliderHandle[float]") -> float:
    """Value of a slider; a stranger's message may say otherwise, or that it is no number."""
    return min(slider.max, max(slider.min, float(slider.value)))
