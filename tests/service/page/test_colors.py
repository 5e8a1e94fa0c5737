"""Colours of the pages: apart for every colour vision, text that can be read, words beside both."""

import re
from itertools import combinations, pairwise

import numpy as np
import pytest

from pages import FAINT, PLANAR, TOUCH, TOUCHED, feeding, reading
from smoskin.records import ChipFlag, Status
from smoskin.service.bridges import foxglove
from smoskin.service.page import carpet, history, panel, parts, scene

KINDS = {
    "normal": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
"""How colours are seen: Machado, Oliveira and Fernandes 2009, severity 1.0, linear sRGB."""
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
     [0.0193339, 0.1191920, 0.9503041]]
)  # fmt: skip
"""Linear sRGB to CIE XYZ, D65."""
APART = 20.0
"""Least distance in CIE Lab (1976) of two colours that mean different things."""
READABLE = 4.5
"""Least contrast of text, WCAG 2.2, 1.4.3."""
STATUSES = {panel._STATUS[status][1] for status in Status} | {
    panel._status(None, 0.0, None)[1],
    panel._status(None, 0.0, ("Calibrating", ""))[1],
}


def lamp_colors():
    """Colours of the chips' lamps, in all that they tell."""
    rows = "".join(
        history.lamps(("S1",), flags, drift)
        for flags in (None, np.array([0]), np.array([int(ChipFlag.MISSING)]))
        for drift in (None, np.full((1, 3), 1.0))
    )
    return set(re.findall(r"color:(#\w{6})", rows))


SETS = {
    "statuses": STATUSES,
    "lamps": lamp_colors(),
    "axes of a field": {color for _, color in panel._AXES},
    "forces": set(history._STROKES),
    "arrows": {scene.ESTIMATED, scene.TRUE, scene.MAGNETISED},
    "creases": {scene.CREASE, scene.SUNK},
    "Foxglove": {
        tuple(round(255 * part) for part in color[:3])
        for color in (foxglove._ESTIMATED, foxglove._SHEET)
    },
}


def linear(color):
    """Linear sRGB of #rrggbb or 0 to 255."""
    if isinstance(color, str):
        color = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    share = np.array(color) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(seen):
    """CIE Lab of linear sRGB."""
    ratio = XYZ @ np.clip(seen, 0.0, 1.0) / XYZ.sum(axis=1)
    x, y, z = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def contrast(first, second):
    """Ratio of two colours' luminances as WCAG has it."""
    dark, light = sorted(float((XYZ @ linear(color))[1]) for color in (first, second))
    return (light + 0.05) / (dark + 0.05)


def test_the_measures_are_those_of_the_literature():
    assert lab(linear("#ffffff")) == pytest.approx([100.0, 0.0, 0.0], abs=0.01)
    assert lab(linear("#ff0000")) == pytest.approx([53.24, 80.09, 67.20], abs=0.02)
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)
    for kind in KINDS.values():  # who sees any colour sees grey as grey
        assert np.sum(kind, axis=1) == pytest.approx(1.0, abs=1e-5)
    seen = [lab(np.array(KINDS["deuteranopia"]) @ linear(c)) for c in ("#8a9a00", "#c98400")]
    assert np.linalg.norm(seen[0] - seen[1]) < np.linalg.norm(
        lab(linear("#8a9a00")) - lab(linear("#c98400"))
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SETS)
def test_colors_that_mean_different_things_stay_apart(name, kind):
    assert len(SETS[name]) >= 2
    for first, second in combinations(SETS[name], 2):
        seen = [lab(np.array(KINDS[kind]) @ linear(color)) for color in (first, second)]
        assert np.linalg.norm(seen[0] - seen[1]) >= APART, (first, second)


@pytest.mark.parametrize("kind", KINDS)
def test_the_map_grows_lighter_for_every_colour_vision(kind):
    lightness = [lab(np.array(KINDS[kind]) @ linear(color))[0] for color in carpet._STEPS]
    assert all(later - sooner >= APART for sooner, later in pairwise(lightness))


def inks():
    """The page's variables of colour, in the light and in the dark."""
    blocks = re.findall(r":root \{([^}]*)\}", parts.text("page.css"))
    return [dict(re.findall(r"--skin-(\w+): (#\w+)", block)) for block in blocks]


def test_text_can_be_read():
    papers = ("#ffffff", "#242424")
    """Of the viewer's own panels."""
    assert len(inks()) == 2
    for named, panels in zip(inks(), papers, strict=True):
        whole = {name: c if len(c) == 7 else "#" + "".join(2 * d for d in c[1:])
                 for name, c in named.items()}  # fmt: skip
        for paper in (whole["paper"], panels):
            assert min(contrast(whole[ink], paper) for ink in ("ink", "dim")) >= READABLE
    (stop,) = re.findall(r"background: (#\w{6}); color: #fff\b", parts.text("page.css"))
    assert contrast(stop, "#ffffff") >= READABLE


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_text_of_a_page_can_be_read(scheme):
    pytest.importorskip("viser")
    from chromium import open_page
    from smoskin.service.page.view import View

    touched = {"on_press": lambda contacts: None, "on_zero": lambda: None}
    with (
        View(PLANAR, estimators=["Bayes", "closed form"], **touched) as view,
        open_page(view.url) as opened,
    ):
        opened.page.emulate_media(color_scheme=scheme)
        opened.page.locator(f'html[data-mantine-color-scheme="{scheme}"]').wait_for(
            state="attached"
        )
        with feeding(lambda k: view.write(reading(0.02 * k), TOUCHED, truth=[TOUCH])):
            opened.wait_until(lambda: opened.text("status") == "Touched")
            opened.page.wait_for_timeout(1000)
            faint = opened.page.evaluate(FAINT)
            assert set(faint) <= {"━━", "●"}


def test_text_has_the_page_s_ink_and_colors_mark_it():
    """Whatever has a colour of its own is a mark; words stand beside it."""
    names = ("arm", "card", "carpet", "curves", "finger", "forces", "legend", "lamps", "note")
    for name in (*names, "page", "recorded", "tally"):
        page = parts.text(f"{name}.html")
        for color, marked in re.findall(r'[";\s](?:color|fill)[:=]"?\s*([^;"}]+)"?>?([^<]*)', page):
            plain = color.strip() in ("var(--skin-dim)", "none")
            assert plain or marked.strip() in ("━━", "●"), (name, color, marked)
    for color in re.findall(r"[{;\s]color: ([^;}]+)", parts.text("page.css")):
        word = color.strip().removesuffix(" !important")
        assert word in ("var(--skin-ink)", "var(--skin-dim)", "#fff")


def test_no_state_is_told_by_its_color_alone():
    words = [word for word, _ in panel._STATUS.values()]
    assert len(set(words)) == len(words) == len(Status)
    states = set()
    for flags, drift in ((None, None), (0, None), (0, 1.0), (1, None), (2, None), (4, None)):
        given = None if flags is None else np.array([flags])
        far = None if drift is None else np.full((1, 3), drift)
        (word,) = re.findall(r"</td><td>([^<]+)</td><td>", history.lamps(("S1",), given, far))
        states.add(word)
    assert len(states) == 6
