"""The flat half of the page: what the skin says in words, numbers and curves, and the controls.

Decides the wording, the colours of the statuses, the units shown (mm, N, uT, ms) and how much
history is drawn. Hides the viewer's widgets; the HTML stands beside this module. Numbers for
people carry a `data-name` attribute, by which programs find them in the page.
"""

import math
import threading
from collections import deque
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact, Status
from smoskin.service.page.carpet import Bound
from smoskin.service.page.history import ForceHistory, lamps
from smoskin.service.page.parts import AMBER, BLUE, GREEN, GREY, RED, css, html, within
from smoskin.service.page.player import Player
from smoskin.service.page.scene import (
    COLUMN,
    CREASE,
    ESTIMATED,
    FRAME,
    MAGNETISED,
    SUNK,
    TRUE,
    Moment,
)
from smoskin.service.page.tally import JUMP, Tally
from smoskin.service.replay import ReplaySource

if TYPE_CHECKING:
    import viser
    from viser import uplot

_HISTORY: Final = 10.0
_QUIET: Final = 20.0
"""Least that a plot shows to both sides of 0, uT, so that noise looks like noise."""
_STALE_AFTER: Final = 1.0
_STATUS: Final = {
    Status.CONTACT: ("Touched", GREEN),
    Status.NO_CONTACT: ("Not touched", GREY),
    Status.SATURATED: ("Saturated", RED),
    Status.OUT_OF_RANGE: ("Out of range", AMBER),
    Status.AMBIGUOUS: ("Ambiguous", AMBER),
    Status.STALE: ("Stale", AMBER),
    Status.CHIP_MISSING: ("Chip missing", RED),
    Status.NOT_CALIBRATED: ("Not calibrated", AMBER),
}
RECORD: Final = ("Record", "Stop recording")
"""What the button of recordings says while none goes on, and while one does."""
RERUN: Final = ("Play the last recording", "Back to live")
"""What the button below says while the skin is shown, and while what was recorded is."""
_AXES: Final = (("Bx", "#bf448a"), ("By", "#11a874"), ("Bz", "#1d6bc5"))
_LEGEND: Final = (
    ("estimated", ESTIMATED),
    ("true", TRUE),
    ("rest", CREASE),
    ("sunk", SUNK),
    ("magnetised", MAGNETISED),
    ("column", COLUMN),
    ("frame", FRAME),
)
_BAD: Final = ChipFlag.MISSING | ChipFlag.INVALID
_QUANTITIES: Final = (
    ("x, mm", 1),
    ("y, mm", 1),
    ("F, N", 3),
    ("press, N", 3),
    ("Fx, N", 3),
    ("Fy, N", 3),
)
"""Rows of a touch's table, and the digits that each shows; F is the whole force."""


def round_scale(change: float) -> float:
    """The least round end of an axis that holds this change.

    Examples
    --------
    >>> [round_scale(change) for change in (20, 21, 104, 999)]
    [20.0, 30.0, 150.0, 1000.0]
    """
    power = 10.0 ** math.floor(math.log10(change))
    return next(power * step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if power * step >= change)


