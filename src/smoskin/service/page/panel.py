"""The flat half of the page: what the skin says in words, numbers and curves, and the controls.

Decides the wording, the colours of the statuses, the units shown (mm, N, uT, ms) and how much
history is drawn. Hides the viewer's widgets. Numbers for people carry a `data-name` attribute, by
which programs find them in the page.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.service.page.scene import ESTIMATED, TRUE

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moment:
    """All that is known of one reading."""

    reading: Reading
    """What the chips read."""
    estimate: Estimate | None
    """What was made of it, if anything."""
    truth: tuple[Contact, ...]
    """What really touches, where that is known."""
    vertices: Floats | None
    """Vertices of the deformed sheet, (V, 3), m; None at rest."""
    latency: float
    """Time from reading to estimate, s; NaN where unknown."""
    arrival: float
    """When it came, s, on the clock of the view."""


class Panel:
    """The page's panels.

    Parameters
    ----------
    server : viser.ViserServer
        The server whose panels are filled.
    title : str
        Heading.
    chips : sequence of str
        Names of the S chips, in the order of every reading.
    pressable : bool
        Whether presses on the page go anywhere; without, their controls are left out.
    estimators : tuple of str
        Names of the estimators to choose from; a choice is shown where there are two.
    """

    def __init__(
        self,
        server: "viser.ViserServer",
        title: str,
        chips: Sequence[str],
        pressable: bool,
        estimators: tuple[str, ...] = (),
    ) -> None:
        gui = server.gui
        self._chips = tuple(chips)
        self._zero: Floats = np.full((len(self._chips), 3), np.nan)
        self._field = self._zero
        self._start = 0.0
        self._history: deque[tuple[float, Floats]] = deque()
        gui.configure_theme(
            dark_mode=False,
            show_logo=False,
            show_share_button=False,
            brand_color=(31, 111, 181),
        )
        gui.set_panel_label(title)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(340)
        self._card = gui.add_html(_card(None, math.nan, 0.0, None))
        self.chooser = (
            gui.add_dropdown("Estimator", estimators, hint="What reads the chips.")
            if len(estimators) > 1
            else None
        )
        self.zero_button = gui.add_button(
            "Zero", hint="Take the skin as untouched now; let go of it first.", color="gray"
        )
        self._offer_press(gui, pressable)
        with gui.add_folder("Picture"):
            self._exaggeration = gui.add_slider("Deformation ×", 1.0, 30.0, 1.0, 10.0)
            self._opacity = gui.add_slider("Sheet opacity", 0.1, 1.0, 0.1, 1.0)
            gui.add_html(_legend())
        fields = gui.add_panel()
        fields.dock_left()
        fields.set_width(320)
        with fields.add_tab("Field change, µT"):
            gui.add_html(_curves())
            self._plots = [_plot(server, name) for name in self._chips]

    def _offer_press(self, gui: "viser.GuiApi", pressable: bool) -> None:
        """Sliders and buttons of a press by the mouse."""
        with gui.add_folder("Press with the mouse", visible=pressable):
            gui.add_html(
                _note("Click the sheet to press it; shift-drag to slide a finger over it.")
            )
            self._push = gui.add_slider("Press, N", 0.05, 2.0, 0.05, 0.5)
            self._shear_x = gui.add_slider("Shear x, N", -1.0, 1.0, 0.05, 0.0)
            self._shear_y = gui.add_slider("Shear y, N", -1.0, 1.0, 0.05, 0.0)
            self._hold = gui.add_slider("Hold, s", 0.2, 5.0, 0.1, 1.5)
            self._keep = gui.add_checkbox("Keep pressing until released", False)
            self.release_button = gui.add_button("Release", color="gray")

    @property
    def force(self) -> tuple[float, float, float]:
        """N: what a press exerts on the skin, as the sliders stand."""
        return float(self._shear_x.value), float(self._shear_y.value), -float(self._push.value)

    @property
    def hold(self) -> float:
        """s: how long a click presses; infinite while presses are kept."""
        return math.inf if self._keep.value else float(self._hold.value)

    @property
    def exaggeration(self) -> float:
        """How many times larger than life the deformation is drawn."""
        return float(self._exaggeration.value)

    @property
    def opacity(self) -> float:
        """Opacity of the sheet, 0 to 1."""
        return float(self._opacity.value)

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
        """Bring words, numbers and curves up to date.

        Parameters
        ----------
        moment : Moment or None
            The latest; None before the first.
        rate : float
            Readings a second, Hz.
        now : float
            Time on the clock of the view, s.
        announced : tuple of str, optional
            A word and a sentence to say in place of the estimate's status.
        """
        self._card.content = _card(moment, rate, now, announced)
        if moment is None or not self._history:
            return
        reading = moment.reading
        # Running seconds, because the plots lay out their axes anew only when a scale moves.
        times = np.array([time for time, _ in self._history]) - self._start
        changes = np.array([change for _, change in self._history])
        if times[0] == 0.0:
            # Zeros before the zero, so that short curves have the scale of long ones.
            times = np.concatenate([[times[-1] - _HISTORY, 0.0], times])
            changes = np.concatenate([np.zeros_like(changes[[0, 0]]), changes])
        for chip, plot in enumerate(self._plots):
            plot.data = (times, *changes[:, chip].T)
            plot.title = _heading(self._chips[chip], ChipFlag(int(reading.flags[chip])))


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
        title=_heading(name, ChipFlag.GOOD),
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
    wrong = [flag.name.lower() for flag in ChipFlag if flag in flags and flag.name]
    return f"{name} · {', '.join(wrong)}" if wrong else name


def _note(text: str) -> str:
    return (
        '<div style="padding:0 12px 6px;font-size:12px;color:var(--mantine-color-dimmed)">'
        f"{escape(text)}</div>"
    )


def _legend() -> str:
    estimated, true = (",".join(map(str, color)) for color in (ESTIMATED, TRUE))
    marks = (
        (f"background:rgb({estimated})", "estimated force, 50 mm per newton"),
        (f"background:rgba({true},.45)", "true force"),
        (f"border:1.5px solid rgb({estimated});height:9px", "95 % ellipse of the place"),
        (
            f"background:linear-gradient(90deg,#96866e,rgb({estimated}))",
            "creases sunk by 0 to 0.2 mm",
        ),
    )
    rows = (
        '<div style="display:flex;align-items:center;gap:8px"><span style="width:18px;height:6px;'
        f'border-radius:5px;box-sizing:border-box;{style}"></span>{text}</div>'
        for style, text in marks
    )
    return (
        f'<div style="padding:2px 12px 10px;font-size:12px;line-height:1.7">{"".join(rows)}</div>'
    )


def _curves() -> str:
    names = "".join(
        f'<span style="color:{color};font-weight:600;margin-right:14px">{name}</span>'
        for name, color in _AXES
    )
    return (
        f'<div style="padding:2px 12px 6px;font-size:12px">{names}'
        '<span style="color:var(--mantine-color-dimmed)">over the seconds since zero</span></div>'
    )


def _card(moment: Moment | None, rate: float, now: float, announced: tuple[str, str] | None) -> str:
    """The status, the touches and the pace, as HTML."""
    estimate = None if moment is None else moment.estimate
    latency = math.nan if moment is None else moment.latency
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
    touches = [] if moment is None or estimate is None else _touches(estimate, moment.truth)
    pace = " · ".join(
        (
            f'<span data-name="rate">{_number(rate, 0)} Hz</span>',
            f'<span data-name="latency">{_number(latency * 1e3, 1)} ms</span>',
        )
    )
    return (
        '<div style="padding:4px 12px 8px;font-variant-numeric:tabular-nums">'
        f'<div style="border-left:5px solid {color};padding-left:10px">'
        f'<div data-name="status" style="font-size:20px;font-weight:650;color:{color}">{word}</div>'
        f'<div data-name="sentence" style="font-size:12px;min-height:34px">{escape(sentence)}</div>'
        "</div>"
        f'<div data-name="touches" style="min-height:150px">{"".join(touches)}</div>'
        '<div style="font-size:12px;color:var(--mantine-color-dimmed)">readings '
        f"{pace}</div></div>"
    )


def _touches(estimate: Estimate, truth: Sequence[Contact]) -> list[str]:
    """A block for each estimated contact, beside the true one nearest to it."""
    blocks = []
    for contact, covariance in zip(estimate.contacts, estimate.covariance, strict=True):
        near = min(
            truth,
            key=lambda true: float(np.linalg.norm(true.position - contact.position)),
            default=None,
        )
        blocks.append(_touch(contact, covariance, near))
    return blocks


def _touch(contact: Contact, covariance: Floats, true: Contact | None) -> str:
    """One touch: a line with its place and force, and a table against the truth."""
    deviations = np.sqrt(np.diag(covariance))
    spread = (*deviations[:2], deviations[4], *deviations[2:4])
    rows = []
    for index, (name, unit, factor, digits) in enumerate(_QUANTITIES):
        value = _values(contact)[index] * factor
        deviation = spread[index] * factor
        cells = [f"{name}, {unit}", _number(value, digits)]
        cells.append(f"± {deviation:.{digits}f}" if math.isfinite(deviation) else "")
        if true is not None:
            actual = _values(true)[index] * factor
            cells += [_number(actual, digits), f"{round(value - actual, digits) + 0.0:+.{digits}f}"]
        rows.append(cells)
    heads = ["", "estimate", ""] + (["true", "error"] if true is not None else [])
    line = (
        f"x {contact.position[0] * 1e3:.1f} mm  y {contact.position[1] * 1e3:.1f} mm  "
        f"Fn {contact.normal_force:.2f} N"
    )
    return (
        '<div data-name="touch" style="font-size:15px;font-weight:600;white-space:pre;'
        f'margin:8px 0 2px">{line}</div>'
        '<table style="width:100%;font-size:12px;text-align:right;border-spacing:0">'
        + _row("th", heads)
        + "".join(_row("td", cells) for cells in rows)
        + "</table>"
    )


_QUANTITIES: Final = (
    ("x", "mm", 1e3, 1),
    ("y", "mm", 1e3, 1),
    ("Fn", "N", 1.0, 3),
    ("Fx", "N", 1.0, 3),
    ("Fy", "N", 1.0, 3),
)


def _values(contact: Contact) -> tuple[float, ...]:
    """x, y, Fn, Fx, Fy in SI."""
    x, y = contact.position
    return (
        float(x),
        float(y),
        contact.normal_force,
        float(contact.force[0]),
        float(contact.force[1]),
    )


def _row(tag: str, cells: Sequence[str]) -> str:
    style = "font-weight:400;color:var(--mantine-color-dimmed)"
    marked = (
        f'<{tag} style="{style if tag == "th" or not column else ""}'
        f'{";text-align:left" if not column else ""}">{cell}</{tag}>'
        for column, cell in enumerate(cells)
    )
    return f"<tr>{''.join(marked)}</tr>"


def _number(value: float, digits: int) -> str:
    """A number for people: no minus before zero, a dash where there is none."""
    return f"{round(value, digits) + 0.0:.{digits}f}" if math.isfinite(value) else "–"
