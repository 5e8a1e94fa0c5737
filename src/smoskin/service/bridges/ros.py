"""A ROS 2 node of a skin: what its chips read and what it feels, in messages that robots know.

Decides topics, frames, stamps, qualities of service and what a service and parameters may change.
Places and forces are in the skin's own Cartesian frame, round a limb too. Hides rclpy, which a
sourced ROS 2 workspace brings, or wheels of pip (``docs/ros.md``).
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Final, final

import numpy as np
from scipy.spatial.transform import Rotation

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SmoskinError
from smoskin.magnetics import mlx90393
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.roles import Sink
from smoskin.service.ros import WRENCH_KNOWN, shown_field

_LOG: Final = logging.getLogger(__name__)
_KEPT: Final = 100
"""Messages of a topic that wait for a reliable subscriber, and readings for ROS, at most."""
_CONTACTS: Final = 2
"""Topics of contacts; estimators tell no more of them apart."""
_NS: Final = 1_000_000_000
_DRIFT: Final = 1e-4
"""Share by which the clock of the readings may go more slowly than that of ROS."""
_LATE: Final = 0.5
"""s by which readings come later than they could, from which a clock has jumped or was stopped."""
_ZEROED_WITHIN: Final = 5.0
"""s for a new zero."""
_PERIOD: Final = 1.0
"""s between diagnostics."""
_LEVELS: Final = {
    Status.CONTACT: b"\0",
    Status.NO_CONTACT: b"\0",
    Status.CHIP_MISSING: b"\2",
    Status.STALE: b"\3",
}
"""Levels of diagnostics, as `diagnostic_msgs/DiagnosticStatus` numbers them; others warn."""


def static_frames(design: SkinDesign) -> tuple[Floats, Floats]:
    """Chips in the skin's frame: places, (S, 3), m, and turns as quaternions x, y, z, w, (S, 4).

    A chip's turn takes vectors of its own axes, in which it reports, to the skin's.
    """
    skin = geometry(design)
    turns = skin.chip_axes @ mlx90393.rotations(design.halls)
    return skin.chips, np.asarray(Rotation.from_matrix(turns).as_quat())


def in_space(design: SkinDesign, contact: Contact) -> tuple[Floats, Floats]:
    """Place, m, and force, N, of a contact in the skin's Cartesian frame, (3,) each."""
    roll = geometry(design).roll
    turn = roll.axes(contact.position[1])
    return roll.places([*contact.position, 0.0]), np.asarray(turn @ contact.force)


@final
class Stamps:
    """Times of a source's clock on another, by the readings that came with the least delay.

    A stamp never lies after the moment at which it is asked for. Times that go back, and readings
    half a second later than others, begin anew: the source was paused, or a clock set.

    Parameters
    ----------
    clock : callable
        Clock of the stamps, ns.
    """

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._time = self._ahead = 0.0
        self._stamp: int | None = None

    def __call__(self, time: float) -> int:
        """Stamp of a reading that has just come, ns, by its own time, s."""
        now = self._clock()
        ahead = now * 1e-9 - time
        drifted = self._ahead + _DRIFT * (time - self._time)
        anew = self._stamp is None or time < self._time or ahead > drifted + _LATE
        self._ahead = ahead if anew else min(ahead, drifted)
        stamp = min(round((time + self._ahead) * _NS), now)
        if not anew and self._stamp is not None and now > self._stamp:
            stamp = max(stamp, self._stamp + 1)  # the least delay was overestimated till now
        self._time, self._stamp = time, stamp
        return stamp


