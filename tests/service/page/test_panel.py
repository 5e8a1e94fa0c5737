"""The page's panels: sliders, curves, and words and numbers at the edges where they change."""

import numpy as np
import pytest

from pages import NOTHING, PLANAR, TOUCH, TOUCHED, reading
from smoskin.records import ChipFlag, Contact, Estimate, Status
from smoskin.service.page import panel as panels
from smoskin.service.page.panel import round_scale
from smoskin.service.page.scene import Moment
from smoskin.service.page.tally import Tally
from smoskin.service.page.view import View


@pytest.fixture
def view():
    with View(PLANAR, on_press=lambda contacts: None) as opened:
        yield opened


def moment(
    time=0.0, field=0.0, estimate=NOTHING, flags=None, truth=(), arrival=0.0, latency=np.nan
):
    return Moment(reading(time, field, flags), estimate, tuple(truth), None, latency, arrival)


def test_every_slider_starts_on_one_of_its_steps_within_its_ends(view):
    panel = view._panel
    sliders = {
        name: getattr(panel, f"_{name}")
        for name in ("push", "shear_x", "shear_y", "exaggeration", "opacity")
    }
    for name, slider in sliders.items():
        steps = np.array([slider.value - slider.min, slider.max - slider.value]) / slider.step
        np.testing.assert_allclose(steps, steps.round(), atol=1e-9, err_msg=name)
        assert (steps >= 0).all()
        assert steps.sum() >= 8, name  # fine enough to choose from
    # Presses and drags that estimators of the demonstration read: 0.05 to 1 N, 0.4 N either way.
    assert (sliders["push"].min, sliders["push"].max) == (0.05, 1.0)
    for name in ("shear_x", "shear_y"):
        assert (sliders[name].min, sliders[name].value, sliders[name].max) == (-0.4, 0.0, 0.4)
    assert panel.force == (0.0, 0.0, -0.5)
    # Deformation from life size, a sheet from nearly clear to paper.
    assert sliders["exaggeration"].min == 1.0
    assert (
        0 < sliders["opacity"].min <= 0.2 < sliders["opacity"].value < sliders["opacity"].max == 1
    )
    magnified, opacity, trail = panel.picture
    assert (magnified, opacity) == (sliders["exaggeration"].value, sliders["opacity"].value)
    assert trail.shape == (0, 2)


def test_the_trail_is_shown_where_it_is_asked_for(view):
    panel = view._panel
    panel.record(moment(estimate=TOUCHED))
    np.testing.assert_array_equal(panel.picture[2], [TOUCH.position])
    panel._trail.value = False
    assert panel.picture[2].shape == (0, 2)


@pytest.mark.parametrize(
    ("shown", "change", "end"),
    [
        (20, 3, 20), (20, 20, 20), (20, 20.5, 30), (30, 20, 30), (30, 13.5, 20),
        (30, 13.6, 30), (100, 44, 50), (100, 46, 100), (100, 100, 100), (100, 101, 150),
    ],
)  # fmt: skip
def test_curves_get_a_new_scale_where_they_leave_it_or_use_less_than_045_of_it(
    view, shown, change, end
):
    panel = view._panel
    panel._scale = float(shown)
    panel._fit(change)
    assert panel._scale == end
    if end != shown:
        assert {plot.scales["y"]["range"] for plot in panel._plots} == {(-end, end)}


def test_a_round_scale_is_the_least_of_its_numbers_that_holds():
    for change in np.geomspace(0.3, 3000, 97):
        end = round_scale(change)
        assert change <= end < 1.51 * change
        assert f"{end:.3e}"[:5] in {f"{k:.3f}" for k in (1, 1.5, 2, 3, 4, 5, 6, 8)}


def test_curves_hold_ten_seconds_since_the_zero(view):
    panel = view._panel
    for k in range(241):
        panel.record(moment(5 + 0.1 * k, 1e-6 * k))
        if k == 49:
            panel.write(moment(), 10.0, 0.0, None)
            times, *curves = panel._plots[0].data
            # Zeros before the zero, so that short curves have the scale of long ones.
            np.testing.assert_allclose(times[[0, 1, 2, -1]], [4.9 - 10, 0, 0, 4.9], atol=1e-9)
            np.testing.assert_allclose(curves[0][[0, 1, 2, -1]], [0, 0, 0, 49], atol=1e-9)
    panel.write(moment(), 10.0, 0.0, None)
    times, *curves = panel._plots[1].data
    np.testing.assert_allclose(times[[0, -1]], [14, 24], atol=0.11)
    assert len(times) == len(curves[0]) in (100, 101)
    np.testing.assert_allclose(curves[2], 10 * times, atol=1e-6)  # 1 uT in 0.1 s
    panel.zero()
    panel.record(moment(29.1, 300e-6))
    panel.write(moment(), 10.0, 0.0, None)
    times, *curves = panel._plots[1].data
    np.testing.assert_array_equal(times, [-10, 0, 0])
    np.testing.assert_array_equal(curves[0], [0, 0, 0])


