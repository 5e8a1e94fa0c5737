"""Each extra brings all that its own doors import; nothing else has to be installed."""

import ast
import subprocess
import sys
import tomllib
from functools import cache
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from smoskin import errors

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
OWNERS = {
    name: {canonicalize_name(owner) for owner in owners}
    for name, owners in packages_distributions().items()
} | {name: {"ur-rtde"} for name in ("rtde_control", "rtde_receive")}  # compiled, and not listed
"""Distributions by the names that are imported."""
STATED = {
    canonicalize_name(Requirement(line).name)
    for line in (*PROJECT["dependencies"], *(line for lines in EXTRAS.values() for line in lines))
} | {"distributed"}  # as dask[distributed]

ROS = ("_msgs", "_srvs", "_interfaces")
"""Endings of the names of ROS 2's packages of messages."""

DOORS = {
    "recording": """
from smoskin import Reading, load_design
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
design = load_design("planar")
with Recorder("a.mcap", design) as recorder:
    recorder.write(Reading(time=0.0, field=[[0.0] * 3] * 3))
recording = open_recording("a.mcap")
assert len(list(recording)) == 1 and recording.design == design
""",
    "view": """
from smoskin import load_design
from smoskin.service.page.view import View
View(load_design("planar")).close()
""",
    "learned": """
from smoskin import load_response_table
load_response_table("planar").save("a.table")
load_response_table("a.table")
""",
    "fabrication": """
from smoskin import load_design
from smoskin.fabrication.bundle import make_bundle
assert len(make_bundle(load_design("planar")).files) > 40
""",
    "plots": """
from smoskin import load_design, plots
plots.draw_skin(load_design("planar"))
""",
    "mesh": """
from pathlib import Path
from smoskin.origami.surface.mesh import read_mesh
Path("a.obj").write_text("v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n")
assert len(read_mesh("a.obj").triangles) == 1
""",
    "cli": """
import sys
from smoskin.cli import main
sys.argv = ["smoskin", "info", "planar"]
try:
    main()
except SystemExit as end:
    assert end.code == 0, end.code
""",
    "twin": """
from smoskin import Twin, load_design
Twin(load_design("planar")).read()
""",
    "train": "import smoskin.sensing.network.training",
    "data": """
import math
from smoskin.datasets.workers import Engine
assert list(Engine(2).run(math.factorial, [3, 4]))
import smoskin.datasets.store
import h5py
from smoskin import load_design
from smoskin.design.document import format_design
format_design(load_design("planar"))
""",
}

GUARD = """
import sys
barred = set(sys.argv.pop(1).split(","))
class Bar:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in barred:
            raise ModuleNotFoundError(f"{name} is not of this extra", name=name)
sys.meta_path.insert(0, Bar())
"""


@cache
def brought(requirement: str) -> frozenset[str]:
    """Distributions that a requirement installs, its own requirements included."""
    wanted = Requirement(requirement)
    if wanted.name == "smoskin":
        return frozenset().union(*(brought(r) for extra in wanted.extras for r in EXTRAS[extra]))
    try:
        needs = [Requirement(text) for text in requires(wanted.name) or ()]
    except PackageNotFoundError:
        return frozenset()
    kept = [
        need
        for need in needs
        if need.marker is None
        or any(need.marker.evaluate({"extra": extra}) for extra in (*wanted.extras, ""))
    ]
    return frozenset({canonicalize_name(wanted.name)}).union(
        *(brought(f"{need.name}") for need in kept)
    )


def third_party(path: Path) -> set[str]:
    """Names of other packages that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - {"smoskin"}


def test_whatever_is_imported_is_stated() -> None:
    files = (ROOT / "src" / "smoskin").rglob("*.py")
    imported = set().union(*map(third_party, files))
    unstated = {name for name in imported if not OWNERS.get(name, {name}) & STATED}
    # A sourced workspace brings ROS 2; its wheels suit an environment of their own alone.
    assert {name for name in unstated if name != "rclpy" and not name.endswith(ROS)} == set()


@pytest.mark.slow
@pytest.mark.parametrize("extra", DOORS)
def test_an_extra_is_enough_for_its_doors(extra: str, tmp_path: Path) -> None:
    lines = (*PROJECT["dependencies"], *EXTRAS[extra])
    allowed = frozenset().union(*map(brought, lines))
    barred = [name for name, owners in OWNERS.items() if owners & (STATED - allowed - {"smoskin"})]
    assert len({"jax", "viser", "mcap", "matplotlib"} & set(barred)) >= 3
    command = [sys.executable, "-c", GUARD + DOORS[extra], ",".join(barred)]
    environment = {"PYTHONPATH": str(ROOT / "src"), "HOME": str(tmp_path)}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("around", [True, False])
def test_a_library_that_cannot_even_be_looked_for_is_missing(monkeypatch, around):
    def find_spec(module):
        if around:
            raise ModuleNotFoundError(module)

    monkeypatch.setattr(errors, "find_spec", find_spec)
    with pytest.raises(errors.MissingExtraError, match=r"flying needs the extra 'wings'"):
        errors.require("flying", "wings", "feathers.long")
    monkeypatch.setattr(errors, "find_spec", lambda module: object())
    errors.require("flying", "wings", "feathers.long")
