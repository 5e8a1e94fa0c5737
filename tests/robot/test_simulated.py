"""The simulated arm: its geometry against MuJoCo's own, its drives, its contacts, its refusals."""

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, ModelError, SourceError
from smoskin.origami.geometry import geometry
from smoskin.robot.simulated import OWN_MODEL, SimulatedArm

mujoco = pytest.importorskip("mujoco")
DESIGN = read_design("curved")


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def arm(clock):
    with SimulatedArm(DESIGN, clock) as arm:
        yield arm


@pytest.mark.parametrize("seed", range(3))
def test_places_and_jacobian_are_those_of_mujoco(arm, seed):
    chain = arm.chain
    angles = np.random.default_rng(seed).uniform(chain.lower, chain.upper)
    model = mujoco.MjModel.from_xml_path(str(OWN_MODEL))
    data = mujoco.MjData(model)
    data.qpos[:] = angles
    mujoco.mj_forward(model, data)
    site = model.site("skin").id
    skin = geometry(DESIGN)
    posture = chain.posture(angles)
    place = posture.on_skin([skin.extent[0] / 2, skin.roll.middle, 0.0])
    assert place == pytest.approx(data.site_xpos[site], abs=1e-12)
    assert pytest.approx(data.site_xmat[site].reshape(3, 3)) == posture.of_skin(np.eye(3)).T
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, site)
    assert posture.jacobian(place) == pytest.approx(jacobian, abs=1e-12)
    hand = data.geom("hand")
    inside = np.abs((posture.corners[-8:] - hand.xpos) @ hand.xmat.reshape(3, 3))
    assert inside == pytest.approx(np.tile([0.05, 0.035, 0.02], (8, 1)), abs=1e-9)


def test_joints_gain_speed_as_they_can_and_lose_it_without_a_master(arm, clock):
    asked = np.array([0.5, 0.0, 0.0, 0.0])
    assert arm.move(asked) == pytest.approx(asked)
    clock.now = 0.02
    assert arm.state().speeds[0] == pytest.approx(0.2, abs=0.02)  # 10 rad/s^2
    clock.now = 0.1
    assert arm.state().speeds[0] == pytest.approx(0.5, abs=0.01)
    clock.now = 0.2
    arm.state()
    clock.now = 0.3
    stopped = arm.state()
    assert np.abs(stopped.speeds).max() < 1e-3
    assert arm.move([9.0, -9.0, 0.0, 0.0]).tolist() == [1.5, -1.5, 0.0, 0.0]


def test_it_holds_still_under_gravity_and_a_push(arm, clock):
    before = arm.state().angles
    place = arm.chain.posture(before).on_skin([0.06, 0.08, 0.0])
    arm.push(place, np.array([0.0, 0.0, -1.0]))
    for _ in range(10):
        clock.now += 0.1
        after = arm.state()
    assert np.abs(after.angles - before).max() < 1e-4
    assert after.meets == ""


def test_contact_with_the_ground_or_itself_is_told(arm):
    arm.pose(np.array([0.0, -0.3, -1.2, 0.0]))
    assert "ground" in arm.state().meets
    arm.pose(np.array([0.79, 0.21, -2.4, -1.74]))
    assert arm.state().meets == "base and hand"
    with pytest.raises(ArgumentError):
        arm.pose(np.zeros(3))


def test_a_closed_arm_answers_no_more(arm):
    arm.close()
    with pytest.raises(SourceError):
        arm.state()
    with pytest.raises(SourceError):
        arm.move(np.zeros(4))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("no model", "MuJoCo reads"),
        ("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", "hinges"),
        (
            "<mujoco><worldbody><body><joint name='a' type='slide'/><geom size='1'/></body>"
            "</worldbody></mujoco>",
            "hinges",
        ),
        (
            "<mujoco><worldbody><body><joint name='a'/><geom size='1'/></body>"
            "</worldbody></mujoco>",
            "site",
        ),
        (
            "<mujoco><worldbody><body><joint name='a'/><geom size='1'/><site name='skin'/></body>"
            "<body><joint name='b'/><geom size='1'/></body></worldbody></mujoco>",
            "in a row",
        ),
    ],
)
def test_other_models_are_refused_with_the_reason(tmp_path, clock, text, reason):
    path = tmp_path / "arm.xml"
    path.write_text(text)
    with pytest.raises(ModelError, match=reason):
        SimulatedArm(DESIGN, clock, model=path)
