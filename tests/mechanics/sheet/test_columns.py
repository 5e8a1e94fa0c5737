"""Columns and stops as elements: against the greatest energy, finite differences, and limits."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from smoskin.mechanics import beam

pytest.importorskip("jax")
import jax

from smoskin.mechanics.sheet import columns

UNIT, HEIGHT, SHARE, SOFTNESS = 0.25, 0.01, 0.0188, 0.0055


@pytest.fixture(autouse=True)
def double():
    with jax.enable_x64(True):
        yield


def standing(count, *, turned=True):
    """Local axes of columns, (C, 3, 3), any or those of the frame."""
    drawn = np.random.default_rng(5).normal(size=(count, 3, 3))
    return np.linalg.qr(drawn)[0] if turned else np.tile(np.eye(3), (count, 1, 1))


def some(count, *, turned=True):
    """Columns of one kind."""
    parts = (
        *(UNIT, HEIGHT, SHARE, SOFTNESS),
        beam.slackest(SHARE),
        float(beam.crushing(SHARE)),
    )
    axes = standing(count, turned=turned)[..., None]
    return columns.Columns(np.arange(count), axes, *(np.full((count, 1), part) for part in parts))


def motions(count, seed=0):
    """Tops that sway by up to 3 mm and sink by up to 3 mm, or rise a little; (C, 3, 1), m."""
    rng = np.random.default_rng(seed)
    local = rng.uniform([-2e-3, -2e-3, -3e-3], [2e-3, 2e-3, 5e-4], (count, 3))[..., None]
    return standing(count) @ local


def energy(motion, axes):
    """Energy of one column: the greatest over its load, J."""
    motion = motion @ axes
    wide, short = (motion[:2] ** 2).sum() / HEIGHT**2, -motion[2] / HEIGHT

    def lost(z):
        sways = float(beam.sway(z, SHARE).value)
        return -(sways * wide / 2 + z * short - SOFTNESS * z**2 / 2)

    ends = 0.98 * float(beam.slackest(SHARE)), 0.999 * float(beam.crushing(SHARE))
    return -UNIT * HEIGHT**2 * minimize_scalar(lost, bounds=ends, options={"xatol": 1e-11}).fun


def test_forces_are_the_derivatives_of_the_greatest_energy():
    motion = motions(20)
    made = some(20)
    force = np.asarray(columns.column_forces(made, columns.bend(made, motion)))[..., 0]
    step = 1e-6
    for row, axis in np.ndindex(20, 3):
        ends = np.repeat(motion[row : row + 1, :, 0], 2, axis=0)
        ends[:, axis] += [step, -step]
        own = standing(20)[row]
        slope = (energy(ends[0], own) - energy(ends[1], own)) / (2 * step)
        assert force[row, axis] == pytest.approx(slope, rel=1e-5, abs=1e-8)


def test_blocks_are_the_derivatives_of_the_forces():
    motion, made, step = motions(20, 1), some(20), 1e-8
    blocks = np.asarray(columns.column_blocks(made, columns.bend(made, motion)))
    for axis in range(3):
        shift = step * np.eye(3)[axis][:, None]
        ends = [
            np.asarray(columns.column_forces(made, columns.bend(made, motion + sign * shift)))
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1])[..., 0] / (2 * step)
        np.testing.assert_allclose(blocks[..., axis], slope, rtol=1e-5, atol=1e-6 * UNIT)
    np.testing.assert_allclose(blocks, np.swapaxes(blocks, 1, 2), rtol=1e-12)


def test_changes_with_stiffness_are_those_of_stiffer_columns():
    motion, made, step = motions(20, 2), some(20), 1e-6
    sideways, along = columns.column_changes(made, columns.bend(made, motion))

    def forces(stiffer, longer):
        softness = made.softness * (1 + stiffer) / (1 + longer)
        other = made._replace(unit=made.unit * (1 + stiffer), softness=softness)
        return np.asarray(columns.column_forces(other, columns.bend(other, motion)))

    for change, way in ((sideways, np.array([1, 0])), (along, np.array([0, 1]))):
        slope = (forces(*(step * way)) - forces(*(-step * way))) / (2 * step)
        np.testing.assert_allclose(change, slope, rtol=1e-5, atol=1e-7)


def test_a_column_that_buckles_keeps_a_finite_load_and_a_falling_stiffness():
    """Beyond every buckling load the shortening goes into sway; nothing breaks."""
    deep = np.zeros((3, 3, 1))
    deep[:, 2, 0] = [-2e-3, -5e-3, -9e-3]
    deep[:, 0, 0] = 1e-3
    made = some(3, turned=False)
    bent = columns.bend(made, deep)
    load = np.asarray(bent.load)[:, 0]
    assert (np.diff(load) > 0).all()
    assert load[-1] < float(beam.crushing(SHARE))
    assert (np.asarray(bent.sway.value)[:, 0] < 0).all()
    gap = 0.1 * np.array([2, 5, 9]) - SOFTNESS * load + 0.005 * np.asarray(bent.sway.slope)[:, 0]
    np.testing.assert_allclose(gap, 0, atol=1e-9)


def test_a_pulled_column_stiffens_and_then_goes_straight_on():
    up = np.zeros((2, 3, 1))
    up[:, 2, 0], up[:, 0, 0] = [1e-3, 9e-3], 1e-4
    made = some(2, turned=False)
    bent = columns.bend(made, up)
    force = np.asarray(columns.column_forces(made, bent))[..., 0]
    np.testing.assert_allclose(force[:, 2], UNIT / SOFTNESS * up[:, 2, 0], rtol=1e-3)
    assert (np.asarray(bent.sway.value)[:, 0] > beam.unloaded(SHARE)).all()
    assert np.isfinite(force).all()


def test_a_stop_pushes_only_past_its_free_sway_and_smoothly():
    free, width, k = 1.5e-3, 75e-6, 7.5
    stops = SimpleNamespace(
        nodes=np.array([0]),
        normal=np.array([[[0.6], [0.8], [0.0]]]),
        stiffness=np.array([[k]]),
        free=np.array([[free]]),
        rounding=np.array([[width]]),
        by_board=np.zeros((1, 6)),
    )
    sway = np.linspace(-3e-3, 3e-3, 2001)
    motion = np.zeros((1, 3, len(sway)))
    motion[0, :2] = np.array([[0.6], [0.8]]) * sway
    push, slope = (
        np.asarray(part)[0] for part in columns.stop_forces(stops, motion, np.zeros((6, 1)))
    )
    np.testing.assert_array_equal(push[sway < free - width], 0.0)
    far = sway > free + width
    np.testing.assert_allclose(push[far], k * (sway[far] - free))
    np.testing.assert_allclose(np.gradient(push, sway)[1:-1], slope[1:-1], atol=0.03 * k)
