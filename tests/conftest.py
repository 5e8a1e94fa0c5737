"""Fixtures shared by the whole suite."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings

from smoskin.design.skin import Limb, SkinDesign
from smoskin.feasibility import load_design

# Every core has a test process of its own; threads of theirs would only wait for each other.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# What one test process has compiled, the others and their subprocesses need not compile again.
os.environ.setdefault(
    "JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "jax")
)
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")

# A busy machine makes any example slow; speed is for the benchmarks.
settings.register_profile("smoskin", deadline=None)
settings.load_profile("smoskin")

collect_ignore = ["ros_listener.py", "ros_publisher.py"]
"""Programs that tests run by the Python of ROS."""


@pytest.fixture(scope="session")
def planar() -> SkinDesign:
    """The reference design."""
    return load_design("planar")


@pytest.fixture(scope="session")
def curved() -> SkinDesign:
    """The reference design's cells on a forearm."""
    return load_design("curved")


@pytest.fixture(scope="session")
def small_cone(curved: SkinDesign) -> SkinDesign:
    """A skin of 3 x 3 cells on a cone whose radius grows by 8 mm on 60."""
    corners = {"M1": (1, 2), "M2": (2, 1), "M3": (1, 1), "M4": (2, 2)}
    return replace(
        curved,
        cells=(3, 3),
        magnets=tuple(replace(m, corner=corners[m.name]) for m in curved.magnets),
        limb=Limb(skin_radius=0.07, far_radius=0.078),
    )


@pytest.fixture(scope="session")
def long_planar(planar: SkinDesign) -> SkinDesign:
    """A skin of other numbers of cells than the reference, 4 x 5, with its magnets inside."""
    corners = {"M1": (2, 2), "M2": (3, 2), "M3": (1, 3)}
    magnets = tuple(replace(m, corner=corners[m.name]) for m in planar.magnets)
    return replace(planar, name="4x5", cells=(4, 5), magnets=magnets)


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings; the test is skipped where there is none."""
    named = os.environ.get("SMOSKIN_DATA")
    folder = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
    if not (folder / "eflesh").is_dir():
        pytest.skip(f"no eFlesh recordings in {folder}; set SMOSKIN_DATA to their folder")
    return folder / "eflesh"
