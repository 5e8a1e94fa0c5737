"""Sources by URL, and the pace of playback and of the twin."""

import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, DesignError, SourceError
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.pace import Pace
from smoskin.records import Contact, Reading
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource, open_source
from smoskin.twin.creep import Creep
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin
from touch_recordings import FakeTime, recorded

DESIGN = read_design("planar")
CHIPS = len(DESIGN.halls)


# ---------------------------------------------------------------- twin


def test_the_twin_keeps_its_rate() -> None:
    fake = FakeTime()
    source = TwinSource(ReducedTwin(DESIGN), rate=50.0, pace=Pace(fake.clock, fake.sleep))
    times = [source.read().time for _ in range(5)]  # type: ignore[union-attr]
    np.testing.assert_allclose(times, [0.0, 0.02, 0.04, 0.06, 0.08])
    assert fake.now == pytest.approx(1000.08)


def test_the_twin_skips_what_nobody_read_in_time() -> None:
    fake = FakeTime()
    source = TwinSource(ReducedTwin(DESIGN), rate=100.0, pace=Pace(fake.clock, fake.sleep))
    source.read()
    fake.now += 0.055  # readings 1 to 4 pass, 5 is waited for no more
    late, following = source.read(), source.read()
    assert late is not None
    assert following is not None
    assert (late.time, following.time) == (pytest.approx(0.05), pytest.approx(0.06))
    assert fake.now == pytest.approx(1000.06)
    assert source.missed == 4


def test_an_unpaced_twin_never_waits() -> None:
    def never(_: float) -> None:
        raise AssertionError("slept")

    source = TwinSource(ReducedTwin(DESIGN), rate=10.0, speed=float("inf"), pace=Pace(sleep=never))
    times = [source.read().time for _ in range(4)]  # type: ignore[union-attr]
    np.testing.assert_allclose(times, [0.0, 0.1, 0.2, 0.3])


def test_a_touch_shows_in_the_next_reading() -> None:
    source = TwinSource(ReducedTwin(DESIGN, seed=None), speed=float("inf"))
    free = source.read()
    press = [Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5))]
    source.touch(press)
    pressed = source.read()
    source.touch([])
    again = source.read()
    assert free is not None
    assert pressed is not None
    assert again is not None
    np.testing.assert_array_equal(pressed.field, ReducedTwin(DESIGN, seed=None).read(press).field)
    assert np.abs(pressed.field - free.field).max() > 1e-5
    np.testing.assert_array_equal(again.field, free.field)


def test_an_impossible_touch_raises_where_it_is_made() -> None:
    source = TwinSource(ReducedTwin(DESIGN), speed=float("inf"))
    with pytest.raises(ArgumentError, match="position must lie on the skin"):
        source.touch([Contact(position=(9.0, 9.0), force=(0.0, 0.0, -0.5))])
    assert source.read() is not None


def test_the_same_seed_gives_the_same_readings() -> None:
    url = "twin://planar?rate=1000&seed={}&speed=max&mechanics=reduced"
    source, same, other = (open_source(url.format(seed)) for seed in (7, 7, 8))
    first = source.read()
    assert first is not None
    assert first == same.read()
    assert first != other.read()


def test_touching_from_another_thread_while_reading() -> None:
    source = TwinSource(ReducedTwin(DESIGN), rate=500.0)
    stop = threading.Event()

    def rub() -> None:
        while not stop.is_set():
            for x in (0.03, 0.06):
                source.touch([Contact(position=(x, 0.08), force=(0.0, 0.0, -0.3))])

    rubbing = threading.Thread(target=rub)
    rubbing.start()
    try:
        times = [source.read().time for _ in range(50)]  # type: ignore[union-attr]
    finally:
        stop.set()
        rubbing.join(5.0)
    assert times == sorted(set(times))


def settled(source: TwinSource) -> np.ndarray:
    reading = source.read()
    assert reading is not None
    return reading.field


def test_a_touch_creeps_in_and_out_again() -> None:
    """With the rubber's own compliance, and to the same end as without creep."""
    skin, solid = ReducedTwin(DESIGN, seed=None), elastomer_prony(DESIGN.columns.material)
    source = TwinSource(skin, rate=1.0, speed=float("inf"), creep=Creep(DESIGN))
    touch = [Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.05))]
    rest, end = skin.read().field, skin.read(touch).field
    np.testing.assert_array_equal(settled(source), rest)
    source.touch(touch)
    held = np.array([(settled(source) - rest)[1, 0] for _ in range(300)]) / (end - rest)[1, 0]
    assert held[0] < 0.99
    assert held[-1] == pytest.approx(1.0, abs=1e-3)
    # The touch grows over the first second; long after, that no longer shows.
    since = np.arange(len(held)) + 0.5
    np.testing.assert_allclose(held[20:], solid.compliance(since[20:]), atol=3e-3)
    source.touch([])
    left = np.array([(settled(source) - rest)[1, 0] for _ in range(300)]) / (end - rest)[1, 0]
    assert 0.01 < left[0] < 0.15
    np.testing.assert_allclose(left[20:], 1 - solid.compliance(since[20:]), atol=3e-3)


