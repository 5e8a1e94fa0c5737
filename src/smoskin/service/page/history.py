"""What the left side of the page tells: forces beside a threshold, and how the chips are.

Decides when a force counts as above the threshold, from which drift a zero is worth a look, and
that every lamp has a word. Hides the plot's widget.
"""

from collections import deque
from html import escape
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.records import ChipFlag
from smoskin.service.page.parts import AMBER, GREEN, GREY, RED, html

if TYPE_CHECKING:
    import viser
    from viser import uplot

    from smoskin.service.page.scene import Moment

_SECONDS: Final = 10.0
_LEAST: Final = 1.0
"""N: least end of the plot's axis."""
_WORTH_A_LOOK: Final = 100e-6
"""T: drift past which the zero is better taken anew."""
_STROKES: Final = ("#d55e00", "#059b6d", "#838e9f")
"""First touch, second touch, threshold."""


class ForceHistory:
    """Sizes of the estimated forces over the last seconds, beside a threshold."""

    def __init__(self, gui: "viser.GuiApi") -> None:
        self._past: deque[tuple[float, float, float]] = deque()
        self._threshold = gui.add_slider(
            "Threshold, N", 0.05, 1.0, 0.05, 0.5, hint="Touches are told to be above or below it."
        )
        self._top = _LEAST
        curves: list[uplot.Series] = [
            {"stroke": color, "width": 1.6, "points": {"show": False}} for color in _STROKES
        ]
        nothing = np.zeros(2)
        self._plot = gui.add_uplot(
            data=(np.array((-_SECONDS, 0.0)), nothing, nothing, nothing),
            series=({}, *curves),
            title="Force",
            scales=_scales(_LEAST),
            axes=(
                {"size": 24, "ticks": {"show": False}, "label": "s", "labelSize": 14},
                {"size": 52, "ticks": {"show": False}, "label": "N", "labelSize": 16},
            ),
            legend={"show": False},
            cursor={"show": False},
            height=260,
            padding=(10, 14, 4, 0),
        )
        gui.add_html(html("forces", first=_STROKES[0], second=_STROKES[1], threshold=_STROKES[2]))

    def add(self, moment: "Moment") -> None:
        """Take note of what is estimated."""
        time, estimate = moment.reading.time, moment.estimate
        contacts = () if estimate is None else estimate.contacts
        sizes = [float(np.linalg.norm(contact.force)) for contact in contacts] + [0.0, 0.0]
        if self._past and not 0.0 < time - self._past[-1][0] <= _SECONDS:
            self._past.clear()
        self._past.append((time, sizes[0], sizes[1]))
        while time - self._past[0][0] > _SECONDS:
            self._past.popleft()

    def write(self) -> None:
        """Bring the plot up to date."""
        if not self._past:
            return
        past, threshold = np.array(self._past), float(self._threshold.value)
        top = max(_LEAST, float(np.ceil(5 * past[:, 1:].max()) / 5))
        if top != self._top:
            self._top = top
            self._plot.scales = _scales(top)
        since = np.concatenate([[-_SECONDS], past[:, 0] - past[-1, 0]])
        forces = np.concatenate([np.zeros((1, 2)), past[:, 1:]])
        self._plot.data = (since, *forces.T, np.full_like(since, threshold))

    def sentence(self) -> str:
        """Whether the newest touch is above the threshold, in words; empty without a touch."""
        if not self._past or not (force := max(self._past[-1][1:])):
            return ""
        threshold = float(self._threshold.value)
        return f"{'above' if force > threshold else 'below'} the threshold of {threshold:.2f} N"


def lamps(names: tuple[str, ...], flags: Ints | None, drift: Floats | None) -> str:
    """How each chip is, in a word beside its lamp, and how far its zero has drifted, as HTML."""
    rows = []
    for chip, name in enumerate(names):
        flag = ChipFlag(0 if flags is None else int(flags[chip]))
        words = ", ".join(kind.name.lower() for kind in ChipFlag if kind in flag and kind.name)
        far = None if drift is None else float(np.linalg.norm(drift[chip]))
        color, word = (RED, words) if words else (GREEN, "good")
        if flags is None:
            color, word = GREY, "no reading yet"
        elif not words and far is not None and far > _WORTH_A_LOOK:
            color, word = AMBER, "drifted: zero it untouched"
        moved = "–" if far is None or not np.isfinite(far) else f"{1e6 * far:.0f} µT"
        rows.append(
            f'<tr><td><span style="color:{color}">●</span> {escape(name)}</td>'
            f"<td>{escape(word)}</td><td>zero drifted {moved}</td></tr>"
        )
    return html("lamps", rows="".join(rows))


def _scales(top: float) -> "dict[str, uplot.Scale]":
    return {"x": {"time": False, "range": (-_SECONDS, 0.0)}, "y": {"range": (0.0, top)}}
