"""A Gymnasium environment: a finger presses a skin where and as hard as it is asked to.

The finger slides along three axes over a skin on a table, in MuJoCo; contacts press the skin's
twin, its chips are read and an estimator says what it feels. A policy sees the finger's place, the
goal and the tactile observation, by LeRobot's names. Run it for a policy that is written by hand:

    pip install 'smoskin[gym]' && python examples/gym/press.py
"""

import time

import gymnasium
import mujoco
import numpy as np
from gymnasium.spaces import Box, Dict

import smoskin as smo
from smoskin.origami.geometry import geometry

MODEL = """
<mujoco>
  <option timestep="0.002" cone="elliptic" impratio="5" integrator="implicitfast"/>
  <worldbody>
    <geom name="skin" type="box" size="0.06 0.08 0.01" pos="0 0 -0.01" solref="0.01 1"/>
    <site name="skin"/>
    <body name="finger" pos="0 0 0.012" gravcomp="1">
      <joint name="x" type="slide" axis="1 0 0" damping="6"/>
      <joint name="y" type="slide" axis="0 1 0" damping="6"/>
      <joint name="z" type="slide" axis="0 0 1" damping="6"/>
      <geom type="sphere" size="0.006" mass="0.05" friction="0.6"/>
    </body>
  </worldbody>
  <actuator>
    <position joint="x" kp="200"/>
    <position joint="y" kp="200"/>
    <position joint="z" kp="200"/>
  </actuator>
</mujoco>
"""
STEP = np.array([2e-3, 2e-3, 5e-4])
"""Largest change of the finger's target in a step, m."""
LOWEST, HIGHEST = np.array([-0.05, -0.07, -0.012]), np.array([0.05, 0.07, 0.0])
"""Ends of the targets, m from the start, 6 mm over the skin's middle."""
STEPS = 200
NEAR, TRUE, STEADY = 2e-3, 0.1, 10
"""A goal is reached at so many m, so large a share of the force, for so many steps in a row."""


class Press(gymnasium.Env):
    """The actions are changes of the finger's target, the rewards grow towards the goal."""

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(self):
        design = smo.load_design("planar")
        self.model = mujoco.MjModel.from_xml_string(MODEL)
        self.data = mujoco.MjData(self.model)
        estimator = smo.BayesEstimator(design, smo.load_response_table("planar"))
        contacts = smo.SkinContacts(design, self.model)
        self.skin = smo.TactileSkin(smo.Twin(design), estimator, contacts, rate=50.0)
        self.middle = geometry(design).extent / 2
        tactile = self.skin.reset(seed=0).observation
        ends = {"field": 0.1, "force": 100.0}  # T, N; all else is below 1
        spaces = {
            name: Box(-(end := ends.get(name.rpartition(".")[2], 1.0)), end, values.shape)
            for name, values in tactile.items()
        }
        spaces["observation.state"] = Box(-1.0, 1.0, (3,))  # m: place of the finger
        spaces["observation.goal"] = Box(-1.0, 1.0, (3,))  # m and N: place on the skin, force
        self.observation_space = Dict(spaces)
        self.action_space = Box(-1.0, 1.0, (3,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed, options=options)
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)
        room = self.middle - 0.02
        self.goal = np.array(
            [*self.np_random.uniform(-room, room), self.np_random.uniform(0.2, 0.8)]
        )
        self.steps = self.steady = 0
        felt = self.skin.reset(seed=int(self.np_random.integers(2**31)))
        return self._observation(felt), self._truth(felt)

    def step(self, action):
        change = STEP * np.clip(action, -1.0, 1.0)
        self.data.ctrl[:] = np.clip(self.data.ctrl + change, LOWEST, HIGHEST)
        mujoco.mj_step(
            self.model, self.data, nstep=round(1 / self.skin.rate / self.model.opt.timestep)
        )
        felt = self.skin.step(self.data)
        truth = self._truth(felt)
        self.steps += 1
        near = truth["off"] < NEAR and truth["share"] < TRUE
        self.steady = self.steady + 1 if near else 0
        reached = self.steady >= STEADY
        reward = 10.0 * reached - min(truth["off"] / 0.05, 1.0) - min(truth["share"], 1.0)
        return self._observation(felt), float(reward), reached, self.steps >= STEPS, truth

    def _observation(self, felt):
        more = {"state": self.data.qpos, "goal": [*(self.goal[:2] + self.middle), self.goal[2]]}
        named = {f"observation.{name}": np.float32(values) for name, values in more.items()}
        whole = {**felt.observation, **named}
        return {
            n: np.clip(v, box.low, box.high)
            for n, v in whole.items()
            for box in [self.observation_space[n]]
        }

    def _truth(self, felt):
        """How far the hardest touch is off the goal, m, and by which share of the force."""
        if not felt.touches:
            return {"off": float(np.linalg.norm(self.data.qpos[:2] - self.goal[:2])), "share": 1.0}
        touch = felt.touches[0]
        off = float(np.linalg.norm(touch.position - self.middle - self.goal[:2]))
        return {"off": off, "share": abs(touch.normal_force / self.goal[2] - 1.0)}


class ByHand:
    """A policy written by hand: go there, go down, then correct place and force by touch."""

    def __init__(self, middle):
        self.middle = middle

    def __call__(self, seen):
        state, goal = seen["observation.state"], seen["observation.goal"]
        away = goal[:2] - self.middle - state[:2]
        if np.linalg.norm(away) > 1e-3 and state[2] > -4e-3:
            return np.array([*(0.4 * away / STEP[:2]), 0.0])
        if not seen["observation.tactile.contact"][0]:
            return np.array([0.0, 0.0, -0.5])
        off = goal[:2] - seen["observation.tactile.position"][:2]
        more = goal[2] + seen["observation.tactile.force"][2]
        return np.array([*(0.1 * off / STEP[:2]), -1.5 * more])


if __name__ == "__main__":
    env = Press()
    policy, ends, steps, begun = ByHand(env.middle), [], 0, time.perf_counter()
    for seed in range(5):
        seen, info = env.reset(seed=seed)
        reached = over = False
        while not (reached or over):
            seen, reward, reached, over, info = env.step(policy(seen))
            steps += 1
        ends.append(reached)
        print(f"seed {seed}: {1e3 * info['off']:.2f} mm and {100 * info['share']:.1f} % off")
    rate = steps / (time.perf_counter() - begun)
    print(f"{sum(ends)} of 5 goals reached, {rate:.0f} steps a second")
    assert sum(ends) == 5
