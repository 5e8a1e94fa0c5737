"""The virtual bench: what is applied, on which skins, and how noisy gauge, stage and chips are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.temperature import temperature_factor
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.twin.bench import calibration_loads, made_skin, measure, table_loads
from smoskin.twin.manufacture import as_designed
from smoskin.twin.reduced import ReducedTwin


def touching(loads):
    return [load for load in loads if load is not None]


def cells_of(design, loads):
    """Cell on whose top vertex each load lies."""
    tops = {tuple(place.round(9)): cell for cell, place in places(design)}
    return [tops[tuple(load.position.round(9))] for load in loads]


def places(design):
    return [(cell, geometry(design).tops[cell]) for cell in np.ndindex(*design.cells)]


def test_the_protocol_fits_an_hour_and_the_paper(planar):
    loads = calibration_loads(planar)
    touches = touching(loads)
    assert len(touches) == 220
    assert loads[:20] == (None,) * 20
    cells = cells_of(planar, touches)
    assert {(0, 0), (1, 1), (2, 2)} <= set(cells)
    slanted = [load.force for load in touches if load.force[:2].any()]
    assert len(slanted) == 3 * 2 * 4 * 6
    for x, y, z in slanted:
        assert np.hypot(x, y) == pytest.approx(-z)  # 45 degrees
    straight = [-load.force[2] for load in touches if not load.force[:2].any()]
    assert sorted(set(straight)) == [0.2, 0.4, 0.5, 0.6, 0.8, 1.0]


def test_the_protocol_suits_other_skins(long_planar):
    cells = cells_of(long_planar, touching(calibration_loads(long_planar)))
    assert {(0, 0), (1, 1)} <= set(cells)


def test_the_table_s_protocol_presses_and_drags_every_cell(planar, long_planar):
    for design in (planar, long_planar):
        loads = table_loads(design)
        touches = touching(loads)
        count = design.cells[0] * design.cells[1]
        assert len(touches) == 3 * count
        rests = [k for k, load in enumerate(loads) if load is None]
        assert rests == list(range(0, len(loads), 10))
        cells = cells_of(design, touches)
        assert cells == [cell for cell in np.ndindex(*design.cells) for _ in range(3)]
        force = np.array([load.force for load in touches]).reshape(count, 3, 3)
        assert (force[..., 2] == -0.3).all()
        np.testing.assert_array_equal(
            np.abs(force[..., :2]), [[[0, 0], [0.2, 0], [0, 0.2]]] * count
        )
        assert {-0.2, 0.2} <= set(force[:, 1, 0])


def test_made_skins_scatter_as_stated(planar):
    for seed in range(50):
        skin = made_skin(planar, np.random.default_rng(seed))
        made, c = skin.design, skin.design.coefficients
        assert 0.15 <= c.attenuation[0] <= 0.5
        assert c.attenuation[0] == c.attenuation[1]
        assert 0.7 <= c.stiffness_variation <= 1.4
        for stiffness in (board_stiffness, sheet_stiffness):
            assert 0.9 - 1e-9 <= stiffness(made) / stiffness(planar) <= 1.1 + 1e-9
        given = planar.coefficients
        for axis in ("folding_correction_x", "folding_correction_y"):
            factors = np.divide(getattr(c, axis), getattr(given, axis))
            assert 0.8 <= factors.min() < factors.max() <= 1.2
        strengths = [
            m.remanence / n.remanence for m, n in zip(made.magnets, planar.magnets, strict=True)
        ]
        assert 0.97 <= min(strengths) < max(strengths) <= 1.03
        chips = skin.deviations.chips
        assert 0 < np.degrees(np.linalg.norm(chips.turn, axis=1)).max() <= 2.0
        assert 0 < np.abs(chips.zero).max() <= 50e-6


def test_turned_chips_with_offsets_read_so(planar):
    turn = np.array([[0.02, 0.0, 0.0], [0.0, -0.03, 0.0], [0.0, 0.0, 0.01]])
    offset = np.array([[40e-6, 0.0, 0.0], [0.0, -30e-6, 0.0], [0.0, 0.0, 20e-6]])
    straight = ReducedTwin(planar, seed=None).read().field
    designed = as_designed(planar)
    deviations = replace(designed, chips=replace(designed.chips, turn=turn, zero=offset))
    seen = ReducedTwin(planar, seed=None, deviations=deviations).read().field
    mounts = mlx90393.rotations(planar.halls)
    matrices = Rotation.from_rotvec(turn).as_matrix() @ mounts
    in_skin = np.einsum("sij,sj->si", mounts, straight)
    np.testing.assert_allclose(seen, np.einsum("sij,si->sj", matrices, in_skin) + offset)


def test_gauge_and_stage_are_as_noisy_as_asked(planar):
    twin = made_skin(planar, np.random.default_rng(0))
    load = Contact(position=geometry(planar).tops[1, 1], force=(0.5, 0.0, -0.5))
    table = measure(twin, [load] * 2000, np.random.default_rng(1))
    relative = table.force[:, [0, 2]] / 0.5
    np.testing.assert_allclose(relative.std(axis=0), 0.02, rtol=0.1)
    np.testing.assert_allclose(np.abs(relative.mean(axis=0)), 1.0, atol=2e-3)
    # The stage's micrometres are another hundredth of what it sinks.
    np.testing.assert_allclose((table.depth / twin.depths([load])).std(), 0.02, rtol=0.15)
    assert np.all(table.force[:, 1] == 0)
    np.testing.assert_allclose(table.temperature[[0, -1], 0], (24.0, 27.0), atol=0.1)
    # Gauge and stage show millinewtons and micrometres.
    for shown, step in ((table.force, 1e-3), (table.depth, 1e-6)):
        np.testing.assert_allclose(shown / step, np.rint(shown / step), atol=1e-6)
        assert np.diff(np.unique(shown)).min() == pytest.approx(step)


def test_a_state_that_is_none_is_a_row_without_field(planar, monkeypatch):
    twin = ReducedTwin(planar, seed=None)
    load = Contact(position=geometry(planar).tops[1, 1], force=(0.0, 0.0, -0.5))
    still = twin.motions

    def lost(touches, **options):
        return still(touches, **options).where(np.array([True, False, True]))

    monkeypatch.setattr(twin, "motions", lost)
    table = measure(twin, [load] * 3, np.random.default_rng(0))
    assert np.isnan(table.field).all(axis=(1, 2)).tolist() == [False, True, False]
    assert np.isfinite(table.field[[0, 2]]).all()


def test_an_untouched_skin_is_measured_as_such(planar):
    twin = made_skin(planar, np.random.default_rng(0))
    load = Contact(position=geometry(planar).tops[1, 1], force=(0.0, 0.0, -0.5))
    table = measure(twin, [None, load, None], np.random.default_rng(1))
    assert table.touched.tolist() == [False, True, False]
    assert not table.depth[[0, 2]].any()
    rest = twin.read().field
    # Magnets at 24 and 27 degC, up to their chips' noise.
    warm = temperature_factor(np.array([24.0, 27.0]))[:, None, None]
    offset = twin.deviations.chips.zero
    np.testing.assert_allclose(table.field[[0, 2]], (rest - offset) * warm + offset, atol=12e-6)
    assert np.abs(table.field[1] - rest).max() > 400e-6


def test_wrong_use_is_named(planar):
    twin = made_skin(planar, np.random.default_rng(0))
    with pytest.raises(ArgumentError, match="gauge_noise must be >= 0"):
        measure(twin, [], np.random.default_rng(0), gauge_noise=-1)
