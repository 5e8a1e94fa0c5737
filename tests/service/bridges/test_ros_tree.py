"""The chips' frames as ROS 2 gets them: message by message, where no rclpy is installed.

The node builds messages of rosbags' types, which know nothing of the node; their bytes are what a
robot's tf2 would get.
"""

import importlib
import sys
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from smoskin.feasibility import load_design
from smoskin.magnetics.mlx90393 import rotations
from smoskin.origami.geometry import geometry
from smoskin.service.bridges.ros import RosNode

typesys = pytest.importorskip("rosbags.typesys")

NOW = 1_700_000_000_123_456_789
STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)


def message(kind):
    return STORE.types[kind]


class Node:
    """Takes what a node declares; what it publishes is kept as bytes."""

    def __init__(self, arguments):
        self.given = dict(word.split(":=") for word in arguments if ":=" in word)
        self.published = {}
        self.parameters = {}

    def declare_parameter(self, name, value, about):
        self.parameters[name] = SimpleNamespace(value=self.given.get(name, value))
        return self.parameters[name]

    def create_publisher(self, kind, topic, quality):
        def publish(msg):
            name = msg.__msgtype__
            raw = bytes(STORE.serialize_cdr(msg, name))
            self.published.setdefault(topic, []).append((name, raw, quality))

        return SimpleNamespace(publish=publish)

    def create_service(self, *given):
        pass

    create_timer = create_service

    def get_clock(self):
        stamp = message("builtin_interfaces/msg/Time")(*divmod(NOW, 10**9))
        now = SimpleNamespace(nanoseconds=NOW, to_msg=lambda: stamp)
        return SimpleNamespace(now=lambda: now)

    def get_fully_qualified_name(self):
        return "/smoskin"

    def destroy_node(self):
        pass


@pytest.fixture
def ros(monkeypatch):
    """Modules of ROS with rosbags' messages; gives the nodes that are made."""
    nodes, asked = [], []
    context = SimpleNamespace(try_shutdown=lambda: None)
    executor = SimpleNamespace(
        add_node=lambda node: None, spin=lambda: None, shutdown=lambda seconds: None
    )

    def create_node(name, context):
        nodes.append(Node(asked))
        return nodes[-1]

    executors = SimpleNamespace(
        SingleThreadedExecutor=lambda context: executor, ExternalShutdownException=RuntimeError
    )
    qos = SimpleNamespace(
        QoSProfile=SimpleNamespace,
        DurabilityPolicy=SimpleNamespace(TRANSIENT_LOCAL="transient local", VOLATILE="volatile"),
        HistoryPolicy=SimpleNamespace(KEEP_LAST="keep last"),
        ReliabilityPolicy=SimpleNamespace(RELIABLE="reliable"),
    )
    rclpy = SimpleNamespace(
        Context=lambda: context,
        init=lambda args, context: asked.extend(args),
        create_node=create_node,
        executors=executors,
        qos=qos,
    )
    shapes = ("Point", "PointStamped", "Wrench", "WrenchStamped", "Quaternion", "Vector3")
    shapes = (*shapes, "Transform", "TransformStamped")
    modules = {
        "rclpy": rclpy,
        "rclpy.executors": executors,
        "builtin_interfaces.msg": ("Time",),
        "diagnostic_msgs.msg": ("DiagnosticArray", "DiagnosticStatus", "KeyValue"),
        "geometry_msgs": SimpleNamespace(
            msg=SimpleNamespace(**{k: message(f"geometry_msgs/msg/{k}") for k in shapes})
        ),
        "rcl_interfaces.msg": SimpleNamespace(
            FloatingPointRange=SimpleNamespace, ParameterDescriptor=SimpleNamespace
        ),
        "sensor_msgs.msg": ("MagneticField",),
        "std_msgs.msg": ("Header",),
        "std_srvs.srv": SimpleNamespace(Trigger=None),
        "tf2_msgs.msg": ("TFMessage",),
    }
    for name, module in modules.items():
        if isinstance(module, tuple):
            kinds = {kind: message(f"{name.replace('.', '/')}/{kind}") for kind in module}
            module = SimpleNamespace(**kinds)
        package = name.partition(".")[0]
        if package != name and package != "rclpy":
            monkeypatch.setitem(sys.modules, package, SimpleNamespace(__path__=[]))
        monkeypatch.setitem(sys.modules, name, module)
    return nodes


def decoded(kind, raw):
    """What a robot reads in bytes, by another store of the message types."""
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).deserialize_cdr(raw, kind)


def assert_tree(transforms, design, prefix):
    """Each chip stands in the skin's frame where it lies, its axes turned as it was soldered."""
    skin = geometry(design)
    assert len(transforms) == len(design.halls)
    for chip, frame in enumerate(transforms):
        assert frame.header.frame_id == f"{prefix}skin"
        assert frame.child_frame_id == f"{prefix}chip{chip}"
        assert frame.header.stamp.sec * 10**9 + frame.header.stamp.nanosec == NOW
        place, turn = frame.transform.translation, frame.transform.rotation
        assert [place.x, place.y, place.z] == pytest.approx(skin.chips[chip], abs=1e-12)
        turned = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
        assert np.linalg.norm([turn.x, turn.y, turn.z, turn.w]) == pytest.approx(1.0)
        axes = skin.chip_axes[chip] @ rotations(design.halls)[chip]
        assert turned.as_matrix() == pytest.approx(axes, abs=1e-12)


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_tf_static_holds_each_chip_for_those_who_come_later_too(ros, name):
    design = load_design(name)
    arguments = ["--ros-args", "-p", "prefix:=left_"]
    with RosNode(design, zero=lambda: None, arguments=arguments):
        ((kind, raw, quality),) = ros[0].published.pop("/tf_static")
    assert kind == "tf2_msgs/msg/TFMessage"
    assert_tree(decoded(kind, raw).transforms, design, "left_")
    assert (quality.durability, quality.reliability, quality.depth) == (
        *("transient local", "reliable", 1),
    )
    assert ros[0].published == {}


def test_without_tf2_each_frame_is_a_message_of_its_own(ros, monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", None)
    design = load_design("planar")
    with RosNode(design, zero=lambda: None):
        frames = ros[0].published.pop("skin/frames")
    assert {kind for kind, _, _ in frames} == {"geometry_msgs/msg/TransformStamped"}
    assert_tree([decoded(kind, raw) for kind, raw, _ in frames], design, "")
    assert {(quality.durability, quality.depth) for _, _, quality in frames} == {
        ("transient local", 3),
    }
    assert "the chips' frames are on skin/frames" in caplog.text
    assert ros[0].published == {}


def test_the_node_declares_what_a_launch_file_may_set(ros, launched):
    words = launched
    with RosNode(load_design("planar"), zero=lambda: None):
        declared = set(ros[0].parameters)
    assert declared == {"prefix", "fields", "least_force"}
    named = {word.partition(":=")[0] for flag, word in pairwise(words) if flag == "-p"}
    assert named == {"prefix"} & declared
    typer = pytest.importorskip("typer.main")
    command = typer.get_command(importlib.import_module("smoskin.cli").app).commands[words[1]]
    options = {name for parameter in command.params for name in parameter.opts}
    given = {word for word in words[: words.index("--")] if word.startswith("--")}
    assert given == {"--calibration"} & options
