"""What the page is sent before any reading: its panels, controls and plots, its light and eye.

All of it as a browser gets it, so that nothing is left to what the viewer would do by itself.
"""

import numpy as np
import pytest

from pages import PLANAR
from smoskin.service.page.scene import camera
from smoskin.service.page.view import View


def sent(view):
    """Everything that a browser gets on opening the page, in the order in which it was made."""
    server = view._scene._server
    return list(server._websock_server._broadcast_buffer.message_from_id.values())


def of_kind(messages, kind):
    return [message for message in messages if type(message).__name__ == f"{kind}Message"]


def only(messages, kind):
    (message,) = of_kind(messages, kind)
    return message


@pytest.fixture(scope="module")
def page():
    with View(PLANAR, on_press=lambda contacts: None, estimators=("one", "other")) as view:
        yield sent(view)


CONTROLS = [
    ("GuiHtml", "", None, True),
    ("GuiDropdown", "Estimator", "one", True),
    ("GuiFolder", "Press the skin", None, True),
    ("GuiHtml", "", None, True),
    ("GuiSlider", "Press, N", 0.5, True),
    ("GuiSlider", "Shear x, N", 0.0, True),
    ("GuiSlider", "Shear y, N", 0.0, True),
    ("GuiCheckbox", "Hold the hand still", False, False),
    ("GuiButtonGroup", "Actions", "Pause", True),
    ("GuiFolder", "Touches so far", None, True),
    ("GuiHtml", "", None, True),
    ("GuiFolder", "Picture", None, True),
    ("GuiSlider", "Deformation ×", 10.0, True),
    ("GuiSlider", "Taken apart", 0.0, True),
    ("GuiSlider", "Sheet opacity", 0.6, True),
    ("GuiCheckbox", "Scales", False, True),
    ("GuiCheckbox", "Map of the bound", False, False),
    ("GuiHtml", "", None, False),
    ("GuiCheckbox", "Trail", True, True),
    ("GuiHtml", "", None, True),
    ("GuiPanel", "", None, True),
    ("GuiHtml", "", None, True),
    ("GuiHtml", "", None, True),
    ("GuiUplot", "S1", None, True),
    ("GuiUplot", "S2", None, True),
    ("GuiUplot", "S3", None, True),
    ("GuiSlider", "Threshold, N", 0.5, True),
    ("GuiUplot", "Force", None, True),
    ("GuiHtml", "", None, True),
]
"""What a reader meets from top to bottom: kind, label, value, whether it is shown."""


def test_controls_stand_in_their_order_with_their_first_values(page):
    controls = []
    for message in page:
        kind = type(message).__name__.removesuffix("Message")
        if kind in {name for name, *_ in CONTROLS}:
            label = (
                getattr(message.props, "label", None) or getattr(message.props, "title", None) or ""
            )
            controls.append((kind, label, getattr(message, "value", None), message.props.visible))
    assert controls == CONTROLS


def test_sliders_have_their_ends_and_steps(page):
    ends = {
        slider.props.label: (slider.props.min, slider.props.max, slider.props.step)
        for slider in of_kind(page, "GuiSlider")
    }
    assert ends == {
        "Press, N": (0.05, 1.0, 0.05),
        "Shear x, N": (-0.4, 0.4, 0.05),
        "Shear y, N": (-0.4, 0.4, 0.05),
        "Deformation ×": (1.0, 30.0, 1.0),
        "Taken apart": (0.0, 1.0, 0.05),
        "Threshold, N": (0.05, 1.0, 0.05),
        "Sheet opacity": (0.1, 1.0, 0.1),
    }
    assert only(page, "GuiDropdown").props.options == ("one", "other")
    assert only(page, "GuiButtonGroup").props.options == ("Pause", "Zero")


def test_controls_stand_in_their_folders(page):
    names = {
        "root": "",
        **{folder.uuid: folder.props.label for folder in of_kind(page, "GuiFolder")},
    }
    inside = {
        control.props.label: names[control.container_uuid]
        for kind in ("GuiSlider", "GuiCheckbox", "GuiButtonGroup", "GuiDropdown")
        for control in of_kind(page, kind)
        if control.container_uuid in names
    }
    drawn = ("Deformation ×", "Taken apart", "Sheet opacity", "Scales")
    picture = (*drawn, "Map of the bound", "Trail")
    hand = ("Press, N", "Shear x, N", "Shear y, N", "Hold the hand still")
    assert inside == {
        **dict.fromkeys(picture, "Picture"),
        **dict.fromkeys(hand, "Press the skin"),
        **dict.fromkeys(("Actions", "Estimator"), ""),
    }
    tabs = only(page, "GuiPanel").props
    assert tabs._tab_labels == ("Field change, µT", "Force, N")
    curves, forces = tabs._tab_container_ids
    *chips, force = of_kind(page, "GuiUplot")
    assert {plot.container_uuid for plot in chips} == {curves}
    assert force.container_uuid == forces


