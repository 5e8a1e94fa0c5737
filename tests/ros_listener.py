"""A plain ROS 2 node that hears a skin, run by its own Python: nothing of smoskin is imported.

It prints one line of JSON: what came on each topic, and what service and parameters answered.
"""

import json
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, TransformStamped, WrenchStamped
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import MagneticField
from std_srvs.srv import Trigger

asked = {
    "topics": [],
    "until": ["", 0],
    "deadline": 20.0,
    "best_effort": False,
    "calls": [],
    "more": 1,
    "depth": 100,
}
asked |= json.loads(sys.argv[1])
TYPES = {"field": MagneticField, "wrench": WrenchStamped, "frames": TransformStamped}
TYPES |= {"contact0": PointStamped, "contact1": PointStamped, "/diagnostics": DiagnosticArray}
try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    pass  # the wheels have none
else:
    TYPES["/tf_static"] = TFMessage
asked["topics"] = [t for t in asked["topics"] if t != "/tf_static" or t in TYPES]
rclpy.init(args=["--ros-args", *asked.get("arguments", [])])
node = rclpy.create_node("listener")
executor = SingleThreadedExecutor()
executor.add_node(node)
heard = {topic: [] for topic in asked["topics"]}


def values(message):
    match message:
        case MagneticField(magnetic_field=v):
            return [v.x, v.y, v.z]
        case PointStamped(point=p):
            return [p.x, p.y, p.z]
        case WrenchStamped(wrench=w):
            parts = (w.force, w.torque)
            return [getattr(part, axis) for part in parts for axis in "xyz"]
        case TransformStamped(transform=t):
            turn = [getattr(t.rotation, axis) for axis in "xyzw"]
            return [message.child_frame_id, [getattr(t.translation, a) for a in "xyz"], turn]
        case DiagnosticArray(status=states):
            pairs = [{v.key: v.value for v in s.values} for s in states]
            return [[s.level[0], s.name, s.message, s.hardware_id] for s in states], pairs


def hearer(topic):
    def hear(message):
        now = time.time_ns()
        for part in getattr(message, "transforms", [message]):
            at = part.header.stamp.sec * 1_000_000_000 + part.header.stamp.nanosec
            heard[topic].append([at, now, part.header.frame_id, values(part)])

    return hear


for topic in asked["topics"]:
    lasting = topic in ("skin/frames", "/tf_static")
    quality = QoSProfile(
        depth=asked["depth"],
        reliability=ReliabilityPolicy.BEST_EFFORT
        if asked["best_effort"]
        else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if lasting else DurabilityPolicy.VOLATILE,
    )
    node.create_subscription(
        TYPES[topic.rpartition("/")[2] if topic[0] != "/" else topic], topic, hearer(topic), quality
    )


def answer(kind, name, request):
    client = node.create_client(kind, name)
    assert client.wait_for_service(timeout_sec=10.0), name
    future = client.call_async(request)
    executor.spin_until_future_complete(future, timeout_sec=10.0)
    return future.result()


def call(name, *given):
    if name == "zero":
        result = answer(Trigger, "skin/zero", Trigger.Request())
        return [result.success, result.message]
    if name == "get":
        got = answer(GetParameters, "smoskin/get_parameters", GetParameters.Request(names=given))
        return [rclpy.parameter.parameter_value_to_python(value) for value in got.values]
    setting = Parameter(given[0], value=given[1]).to_parameter_msg()
    request = SetParameters.Request(parameters=[setting])
    return answer(SetParameters, "smoskin/set_parameters", request).results[0].successful


def hear_until(topic, count):
    begun = time.monotonic()
    while len(heard[topic]) < count and time.monotonic() - begun < asked["deadline"]:
        executor.spin_once(timeout_sec=0.1)


hear_until(*asked["until"])
answers = [call(*given) for given in asked["calls"]]
by_then = {topic: len(messages) for topic, messages in heard.items()}
if asked["calls"]:
    hear_until(asked["until"][0], len(heard[asked["until"][0]]) + asked["more"])
print(json.dumps({"heard": heard, "by_then": by_then, "answers": answers}), flush=True)
rclpy.shutdown()
