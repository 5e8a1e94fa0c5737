"""Touches of a skin in a MuJoCo simulation: contacts of a geom become places and forces on it.

Decides which contacts are touches and which of them belong together. Hides MuJoCo's frames.
"""

from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError, require
from smoskin.origami.geometry import geometry
from smoskin.records import Contact

if TYPE_CHECKING:
    import mujoco

_ACROSS: Final = 12e-3
"""Largest distance between points of one touch, m: a fingertip's."""
_OUTWARD: Final = 0.5
"""Cosine of the largest angle between a contact's normal and the skin's."""
_LEAST: Final = 1e-5
"""Least press that is a touch, N; contacts that only come near have no force."""


@final
class SkinContacts:
    """What touches a skin that is a geom of a MuJoCo model.

    Points at which one geom touches, no more than 12 mm apart, are one touch at their middle of
    pressure; others are touches of their own, as the legs of a stool. Contacts beside
    the skin, at the geom's sides and without pressure are none. The geom is as soft as its
    ``solref`` says; how far the skin itself sinks is not told to MuJoCo.

    Parameters
    ----------
    design : SkinDesign
        Skin, whose middle lies at the site: x along the skin, z outward.
    model : mujoco.MjModel
    geom, site : str
        Names of the skin's geom, and of the site, which goes with the geom.

    Raises
    ------
    ModelError
        If the model has no such geom or site, or the site does not go with the geom.
    MissingExtraError
        If the extra ``robot`` is not installed.
    """

    def __init__(
        self, design: SkinDesign, model: "mujoco.MjModel", *, geom: str = "skin", site: str = "skin"
    ) -> None:
        require("touches of a simulation", "robot", "mujoco")
        import mujoco

        self._mujoco: Any = mujoco
        self._model = model
        kinds = mujoco.mjtObj
        self._geom = mujoco.mj_name2id(model, kinds.mjOBJ_GEOM, geom)
        self._site = mujoco.mj_name2id(model, kinds.mjOBJ_SITE, site)
        for name, what, number in (("geom", geom, self._geom), ("site", site, self._site)):
            if number < 0:
                raise ModelError(f"model must have the {name} {what!r} of the skin; it has none")
        if model.geom_bodyid[self._geom] != model.site_bodyid[self._site]:
            raise ModelError(f"site {site!r} must go with the geom {geom!r}; it is on another body")
        skin = geometry(design)
        self._roll, self._extent = skin.roll, skin.extent
        self._middle = np.array([skin.extent[0] / 2, skin.roll.middle, 0.0])

    def touches(self, data: "mujoco.MjData") -> tuple[Contact, ...]:
        """Touches at this moment, the hardest first: what the toucher exerts on the skin."""
        points: dict[int, list[tuple[Floats, Floats]]] = {}
        for index in np.flatnonzero((data.contact.geom[: data.ncon] == self._geom).any(axis=1)):
            other, place, force, facing = self._point(data, int(index))
            inside = (place >= 0.0).all() and (place <= self._extent).all()
            if inside and facing >= _OUTWARD and force[2] < -_LEAST:
                points.setdefault(other, []).append((place, force))
        touches = [touch for own in points.values() for touch in _joined(own)]
        return tuple(sorted(touches, key=lambda touch: -touch.normal_force))

    def _point(self, data: "mujoco.MjData", index: int) -> tuple[int, Floats, Floats, float]:
        """A contact's other geom, developed place, local force, and how far it faces the skin."""
        contact = data.contact[index]
        first, second = contact.geom
        six = np.zeros(6)
        self._mujoco.mj_contactForce(self._model, data, index, six)
        axes = contact.frame.reshape(3, 3)
        # The normal leads from the first geom to the second, which feels the force.
        sign = 1.0 if second == self._geom else -1.0
        turn = data.site_xmat[self._site].reshape(3, 3)
        local = turn.T @ (contact.pos - data.site_xpos[self._site]) + self._middle
        place = self._roll.developed(local)[:2]
        upright = (turn @ self._roll.axes(place[1])).T
        force = upright @ (sign * axes.T @ six[:3])
        facing = -float((upright @ (sign * axes[0]))[2])
        return int(first if second == self._geom else second), place, force, facing


def _joined(points: list[tuple[Floats, Floats]]) -> list[Contact]:
    """Touches by points of one geom, the hardest points first."""
    groups: list[list[tuple[Floats, Floats]]] = []
    for place, force in sorted(points, key=lambda point: float(point[1][2])):
        for group in groups:
            if all(np.linalg.norm(place - other) <= _ACROSS for other, _ in group):
                group.append((place, force))
                break
        else:
            groups.append([(place, force)])
    return [
        Contact(
            position=np.average([p for p, _ in group], axis=0, weights=[f[2] for _, f in group]),
            force=np.sum([f for _, f in group], axis=0),
        )
        for group in groups
    ]
