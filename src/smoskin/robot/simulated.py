"""A simulated arm: MuJoCo's physics of a model, its joints driven as a real arm's controller does.

Decides how joints follow the speeds they are asked for, and which contacts count. Hides MuJoCo.
"""

import os
import sys
from collections.abc import Callable
from ctypes.util import find_library
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError, SourceError, require
from smoskin.origami.geometry import geometry
from smoskin.outputs import read_text
from smoskin.robot.arm import Arm, ArmState
from smoskin.robot.chain import Chain

if TYPE_CHECKING:
    import mujoco

OWN_MODEL: Final = Path(__file__).with_name("arm.xml")
"""The arm of primitive shapes that comes with the package."""
_GAIN: Final = 2e4
"""Moment per speed missed of a joint's drive, N m s/rad."""
_SPEED, _ACCELERATION = 1.5, 10.0
"""rad/s and rad/s^2 of each joint."""
_MASTERLESS: Final = 0.1
"""Time for which joints go on at what was asked last, s."""
_LONGEST: Final = 0.1
"""Longest time that is simulated at once, s: what is missed of more never happens."""


class Shape(NamedTuple):
    """A solid part at all joints' zero, in the base's frame; a box is round what is no other."""

    kind: str
    """``capsule`` (or a ball), ``cylinder`` or ``box``; `size` (3,), m, is as MuJoCo has it."""
    size: Floats
    place: Floats
    turn: Floats
    color: Floats
    moved_by: int


@final
class SimulatedArm(Arm):
    """An arm of a MuJoCo model, with a skin at one of its sites.

    All joints are driven by speed, whatever the model's own actuators, and gravity is borne, as
    arms' controllers do. `state` brings the simulation up to the clock.

    Parameters
    ----------
    design : SkinDesign
        Skin, whose middle lies at the site, x along the limb and z outward.
    clock : callable
        Time in s.
    model : path
        MJCF file with hinges in a row; it begins in its first keyframe, if there is one.
    site : str
        Name of the site.

    Raises
    ------
    ModelError
        If the model cannot be read, has no such site, or joints other than hinges in a row.
    MissingExtraError
        If the extra ``robot`` is not installed.
    """

    def __init__(
        self,
        design: SkinDesign,
        clock: Callable[[], float],
        *,
        model: str | os.PathLike[str] = OWN_MODEL,
        site: str = "skin",
    ) -> None:
        require("the simulated arm", "robot", "mujoco")
        self._model = _driven(model)
        self._data = _mujoco().MjData(self._model)
        self._chain = _chain_of(self._model, site, design, str(model))
        if self._model.nkey:
            _mujoco().mj_resetDataKeyframe(self._model, self._data, 0)
        _mujoco().mj_forward(self._model, self._data)
        self._clock, self._time = clock, clock()
        self._asked: Floats = np.zeros(self._chain.joints)
        self._asked_at = self._time
        self._closed = False
        self._renderer: Any = None

    @property
    def chain(self) -> Chain:
        """Joints of the model, all with the same limits of speed."""
        return self._chain

    def state(self) -> ArmState:
        """The joints, once the simulation has reached the clock."""
        if self._closed:
            raise SourceError("the arm is closed")
        now = self._clock()
        self._time = max(self._time, now - _LONGEST)
        step = self._model.opt.timestep
        while self._time + step <= now + 1e-9:
            self._step(step)
            self._time += step
        return ArmState(
            angles=self._data.qpos.copy(), speeds=self._data.qvel.copy(), meets=self._meeting()
        )

    def move(self, speeds: Floats) -> Floats:
        """Take speeds, within those of the joints."""
        if self._closed:
            raise SourceError("the arm is closed")
        self._asked = np.clip(speeds, -self._chain.speed, self._chain.speed)
        self._asked_at = self._time
        return self._asked

    def stop(self) -> None:
        """Let the drives brake."""
        self._asked = np.zeros(self._chain.joints)

    def close(self) -> None:
        """Answer no more."""
        self.stop()
        self._closed = True
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def shapes(self) -> tuple[Shape, ...]:
        """Its solid parts, its base's too."""
        mj, model, shapes = _mujoco(), self._model, []
        data, kinds = mj.MjData(model), mj.mjtGeom
        data.qpos[:] = 0.0
        mj.mj_forward(model, data)
        names = {kinds.mjGEOM_CAPSULE: "capsule", kinds.mjGEOM_CYLINDER: "cylinder"}
        names[kinds.mjGEOM_SPHERE] = "capsule"
        for k in np.flatnonzero((model.geom_contype > 0) & (model.geom_type != 0)):
            turn, place, size = (
                data.geom_xmat[k].reshape(3, 3),
                data.geom_xpos[k],
                model.geom_size[k],
            )
            kind = names.get(kinds(model.geom_type[k]), "box")
            if kind == "box":
                place, size = place + turn @ model.geom_aabb[k, :3], model.geom_aabb[k, 3:]
            material, count = model.geom_matid[k], _joints_above(model, int(model.geom_bodyid[k]))
            color = model.geom_rgba[k] if material < 0 else model.mat_rgba[material]
            shapes.append(Shape(kind, size, place, turn, color[:3], count))
        return tuple(shapes)

    def pose(self, angles: Floats) -> None:
        """Put the joints at angles, (J,), rad, at rest."""
        if np.shape(angles) != (self._chain.joints,):
            raise ArgumentError(f"angles must be {self._chain.joints}; got {np.shape(angles)}")
        self._data.qpos[:], self._data.qvel[:] = angles, 0.0
        _mujoco().mj_forward(self._model, self._data)

    def push(self, place: Floats, force: Floats) -> None:
        """Push the skin's link at a place, (3,), m, with a force, (3,), N, until the next push."""
        self._data.qfrc_applied[:] = self._chain.posture(self._data.qpos).jacobian(place).T @ force

    def picture(
        self, camera: str | int, size: tuple[int, int], arrows: "tuple[tuple[Floats, Floats], ...]"
    ) -> NDArray[np.uint8]:
        """What a camera sees, (H, W, 3), with arrows from places to places, m; without a window.

        The size, width and height, stays that of the first picture.
        """
        mj: Any = _mujoco()
        if self._renderer is None:
            self._renderer = mj.Renderer(self._model, size[1], size[0])
        scene = self._renderer.scene
        self._renderer.update_scene(self._data, camera)
        for start, end in arrows:
            shape = scene.geoms[scene.ngeom]
            color = np.array([0.85, 0.1, 0.1, 1.0], dtype=np.float32)
            kind = mj.mjtGeom.mjGEOM_ARROW
            mj.mjv_initGeom(shape, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), color)
            mj.mjv_connector(shape, kind, 0.008, start, end)
            scene.ngeom += 1
        return np.array(self._renderer.render())

    def _step(self, step: float) -> None:
        """Simulate one step: the drives' speeds change no faster than they can."""
        alone = self._time - self._asked_at > _MASTERLESS
        wanted = np.zeros_like(self._asked) if alone else self._asked
        most = step * self._chain.acceleration
        self._data.ctrl += np.clip(wanted - self._data.ctrl, -most, most)
        _mujoco().mj_step(self._model, self._data)

    def _meeting(self) -> str:
        """Names of the first two shapes that meet; empty where none do."""
        contacts = self._data.contact
        for first, second in contacts.geom[: self._data.ncon]:
            return f"{self._model.geom(first).name} and {self._model.geom(second).name}"
        return ""


