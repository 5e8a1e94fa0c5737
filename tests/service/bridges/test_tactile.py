"""A simulated skin in MuJoCo: what is felt there, and that policies see what recordings hold."""

import runpy
import warnings
from pathlib import Path

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.robot.contacts import SkinContacts
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.service.bridges.tactile import TactileSkin, observe
from smoskin.twin.reduced import ReducedTwin

PLANAR = load_design("planar")
EXAMPLE = Path(__file__).parents[3] / "examples" / "gym" / "press.py"
BALL = """<mujoco><option timestep="0.002"/><worldbody>
<geom name="skin" type="box" size="0.06 0.08 0.01" pos="0 0 -0.01"/><site name="skin"/>
<body pos="-0.01 0.013333 0.006"><freejoint/>
<geom type="sphere" size="0.006" mass="0.06" friction="1 0.1 0.1" condim="6"/></body>
</worldbody></mujoco>"""
SMALL = {"rtol": 2e-7, "atol": 0.0}


@pytest.fixture
def world():
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    twin = ReducedTwin(PLANAR, seed=0)
    skin = TactileSkin(twin, ClosedFormEstimator(PLANAR), SkinContacts(PLANAR, model), window=3)

    def play(seed):
        mujoco.mj_resetData(model, data)
        felt = [skin.reset(seed)]
        for _ in range(60):
            mujoco.mj_step(model, data, nstep=5)
            felt.append(skin.step(data))
        return felt

    return play


def test_a_ball_is_felt_where_it_lies_with_its_weight(world):
    untouched, *_, last = world(seed=4)
    weight = 0.06 * 9.81
    assert (untouched.touches, untouched.estimate.status) == ((), Status.NO_CONTACT)
    assert last.estimate.status is Status.CONTACT
    (touch,), (contact,) = last.touches, last.estimate.contacts
    assert touch.force == pytest.approx([0.0, 0.0, -weight], abs=1e-3)
    assert touch.position == pytest.approx([0.05, 0.09333], abs=1e-4)
    assert contact.position == pytest.approx(touch.position, abs=1e-3)
    # The closed form takes rubber at its final softness: creep is still to come.
    assert contact.normal_force == pytest.approx(weight, rel=0.15)
    seen = last.observation
    assert seen["observation.tactile.contact"].tolist() == [1.0, 0.0]
    assert np.allclose(seen["observation.tactile.force"][:3], contact.force, **SMALL)
    assert np.allclose(seen["observation.tactile.field"][-9:], last.reading.field.ravel(), **SMALL)


def test_a_seed_gives_the_same_readings_and_another_seed_others(world):
    first, again, other = (world(seed) for seed in (7, 7, 8))
    assert [felt.reading for felt in first] == [felt.reading for felt in again]
    assert [felt.estimate for felt in first] == [felt.estimate for felt in again]
    assert [felt.touches for felt in first] == [felt.touches for felt in other]
    assert all(a.reading != b.reading for a, b in zip(first, other, strict=True))


def test_policies_see_what_exported_recordings_hold(tmp_path):
    pytest.importorskip("mcap")
    parquet = pytest.importorskip("pyarrow.parquet")
    from smoskin.service.exchange import export_lerobot
    from smoskin.service.recorder import Recorder

    rng = np.random.default_rng(0)
    readings, estimates = [], []
    for k in range(8):
        field = rng.normal(size=(3, 3)) * 1e-3
        flags = np.zeros(3, int)
        if k in (4, 5):
            field[1], flags[1] = np.nan, ChipFlag.MISSING
        readings.append(Reading(time=0.1 * k, field=field, flags=flags))
        contacts = tuple(
            Contact(position=rng.uniform(0, 0.1, 2), force=rng.normal(size=3)) for _ in range(k % 3)
        )
        status = Status.CONTACT if contacts else Status.NO_CONTACT
        covariance = np.zeros((len(contacts), 5, 5))
        estimates.append(
            Estimate(time=0.1 * k, status=status, contacts=contacts, covariance=covariance)
        )
    with Recorder(tmp_path / "touch.mcap", PLANAR) as recorder:
        for reading, estimate in zip(readings, estimates, strict=True):
            recorder.write(reading, estimate)
    assert export_lerobot(tmp_path / "touch.mcap", tmp_path / "set", rate=10, window=3) == 6
    kept = parquet.read_table(tmp_path / "set" / "data" / "chunk-000" / "file-000.parquet")
    for k in range(6):
        for name, values in observe(readings[k : k + 3], estimates[k + 2]).items():
            # What a chip gave before the window only the recording knows.
            if np.isfinite(readings[k].field).all() or not name.endswith("field"):
                assert np.allclose(kept[name][k].as_py(), values, **SMALL), (k, name)


def test_an_observation_needs_a_reading_and_a_window_some():
    with pytest.raises(ArgumentError, match="readings must be at least one; got none"):
        observe((), Estimate(time=0.0, status=Status.STALE))
    lost = Reading(time=0.0, field=np.full((3, 3), np.nan), flags=[1, 1, 1])
    seen = observe([lost], Estimate(time=0.0, status=Status.CHIP_MISSING))
    assert all(np.isfinite(values).all() for values in seen.values())
    assert seen["observation.tactile.missing"].tolist() == [1.0, 1.0, 1.0]
    for window in (0, 21):
        with pytest.raises(ArgumentError, match=f"window must be from 1 to 20; got {window}"):
            TactileSkin(None, None, None, window=window)


@pytest.mark.slow
def test_the_environment_keeps_gymnasiums_rules_and_a_policy_by_hand_reaches_its_goals(capsys):
    pytest.importorskip("gymnasium")
    pytest.importorskip("mujoco")
    pytest.importorskip("jax")
    from gymnasium.utils.env_checker import check_env

    made = runpy.run_path(str(EXAMPLE))
    env = made["Press"]()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env, skip_render_check=True)
    rng = np.random.default_rng(1)
    actions = rng.uniform(-1, 1, (120, 3)) - [0, 0, 0.6]

    def play(seed):
        seen = [env.reset(seed=seed)[0]]
        return [*seen, *(env.step(action)[0] for action in actions)]

    first, again, other = play(3), play(3), play(4)
    name = "observation.tactile.field"
    for seen, twice, differently in zip(first, again, other, strict=True):
        assert all((seen[key] == twice[key]).all() for key in seen)
        assert (seen[name] != differently[name]).any()
    assert any(seen["observation.tactile.contact"].any() for seen in first)
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert "5 of 5 goals reached" in capsys.readouterr().out
