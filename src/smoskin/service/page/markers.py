"""Marks of touches in the 3-D picture: an arrow for the force, an ellipse for where it may be.

Decides their size and form; one mark is moved from touch to touch. Hides the viewer's nodes.
"""

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.records import Contact

if TYPE_CHECKING:
    import viser

UNITS: Final = 100.0
"""Units of the viewer's scene in a metre: it is drawn in centimetres."""
LIFT: Final = 0.05
"""Height of marks over the sheet, in units of the scene."""
_ARROW_PER_NEWTON: Final = 0.05 * UNITS
_ARROW_SIDES: Final = 24
_DISC_RADIUS: Final = 0.45
_ELLIPSE_95: Final = 2.4477
"""Radius of the ellipse that holds 95 % of a normal distribution in the plane."""


class Marker:
    """One touch: a disc where it is, an arrow for its force, an ellipse for its spread.

    A mark that is not opaque is slimmer, so that it hides inside an estimate that is right, and
    carries no label.
    """

    def __init__(
        self, server: "viser.ViserServer", name: str, color: tuple[int, int, int], opacity: float
    ) -> None:
        scene = server.scene
        self._solid = solid = opacity >= 1.0
        self._girth = 1.0 if solid else 0.7
        self._root = scene.add_frame(name, show_axes=False, visible=False)
        mesh, clear = arrow(np.array((0.0, 0.0, -1.0)), self._girth), None if solid else opacity
        self._arrow = scene.add_mesh_simple(
            f"{name}/arrow", *mesh, color=color, opacity=clear, side="double"
        )
        radius, faint = (_DISC_RADIUS, 0.8) if solid else (1.35 * _DISC_RADIUS, opacity)
        scene.add_cylinder(f"{name}/disc", radius=radius, height=0.02, color=color, opacity=faint)
        self._ellipse = scene.add_line_segments(
            f"{name}/ellipse", np.zeros((48, 2, 3)), color, thickness=0.08, visible=False
        )
        self._label = scene.add_label(
            f"{name}/label", "", font_screen_scale=0.9, anchor="bottom-center", visible=False
        )

    def show(
        self,
        contact: Contact,
        place: Floats,
        attitude: tuple[float, float, float, float],
        covariance: Floats,
    ) -> None:
        """Mark a touch at a place of the scene, (3,), m, with its place's covariance (2, 2), m^2.

        The attitude is the quaternion of the skin's local axes there.
        """
        force = np.nan_to_num(contact.force)
        self._root.position, self._root.wxyz = tuple(place * UNITS), attitude
        self._arrow.vertices = arrow(force, self._girth)[0].astype(np.float32)
        self._arrow.visible = bool(force.any())
        known = bool(np.isfinite(covariance).all())
        if known:
            self._ellipse.points = ellipse(covariance).astype(np.float32)
        self._ellipse.visible = known
        if self._solid:
            self._label.text = f"F {np.linalg.norm(force):.2f} N"
            self._label.position = tuple(_tail(force) + np.array((0.0, 0.0, 0.35)))
            self._label.visible = True
        self._root.visible = True

    def hide(self) -> None:
        """Mark nothing."""
        self._root.visible = False


def attitude(axes: Floats) -> tuple[float, float, float, float]:
    """Quaternion w, x, y, z of local axes, (3, 3), which are turned about x alone."""
    half = math.atan2(axes[2, 1], axes[1, 1]) / 2
    return math.cos(half), math.sin(half), 0.0, 0.0


def arrow(force: Floats, girth: float) -> tuple[Floats, Ints]:
    """An arrow for a force (3,), N, so many times as thick as usual.

    Returns
    -------
    vertices : Floats, shape (V, 3)
        In units of the scene, with the contact at the origin.
    triangles : Ints, shape (F, 3)
    """
    length = float(np.linalg.norm(force)) * _ARROW_PER_NEWTON
    axis = force / np.linalg.norm(force) if length > 0.0 else np.array((0.0, 0.0, -1.0))
    aside = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    aside /= np.linalg.norm(aside)
    angle = np.linspace(0.0, 2 * np.pi, _ARROW_SIDES, endpoint=False)[:, None]
    circle = np.cos(angle) * aside + np.sin(angle) * np.cross(axis, aside)
    head = min(0.75 * girth, 0.5 * length)
    thin, wide = 0.13 * girth, 0.34 * girth
    # Stations along the arrow as (distance from its tail, radius).
    stations = ((0.0, 0.0), (0.0, thin), (length - head, thin), (length - head, wide))
    rings = [_tail(force) + along * axis + radius * circle for along, radius in stations]
    rings.append(np.broadcast_to(_tail(force) + length * axis, circle.shape))
    here = np.arange(_ARROW_SIDES)
    after = np.roll(here, -1)
    faces = [
        np.stack([ring * _ARROW_SIDES + first, ring * _ARROW_SIDES + second, third], axis=1)
        for ring in range(len(rings) - 1)
        for first, second, third in (
            (here, after, (ring + 1) * _ARROW_SIDES + here),
            (after, after + _ARROW_SIDES, (ring + 1) * _ARROW_SIDES + here),
        )
    ]
    return np.concatenate(rings), np.concatenate(faces)


def ellipse(covariance: Floats) -> Floats:
    """The 95 % ellipse of a (2, 2) covariance in m^2, as (48, 2, 3) segments in the scene."""
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0.0, 2 * np.pi, 49)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    radii = _ELLIPSE_95 * np.sqrt(np.clip(values, 0.0, None)) * UNITS
    loop = np.zeros((49, 3))
    loop[:, :2] = (circle * radii) @ vectors.T
    return np.stack([loop[:-1], loop[1:]], axis=1)


def _tail(force: Floats) -> Floats:
    """Place of an arrow's blunt end, seen from the contact; a pull starts at the contact."""
    return np.zeros(3) if force[2] > 0.0 else -force * _ARROW_PER_NEWTON
