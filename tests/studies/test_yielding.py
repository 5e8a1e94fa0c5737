"""The study of yielding: its trajectories reach the speed limit, its figures are the page's."""

import json

import numpy as np
import pytest

pytest.importorskip("jax")

from smoskin.robot.law import HARD_LIMIT
from studies.yielding import FIGURES, trajectory
from tests.arms import BENT, forearm_chain


def test_trajectories_go_as_fast_as_may_be_and_rest_between():
    chain = forearm_chain()
    path = trajectory(chain, BENT, np.random.default_rng(3), 2, 6.0)
    speeds = np.gradient(path, 1 / 50, axis=0)
    fastest = [
        np.linalg.norm(chain.posture(angles).corner_motions @ speed, axis=1).max()
        for angles, speed in zip(path, speeds, strict=True)
    ]
    swing, period = 450, 350  # readings
    assert max(fastest[355:449]) < 1e-9
    for begin in (swing, swing + period):
        assert 0.9 * HARD_LIMIT < max(fastest[begin : begin + 300]) <= HARD_LIMIT * 1.03
        assert max(fastest[begin + 302 : begin + 349]) < 1e-9
    assert (path >= chain.lower).all()
    assert (path <= chain.upper).all()


def test_the_figures_keep_the_promise_and_are_those_of_the_page():
    figures = json.loads(FIGURES.read_text())
    page = FIGURES.with_name("follow.md").read_text(encoding="utf-8")
    for world in ("plain", "hard"):
        for size, (moves, asked) in figures[world].items():
            assert asked >= 90
            if float(size) <= 0.40:
                assert moves == 0
            if float(size) >= 0.60:
                assert moves == asked
    nobody = figures["nobody"]
    assert nobody["asked_to_move"] == 0
    assert f"{nobody['largest_force_N']:.2f} N; none of {nobody['trajectories']} asked" in page