@pytest.mark.parametrize(
    ("gap", "goes_on"), [(2.9, True), (3.1, False), (0.0, False), (-1.0, False)]
)
def test_curves_begin_anew_where_the_clock_jumps(view, gap, goes_on):
    panel = view._panel
    for time in (7.0, 8.0, 8.0 + gap):
        panel.record(moment(time))
    assert [time for time, _ in panel._history] == (
        [7.0, 8.0, 8.0 + gap] if goes_on else [8.0 + gap]
    )


@pytest.mark.parametrize("flag", [ChipFlag.MISSING, ChipFlag.INVALID])
def test_a_chip_that_gives_no_numbers_keeps_its_last_good_ones(view, flag):
    panel = view._panel
    panel.record(moment(0.0, 1e-6))
    panel.record(moment(0.1, 3e-6, flags=[0, flag, 0]))
    _, change = panel._history[-1]
    np.testing.assert_allclose(change, np.outer([2, 0, 2], np.ones(3)))
    panel.record(moment(0.2, 4e-6, flags=[0, ChipFlag.SATURATED, 0]))
    np.testing.assert_allclose(panel._history[-1][1], np.full((3, 3), 3))


@pytest.mark.parametrize(
    ("shown", "now", "word", "color"),
    [
        (None, 0.0, "Waiting", panels.GREY),
        (moment(estimate=None), 0.99, "Reading", panels.GREY),
        (moment(), 1.01, "Silent", panels.RED),
        *(
            (moment(estimate=Estimate(time=0.0, status=status)), 0.99, *panels._STATUS[status])
            for status in Status if status is not Status.CONTACT
        ),
        (moment(estimate=TOUCHED), 0.99, "Touched", panels.GREEN),
    ],
)  # fmt: skip
def test_a_word_and_a_colour_for_every_state(shown, now, word, color):
    assert panels._status(shown, now, None)[:2] == (word, color)
    assert panels._status(shown, now, ("Calibrating", "Touch 1."))[::2] == (
        "Calibrating",
        "Touch 1.",
    )


def test_numbers_that_are_unknown_are_left_out():
    pull = Contact(position=(0.01, 0.02), force=(0.3, 0.0, -0.4))
    far = Contact(position=(0.04, 0.02), force=(0.0, 0.0, -0.2))
    near = Contact(position=(0.0112, 0.02), force=(0.3, 0.1, -0.4))
    covariance = np.diag([1e-3, 2e-3, 0.03, 0.04, 0.05])[None] ** 2
    rows = panels._rows([pull], covariance, [far, near])
    cells = [row.replace("</td>", "|").replace("<td>", "") for row in rows.split("<tr>")[2:]]
    entries = [row.removesuffix("</tr>").removesuffix("|").split("|") for row in cells]
    whole = np.sqrt((0.6 * 0.03) ** 2 + (0.8 * 0.05) ** 2)  # along the force (0.6, 0, -0.8)
    assert entries == [
        ["x, mm", "10.0", "± 1.0", "11.2", "-1.2"],
        ["y, mm", "20.0", "± 2.0", "20.0", "+0.0"],
        ["F, N", "0.500", f"± {whole:.3f}", "0.510", "-0.010"],
        ["press, N", "0.400", "± 0.050", "0.400", "+0.000"],
        ["Fx, N", "0.300", "± 0.030", "0.300", "+0.000"],
        ["Fy, N", "0.000", "± 0.040", "0.100", "-0.100"],
    ]
    unknown = panels._rows([pull], np.full((1, 5, 5), np.nan), [])
    assert "±" not in unknown
    assert unknown.count("<td>–</td>") == 12
    assert panels._line(pull) == "x 10.0 mm  y 20.0 mm  F 0.50 N"


def test_a_second_touch_has_a_line_of_its_own(view):
    other = Contact(position=(0.02, 0.03), force=(0.0, 0.0, -0.25))
    two = Estimate(
        time=0.0,
        status=Status.CONTACT,
        contacts=(TOUCH, other),
        covariance=np.repeat(TOUCHED.covariance, 2, axis=0),
    )
    card = view._panel._card_html(moment(estimate=two, latency=2.5e-3), 99.6, 0.5, None)
    assert "second touch x 20.0 mm  y 30.0 mm  F 0.25 N" in card
    assert "100 readings/s" in card
    assert "2.5 ms" in card
    single = view._panel._card_html(moment(estimate=TOUCHED), 0.0, 0.5, None)
    assert "second touch" not in single
    assert "– ms" in single


@pytest.mark.parametrize(
    ("value", "push"), [(np.nan, 0.05), (-1.0, 0.05), (1e300, 1.0), (0.3, 0.3)]
)
def test_a_press_is_one_of_the_sliders_whatever_a_message_says(value, push):
    with View(PLANAR) as view:
        view._panel._push._impl.value = value
        assert view._panel.force == (0.0, 0.0, -push)