@final
class RosNode(Sink):
    """A ROS 2 node that publishes a skin's readings and estimates.

    Topics, relative to the node's namespace, reliable with the last 100 kept: ``skin/chip0/field``
    and so on (`sensor_msgs/MagneticField`, T, in the chip's frame), ``skin/wrench``
    (`geometry_msgs/WrenchStamped`, all touches about the skin's origin), ``skin/contact0`` and
    ``skin/contact1`` (`geometry_msgs/PointStamped`), each at the time at which it was acquired;
    ``/diagnostics`` once a second; the chips' frames on ``/tf_static``, or without `tf2_msgs` on
    ``skin/frames``, one `geometry_msgs/TransformStamped` each, for those who come later too.
    The service ``skin/zero`` (`std_srvs/Trigger`) takes a new zero of the untouched skin.
    Parameters: ``prefix`` of all frames' names, read-only; ``fields``, whether fields are
    published; ``least_force``, N, below which touches are not.

    Parameters
    ----------
    design : SkinDesign
        Skin that is read.
    zero : callable
        Called, from the node's thread, when somebody asks for a new zero; estimates say
        `Status.NOT_CALIBRATED` until it is taken.
    arguments : sequence of str
        Arguments of ROS, such as ``--ros-args -r __ns:=/left -p fields:=false``.

    Raises
    ------
    SmoskinError
        If rclpy or a package of messages cannot be imported.
    ArgumentError
        If ROS refuses the arguments.
    """

    def __init__(
        self, design: SkinDesign, *, zero: Callable[[], None], arguments: Sequence[str] = ()
    ) -> None:
        self._messages = _Messages()
        rclpy = self._messages.rclpy
        self._design, self._zero = design, zero
        self._heard = threading.Condition()
        self._status: Status | None = None
        self._touched = self._closed = False
        self._readings = self._diagnosed = 0
        self._flags = np.zeros(len(design.halls), int)
        self._waiting: deque[tuple[int, Reading, Estimate | None]] = deque(maxlen=_KEPT)
        self._dropped = 0
        self._context = rclpy.Context()
        try:
            rclpy.init(args=list(arguments), context=self._context)
            self._node = rclpy.create_node("smoskin", context=self._context)
            self._declare()
        except Exception as error:  # rclpy's own are of many kinds
            self._context.try_shutdown()
            raise ArgumentError(
                f"arguments must be what ROS takes; got {list(arguments)}: {error}"
            ) from error
        self._stamps = Stamps(lambda: int(self._node.get_clock().now().nanoseconds))
        self._publish_frames()
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._threads = [
            threading.Thread(target=work, name=f"smoskin-ros-{name}", daemon=True)
            for name, work in (("answers", self._spin), ("topics", self._publish))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def name(self) -> str:
        """Full name of the node."""
        return str(self._node.get_fully_qualified_name())

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Have a reading and its estimate published; it never waits for ROS or subscribers."""
        chips = len(self._design.halls)
        if len(reading.field) != chips:
            raise ArgumentError(
                f"reading must have the design's {chips} chips; got {len(reading.field)}"
            )
        if self._closed:
            raise SmoskinError("the node is closed")
        stamp = self._stamps(reading.time)
        with self._heard:
            self._dropped += len(self._waiting) == self._waiting.maxlen
            self._waiting.append((stamp, reading, estimate))
            self._readings += 1
            self._flags |= reading.flags
            if estimate is not None:
                self._status, self._touched = estimate.status, bool(estimate.contacts)
            self._heard.notify_all()

    @property
    def dropped(self) -> int:
        """How many readings ROS was too slow for."""
        return self._dropped

    def close(self) -> None:
        """End the node; any number of times."""
        with self._heard:
            if self._closed:
                return
            self._closed = True
            self._heard.notify_all()
        self._executor.shutdown(_ZEROED_WITHIN)
        for thread in self._threads:
            thread.join(_ZEROED_WITHIN)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _publish(self) -> None:
        """Publish what waits, until the end and what waits then."""
        while True:
            with self._heard:
                if not self._heard.wait_for(lambda: self._waiting or self._closed, _PERIOD):
                    continue
                if not self._waiting:
                    return
                moment, reading, estimate = self._waiting.popleft()
            message = self._messages
            stamp = message.time(moment)
            if self._node.get_parameter("fields").value:
                for chip, publisher in enumerate(self._fields):
                    field = message.vector(shown_field(reading, chip))
                    header = message.header(stamp, self._frame(f"chip{chip}"))
                    publisher.publish(message.MagneticField(header=header, magnetic_field=field))
            if estimate is not None and estimate.status in WRENCH_KNOWN:
                self._publish_touches(estimate, stamp)

    def _publish_touches(self, estimate: Estimate, stamp: Any) -> None:
        """Publish the touches that are strong enough."""
        message = self._messages
        least = self._node.get_parameter("least_force").value
        touches = [
            in_space(self._design, contact)
            for contact in estimate.contacts
            if np.linalg.norm(contact.force) >= least
        ]
        force, torque = np.zeros(3), np.zeros(3)
        for place, push in touches:
            force, torque = force + push, torque + np.cross(place, push)
        header = message.header(stamp, self._frame("skin"))
        wrench = message.Wrench(force=message.vector(force), torque=message.vector(torque))
        self._wrench.publish(message.WrenchStamped(header=header, wrench=wrench))
        for publisher, (place, _) in zip(self._points, touches, strict=False):
            x, y, z = place.tolist()
            point = message.Point(x=x, y=y, z=z)
            publisher.publish(message.PointStamped(header=header, point=point))

    def _frame(self, name: str) -> str:
        return f"{self._prefix}{name}"

    def _declare(self) -> None:
        """Declare parameters, topics, the service and the timer of diagnostics."""
        node, message = self._node, self._messages
        kind, span = message.ParameterDescriptor, message.FloatingPointRange
        about = kind(description="Put before the names of all frames.", read_only=True)
        self._prefix = str(node.declare_parameter("prefix", "", about).value)
        node.declare_parameter("fields", True, kind(description="Publish the chips' fields."))
        room = span(from_value=0.0, to_value=1000.0)
        about = kind(description="Touches below this are left out, N.", floating_point_range=[room])
        node.declare_parameter("least_force", 0.0, about)
        kept = message.quality(_KEPT)
        self._fields = [
            node.create_publisher(message.MagneticField, f"skin/chip{chip}/field", kept)
            for chip in range(len(self._design.halls))
        ]
        self._wrench = node.create_publisher(message.WrenchStamped, "skin/wrench", kept)
        self._points = [
            node.create_publisher(message.PointStamped, f"skin/contact{k}", kept)
            for k in range(_CONTACTS)
        ]
        self._health = node.create_publisher(message.DiagnosticArray, "/diagnostics", kept)
        node.create_service(message.Trigger, "skin/zero", self._take_zero)
        node.create_timer(_PERIOD, self._diagnose)

    def _publish_frames(self) -> None:
        """Publish the chips' frames once, kept for those who come later."""
        message = self._messages
        stamp = self._node.get_clock().now().to_msg()
        transforms = []
        for chip, (place, turn) in enumerate(zip(*static_frames(self._design), strict=True)):
            x, y, z, w = turn.tolist()
            moved = message.Transform(
                translation=message.vector(place), rotation=message.Quaternion(x=x, y=y, z=z, w=w)
            )
            header = message.header(stamp, self._frame("skin"))
            child = self._frame(f"chip{chip}")
            transforms.append(
                message.TransformStamped(header=header, child_frame_id=child, transform=moved)
            )
        if message.TFMessage is not None:
            kept = message.quality(1, lasting=True)
            self._tree = self._node.create_publisher(message.TFMessage, "/tf_static", kept)
            self._tree.publish(message.TFMessage(transforms=transforms))
            return
        _LOG.warning("tf2_msgs is not installed: the chips' frames are on skin/frames")
        kept = message.quality(len(transforms), lasting=True)
        self._tree = self._node.create_publisher(message.TransformStamped, "skin/frames", kept)
        for transform in transforms:
            self._tree.publish(transform)

    def _spin(self) -> None:
        """Answer what ROS asks, until the end."""
        with suppress(self._messages.rclpy.executors.ExternalShutdownException):
            self._executor.spin()

    def _take_zero(self, request: Any, response: Any) -> Any:
        """Ask for a new zero and answer when it is taken, or why not; never later than 5 s."""
        with self._heard:
            response.success, response.message = False, "The skin is touched."
            if self._touched:
                return response
            self._zero()
            if not (self._comes(zeroed=False) and self._comes(zeroed=True)):
                response.message = "Not yet: the zero is taken as soon as the skin rests."
                return response
        response.success, response.message = True, "The zero is taken."
        return response

    def _comes(self, *, zeroed: bool) -> bool:
        """Whether an estimate with a zero, or without, comes in time."""
        without = Status.NOT_CALIBRATED
        self._heard.wait_for(
            lambda: self._closed or (self._status is not without) == zeroed, _ZEROED_WITHIN / 2
        )
        return not self._closed and (self._status is not without) == zeroed

    def _diagnose(self) -> None:
        """Say how the skin does."""
        message = self._messages
        with self._heard:
            count, self._diagnosed = self._readings - self._diagnosed, self._readings
            status, flags = self._status, self._flags.copy()
            self._flags[:] = 0
        level, words = b"\3", "No readings come."
        if count and status is not None:
            level, words = _LEVELS.get(status, b"\1"), status.value
        faults = {
            f"chip{chip}": ", ".join(str(f.name) for f in ChipFlag(int(flag))) or "good"
            for chip, flag in enumerate(flags)
        }
        rate = f"{count / _PERIOD:.1f}"
        values = {"readings": str(self._readings), "rate, Hz": rate, "dropped": str(self._dropped)}
        values |= faults
        diagnostic = message.DiagnosticStatus(
            level=level,
            name=f"{self.name}: skin",
            message=words,
            hardware_id=self._design.name,
            values=[message.KeyValue(key=key, value=value) for key, value in values.items()],
        )
        header = message.header(self._node.get_clock().now().to_msg(), "")
        self._health.publish(message.DiagnosticArray(header=header, status=[diagnostic]))


class _Messages:
    """Types of ROS 2, imported when a node is made."""

    def __init__(self) -> None:
        try:
            import rclpy
            import rclpy.executors
            from builtin_interfaces.msg import Time
            from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
            from geometry_msgs import msg as shapes
            from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
            from rclpy import qos
            from sensor_msgs.msg import MagneticField
            from std_msgs.msg import Header
            from std_srvs.srv import Trigger
        except ImportError as error:
            raise SmoskinError(
                "a ROS 2 node needs rclpy, which comes with a sourced ROS 2 workspace or with the "
                f"wheels that docs/ros.md names: {error}"
            ) from error
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            TFMessage = None
        self.rclpy, self._qos, self._header, self._moment = rclpy, qos, Header, Time
        self.TFMessage, self.Trigger, self.MagneticField = TFMessage, Trigger, MagneticField
        self.DiagnosticArray, self.KeyValue = DiagnosticArray, KeyValue
        self.DiagnosticStatus = DiagnosticStatus
        self.ParameterDescriptor, self.FloatingPointRange = ParameterDescriptor, FloatingPointRange
        self.Point, self.PointStamped = shapes.Point, shapes.PointStamped
        self.Wrench, self.WrenchStamped = shapes.Wrench, shapes.WrenchStamped
        self.Transform, self.TransformStamped = shapes.Transform, shapes.TransformStamped
        self.Quaternion, self._vector = shapes.Quaternion, shapes.Vector3

    def time(self, stamp: int) -> Any:
        """A stamp, ns."""
        seconds, nanoseconds = divmod(stamp, _NS)
        return self._moment(sec=seconds, nanosec=nanoseconds)

    def header(self, stamp: Any, frame: str) -> Any:
        """A header of a moment and a frame."""
        return self._header(stamp=stamp, frame_id=frame)

    def vector(self, xyz: Floats) -> Any:
        """A vector, (3,)."""
        x, y, z = xyz.tolist()
        return self._vector(x=x, y=y, z=z)

    def quality(self, depth: int, *, lasting: bool = False) -> Any:
        """A reliable topic's quality; a lasting one tells those who come later too."""
        later = self._qos.DurabilityPolicy
        return self._qos.QoSProfile(
            depth=depth,
            history=self._qos.HistoryPolicy.KEEP_LAST,
            reliability=self._qos.ReliabilityPolicy.RELIABLE,
            durability=later.TRANSIENT_LOCAL if lasting else later.VOLATILE,
        )
