"""The flat half of the page: what the skin says in words, numbers and curves, and the controls.

Decides the wording, the colours of the statuses, the units shown (mm, N, uT, ms) and how much
history is drawn. Hides the viewer's widgets; the HTML stands beside this module. Numbers for
people carry a `data-name` attribute, by which programs find them in the page.
"""

import math
from collections import deque
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib import resources
from string import Template
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.records import ChipFlag, Contact, Reading, Status
from smoskin.service.page.scene import ESTIMATED, TRUE, Moment

if TYPE_CHECKING:
    import viser
    from viser import uplot

_HISTORY: Final = 10.0
_STALE_AFTER: Final = 1.0
_GREY, _GREEN, _AMBER, _RED, _BLUE = "#8a919c", "#2b8a5f", "#d08700", "#c92a2a", "#1f6fb5"
_STATUS: Final = {
    Status.CONTACT: ("Touched", _GREEN),
    Status.NO_CONTACT: ("Not touched", _GREY),
    Status.SATURATED: ("Saturated", _RED),
    Status.OUT_OF_RANGE: ("Out of range", _AMBER),
    Status.AMBIGUOUS: ("Ambiguous", _AMBER),
    Status.STALE: ("Stale", _AMBER),
    Status.CHIP_MISSING: ("Chip missing", _RED),
    Status.NOT_CALIBRATED: ("Not calibrated", _AMBER),
}
_AXES: Final = (("Bx", "#c2478f"), ("By", "#0f9d74"), ("Bz", "#1f6fb5"))
_BAD: Final = ChipFlag.MISSING | ChipFlag.INVALID
_QUANTITIES: Final = (("x, mm", 1), ("y, mm", 1), ("Fn, N", 3), ("Fx, N", 3), ("Fy, N", 3))
"""Rows of a touch's table, and the digits that each shows."""


class Panel:
    """The page's panels, of chips in the order of every reading.

    Where presses go nowhere their controls are left out; estimators are to choose from where there
    are two.
    """

    def __init__(
        self,
        server: "viser.ViserServer",
        title: str,
        chips: Sequence[str],
        pressable: bool,
        estimators: Sequence[str],
    ) -> None:
        gui = server.gui
        self._chips = tuple(chips)
        self._zero: Floats = np.full((len(self._chips), 3), np.nan)
        self._field = self._zero
        self._start = 0.0
        self._history: deque[tuple[float, Floats]] = deque()
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(31, 111, 181))
        gui.set_panel_label(title)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(340)
        self._card = gui.add_html(_card(None, math.nan, 0.0, None))
        self.chooser = (
            gui.add_dropdown("Estimator", tuple(estimators), hint="What reads the chips.")
            if len(estimators) > 1
            else None
        )
        self.zero_button = gui.add_button(
            "Zero", hint="Take the skin as untouched now; let go of it first.", color="gray"
        )
        with gui.add_folder("Press with the mouse", visible=pressable):
            gui.add_html(_html("note"))
            self._push = gui.add_slider("Press, N", 0.05, 2.0, 0.05, 0.5)
            self._shear_x = gui.add_slider("Shear x, N", -1.0, 1.0, 0.05, 0.0)
            self._shear_y = gui.add_slider("Shear y, N", -1.0, 1.0, 0.05, 0.0)
            self._hold = gui.add_slider("Hold, s", 0.2, 5.0, 0.1, 1.5)
            self._keep = gui.add_checkbox("Keep pressing until released", False)
            self.release_button = gui.add_button("Release", color="gray")
        with gui.add_folder("Picture"):
            self._exaggeration = gui.add_slider("Deformation ×", 1.0, 30.0, 1.0, 10.0)
            self._opacity = gui.add_slider("Sheet opacity", 0.1, 1.0, 0.1, 1.0)
            estimated, true = (",".join(map(str, color)) for color in (ESTIMATED, TRUE))
            gui.add_html(_html("legend", estimated=estimated, true=true))
        fields = gui.add_panel()
        fields.dock_left()
        fields.set_width(320)
        with fields.add_tab("Field change, µT"):
            gui.add_html(_html("curves", **dict(_AXES)))
            self._plots = [_plot(server, name) for name in self._chips]

    @property
    def force(self) -> tuple[float, float, float]:
        """Force that a press exerts on the skin, as the sliders stand, N."""
        return float(self._shear_x.value), float(self._shear_y.value), -float(self._push.value)

    @property
    def hold(self) -> float:
        """Time for which a click presses, s; infinite while presses are kept."""
        return math.inf if self._keep.value else float(self._hold.value)

    @property
    def picture(self) -> tuple[float, float]:
        """How much larger than life deformation is drawn, and the sheet's opacity, 0 to 1."""
        return float(self._exaggeration.value), float(self._opacity.value)

    def zero(self) -> None:
        """Draw the curves from the next reading's field onwards."""
        self._zero = np.full_like(self._zero, np.nan)
        self._history.clear()

    def record(self, reading: Reading) -> None:
        """Add a reading to the curves."""
        # A chip that gives no numbers keeps its last good ones; its heading says so.
        bad = (reading.flags & _BAD) != 0
        self._field = np.where(bad[:, None], self._field, reading.field)
        if self._history and reading.time <= self._history[-1][0]:
            self._history.clear()
        if not self._history:
            self._start = reading.time
        # A chip that was away at the zero starts from its first good field.
        self._zero = np.where(np.isnan(self._zero), self._field, self._zero)
        change = np.nan_to_num(self._field - self._zero) * 1e6
        self._history.append((reading.time, change))
        while reading.time - self._history[0][0] > _HISTORY:
            self._history.popleft()

    def write(
        self, moment: Moment | None, rate: float, now: float, announced: tuple[str, str] | None
    ) -> None:
        """Bring words, numbers and curves up to date with the latest moment.

        `rate` is that of the readings, Hz, `now` the time on the view's clock, s; a word and a
        sentence that are `announced` stand in place of the estimate's status.
        """
        self._card.content = _card(moment, rate, now, announced)
        if moment is None or not self._history:
            return
        # Running seconds, because the plots lay out their axes anew only when a scale moves.
        times = np.array([time for time, _ in self._history]) - self._start
        changes = np.array([change for _, change in self._history])
        if times[0] == 0.0:
            # Zeros before the zero, so that short curves have the scale of long ones.
            times = np.concatenate([[times[-1] - _HISTORY, 0.0], times])
            changes = np.concatenate([np.zeros_like(changes[[0, 0]]), changes])
        for chip, plot in enumerate(self._plots):
            plot.data = (times, *changes[:, chip].T)
            plot.title = _heading(self._chips[chip], ChipFlag(int(moment.reading.flags[chip])))