def test_buttons_stand_only_for_what_can_be_done():
    for undo, record, names in (
        (None, None, ("Pause", "Zero")),
        (print, None, ("Pause", "Zero", "Undo")),
        (print, print, ("Pause", "Zero", "Undo", "Record")),
    ):
        with View(PLANAR, on_undo=undo, on_record=record) as view:
            assert view._panel.actions.options == names
            assert view._panel.chooser is None


def test_readings_a_second_are_those_of_the_last_second(view):
    view._arrivals.extend([5.0, *(10 + 0.1 * np.arange(11))])
    assert view._rate(11.0) == pytest.approx(10)
    assert view._rate(11.55) == pytest.approx(10)  # five of them
    assert view._rate(11.95) == 0.0  # one alone
    assert view._rate(20.0) == 0.0
    view._arrivals.extend([30.0, 30.0])
    assert view._rate(30.0) == np.inf


def test_the_map_of_touches_has_a_square_where_each_was():
    extent = np.array([0.12, 0.24])
    tally = Tally(extent)
    places = [(0.0, 0.0), (0.06, 0.12), (0.06, 0.12), (0.1199, 0.2399)]
    for k, place in enumerate(places):
        contact = Contact(position=place, force=(0.0, 0.0, -0.5))
        estimate = Estimate(
            time=k, status=Status.CONTACT, contacts=(contact,), covariance=np.eye(5)[None]
        )
        off = Contact(position=(place[0] + 6e-4 * k, place[1] + 8e-4 * k), force=contact.force)
        for part in (0.0, 0.1):
            tally.add(moment(k + part, estimate=estimate, truth=[off]))
        tally.add(moment(k + 0.2))
    text = tally.html()
    assert "4 touches so far, off by 1.5 mm (median)" in text  # 0, 1, 2 and 3 mm
    squares = [part.split("/>")[0] for part in text.split("<rect ")[1:] if "rgba" in part]
    # 10 by 20 mm each; y counts from the lower edge, and the fullest is the darkest.
    assert sorted(squares) == sorted(
        f'x="{x}" y="{y}" width="10.0" height="20.0" fill="rgba(213,94,0,{dark})"'
        for x, y, dark in (
            ("0.0", "220.0", "0.62"),
            ("60.0", "100.0", "1.00"),
            ("110.0", "0.0", "0.62"),
        )
    )


def test_the_trail_keeps_the_last_150_places():
    tally = Tally(np.array([0.1, 0.2]))
    for k in range(200):
        contact = Contact(position=(1e-4 * k, 0.1), force=(0.0, 0.0, -0.5))
        estimate = Estimate(
            time=k, status=Status.CONTACT, contacts=(contact,), covariance=np.eye(5)[None]
        )
        tally.add(moment(0.1 * k, estimate=estimate))
    assert len(tally.trail) == 150
    np.testing.assert_allclose(tally.trail[[0, -1], 0], [50e-4, 199e-4])


def test_plots_begin_with_ten_flat_seconds_of_every_chip(view):
    plots = view._panel._plots
    assert [plot.title for plot in plots] == ["S1", "S2", "S3"]
    for plot in plots:
        times, *curves = plot.data
        np.testing.assert_array_equal(times, [-10.0, 0.0])
        assert len(curves) == 3
        assert not np.any(curves)
        assert plot.scales["y"]["range"] == (-20.0, 20.0)
        assert plot.scales["x"]["time"] is False  # else seconds are dates
        assert [line.get("stroke") for line in plot.series[1:]] == [
            color for _, color in panels._AXES
        ]
        assert plot.legend["show"] is plot.cursor["show"] is False


def test_a_chips_heading_says_what_is_wrong_with_it(view):
    panel = view._panel
    flags = [0, int(ChipFlag.MISSING | ChipFlag.OLD), int(ChipFlag.SATURATED)]
    shown = moment(flags=flags)
    panel.record(shown)
    panel.write(shown, 10.0, 0.0, None)
    assert [plot.title for plot in panel._plots] == ["S1", "S2 · missing, old", "S3 · saturated"]


def test_what_is_drawn_is_told_in_the_legend_in_its_colour():
    from smoskin.service.page.parts import css, html
    from smoskin.service.page.scene import (
        COLUMN,
        CREASE,
        ESTIMATED,
        FRAME,
        MAGNETISED,
        SUNK,
        TRUE,
    )

    colors = dict(panels._LEGEND)
    drawn = {"estimated": ESTIMATED, "true": TRUE, "rest": CREASE, "sunk": SUNK}
    assert colors == drawn | {"magnetised": MAGNETISED, "column": COLUMN, "frame": FRAME}
    text = html("legend", **{name: css(color) for name, color in colors.items()})
    for color in colors.values():
        assert f"rgb({color[0]}, {color[1]}, {color[2]})" in text


def test_the_controls_are_docked_at_the_right_and_leave_the_skin_in_view(view, monkeypatch):
    placed, handle = [], type(view._server.gui.main_panel)
    monkeypatch.setattr(handle, "dock_right", lambda panel: placed.append("right"))
    monkeypatch.setattr(handle, "set_width", lambda panel, width: placed.append(width))
    with View(PLANAR):
        where, width = placed
    assert where == "right"
    assert 250 < width < 450