def test_creep_goes_on_through_readings_that_nobody_read() -> None:
    fake = FakeTime()
    press = [Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5))]
    skin = ReducedTwin(DESIGN, seed=None)
    patient = TwinSource(skin, rate=10.0, speed=float("inf"), creep=Creep(DESIGN))
    late = TwinSource(skin, rate=10.0, creep=Creep(DESIGN), pace=Pace(fake.clock, fake.sleep))
    for source in (patient, late):
        settled(source)
        source.touch(press)
        settled(source)
    every = [settled(patient) for _ in range(20)]
    fake.now += 1.23
    last = late.read()
    assert last is not None
    assert late.missed == 11
    np.testing.assert_allclose(last.field, every[late.missed], rtol=1e-12)


def test_the_temperature_is_set_and_read() -> None:
    with open_source("twin://planar?temperature=45&mechanics=reduced&speed=max") as source:
        reading = source.read()
    assert reading is not None
    np.testing.assert_allclose(reading.temperature, 45.0, atol=0.05)
    cold = ReducedTwin(DESIGN, seed=None).read()
    np.testing.assert_allclose(reading.field, 0.9 * cold.field, atol=1e-5)


def test_a_warm_skin_moves_as_it_does_in_the_warmth() -> None:
    touch = Contact(position=(0.05, 0.07), force=(0.0, 0.0, -0.6))
    twin, warm = ReducedTwin(DESIGN, seed=None), 40.0
    with TwinSource(twin, temperature=warm, speed=float("inf")) as source:
        source.touch([touch])
        reading = source.read()
    assert reading is not None
    motion = twin.motion([touch], temperature=warm)
    expected = twin.sense(motion, time=0.0, temperature=warm).field
    np.testing.assert_array_equal(reading.field, expected)
    stiff = twin.sense(twin.motion([touch]), time=0.0, temperature=warm).field
    assert np.abs(stiff - expected).max() > 5e-6


def test_the_whole_sheet_is_the_default() -> None:
    touch = [Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5))]
    with open_source("twin://planar?manufactured=yes&seed=3&speed=max&creep=no") as source:
        assert isinstance(source, TwinSource)
        source.read()
        source.touch(touch)
        reading = source.read()
    made = Twin(DESIGN, seed=3, manufactured=True)
    made.read()
    assert reading is not None
    expected = made.read(touch)
    np.testing.assert_array_equal(reading.field, expected.field)


def test_the_rubber_creeps_unless_it_is_told_not_to() -> None:
    """Estimators undo creep, so a virtual skin has it too."""
    touch = [Contact(position=(0.05, 0.067), force=(0.0, 0.0, -1.5))]
    settled = {}
    for option in ("", "&creep=yes", "&creep=no"):
        url = f"twin://planar?mechanics=reduced&speed=max&rate=1{option}"
        with open_source(url) as source:
            assert isinstance(source, TwinSource)
            source.read()
            source.touch(touch)
            fields = [source.read().field for _ in range(20)]  # type: ignore[union-attr]
            settled[option] = np.abs(fields[0] - fields[-1]).max()
    assert settled[""] == settled["&creep=yes"] > 5 * settled["&creep=no"]