class Panel:
    """The page's panels, of chips in the order of every reading.

    Where presses or recordings go nowhere their controls are left out; estimators are to choose
    from where there are two, and a source that is played has a player.
    """

    def __init__(
        self,
        server: "viser.ViserServer",
        title: str,
        design: SkinDesign,
        estimators: Sequence[str],
        *,
        pressable: bool,
        holdable: bool,
        undoable: bool,
        recordable: bool,
        played: ReplaySource | None = None,
    ) -> None:
        self._server, gui = server, server.gui
        self._chips = tuple(site.name for site in design.halls)
        self._zero: Floats = np.full((len(self._chips), 3), np.nan)
        self._field = self._zero
        self._start = 0.0
        self._scale = _QUIET
        self._history: deque[tuple[float, Floats]] = deque()
        self.tally = Tally(geometry(design).extent, once=played is not None)
        self.drift: Floats | None = None
        """(S, 3), T: how far the zero has followed; None where nobody has told."""
        self.end = ""
        """Last sentence of the page, empty while it goes on."""
        self.recording: tuple[bool, str, Path | None] = (False, "", None)
        """Whether a recording goes on, a sentence about the newest, and the file to be played."""
        self.refusal = ""
        """Sentence about a recording that cannot be played; empty while there is none."""
        self._notice, self._labels = "", threading.Lock()
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(31, 111, 181))
        gui.set_panel_label(title)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(340)
        self._card = gui.add_html(self._card_html(None, math.nan, 0.0, None))
        self.chooser = (
            gui.add_dropdown("Estimator", tuple(estimators), hint="What reads the chips.")
            if len(estimators) > 1
            else None
        )
        self._add_press(gui, pressable, holdable)
        actions = ("Pause", "Zero", *(("Undo",) * undoable), *(RECORD[:1] * recordable))
        self.actions = gui.add_button_group(
            "Actions", actions, hint="Let go before Zero; Undo goes back to the zero before."
        )
        self._add_recordings(recordable, played)
        with gui.add_folder("Touches so far"):
            self._touches = gui.add_html(self.tally.html())
        self._add_picture(gui)
        self._add_fields(server)

    def _add_recordings(self, recordable: bool, played: ReplaySource | None) -> None:
        """Add what is told of recordings, and what plays them."""
        gui = self._server.gui
        self._recorded = gui.add_html("", visible=False) if recordable else None
        self.rerun = gui.add_button(
            RERUN[0], visible=False, hint="What was estimated then; the skin is read on meanwhile."
        )
        self.player = None if played is None else Player(self._server, played)

    def _add_fields(self, server: "viser.ViserServer") -> None:
        """Add what stands at the left: how the chips are, what they read, and forces."""
        gui = server.gui
        fields = gui.add_panel()
        fields.dock_left()
        fields.set_width(320)
        with fields.add_tab("Field change, µT"):
            gui.add_html(html("curves", **dict(_AXES)))
            self._lamps = gui.add_html(lamps(self._chips, None, None))
            self._plots = [_plot(server, name) for name in self._chips]
        with fields.add_tab("Force, N"):
            self._forces = ForceHistory(gui)

    def _add_press(self, gui: "viser.GuiApi", pressable: bool, holdable: bool) -> None:
        """Add how hard a finger presses, and what the hand does meanwhile."""
        with gui.add_folder("Press the skin", visible=pressable):
            gui.add_html(html("note"))
            self._push = gui.add_slider("Press, N", 0.05, 1.0, 0.05, 0.5)
            self._shear_x = gui.add_slider("Shear x, N", -0.4, 0.4, 0.05, 0.0)
            self._shear_y = gui.add_slider("Shear y, N", -0.4, 0.4, 0.05, 0.0)
            self.still = gui.add_checkbox(
                "Hold the hand still",
                False,
                visible=holdable,
                hint="It touches on where it is, beside your finger.",
            )

    def _add_picture(self, gui: "viser.GuiApi") -> None:
        """Add how the skin is drawn, and what the colours mean."""
        with gui.add_folder("Picture"):
            self._exaggeration = gui.add_slider("Deformation ×", 1.0, 30.0, 1.0, 10.0)
            self._apart = gui.add_slider(
                "Taken apart", 0.0, 1.0, 0.05, 0.0, hint="Lifts the parts off each other."
            )
            self._opacity = gui.add_slider("Sheet opacity", 0.1, 1.0, 0.1, 0.6)
            self._scaled = gui.add_checkbox("Scales", False, hint="They cover the sheet.")
            self._mapped = gui.add_checkbox(
                "Map of the bound",
                False,
                visible=False,
                hint="How finely touches can be placed by this skin's chips.",
            )
            self._map = gui.add_html("", visible=False)
            self._trail = gui.add_checkbox("Trail", True, hint="Places that were estimated last.")
            colors = {name: css(color) for name, color in _LEGEND}
            gui.add_html(html("legend", **colors))

    @property
    def force(self) -> tuple[float, float, float]:
        """Force that a press exerts on the skin, as the sliders stand, N."""
        return within(self._shear_x), within(self._shear_y), -within(self._push)

    @property
    def picture(self) -> tuple[float, float, Floats]:
        """How much larger than life deformation is drawn, the sheet's opacity, and the trail."""
        trail = self.tally.trail if self._trail.value else np.zeros((0, 2))
        return float(self._exaggeration.value), float(self._opacity.value), trail

    @property
    def mapped(self) -> bool:
        """Whether the map of the bound is drawn."""
        return bool(self._mapped.value)

    def lay(self, bound: Bound) -> None:
        """Offer the map of a bound."""
        self._map.content = bound.legend()
        self._map.visible = self._mapped.visible = True

    @property
    def spread(self) -> tuple[float, bool]:
        """How far apart the skin is drawn, 0 to 1, and whether its scales are."""
        return float(self._apart.value), bool(self._scaled.value)

    def relabel(self, action: str, label: str) -> None:
        """Let a button that did one thing do its opposite."""
        with self._labels:
            options = self.actions.options
            if action in options:
                self.actions.options = tuple(label if name == action else name for name in options)

    def play(self, source: ReplaySource | None, caption: str = "") -> None:
        """Show the controls of what was recorded, or take them away."""
        if self.player is not None:
            self.player.remove()
        order, server = self.rerun.order + 0.5, self._server
        self.player = source and Player(server, source, order=order, caption=caption)
        self.rerun.label = RERUN[source is not None]
        self.relabel("Go on", "Pause")

    def write_recording(self) -> None:
        """Bring what is told of recordings up to date."""
        goes_on, sentence, finished = self.recording
        self.relabel(RECORD[not goes_on], RECORD[goes_on])
        self.rerun.visible = finished is not None
        sentence = self.refusal or sentence
        if sentence and sentence != self._notice and self._recorded is not None:
            self._notice, self._recorded.visible = sentence, True
            self._recorded.content = html("recorded", sentence=escape(sentence))

    def zero(self) -> None:
        """Draw the curves from the next reading's field onwards."""
        self._zero = np.full_like(self._zero, np.nan)
        self._history.clear()

    def record(self, moment: Moment, *, again: bool = False) -> None:
        """Add a moment to the curves and, unless it is shown again, to the touches so far."""
        if not again:
            self.tally.add(moment)
        self._forces.add(moment)
        reading = moment.reading
        # A chip that gives no numbers keeps its last good ones; its heading says so.
        bad = (reading.flags & _BAD) != 0
        self._field = np.where(bad[:, None], self._field, reading.field)
        if self._history and not 0.0 < reading.time - self._history[-1][0] <= JUMP:
            self._history.clear()  # a clock set anew, or a jump in a recording
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
        self._card.content = self._card_html(moment, rate, now, announced)
        self._touches.content = self.tally.html()
        self._lamps.content = lamps(
            self._chips, None if moment is None else moment.reading.flags, self.drift
        )
        self._forces.write()
        if moment is None or not self._history:
            return
        # Running seconds, because the plots lay out their axes anew only when a scale moves.
        times = np.array([time for time, _ in self._history]) - self._start
        changes = np.array([change for _, change in self._history])
        if times[0] == 0.0:
            # Zeros before the zero, so that short curves have the scale of long ones.
            times = np.concatenate([[times[-1] - _HISTORY, 0.0], times])
            changes = np.concatenate([np.zeros_like(changes[[0, 0]]), changes])
        self._fit(float(np.abs(changes).max()))
        for chip, plot in enumerate(self._plots):
            plot.data = (times, *changes[:, chip].T)
            plot.title = _heading(self._chips[chip], ChipFlag(int(moment.reading.flags[chip])))

    def _fit(self, change: float) -> None:
        """Give all curves one scale that holds this change, uT; it shrinks when half is idle."""
        if 0.45 * self._scale < change <= self._scale or change <= self._scale == _QUIET:
            return
        self._scale = round_scale(max(change, _QUIET))
        for plot in self._plots:
            plot.scales = _scales(self._scale)

    def _card_html(
        self, moment: Moment | None, rate: float, now: float, announced: tuple[str, str] | None
    ) -> str:
        """The status, the touches and the pace, as HTML; rows stay where they are."""
        estimate = None if moment is None else moment.estimate
        word, color, sentence = _status(moment, now, announced)
        contacts = () if estimate is None else estimate.contacts
        covariance = np.full((1, 5, 5), np.nan) if estimate is None else estimate.covariance
        truth = () if moment is None else moment.truth
        return html(
            "card",
            color=color,
            word=escape(word),
            sentence=escape(sentence),
            line=_line(contacts[0]) if contacts else "–",
            rows=_rows(contacts, covariance, truth),
            second=f"second touch {_line(contacts[1])}" if len(contacts) > 1 else " ",
            rate=_number(rate, 0),
            latency=_number(math.nan if moment is None else moment.latency * 1e3, 1),
            threshold=(self._forces.sentence() if moment else "") or " ",
            end=escape(self.end),
        )


