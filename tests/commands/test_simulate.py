"""`smoskin simulate`: a press in words."""

import json

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.commands.simulate import parse_grip, parse_numbers, simulate_press
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sticking
from smoskin.records import Contact
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin


def test_a_press_of_the_reduced_model_is_told_in_the_units_of_people(planar):
    report = simulate_press(planar, ["45,80"], ["0,0,-0.5"], mechanics="reduced")
    answer = json.loads(json.dumps(report.as_json()))
    (touch,) = answer["touches"]
    assert (touch["at_mm"], touch["force_N"]) == ([45.0, 80.0], [0.0, 0.0, -0.5])
    twin = ReducedTwin(planar, seed=0)
    contact = Contact(position=(0.045, 0.080), force=(0.0, 0.0, -0.5))
    moved = twin.motion([contact]).magnets[1, :3] * 1e3
    assert answer["magnets"][1]["shift_mm"] == pytest.approx(moved.tolist(), rel=1e-8)
    field = twin.field(twin.motion([contact]))
    assert answer["chips"][2]["field_mT"] == pytest.approx((field[2] * 1e3).tolist())
    assert answer["chips"][2]["reading_mT"] == (
        pytest.approx((twin.read([contact]).field[2] * 1e3).tolist())
    )
    assert answer["valid"]
    assert 0.01 < touch["depth_mm"] < 0.3
    console = Console(width=120)
    with console.capture() as capture:
        for table in report.tables():
            console.print(table)
    for words in ("45.0, 80.0", "0.000, 0.000, -0.500", "M3", "S1", "good"):
        assert words in capture.get()


def test_a_press_of_the_whole_sheet(planar):
    pytest.importorskip("jax")
    report = simulate_press(
        planar, ["45,80", "90,40"], ["0,0,-0.5", "0.1,0,-0.3"], temperature=40.0
    )
    assert report.valid
    assert (report.depths > 5e-5).all()
    assert (report.depths < 5e-4).all()
    board = report.as_json()["board"]
    assert 0 < board["shift_mm"][0] < 1
    twice = simulate_press(planar, ["45,80"], ["0,0,-0.5"], manufactured=True, seed=3)
    other = simulate_press(planar, ["45,80"], ["0,0,-0.5"], manufactured=True, seed=4)
    assert not np.allclose(twice.field, other.field, rtol=1e-6)


def test_a_press_without_an_equilibrium_says_so(planar):
    pytest.importorskip("jax")
    report = simulate_press(planar, ["60,80"], ["0,0,-45"])
    answer = report.as_json()
    assert not answer["valid"]
    assert answer["chips"][0]["field_mT"] == [None] * 3
    assert answer["chips"][0]["flags"] == ["INVALID"]


@pytest.mark.parametrize(
    ("at", "force", "more", "reason"),
    [
        (["130,80"], ["0,0,-1"], {}, "must lie on the skin"),
        (["45,80"], ["0,0,1"], {}, "force must be finite and press"),
        (["45,80"], ["0,0,-51"], {}, "force must lie within 50 N; got [0.0, 0.0, -51.0] N"),
        (["45,80"], ["0,0,nan"], {}, "force must lie within 50 N"),
        (["45"], ["0,0,-1"], {}, "at must be 2 numbers with commas; got '45'"),
        (["45,80"], ["0,0,down"], {}, "force must be 3 numbers with commas; got '0,0,down'"),
        (["45,80"] * 3, ["0,0,-1"] * 2, {}, "force must be given once, or once for each at; got 2"),
        (["45,80"], ["0,0,-1"], {"temperature": 120.0}, "temperature must lie in -40..75 degC"),
        (["45,80"], ["0,0,-1"], {"grip": "glue"}, "grip must be sticking, frictionless"),
        (["45,80"], ["0,0,-1"], {"manufactured": True}, "know neither grip nor manufactured"),
    ],
)
def test_presses_that_cannot_be_are_refused(planar, at, force, more, reason):
    with pytest.raises(ArgumentError) as refused:
        simulate_press(planar, at, force, mechanics="reduced", **more)
    if "grip" not in more:
        assert reason in str(refused.value)


