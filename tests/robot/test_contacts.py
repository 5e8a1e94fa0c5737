"""Contacts of a MuJoCo simulation as touches, by what statics says of bodies on a skin."""

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.errors import ModelError
from smoskin.origami.geometry import geometry
from smoskin.robot.contacts import SkinContacts

mujoco = pytest.importorskip("mujoco")
PLANAR, CURVED = read_design("planar"), read_design("curved")
MIDDLE = geometry(PLANAR).extent / 2
FLAT = '<geom name="skin" type="box" size="0.08 0.1 0.01" pos="0 0 -0.01"/><site name="skin"/>'
WEIGHT = 0.05 * 9.81


def settled(bodies, skin=FLAT, *, gravity="0 0 -9.81", first=False, seconds=1.5, push=None):
    """A model with a skin on a body of its own, and its state when everything rests."""
    where = 'pos="0.3 -0.2 0.5" euler="0 0 30"'
    parts = [f"<body {where}>{skin}</body>", f"<frame {where}>{bodies}</frame>"]
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" gravity="{gravity}" cone="elliptic" impratio="10"/>
        <default><geom friction="1 0.05 0.05"/></default>
        <worldbody>{"".join(reversed(parts) if first else parts)}</worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    if push is not None:
        data.xfrc_applied[-1, :3] = push
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
    return model, data


def touches(model, data, design=PLANAR):
    return SkinContacts(design, model).touches(data)


def body(geom, pos="0 0 0.01", mass=0.05):
    inertia = f'<inertial pos="0 0 0" mass="{mass}" diaginertia="1e-5 1e-5 1e-5"/>'
    return f'<body pos="{pos}"><freejoint/>{inertia}{geom}</body>'


@pytest.mark.parametrize("first", [False, True], ids=["skin first", "ball first"])
def test_a_ball_lies_with_its_weight_where_it_lies(first):
    ball = body('<geom type="sphere" size="0.01" condim="6"/>', "0.02 -0.03 0.01")
    (touch,) = touches(*settled(ball, first=first))
    assert touch.position == pytest.approx(np.add(MIDDLE, [0.02, -0.03]), abs=1e-5)
    assert touch.force == pytest.approx([0.0, 0.0, -WEIGHT], abs=2e-3 * WEIGHT)


def test_what_is_pushed_drags_the_skin_where_it_is_pushed():
    block = body('<geom type="box" size="0.003 0.003 0.003"/>', "0 0 0.003")
    turn = np.radians(30.0)
    along = 0.1 * np.array([np.cos(turn + 0.7), np.sin(turn + 0.7), 0.0])
    (touch,) = touches(*settled(block, push=along))
    assert touch.force[2] == pytest.approx(-WEIGHT, rel=5e-3)
    assert touch.force[:2] == pytest.approx([0.1 * np.cos(0.7), 0.1 * np.sin(0.7)], abs=1e-3)


def test_points_of_one_geom_share_its_weight_and_are_one_touch_at_the_middle_of_pressure():
    # The heavy end of the block carries more: its middle of pressure lies below its mass.
    block = """<body pos="0.01 0.02 0.002"><freejoint/>
    <inertial pos="0.002 -0.001 0" mass="0.05" diaginertia="1e-5 1e-5 1e-5"/>
    <geom type="box" size="0.004 0.004 0.002"/></body>"""
    model, data = settled(block)
    assert data.ncon == 4
    (touch,) = touches(model, data)
    assert touch.position == pytest.approx(np.add(MIDDLE, [0.012, 0.019]), abs=2e-4)
    assert touch.force == pytest.approx([0.0, 0.0, -WEIGHT], abs=5e-3 * WEIGHT)


def test_legs_far_apart_are_touches_of_their_own_by_the_law_of_the_lever():
    feet = "".join(
        f'<geom type="sphere" size="0.004" pos="{x} {y} -0.01"/>'
        for x, y in ((-0.02, 0.02), (-0.02, -0.02), (0.03, 0.0))
    )
    contacts = touches(*settled(body(feet, "0 0 0.014")))
    assert len(contacts) == 3
    by_x = sorted(contacts, key=lambda touch: touch.position[0])
    shares = [touch.normal_force / WEIGHT for touch in by_x]
    assert shares == pytest.approx([0.3, 0.3, 0.4], abs=0.01)
    assert by_x[2].position == pytest.approx(np.add(MIDDLE, [0.03, 0.0]), abs=2e-4)


def test_a_ball_on_a_limb_lies_where_its_pull_points():
    radius, away = 1.0 / CURVED.curvature, 0.35
    skin = f"""<geom name="skin" type="cylinder" euler="0 90 0" size="{radius} 0.1"/>
    <site name="skin" pos="0 0 {radius}"/>"""
    turn = np.radians(30.0)
    down = -np.array([0.0, np.sin(away), np.cos(away)])
    pull = 9.81 * np.array([-np.sin(turn) * down[1], np.cos(turn) * down[1], down[2]])
    place = -(radius + 0.01) * down
    ball = body('<geom type="sphere" size="0.01" condim="6"/>', "0.015 {1} {2}".format(*place))
    model, data = settled(ball, skin, gravity="{} {} {}".format(*pull.tolist()), seconds=0.3)
    (touch,) = touches(model, data, CURVED)
    middle = geometry(CURVED).extent[0] / 2, geometry(CURVED).roll.middle
    assert touch.position == pytest.approx(np.add(middle, [0.015, radius * away]), abs=3e-4)
    assert touch.force == pytest.approx([0.0, 0.0, -WEIGHT], abs=0.02 * WEIGHT)


def test_what_touches_beside_the_skin_or_its_sides_is_none():
    beside = body(
        '<geom type="sphere" size="0.01" condim="6"/>', "0.07 0 0.01"
    )  # on the geom, off the skin
    assert touches(*settled(beside)) == ()
    assert touches(*settled("")) == ()
    wall = '<geom type="sphere" size="0.01" pos="0.05 0 -0.01"/>'
    low = FLAT.replace("0.08 0.1", "0.05 0.05")
    model, data = settled(wall.join(["<body><joint/>", "</body>"]), low, seconds=0.002)
    assert data.ncon
    assert touches(model, data) == ()


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({"geom": "hand"}, "model must have the geom 'hand' of the skin"),
        ({"site": "hand"}, "model must have the site 'hand' of the skin"),
        ({"site": "elsewhere"}, "site 'elsewhere' must go with the geom 'skin'"),
    ],
)
def test_models_without_the_skin_are_refused(names, message):
    model, _ = settled('<body><site name="elsewhere"/></body>')
    with pytest.raises(ModelError, match=message):
        SkinContacts(PLANAR, model, **names)