def _mujoco() -> Any:
    """MuJoCo, which is imported when it is first needed; it draws without a screen if it can."""
    # Where EGL is asked for and missing the import itself would fail.
    if "mujoco" not in sys.modules and not os.environ.get("DISPLAY") and find_library("EGL"):
        os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco

    return mujoco


def _driven(path: str | os.PathLike[str]) -> "mujoco.MjModel":
    """A model whose drives are ours."""
    mj = _mujoco()
    read_text(path, error=ModelError)
    try:
        spec = mj.MjSpec.from_file(os.fspath(path))
        for actuator in list(spec.actuators):
            spec.delete(actuator)
        for body in spec.bodies:
            body.gravcomp = 1.0
        for joint in spec.joints:
            drive = spec.add_actuator(trntype=mj.mjtTrn.mjTRN_JOINT, target=joint.name)
            drive.set_to_velocity(_GAIN)
        return spec.compile()
    except (ValueError, RuntimeError, TypeError) as error:
        raise ModelError(f"{path}: must be a model that MuJoCo reads: {error}") from error


def _chain_of(model: "mujoco.MjModel", name: str, design: SkinDesign, path: str) -> Chain:
    """The joints of a model, and its skin's place."""
    mj: Any = _mujoco()
    if model.njnt == 0 or (model.jnt_type != mj.mjtJoint.mjJNT_HINGE).any():
        raise ModelError(f"{path}: must have hinges alone as joints")
    site = mj.mj_name2id(model, mj.mjtObj.mjOBJ_SITE, name)
    if site < 0:
        raise ModelError(f"{path}: must have a site {name!r} for the skin's middle")
    data = mj.MjData(model)
    mj.mj_resetData(model, data)
    data.qpos[:] = 0.0
    mj.mj_forward(model, data)
    counts = np.array([_joints_above(model, body) for body in range(model.nbody)])
    if sorted(counts[model.jnt_bodyid]) != list(range(1, model.njnt + 1)):
        raise ModelError(f"{path}: must have its joints in a row, each carried by the one before")
    limited = model.jnt_limited.astype(bool)
    turn = data.site_xmat[site].reshape(3, 3)
    skin = geometry(design)
    middle = np.array([skin.extent[0] / 2, skin.roll.middle, 0.0])
    solid = (model.geom_contype > 0) & (model.geom_type != mj.mjtGeom.mjGEOM_PLANE)
    solid &= counts[model.geom_bodyid] > 0
    boxes = model.geom_aabb[solid].reshape(-1, 2, 3)
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), -1).reshape(-1, 3)
    local = boxes[:, :1] + signs * boxes[:, 1:]
    turns = data.geom_xmat[solid].reshape(-1, 3, 3)
    corners = np.einsum("gab,gcb->gca", turns, local) + data.geom_xpos[solid][:, None]
    ones = np.ones(model.njnt)
    return Chain(
        axes=data.xaxis,
        anchors=data.xanchor,
        lower=np.where(limited, model.jnt_range[:, 0], -2 * np.pi),
        upper=np.where(limited, model.jnt_range[:, 1], 2 * np.pi),
        speed=_SPEED * ones,
        acceleration=_ACCELERATION * ones,
        carriers=int(counts[model.site_bodyid[site]]),
        origin=data.site_xpos[site] - turn @ middle,
        turn=turn,
        corners=corners.reshape(-1, 3),
        moved_by=np.repeat(counts[model.geom_bodyid[solid]], 8),
    )


def _joints_above(model: "mujoco.MjModel", body: int) -> int:
    """Number of joints that move a body."""
    count = 0
    while body > 0:
        count += int(model.body_jntnum[body])
        body = int(model.body_parentid[body])
    return count