def test_what_is_not_told_has_a_default(planar):
    answer = simulate_press(planar, mechanics="reduced").as_json()
    assert answer["touches"][0]["at_mm"] == pytest.approx([60.0, 80.0], abs=1e-3)
    assert answer["touches"][0]["force_N"] == [0.0, 0.0, -0.5]
    assert answer["temperature_degC"] == 25.0
    alike = simulate_press(planar, ["45,80", "90,40"], ["0.1,0,-0.3"], mechanics="reduced")
    assert [contact.force.tolist() for contact in alike.contacts] == [[0.1, 0.0, -0.3]] * 2


@pytest.mark.parametrize("force", ["0,0,-50", "0,0,-50.001"])
def test_forces_up_to_the_largest_are_taken(planar, force):
    if force == "0,0,-50":
        assert simulate_press(planar, force=[force], mechanics="reduced").valid
    else:
        with pytest.raises(ArgumentError, match="force must lie within 50 N"):
            simulate_press(planar, force=[force], mechanics="reduced")


def test_a_press_is_told_at_its_temperature(planar):
    """Depths too: warm rubber is stiffer."""
    cold, warm = (
        simulate_press(planar, temperature=degrees, mechanics="reduced") for degrees in (25.0, 45.0)
    )
    twin = ReducedTwin(planar, seed=None)
    assert warm.depths == pytest.approx(twin.depths(warm.contacts, temperature=45.0))
    assert warm.depths[0] < 0.99 * cold.depths[0]
    assert warm.field == pytest.approx(twin.field(warm.motion, 45.0))


def test_the_grip_and_the_seed_reach_the_skin(planar):
    pytest.importorskip("jax")
    slipping = simulate_press(planar, force=["0.3,0,-0.3"], grip="frictionless", seed=4)
    twin = Twin(planar, seed=4, grip=Frictionless())
    motion = twin.motion(slipping.contacts)
    assert slipping.motion.magnets == pytest.approx(motion.magnets, abs=1e-9)
    assert slipping.reading == twin.sense(slipping.motion)


def test_numbers_and_grips_in_words():
    assert parse_numbers("forces", "0.5") == (0.5,)
    assert parse_numbers("forces", "0.1:1:10") == tuple(k / 10 for k in range(1, 11))
    assert parse_grip(None) == parse_grip("sticking") == Sticking()
    assert (parse_grip("frictionless"), parse_grip("covered")) == (Frictionless(), Covered())


@pytest.mark.parametrize(
    ("act", "reason"),
    [
        (lambda: parse_grip("sliding"), "grip must be sticking, frictionless, covered or sliding:"),
        (lambda: parse_grip("sliding:-1"), "friction must be finite and >= 0; got -1.0"),
        (lambda: parse_grip("covered:1"), "grip must be sticking"),
        (lambda: parse_numbers("forces", "0.1:1"), "forces must be numbers such as 0.1,0.5"),
    ],
)
def test_words_that_mean_nothing_are_refused(act, reason):
    with pytest.raises(ArgumentError) as refused:
        act()
    assert reason in str(refused.value)


def test_the_command_presses_once():
    command = ["simulate", "planar", "--at", "45,80", "--mechanics", "reduced"]
    done = CliRunner().invoke(app, [*command, "--force", "0.1,0,-0.5", "--json"])
    assert done.exit_code == 0
    answer = json.loads(done.stdout)
    assert answer["touches"][0]["force_N"] == [0.1, 0.0, -0.5]
    warm = CliRunner().invoke(app, [*command, "--temperature", "45", "--json"])
    assert json.loads(warm.stdout)["temperature_degC"] == 45.0
    plain = CliRunner().invoke(app, command)
    assert plain.exit_code == 0
    assert "45.0, 80.0" in plain.stdout


def test_the_command_fails_without_an_equilibrium():
    pytest.importorskip("jax")
    done = CliRunner().invoke(app, ["simulate", "--force", "0,0,-45", "--json"])
    assert done.exit_code == 1
    assert not json.loads(done.stdout)["valid"]