# ---------------------------------------------------------------- URLs


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("touch.mcap", r"url must be replay:FILE.* or twin://DESIGN.*; got 'touch.mcap'"),
        ("usb:///dev/ttyACM0", r"url must be replay:FILE"),
        ("spi://1", r"url must be replay:FILE"),
        ("replay:", r"url must be replay:FILE"),
        ("twin://?rate=3", r"url must be replay:FILE"),
        ("", r"url must be replay:FILE"),
        ("twin://planar?speeed=1", "options must be of rate, seed, speed, .*; got 'speeed'"),
        ("twin://planar?mechanics=rigid", "mechanics must be one of whole, reduced; got 'rigid'"),
        ("twin://planar?creep=1", "creep must be one of yes, no; got '1'"),
        ("twin://planar?temperature=hot", "temperature must be a number of degC; got 'hot'"),
        (
            "twin://planar?temperature=90&mechanics=reduced",
            r"temperature must lie in .*75 degC; got 90\.0",
        ),
        (
            "twin://planar?manufactured=yes&mechanics=reduced",
            "manufactured=yes needs mechanics=whole",
        ),
        ("replay:a.mcap?rate=100", "options must be of speed, gap; got 'rate'"),
        ("replay:a.mcap?speed=1&speed=2", "option 'speed' must be given once"),
        ("replay:a.mcap?speed", "options must be written NAME=VALUE"),
        ("replay:a.mcap?speed=-1", "speed must be a number >= 0 or 'max'; got '-1'"),
        ("replay:a.mcap?speed=fast", "speed must be a number >= 0 or 'max'; got 'fast'"),
        ("replay:a.mcap?speed=nan", "speed must be a number >= 0 or 'max'; got 'nan'"),
        ("replay:a.mcap?gap=0", "gap must be a positive number; got '0'"),
        ("twin://planar?rate=0", "rate must be a positive number; got '0'"),
        ("twin://planar?rate=max", "rate must be a positive number; got 'max'"),
        ("twin://planar?seed=1.5", r"seed must be a whole number >= 0; got '1\.5'"),
    ],
)
def test_a_wrong_url_says_what_would_be_right(url: str, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        open_source(url)


def test_what_cannot_be_opened_is_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"none\.mcap cannot be read: No such file"):
        open_source(f"replay:{tmp_path / 'none.mcap'}")
    (tmp_path / "text.mcap").write_text("hello")
    with pytest.raises(SourceError, match="not an MCAP file"):
        open_source(f"replay:{tmp_path / 'text.mcap'}")
    with pytest.raises(DesignError, match="planar"):
        open_source("twin://no-such-design")


@pytest.mark.parametrize("zero", ["max", "0", "0.0"])
def test_as_fast_as_possible_has_two_names(zero: str, tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.mcap", [0.25 * index for index in range(40)])
    start = time.monotonic()
    with open_source(f"replay:{path}?speed={zero}") as source:
        assert len(list(source)) == 40
    assert time.monotonic() - start < 5.0


def test_wrong_paces_are_refused(tmp_path: Path) -> None:
    recording = open_recording(recorded(tmp_path / "a.mcap", [0.0]))
    for value in (0.0, -1.0, 1e-9, 1e9, float("nan"), "1", None, True):
        with pytest.raises(ArgumentError, match=r"speed must be from 0\.001 to 1000 or inf; got"):
            ReplaySource(recording, speed=value)  # type: ignore[arg-type]
        with pytest.raises(ArgumentError, match="speed must be from"):
            TwinSource(ReducedTwin(DESIGN), speed=value)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match=r"longest_gap must be from 1e-06 to 1e\+06; got nan"):
        ReplaySource(recording, longest_gap=float("nan"))
    for value in (-1.0, float("inf"), 1e308):
        with pytest.raises(ArgumentError, match=r"rate must be from 0\.01 to 100000; got"):
            TwinSource(ReducedTwin(DESIGN), rate=value)


def test_a_path_is_that_of_a_recording(tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.mcap", [0.0, 0.01])
    with open_source(path) as source:
        assert [reading.time for reading in source] == [0.0, 0.01]
    for junk in (None, 3, b"twin://planar", ["twin://planar"]):
        with pytest.raises(ArgumentError, match="url must be replay:FILE"):
            open_source(junk)  # type: ignore[arg-type]


def test_a_scripted_hand_touches_what_nothing_else_does() -> None:
    twin = ReducedTwin(DESIGN, seed=None)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    source = TwinSource(twin, speed=float("inf"), hand=[touch])
    held = []
    for _ in range(150):
        source.read()
        held.append(source.contacts)
    assert not any(held[:26])
    assert (touch,) in held[26:60]
    assert not any(held[95:105])  # between its touches
    assert (touch,) in held[105:150]
    other = Contact(position=(0.09, 0.02), force=(0.0, 0.0, -0.4))
    source.touch([other])
    source.read()
    assert source.contacts == (other,)
    with open_source("twin://planar?mechanics=reduced&speed=max&hand=yes") as opened:
        assert isinstance(opened, TwinSource)
        touched = [bool(opened.read() and opened.contacts) for _ in range(200)]
    assert sum(touched) > 50


def test_chips_are_those_of_the_design(tmp_path: Path) -> None:
    design = replace(DESIGN, halls=DESIGN.halls[:2])
    assert TwinSource(ReducedTwin(design)).chips == 2
    with Recorder(tmp_path / "two.mcap", design) as sink:
        sink.write(Reading(time=0.0, field=np.zeros((2, 3))))
    assert ReplaySource(open_recording(tmp_path / "two.mcap")).chips == 2