def test_the_numbers_stand_on_the_right_and_the_curves_on_the_left(page):
    places = {
        message.uuid: message.position["edge"] for message in of_kind(page, "GuiSetPanelPosition")
    }
    widths = {message.uuid: message.width for message in of_kind(page, "GuiSetPanelWidth")}
    main, fields = "viser-control-panel", only(page, "GuiPanel").uuid
    assert places == {main: "right", fields: "left"}
    # A telephone held upright is 390 wide; the picture of a screen of 1366 keeps half of it.
    assert 300 <= widths[fields] < widths[main] < 390
    assert sum(widths.values()) <= 1366 / 2
    assert only(page, "SetGuiPanelLabel").label == "smoskin: planar"
    theme = only(page, "ThemeConfiguration")
    assert not theme.show_logo
    assert not theme.show_share_button


def test_curves_start_empty_over_ten_seconds_and_to_both_sides_of_zero(page):
    for plot in of_kind(page, "GuiUplot")[:-1]:
        shown = plot.props
        assert len(shown.data) == len(shown.series) == 4
        np.testing.assert_array_equal(shown.data[0], [-10.0, 0.0])
        assert not np.any(shown.data[1:])
        assert shown.scales == {"x": {"time": False}, "y": {"range": (-20.0, 20.0)}}
        seconds, field = shown.axes
        assert (seconds["label"], field["label"]) == ("s", "µT")
        # A label keeps clear of the numbers, for which the second axis needs more room.
        assert seconds["labelSize"] < seconds["size"] < field["size"]
        assert field["labelSize"] < field["size"] / 2
        assert field["labelGap"] == 0
        assert not any(axis["ticks"]["show"] for axis in shown.axes)
        assert not shown.legend["show"]
        assert not shown.cursor["show"]
        assert len({curve["stroke"] for curve in shown.series[1:]}) == 3
        for curve in shown.series[1:]:
            assert not curve["points"]["show"]
            assert 1 <= curve["width"] <= 2


def test_two_lights_of_the_scenes_own_shine_on_the_skin(page):
    assert only(page, "EnvironmentMap").hdri_data is None
    assert only(page, "EnableLights").enabled is False
    lights = [message for message in page if type(message).__name__.endswith("LightMessage")]
    assert [light.name for light in lights] == ["/light/sky", "/light/sun"]
    ((x, y, z),) = (
        message.position for message in of_kind(page, "SetPosition") if message.name == "/light/sun"
    )
    # The sun grazes from the left: 20 to 45 degrees high, and hardly from in front.
    assert x < 0
    assert -x > 3 * abs(y)
    assert 20 < np.rad2deg(np.arctan2(z, np.hypot(x, y))) < 45


def test_the_page_opens_with_the_cameras_eye(page):
    position, target, field_of_view = camera(PLANAR)
    np.testing.assert_allclose(only(page, "SetCameraPosition").position, position * 100)
    np.testing.assert_allclose(only(page, "SetCameraLookAt").look_at, target * 100)
    assert only(page, "SetCameraFov").fov == field_of_view


def test_what_lies_under_the_sheet_is_flat_and_its_names_stand_in_its_middle(page):
    boxes = {box.name: np.array(box.props.dimensions) for box in of_kind(page, "Box")}
    assert set(boxes) == {f"/chips/{site.name}" for site in PLANAR.halls}
    for size in boxes.values():
        assert 0.1 < size[2] < 0.2
        assert size[0] == size[1] == pytest.approx(0.4)  # cm, somewhat larger than life
    labels = {label.name: label.props for label in of_kind(page, "Label") if "chips" in label.name}
    assert set(labels) == {f"/chips/{site.name}/label" for site in PLANAR.halls}
    assert {label.anchor for label in labels.values()} == {"center-center"}
