"""The launch file, read by a stand-in of ROS 2's launch system."""

import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

FILE = Path(__file__).parents[3] / "examples" / "ros" / "skin.launch.py"


class Given(SimpleNamespace):
    """Whatever the launch system makes, with what it was given."""

    def __init__(self, *values, **named):
        super().__init__(values=values, **named)


@pytest.fixture
def launched(monkeypatch):
    """Words of the command that the launch file runs by default."""
    modules = {
        "launch": {"LaunchDescription"},
        "launch.actions": {"DeclareLaunchArgument", "ExecuteProcess"},
        "launch.substitutions": {"LaunchConfiguration"},
    }
    for name, classes in modules.items():
        module = SimpleNamespace(**dict.fromkeys(classes, Given))
        monkeypatch.setitem(sys.modules, name, module)
    made = runpy.run_path(str(FILE))
    *declared, process = made["generate_launch_description"]().values[0]
    usual = {argument.values[0]: argument.default_value for argument in declared}

    def text(part):
        parts = part if isinstance(part, list) else [part]
        return "".join(p if isinstance(p, str) else usual[p.values[0]] for p in parts)

    return [text(part) for part in process.cmd]