def _plot(server: "viser.ViserServer", name: str) -> "viser.GuiUplotHandle":
    """Curves of one chip over the seconds since the zero."""
    span, nothing = np.array((-_HISTORY, 0.0)), np.zeros(2)
    seconds: uplot.Axis = {"size": 24, "ticks": {"show": False}}
    microtesla: uplot.Axis = {"size": 44, "ticks": {"show": False}}
    curves: list[uplot.Series] = [
        {"stroke": color, "width": 1.6, "points": {"show": False}} for _, color in _AXES
    ]
    # At least +-20 uT, so that noise looks like noise.
    margin = {"pad": 0.1, "mode": 1}
    return server.gui.add_uplot(
        data=(span, nothing, nothing, nothing),
        series=({}, *curves),
        title=name,
        scales={
            # Without `time` the seconds would be read as dates of 1970.
            "x": {"time": False},
            "y": {"range": {"min": {**margin, "soft": -20.0}, "max": {**margin, "soft": 20.0}}},
        },
        axes=(seconds, microtesla),
        legend={"show": False},
        cursor={"show": False},
        height=200,
        padding=(10, 14, 4, 0),
    )


def _heading(name: str, flags: ChipFlag) -> str:
    """Name of a chip, and what is wrong with its reading."""
    wrong = [flag.name.lower() for flag in ChipFlag if flag in flags and flag.name]
    return f"{name} · {', '.join(wrong)}" if wrong else name


@cache
def _template(name: str) -> Template:
    """The HTML of a part of the page."""
    file = resources.files("smoskin.service.page") / f"{name}.html"
    return Template(file.read_text(encoding="utf-8"))


def _html(name: str, **values: str) -> str:
    """A part of the page with its values."""
    return _template(name).substitute(values)


def _card(moment: Moment | None, rate: float, now: float, announced: tuple[str, str] | None) -> str:
    """The status, the touches and the pace, as HTML."""
    estimate = None if moment is None else moment.estimate
    if announced is not None:
        (word, sentence), color = announced, _BLUE
    elif moment is None:
        word, color, sentence = "Waiting", _GREY, "No reading has come yet."
    elif (age := now - moment.arrival) > _STALE_AFTER:
        word, color, sentence = "Silent", _RED, f"No reading for {age:.0f} s."
    elif estimate is None:
        word, color, sentence = "Reading", _GREY, "No estimator reads the skin."
    else:
        word, color = _STATUS[estimate.status]
        sentence = estimate.status.value
    touches = ""
    if moment is not None and estimate is not None:
        marks = zip(estimate.contacts, estimate.covariance, strict=True)
        touches = "".join(_touch(*mark, moment.truth) for mark in marks)
    return _html(
        "card",
        color=color,
        word=word,
        sentence=escape(sentence),
        touches=touches,
        rate=_number(rate, 0),
        latency=_number(math.nan if moment is None else moment.latency * 1e3, 1),
    )


def _touch(contact: Contact, covariance: Floats, truth: Sequence[Contact]) -> str:
    """A line with a touch's place and force, and a table against the nearest true touch."""
    near = min(truth, key=lambda true: math.dist(true.position, contact.position), default=None)
    variances = np.diag(covariance)[[0, 1, 4, 2, 3]]
    deviations = np.sqrt(variances) * (1e3, 1e3, 1.0, 1.0, 1.0)
    estimated, true = _quantities(contact), None if near is None else _quantities(near)
    rows = [_row("th", ["", "estimate", "", *(() if true is None else ("true", "error"))])]
    for index, (name, digits) in enumerate(_QUANTITIES):
        value, deviation = estimated[index], deviations[index]
        spread = f"± {deviation:.{digits}f}" if math.isfinite(deviation) else ""
        cells = [name, _number(value, digits), spread]
        if true is not None:
            error = round(value - true[index], digits) + 0.0
            cells += [_number(true[index], digits), f"{error:+.{digits}f}"]
        rows.append(_row("td", cells))
    line = f"x {estimated[0]:.1f} mm  y {estimated[1]:.1f} mm  Fn {estimated[2]:.2f} N"
    return _html("touch", line=line, rows="".join(rows))


def _quantities(contact: Contact) -> list[float]:
    """The numbers of a contact in the units of people: x, y, Fn, Fx, Fy."""
    return [*(contact.position * 1e3).tolist(), contact.normal_force, *contact.force[:2].tolist()]


def _row(tag: str, cells: Sequence[str]) -> str:
    """A row of a table."""
    return f"<tr>{''.join(f'<{tag}>{cell}</{tag}>' for cell in cells)}</tr>"


def _number(value: float, digits: int) -> str:
    """A number for people: no minus before zero, a dash where there is none."""
    return f"{round(value, digits) + 0.0:.{digits}f}" if math.isfinite(value) else "–"
