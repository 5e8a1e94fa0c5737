"""The virtual bench and its table on disk."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smoskin.errors import ArgumentError, RecordingError
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.twin.bench import (
    Load,
    MadeSkin,
    calibration_loads,
    load_contact,
    made_skin,
    measure,
    table_loads,
)
from smoskin.twin.reduced import ReducedTwin


def same(one: TouchTable, other: TouchTable) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name != "cell")
        for name in ("cell", "force", "depth", "field", "temperature")
    )


def test_the_protocol_fits_an_hour_and_the_paper(planar):
    loads = calibration_loads(planar)
    touches = [load for load in loads if load.cell is not None]
    assert len(touches) <= 300
    assert {(0, 0), (1, 1), (2, 2)} <= {load.cell for load in touches}
    slanted = [load.force for load in touches if load.force[0] or load.force[1]]
    for x, y, z in slanted:
        assert np.hypot(x, y) == pytest.approx(-z)  # 45 degrees


def test_the_protocol_suits_other_skins(long_planar):
    assert all(
        load.cell is None or (load.cell[0] < 4 and load.cell[1] < 5)
        for load in calibration_loads(long_planar)
    )


def test_the_table_s_protocol_presses_and_drags_every_cell(planar, long_planar):
    for design, layers in ((planar, 3), (long_planar, 2)):
        loads = table_loads(design)
        touches = [load for load in loads if load.cell is not None]
        cells = design.cells[0] * design.cells[1]
        assert len(touches) == 3 * cells + 2 * layers
        assert len(loads) > len(touches) + 1
        straight = [load.cell for load in touches if not any(load.force[:2])]
        assert sorted(straight) == list(np.ndindex(design.cells))
        for axis in range(2):
            dragged = {load.cell for load in touches if load.force[axis]}
            assert len(dragged) == cells
            both = {c for c in dragged if len({x.force[axis] for x in touches if x.cell == c}) == 3}
            assert both == {(k, k) for k in range(layers)}


def test_made_skins_scatter_as_stated(planar):
    for seed in range(50):
        skin = made_skin(planar, np.random.default_rng(seed))
        made, c = skin.design, skin.design.coefficients
        assert 0.15 <= c.attenuation[0] <= 0.5
        assert c.attenuation[0] == c.attenuation[1]
        assert 0.7 <= c.stiffness_variation <= 1.4
        for stiffness in (board_stiffness, sheet_stiffness):
            assert 0.9 - 1e-9 <= stiffness(made) / stiffness(planar) <= 1.1 + 1e-9
        assert np.degrees(np.linalg.norm(skin.chip_rotation, axis=1)).max() <= 2.0
        assert np.abs(skin.chip_offset).max() <= 50e-6


def test_an_unturned_skin_reads_as_the_twin(planar):
    still = np.zeros((3, 3))
    skin = MadeSkin(planar, chip_rotation=still, chip_offset=still)
    touch = load_contact(planar, Load(cell=(2, 3), force=(0.1, 0.2, -0.5)))
    np.testing.assert_allclose(
        skin.field([touch]), ReducedTwin(planar, seed=None).read([touch]).field
    )


def test_a_turned_chip_keeps_the_field_s_size(planar):
    skin = made_skin(planar, np.random.default_rng(0))
    plain = MadeSkin(skin.design, chip_rotation=np.zeros((3, 3)), chip_offset=np.zeros((3, 3)))
    turned, straight = skin.field(), plain.field()
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), np.linalg.norm(straight, axis=1))
    assert np.abs(turned - straight).max() > 1e-4


def test_gauge_and_stage_are_as_noisy_as_asked(planar):
    skin = made_skin(planar, np.random.default_rng(0))
    load = Load(cell=(1, 1), force=(0.5, 0.0, -0.5))
    table = measure(skin, [load] * 2000, np.random.default_rng(1))
    relative = table.force[:, [0, 2]] / 0.5
    np.testing.assert_allclose(relative.std(axis=0), 0.02, rtol=0.1)
    np.testing.assert_allclose((table.depth / skin.depths([load])).std(), 0.02, rtol=0.1)
    assert np.all(table.force[:, 1] == 0)


def test_the_table_survives_its_file(planar, tmp_path):
    skin = made_skin(planar, np.random.default_rng(0))
    table = measure(skin, calibration_loads(planar)[::10], np.random.default_rng(1))
    write_touches(tmp_path / "t.csv", table)
    again, digest = read_touches(tmp_path / "t.csv")
    assert same(table, again)
    write_touches(tmp_path / "u.csv", again)
    assert read_touches(tmp_path / "u.csv")[1] == digest


@settings(max_examples=40)
@given(
    z=st.floats(-10, 0), x=st.floats(-5, 5), depth=st.floats(0, 0.01), field=st.floats(-0.06, 0.06)
)
def test_any_number_survives_its_file(tmp_path_factory, z, x, depth, field):
    path = tmp_path_factory.mktemp("csv") / "t.csv"
    table = TouchTable(
        cell=[(2, 0), (-1, -1)],
        force=[(x, -x, z), (0, 0, 0)],
        depth=[depth, 0],
        field=[[(field, np.nan, 0)], [(np.nan,) * 3]],
        temperature=[[25], [31.5]],
    )
    write_touches(path, table)
    assert same(table, read_touches(path)[0])


def test_one_thermometer_stands_for_chips_that_have_none(tmp_path):
    path = tmp_path / "t.csv"
    chips = ",".join(f"chip{s}_B{axis}_uT" for s in (1, 2) for axis in "xyz")
    row = "1,1,0,0,-1,-1,31.5,1,2,3,4,5,6"
    path.write_text(f"{HEADER},temperature_degC,{chips}\n{row}\n")
    assert read_touches(path)[0].temperature.tolist() == [[31.5, 31.5]]
    path.write_text(
        f"{HEADER},temperature_degC,{chips},chip1_temperature_degC,chip2_temperature_degC\n"
        f"{row},24,\n"
    )
    assert read_touches(path)[0].temperature.tolist() == [[24.0, 31.5]]
    path.write_text(f"{HEADER},{chips}\n{row.replace(',31.5', '')}\n")
    assert read_touches(path)[0].temperature.tolist() == [[25.0, 25.0]]


HEADER = "cell_n,cell_m,force_x_N,force_y_N,force_z_N,displacement_z_mm"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must hold a header and at least one row"),
        (HEADER, "must hold a header"),
        (HEADER.replace("_mm", "") + "\n1,1,0,0,-1,-1", "column 'displacement_z' is unknown"),
        (HEADER.replace("cell_n,", "") + "\n1,0,0,-1,-1", "column 'cell_n' is missing"),
        (HEADER + "\n1,1,0,0,-1", "line 2 must have 6 values; got 5"),
        (HEADER + "\n1,1,0,0,a,-1", "line 2, column force_z_N: must be a number; got 'a'"),
        (HEADER + "\n0,1,0,0,-1,-1", "column cell_n: must be a whole number from 1; got '0'"),
        (HEADER + "\n1,1,0,0,1,-1", "force must press"),
        (HEADER + "\n1,1,0,0,-1,0.3", "depth must press"),
        (HEADER + "\n,,0,0,-1,0", "force must be zero where no cell is touched"),
    ],
)
def test_faulty_tables_are_refused_by_line_and_column(tmp_path, text, message):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message):
        read_touches(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RecordingError, match="must be a readable CSV"):
        read_touches(tmp_path / "none.csv")


def test_wrong_use_is_named(planar):
    skin = made_skin(planar, np.random.default_rng(0))
    with pytest.raises(ArgumentError, match=r"load.cell must lie in \(0..5, 0..5\)"):
        load_contact(planar, Load(cell=(6, 0), force=(0, 0, -1)))
    with pytest.raises(ArgumentError, match="gauge_noise must be >= 0"):
        measure(skin, [], np.random.default_rng(0), gauge_noise=-1)