def _status(
    moment: Moment | None, now: float, announced: tuple[str, str] | None
) -> tuple[str, str, str]:
    """Word, colour and sentence for how the skin is."""
    if announced is not None:
        return announced[0], BLUE, announced[1]
    if moment is None:
        return "Waiting", GREY, "No reading has come yet."
    if (age := now - moment.arrival) > _STALE_AFTER:
        return "Silent", RED, f"No reading for {age:.0f} s."
    if moment.estimate is None:
        return "Reading", GREY, "No estimator reads the skin."
    return *_STATUS[moment.estimate.status], moment.estimate.status.value


def _plot(server: "viser.ViserServer", name: str) -> "viser.GuiUplotHandle":
    """Curves of one chip over the seconds since the zero."""
    span, nothing = np.array((-_HISTORY, 0.0)), np.zeros(2)
    seconds: uplot.Axis = {"size": 24, "ticks": {"show": False}, "label": "s", "labelSize": 14}
    microtesla: uplot.Axis = {
        "size": 62,
        "ticks": {"show": False},
        "label": "µT",
        "labelSize": 16,
        "labelGap": 0,
    }
    curves: list[uplot.Series] = [
        {"stroke": color, "width": 1.6, "points": {"show": False}} for _, color in _AXES
    ]
    return server.gui.add_uplot(
        data=(span, nothing, nothing, nothing),
        series=({}, *curves),
        title=name,
        scales=_scales(_QUIET),
        axes=(seconds, microtesla),
        legend={"show": False},
        cursor={"show": False},
        height=200,
        padding=(10, 14, 4, 0),
    )


