"""Launch the node of a skin: ros2 launch skin.launch.py source:=... calibration:=skin.table."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "source": "serial:///dev/ttyACM0",
    "calibration": "skin.table",
    "namespace": "/",
    "prefix": "''",
}
"""Arguments with their defaults; the prefix goes before the names of all frames."""


def generate_launch_description():
    namespace = ["__ns:=", LaunchConfiguration("namespace")]
    prefix = ["prefix:=", LaunchConfiguration("prefix")]
    skin = [LaunchConfiguration("source"), "--calibration", LaunchConfiguration("calibration")]
    node = ["smoskin", "ros", *skin, "--", "--ros-args", "-r", namespace, "-p", prefix]
    declared = [DeclareLaunchArgument(k, default_value=value) for k, value in ARGUMENTS.items()]
    return LaunchDescription([*declared, ExecuteProcess(cmd=node, output="screen")])
