"""A skin of known figures, recorded, and what the report says of it; a twin on a virtual rig."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.commands.report import characterise, write_report
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, FileError, RecordingError
from smoskin.magnetics import mlx90393
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, HeldTouch, Reading, Trace
from smoskin.service.kept import Campaign
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.rig import VirtualRig
from touch_recordings import DESIGN, record

STIFFNESS, LOST, LAGGING = 4e3, 0.12, 0.07
"""N/m, and shares of the loops of force over depth and signal over force."""
GAIN, OTHERS, TAU = 1e-3, 0.2, 0.4
"""T/N at the nearest chip, the share of it at the others, and s of the recovery."""
SIGMA, WARMTH, REST = 2e-6, -0.005, 5e-3
"""T of noise an axis, 1/K, and T of each axis at rest."""
CHIPS = geometry(DESIGN).chips[:, :2]
RATE = 100.0


def touch(
    rng: np.random.Generator,
    begin: float,
    place: tuple[float, float],
    force: float,
    *,
    degrees: float = 25.0,
    slow: bool = True,
    spread: float = 0.0,
) -> HeldTouch:
    """A touch of the known skin: half a second of rest, a ramp, a hold and the way back."""
    back = 1.0 if slow else 1.0 / RATE
    ends = begin + np.cumsum([0.5, 1.0, 0.3, back, 0.2 if slow else 3.0])
    times = begin + np.arange(round((ends[-1] - begin) * RATE) + 1) / RATE
    up = np.clip((times - ends[0]) / 1.0, 0.0, 1.0)
    u = np.where(times > ends[2], np.clip((ends[3] - times) / back, 0.0, 1.0), up)
    down = times > ends[2]
    felt = force * (u - 3.0 * LOST * u * (1.0 - u) * down)
    part = felt / force
    signal = felt * (1.0 + 3.0 * LAGGING * (1.0 - part) * down)
    if not slow:
        signal = np.where(down, force * np.exp(-(times - ends[2]) / TAU), signal)
    warm = 1.0 + WARMTH * (degrees - 25.0)
    near = np.argmin(np.linalg.norm(CHIPS - place, axis=1))
    gains = np.where(np.arange(3) == near, GAIN, OTHERS * GAIN) * (1.0 + spread * rng.normal())
    fields = warm * (REST + np.multiply.outer(signal, np.outer(gains, [0.0, 0.6, -0.8])))
    fields = fields + SIGMA * rng.normal(size=fields.shape)
    zeros = np.zeros(len(times))
    height = np.where(u > 0.0, -force * u / STIFFNESS, 5e-3)
    begins = [begin, *ends.tolist()]
    names = ("rest", "press", "hold", "retract", "recovery")
    return HeldTouch(
        contact=Contact(position=place, force=(0.0, 0.0, -force)),
        readings=tuple(
            Reading(time=t, field=b, temperature=[degrees] * 3)
            for t, b in zip(times, fields, strict=True)
        ),
        rest=(begins[0], begins[1]),
        held=(begins[2] + 0.02, begins[3]),
        trace=Trace(
            gauge=np.column_stack([times, zeros, zeros, -felt]),
            stage=np.column_stack([times, zeros + place[0], zeros + place[1], height]),
            phases=[*zip(names, begins[:-1], begins[1:], strict=True)],
        ),
    )


def recording(path: Path, **options: object) -> Path:
    rng = np.random.default_rng(5)
    touches = [(CHIPS[1], 0.3), (CHIPS[1], 0.9), *[(CHIPS[2], 0.6)] * 4]
    with Campaign(path, DESIGN, rig={"rig": "by hand"}) as campaign:
        for number, (place, force) in enumerate(touches):
            made = touch(rng, 10.0 * number, place, force, **options)  # type: ignore[arg-type]
            campaign.add(made)
    return path


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("report")
    return {
        "slow": recording(folder / "slow.mcap", spread=0.02),
        "cold": recording(folder / "cold.mcap", slow=False, degrees=15.0),
        "warm": recording(folder / "warm.mcap", slow=False, degrees=40.0),
    }


def test_every_figure_of_a_known_skin_is_found(known: dict[str, Path]) -> None:
    figures = {figure.name: figure for figure in characterise([*known.values()]).figures}
    unknown = {figure.name: figure.reason for figure in figures.values() if figure.reason}
    assert unknown == {
        "rig_compliance": "no recording of a rigid block was given, with gauge and stage"
    }

    def close(name: str, expected: float, share: float) -> None:
        measured = figures[name].measured
        assert_allclose(measured.value, expected, rtol=share, err_msg=name)
        assert measured.deviation >= 0.0 or name == "sensitivity", name

    close("noise", 1e6 * SIGMA, 0.02)
    close("stiffness", 1e-3 * STIFFNESS, 1e-3)
    # The first twentieth of the force is not in the loops.
    close("hysteresis", 100 * LOST, 0.02)
    close("signal_hysteresis", 100 * LAGGING, 0.06)
    close("crosstalk", 100 * OTHERS, 0.03)
    for part in (10, 5, 1):
        close(f"recovery_{part}_percent", -TAU * np.log(part / 100), 0.03)
    close("rest_temperature", 100 * WARMTH, 0.01)
    close("touch_temperature", 100 * WARMTH, 0.03)
    size = GAIN * (1 + 2 * OTHERS**2) ** 0.5
    for label, value in figures["sensitivity"].parts:
        warm = 1.0 + WARMTH * ({"2": 15.0, "3": 40.0}.get(label[-1], 25.0) - 25.0)
        assert_allclose(value, 1e6 * size * warm, rtol=0.05)
    slow = dict(figures["repeatability"].parts)
    expected = np.array([slow[label] for label in slow if label.endswith("recording 1")])
    assert 0.5 < expected.mean() < 4.0  # of 2 %, from four touches


def test_the_rigs_own_give_is_taken_off(known: dict[str, Path], tmp_path: Path) -> None:
    rng, give = np.random.default_rng(1), 30e-6
    path = tmp_path / "block.mcap"
    with Campaign(path, DESIGN) as campaign:
        for number in range(3):
            made = touch(rng, 10.0 * number, (0.05, 0.05), 0.9)
            assert made.trace is not None
            stage = made.trace.stage.copy()
            stage[:, 3] = np.minimum(give * made.trace.gauge[:, 3], 0.0)
            trace = Trace(gauge=made.trace.gauge, stage=stage, phases=made.trace.phases)
            campaign.add(replace(made, trace=trace))
    figures = {f.name: f.measured for f in characterise([known["slow"]], block=path).figures}
    assert_allclose(figures["rig_compliance"].value, 1e6 * give, rtol=1e-3)
    # The skin and the rig gave way one after the other.
    assert_allclose(1.0 / figures["stiffness"].value, 1e3 * (1.0 / STIFFNESS - give), rtol=2e-3)


@pytest.mark.parametrize("late", [-0.03, 0.0, 0.0417])
def test_the_skins_lag_behind_the_gauge_is_found(tmp_path: Path, late: float) -> None:
    path = tmp_path / "a.mcap"
    with Campaign(path, DESIGN) as campaign:
        for number in range(3):
            made = touch(np.random.default_rng(number), 10.0 * number, CHIPS[1], 0.6)
            assert made.trace is not None
            gauge = made.trace.gauge - np.array([late, 0.0, 0.0, 0.0])
            trace = Trace(gauge=gauge, stage=made.trace.stage, phases=made.trace.phases)
            campaign.add(replace(made, trace=trace))
    lag = next(f.measured for f in characterise([path]).figures if f.name == "gauge_lag")
    assert lag.count == 3
    assert_allclose(lag.value, 1e3 * late, atol=1.0)


def test_uncertainties_cover_what_is_missed(known: dict[str, Path]) -> None:
    figures = {figure.name: figure for figure in characterise([known["cold"]]).figures}
    noise = figures["noise"].measured
    assert abs(noise.value - 1e6 * SIGMA) < 4.0 * noise.deviation < 0.2 * noise.value
    recovery = figures["recovery_10_percent"].measured
    assert abs(recovery.value + TAU * np.log(0.1)) < 4.0 * recovery.deviation < 0.05


def test_what_a_recording_cannot_give_says_why(known: dict[str, Path]) -> None:
    quick = {figure.name: figure for figure in characterise([known["cold"]]).figures}
    assert quick["hysteresis"].reason == "the gauge was not read while a touch was let go slowly"
    assert "varied by 0.0 K at one place, less than 3 K" in quick["rest_temperature"].reason
    slow = {figure.name: figure for figure in characterise([known["slow"]]).figures}
    for part in (10, 5, 1):
        assert "no load was taken away at once" in slow[f"recovery_{part}_percent"].reason
    assert slow["recovery_1_percent"].as_json()["value"] is None


def test_a_rig_that_tells_no_trace_gives_what_its_holds_give(tmp_path: Path) -> None:
    rig = VirtualRig(ReducedTwin(DESIGN), np.random.default_rng(0))
    path = tmp_path / "a.mcap"
    with Campaign(path, DESIGN) as campaign:
        for force in (0.3, 0.6):
            campaign.add(rig.press(Contact(position=CHIPS[1], force=(0.0, 0.0, -force))))
    done = characterise([path])
    given = {figure.name for figure in done.figures if not figure.reason}
    assert given == {"noise", "sensitivity"}
    reasons = {figure.name: figure.reason for figure in done.figures}
    assert reasons["stiffness"].startswith("gauge and stage were not read")
    assert reasons["repeatability"].startswith("no touch was made three times")
    assert reasons["crosstalk"] == "all touches are nearest to one chip"
    assert done.recordings[0].world == "a skin of which the recording says nothing"


def test_a_twin_on_a_virtual_rig_is_found_as_it_is(tmp_path: Path) -> None:
    twin = ReducedTwin(DESIGN)
    path, forces = tmp_path / "a.mcap", (0.2, 0.4, 0.8)
    place = geometry(DESIGN).tops[2, 2]
    rig = VirtualRig(twin, np.random.default_rng(0), ramp=1.0, creep=False, drift=0.0)
    with Campaign(path, DESIGN, rig={"rig": "virtual"}) as campaign:
        for force in forces:
            campaign.add(rig.press(Contact(position=place, force=(0.0, 0.0, -force))))
    measured = {figure.name: figure.measured for figure in characterise([path]).figures}
    sigma = 1e6 * float(np.sqrt(np.square(mlx90393.noise(DESIGN.hall_setting)).mean()))
    assert_allclose(measured["noise"].value, sigma, rtol=0.25)  # and whole counts
    deepest = Contact(position=place, force=(0.0, 0.0, -0.8))
    depth = twin.depths((deepest,)).sum()
    assert_allclose(measured["stiffness"].value, 1e-3 * 0.8 / depth, rtol=0.03)
    # Without creep nothing is lost but the gauge's noise.
    assert measured["hysteresis"].value < 1.0
    field = twin.field(twin.motion((deepest,))) - twin.field(twin.motion(()))
    assert_allclose(measured["sensitivity"].value, 1e6 * np.linalg.norm(field) / 0.8, rtol=0.05)


def test_the_report_is_written_once(known: dict[str, Path], tmp_path: Path) -> None:
    done = characterise([known["slow"]])
    files = write_report(done, tmp_path / "report")
    assert [file.name for file in files] == ["report.json", "report.html", "report.svg"]
    document = json.loads(files[0].read_text())
    assert document["recordings"][0]["world"] == "a virtual skin on the rig by hand"
    assert {"value", "deviation", "unit", "equation", "source", "reason"} <= set(
        document["figures"][0]
    )
    page = files[1].read_text()
    assert "Hysteresis of force over depth" in page
    assert "not known: the chips&#x27; temperature varied" in page
    assert "data:image/svg+xml;base64," in page
    with pytest.raises(FileError, match="exists"):
        write_report(done, tmp_path / "report")


def test_what_is_no_recording_of_a_rig_is_refused(tmp_path: Path, known: dict[str, Path]) -> None:
    with pytest.raises(ArgumentError, match="at least one; got none"):
        characterise([])
    with pytest.raises(RecordingError, match="holds no touch of a rig"):
        characterise([record(tmp_path / "a.mcap", 3)])
    other = tmp_path / "b.mcap"
    curved = read_design("curved")
    few = [Reading(time=t, field=np.zeros((len(curved.halls), 3))) for t in np.arange(6.0).tolist()]
    with Campaign(other, curved) as campaign:
        where = Contact(position=(0.05, 0.05), force=(0.0, 0.0, -0.5))
        campaign.add(
            HeldTouch(contact=where, readings=tuple(few), rest=(0.0, 2.0), held=(3.0, 5.0))
        )
    with pytest.raises(ArgumentError, match="must be of one design; got planar, curved"):
        characterise([known["slow"], other])


@pytest.mark.slow
def test_a_stage_and_a_gauge_give_the_stiffness_of_what_they_press(tmp_path: Path) -> None:
    pytest.importorskip("serial")
    from rigs import Bench, World, straight

    path = tmp_path / "a.mcap"
    with Bench(World(stiffness=1500.0)) as bench:
        made = [bench.rig.press(straight(force, (0.01, 0.02))) for force in (0.3, 0.6)]

    def three(held: HeldTouch) -> HeldTouch:
        return replace(
            held,
            readings=tuple(
                Reading(time=r.time, field=np.resize(r.field, (3, 3))) for r in held.readings
            ),
        )

    with Campaign(path, DESIGN, rig={"source": "fake", "stage": "fake"}) as campaign:
        for pressed in made:
            campaign.add(three(pressed))
    done = characterise([path])
    figures = {figure.name: figure for figure in done.figures}
    assert done.recordings[0].world == "a real skin on fake, pressed by fake"
    assert_allclose(figures["stiffness"].measured.value, 1.5, rtol=0.05)
    assert "let go slowly" in figures["hysteresis"].reason
    # A spring is back as soon as the probe is.
    back = figures["recovery_10_percent"].measured
    assert 0.0 <= back.value < 0.2
    assert 0.0 < back.deviation < 0.2