def _scales(widest: float) -> "dict[str, uplot.Scale]":
    """Seconds, and the field to both sides of 0, uT."""
    # Without `time` the seconds would be read as dates of 1970.
    return {"x": {"time": False}, "y": {"range": (-widest, widest)}}


def _heading(name: str, flags: ChipFlag) -> str:
    """Name of a chip, and what is wrong with its reading."""
    wrong = [flag.name.lower() for flag in ChipFlag if flag in flags and flag.name]
    return f"{name} · {', '.join(wrong)}" if wrong else name


def _line(contact: Contact) -> str:
    """A touch in a line; F is the whole force, as on its arrow."""
    x, y, force, *_ = _quantities(contact)
    return f"x {x:.1f} mm  y {y:.1f} mm  F {force:.2f} N"


def _rows(contacts: Sequence[Contact], covariance: Floats, truth: Sequence[Contact]) -> str:
    """A table's rows: the first touch against the nearest true one; empty without a touch."""
    rows = [_row("th", ["", "estimate", "", "true", "error"])]
    if not contacts:
        return "".join(rows + [_row("td", [name, "–", "", "–", "–"]) for name, _ in _QUANTITIES])
    contact = contacts[0]
    near = min(truth, key=lambda true: math.dist(true.position, contact.position), default=None)
    whole = contact.force / max(float(np.linalg.norm(contact.force)), 1e-9)
    spread = np.diag(covariance[0])
    variances = [spread[0], spread[1], whole @ covariance[0, 2:, 2:] @ whole, *spread[[4, 2, 3]]]
    deviations = np.sqrt(variances) * (1e3, 1e3, 1.0, 1.0, 1.0, 1.0)
    estimated, true = _quantities(contact), None if near is None else _quantities(near)
    for index, (name, digits) in enumerate(_QUANTITIES):
        value, deviation = estimated[index], deviations[index]
        cells = [name, _number(value, digits)]
        cells.append(f"± {deviation:.{digits}f}" if math.isfinite(deviation) else "")
        if true is None:
            cells += ["–", "–"]
        else:
            error = round(value - true[index], digits) + 0.0
            cells += [_number(true[index], digits), f"{error:+.{digits}f}"]
        rows.append(_row("td", cells))
    return "".join(rows)


def _quantities(contact: Contact) -> list[float]:
    """The numbers of a contact in the units of people: x, y, F, press, Fx, Fy."""
    x, y = (contact.position * 1e3).tolist()
    force = contact.force
    return [x, y, float(np.linalg.norm(force)), contact.normal_force, *force[:2].tolist()]


def _row(tag: str, cells: Sequence[str]) -> str:
    """A row of a table."""
    return f"<tr>{''.join(f'<{tag}>{cell}</{tag}>' for cell in cells)}</tr>"


def _number(value: float, digits: int) -> str:
    """A number for people: no minus before zero, a dash where there is none."""
    return f"{round(value, digits) + 0.0:.{digits}f}" if math.isfinite(value) else "–"
