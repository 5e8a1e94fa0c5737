"""Skins live in Foxglove: its WebSocket protocol, by the makers' own library.

Decides topics and messages: those of a recording, so that one layout shows both, beside a scene
in 3-D, the status in words and the loop's counters. Foxglove only listens: nothing can be asked of
a skin there. Hides how often what is.
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading
from smoskin.roles import Resource, Sink
from smoskin.service import ros
from smoskin.service.bridges.door import HERE

if TYPE_CHECKING:
    from foxglove.messages import ArrowPrimitive

_VIEWED: Final = 0.01
"""s between two messages for viewers, at least; readings and estimates come at full rate."""
_STANDING: Final = 1.0
"""s between two messages about what stands still, for those who have come since."""
_BACKLOG: Final = 256
"""Messages that wait for a viewer; then the oldest is dropped."""
_ARROW: Final = 0.05
"""m of an arrow for 1 N."""
_ESTIMATED: Final = (0.83, 0.37, 0.0, 1.0)
_SHEET: Final = (0.35, 0.35, 0.40, 1.0)
_WORDS: Final = {"type": "object", "properties": {"status": {"type": "string"}}}


@final
class Foxglove(Resource):
    """A server that Foxglove, and whatever speaks its protocol, connects to.

    It listens to this machine alone: its protocol knows no token.

    Parameters
    ----------
    port : int
        TCP port; 0 takes a free one.

    Raises
    ------
    ArgumentError
        If the port is taken.
    MissingExtraError
        If the extra `foxglove` is not installed, or `recording`, whose messages it sends.
    """

    def __init__(self, *, port: int = 0) -> None:
        try:
            from foxglove import Context, start_server
        except ImportError as error:
            raise MissingExtraError("Foxglove's server", "foxglove") from error
        self._context = Context()
        try:
            self._server = start_server(
                name="smoskin",
                host=HERE,
                port=port,
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
        except (OSError, RuntimeError) as error:
            raise ArgumentError(f"port must be free; got {port}: {error}") from error
        self._names: set[str] = set()
        self._closed = False

    @property
    def url(self) -> str:
        """Address that Foxglove opens as a connection."""
        return f"ws://{HERE}:{self._server.port}"

    def add(
        self,
        name: str,
        chips: int,
        design: SkinDesign | None = None,
        *,
        zero: Callable[[], None] | None = None,
        counters: Callable[[], Mapping[str, Any]] | None = None,
    ) -> Sink:
        """A sink that shows a skin of so many chips under this name.

        `zero` is not offered to viewers. It raises an `ArgumentError` if the name is taken.
        """
        if name in self._names:
            raise ArgumentError(f"name must be of one skin alone; got {name!r} again")
        self._names.add(name)
        return _Shown(self._context, name, chips, design, counters)

    def close(self) -> None:
        """End the connections and the server; any number of times."""
        if not self._closed:
            self._closed = True
            self._server.stop()


@final
class _Shown(Sink):
    """The channels of one skin."""

    def __init__(
        self,
        context: Any,
        name: str,
        chips: int,
        design: SkinDesign | None,
        counters: Callable[[], Mapping[str, Any]] | None,
    ) -> None:
        from foxglove import Channel, Schema
        from foxglove.channels import FrameTransformsChannel, SceneUpdateChannel

        self._codec = ros.Codec(within=f"{name}/")
        self._name, self._chips, self._design = name, chips, design
        self._geometry = None if design is None else geometry(design)

        def cdr(topic: str, kind: str) -> Any:
            known = Schema(name=kind, encoding="ros2msg", data=self._codec.schema(kind))
            topic = f"/{name}/{topic}"
            return Channel(topic, schema=known, message_encoding="cdr", context=context)

        self._reading, self._estimate = cdr("reading", ros.READING), cdr("estimate", ros.ESTIMATE)
        self._fields = [cdr(f"chip{chip}/field", ros.FIELD) for chip in range(chips)]
        self._wrench = cdr("wrench", ros.WRENCH)
        self._contacts = [cdr(f"contact{place}", ros.POSITION) for place in range(2)]
        self._status = Channel(f"/{name}/status", schema=dict(_WORDS), context=context)
        self._loop = Channel(f"/{name}/counters", schema={"type": "object"}, context=context)
        self._scene = SceneUpdateChannel(f"/{name}/scene", context=context)
        self._frames = FrameTransformsChannel(f"/{name}/frames", context=context)
        self._counters = counters
        self._sequence, self._offset = 0, math.nan
        self._viewed = self._standing = -math.inf

    @property
    def dropped(self) -> int:
        """Nothing: what a viewer has missed is that viewer's."""
        return 0

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Show a reading and its estimate to whoever looks; never waits."""
        if len(reading.field) != self._chips:
            raise ArgumentError(f"reading must have {self._chips} chips; got {len(reading.field)}")
        stamp = self._stamp(reading.time)
        sequence, self._sequence = self._sequence, self._sequence + 1
        if self._reading.has_sinks():
            payload = self._codec.encode_reading(reading, sequence, stamp)
            self._reading.log(payload, log_time=stamp)
        if estimate is not None and self._estimate.has_sinks():
            payload = self._codec.encode_estimate(estimate, sequence, stamp)
            self._estimate.log(payload, log_time=stamp)
        now = time.monotonic()
        if now - self._viewed >= _VIEWED:
            self._viewed = now
            self._view(reading, estimate, stamp)
        if now - self._standing >= _STANDING:
            self._standing = now
            self._stand(stamp)

    def close(self) -> None:
        """Take the skin's channels away."""
        for channel in (
            *(self._reading, self._estimate, self._wrench, self._status, self._loop),
            *(self._scene, self._frames, *self._fields, *self._contacts),
        ):
            channel.close()

    def _stamp(self, moment: float) -> int:
        """Wall clock time of a moment on the readings' clock, ns; anew where that clock jumps."""
        now = time.time()
        if not abs(moment + self._offset - now) < 1.0:
            self._offset = now - moment
        return round((moment + self._offset) * 1e9)

    def _view(self, reading: Reading, estimate: Estimate | None, stamp: int) -> None:
        """Send what viewers draw."""
        codec = self._codec
        for chip, channel in enumerate(self._fields):
            if channel.has_sinks():
                channel.log(codec.encode_field(reading, chip, stamp), log_time=stamp)
        if estimate is None:
            return
        for contact, channel in zip(estimate.contacts, self._contacts, strict=False):
            if channel.has_sinks():
                channel.log(codec.encode_position(contact, stamp), log_time=stamp)
        if estimate.status in ros.WRENCH_KNOWN and self._wrench.has_sinks():
            self._wrench.log(codec.encode_wrench(estimate.contacts, stamp), log_time=stamp)
        if self._status.has_sinks():
            message = {"status": estimate.status.name, "means": estimate.status.value}
            self._status.log(message, log_time=stamp)
        if self._scene.has_sinks():
            arrows = [self._arrow(contact) for contact in estimate.contacts]
            self._draw("touches", stamp, arrows=arrows)

    def _stand(self, stamp: int) -> None:
        """Send what stands still: the sheet, the chips' frames, and the counters."""
        if self._counters is not None and self._loop.has_sinks():
            self._loop.log(json.dumps(self._counters()).encode(), log_time=stamp)
        if self._geometry is None:
            return
        if self._scene.has_sinks():
            from foxglove.messages import LinePrimitive, LinePrimitiveLineType

            sheet = self._geometry.sheet
            sides = sheet.facets[:, [0, 1, 1, 2, 2, 3, 3, 0]].reshape(-1, 2)
            ends = sheet.vertices[np.unique(np.sort(sides), axis=0)].reshape(-1, 3)
            lines = LinePrimitive(
                type=LinePrimitiveLineType.LineList,
                thickness=1.0,
                scale_invariant=True,
                points=[_point(place) for place in ends],
                color=_color(_SHEET),
            )
            self._draw("sheet", stamp, lines=[lines])
        if self._frames.has_sinks():
            self._frames.log(self._transforms(stamp), log_time=stamp)

    def _draw(self, what: str, stamp: int, **primitives: Any) -> None:
        from foxglove.messages import SceneEntity, SceneUpdate, Timestamp

        entity = SceneEntity(
            timestamp=Timestamp(*divmod(stamp, 1_000_000_000)),
            frame_id=f"{self._name}/skin",
            id=what,
            **primitives,
        )
        self._scene.log(SceneUpdate(entities=[entity]), log_time=stamp)

    def _arrow(self, contact: Contact) -> "ArrowPrimitive":
        """An arrow whose tip touches the skin; on a limb along its surface there."""
        from foxglove.messages import ArrowPrimitive, Pose

        place, force = np.array([*contact.position, 0.0]), contact.force
        if self._geometry is not None:
            roll = self._geometry.roll
            place, force = roll.places(place), roll.axes(contact.position[1]) @ force
        length = _ARROW * float(np.linalg.norm(force))
        along = force / np.linalg.norm(force) if length > 0.0 else np.array([0.0, 0.0, -1.0])
        head = min(0.01, 0.5 * length)
        return ArrowPrimitive(
            pose=Pose(position=_vector(place - length * along), orientation=_along(along)),
            shaft_length=length - head,
            shaft_diameter=0.003,
            head_length=head,
            head_diameter=0.008,
            color=_color(_ESTIMATED),
        )

    def _transforms(self, stamp: int) -> Any:
        """Places and axes of the chips in the skin's frame."""
        from foxglove.messages import FrameTransform, FrameTransforms, Timestamp

        assert self._geometry is not None
        chips = zip(self._geometry.chips, self._geometry.chip_axes, strict=True)
        return FrameTransforms(
            transforms=[
                FrameTransform(
                    timestamp=Timestamp(*divmod(stamp, 1_000_000_000)),
                    parent_frame_id=f"{self._name}/skin",
                    child_frame_id=f"{self._name}/chip{chip}",
                    translation=_vector(place),
                    rotation=_turned(axes),
                )
                for chip, (place, axes) in enumerate(chips)
            ]
        )


def _vector(xyz: Floats) -> Any:
    from foxglove.messages import Vector3

    x, y, z = xyz.tolist()
    return Vector3(x=x, y=y, z=z)


def _point(xyz: Floats) -> Any:
    from foxglove.messages import Point3

    x, y, z = xyz.tolist()
    return Point3(x=x, y=y, z=z)


def _color(rgba: tuple[float, float, float, float]) -> Any:
    from foxglove.messages import Color

    red, green, blue, alpha = rgba
    return Color(r=red, g=green, b=blue, a=alpha)


def _quaternion(wxyz: Floats) -> Any:
    from foxglove.messages import Quaternion

    w, x, y, z = (wxyz / np.linalg.norm(wxyz)).tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def _along(direction: Floats) -> Any:
    """The turn that brings x to a unit direction."""
    x, y, z = direction
    return _quaternion(np.array([1.0 + x, 0.0, -z, y] if x > -1.0 + 1e-9 else [0.0, 0.0, 0.0, 1.0]))


def _turned(axes: Floats) -> Any:
    """The turn whose columns are these axes, (3, 3)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(axes).as_quat()
    return _quaternion(np.array([w, x, y, z]))
