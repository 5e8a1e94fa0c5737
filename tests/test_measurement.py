"""Touches of known place and force, and their one CSV file."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smoskin.commands.fit_paper import fit_paper
from smoskin.errors import ArgumentError, CalibrationError, RecordingError
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.records import Reading

NAN = float("nan")
HEADER = "x_mm,y_mm,force_x_N,force_y_N,force_z_N"


def same(left: TouchTable, right: TouchTable) -> bool:
    return all(
        np.array_equal(getattr(left, name), getattr(right, name), equal_nan=True)
        for name in ("position", "force", "depth", "field", "temperature", "held")
    )


def table(**changes) -> TouchTable:
    """The untouched skin, two touches of it, the untouched skin again and a touch."""
    fields = np.arange(5)[:, None, None] * 1e-5 + np.zeros((5, 2, 3))
    values = {
        "position": [(NAN, NAN), (0.01, 0.02), (0.03, 0.04), (NAN, NAN), (0.05, 0.06)],
        "force": [(0, 0, 0), (0, 0, -0.5), (0.1, 0, -0.4), (0, 0, 0), (0, 0.2, -0.3)],
        "field": fields,
        "temperature": np.full((5, 2), 26.0),
    }
    return TouchTable(**(values | changes))


HELD = [(0.0, 1.0), (2.0, 3.0), (4.0, 5.0), (6.0, 7.0), (8.0, 9.0)]


def readings(until=10.0, step=0.25):
    """A reading every quarter of a second, whose field is its time in uT."""
    return [
        Reading(time=t, field=np.full((2, 3), t * 1e-6), temperature=[20.0 + t, NAN])
        for t in np.arange(0.0, until, step)
    ]


# The file


@settings(max_examples=40)
@given(
    x=st.floats(-1, 1), z=st.floats(-10, -1e-9), depth=st.floats(0, 0.01),
    field=st.floats(-0.06, 0.06), start=st.floats(0, 1e6),
)  # fmt: skip
def test_any_number_survives_its_file(tmp_path_factory, x, z, depth, field, start):
    path = tmp_path_factory.mktemp("csv") / "t.csv"
    whole = TouchTable(
        position=[(x, -x), (NAN, NAN)],
        force=[(x, -x, z), (0, 0, 0)],
        depth=[depth, NAN],
        field=[[(field, NAN, 0)], [(NAN,) * 3]],
        temperature=[[25], [NAN]],
        held=[(start, start + 1), (NAN, NAN)],
    )
    write_touches(path, whole)
    assert same(whole, read_touches(path)[0])


def test_the_same_table_makes_the_same_file(tmp_path):
    write_touches(tmp_path / "t.csv", table())
    again, digest = read_touches(tmp_path / "t.csv")
    assert same(table(), again)
    write_touches(tmp_path / "u.csv", again)
    assert read_touches(tmp_path / "u.csv")[1] == digest
    header = (tmp_path / "t.csv").read_text().splitlines()[0]
    assert header.startswith(f"{HEADER},displacement_z_mm,from_s,until_s,chip1_Bx_uT,")


def test_columns_that_may_be_missing_may(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text(f"{HEADER}\n,,,,\n10,20,0,0,-1\n,,0,0,0\n")
    touches = read_touches(path)[0]
    assert touches.touched.tolist() == [False, True, False]
    assert touches.field.shape == (3, 0, 3)
    assert touches.force.tolist() == [[0, 0, 0], [0, 0, -1], [0, 0, 0]]
    assert np.isnan(touches.depth).all()
    assert not touches.made.any()
    (contact,) = touches.contacts
    assert contact.position.tolist() == [0.01, 0.02]


def test_one_thermometer_stands_for_chips_that_have_none(tmp_path):
    path = tmp_path / "t.csv"
    chips = ",".join(f"chip{s}_B{axis}_uT" for s in (1, 2) for axis in "xyz")
    row = "10,20,0,0,-1,31.5,1,2,3,4,5,6"
    path.write_text(f"{HEADER},temperature_degC,{chips}\n{row}\n")
    assert read_touches(path)[0].temperature.tolist() == [[31.5, 31.5]]
    path.write_text(
        f"{HEADER},temperature_degC,{chips},chip1_temperature_degC,chip2_temperature_degC\n"
        f"{row},24,\n"
    )
    assert read_touches(path)[0].temperature.tolist() == [[24.0, 31.5]]
    path.write_text(f"{HEADER},{chips}\n{row.replace(',31.5', '')}\n")
    assert np.isnan(read_touches(path)[0].temperature).all()
    assert read_touches(path)[0].field.tolist() == [
        [pytest.approx([1e-6, 2e-6, 3e-6]), pytest.approx([4e-6, 5e-6, 6e-6])]
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must hold a header and at least one row"),
        (HEADER, "must hold a header"),
        (HEADER.replace("x_mm", "x_cm") + "\n1,1,0,0,-1", "column 'x_cm' is unknown"),
        (HEADER + ",x_mm\n1,1,0,0,-1,1", "column 'x_mm' is unknown or occurs twice"),
        (HEADER.replace("x_mm,", "") + "\n1,0,0,-1", "column 'x_mm' is missing"),
        (HEADER + ",chip1_Bx_uT,chip1_By_uT,chip1_Bx_T\n1,1,0,0,-1,1,1,1", "'chip1_Bx_T' is"),
        ("cell_n,cell_m,force_x_N\n1,1,0", "cell_n and cell_m are of an older version"),
        (HEADER + "\n1,1,0,0", "line 2 must have 5 values; got 4"),
        (HEADER + "\n1,1,0,0,a", "line 2, column force_z_N: must be a number; got 'a'"),
        (HEADER + "\n1,1,0,0,-inf", "column force_z_N: must be a finite number"),
        (HEADER + "\n1,1,0,0,0", "force must press: z must be below zero; got .* in row 1"),
        (HEADER + "\n1,1,0,0,1", "force must press"),
        (HEADER + "\n1,1,0,0,", "force must be finite"),
        (HEADER + "\n1,,0,0,-1", "position must have both coordinates or none"),
        (HEADER + "\n,,0,0,-1", "force must be zero where nothing touches"),
        (HEADER + "\n,,,,-1", "force must be zero where nothing touches"),
        (HEADER + ",displacement_z_mm\n1,1,0,0,-1,0.3", "depth must press"),
        (HEADER + ",from_s,until_s\n1,1,0,0,-1,3,2.9", "held must end with a time"),
        (HEADER + ",from_s,until_s\n1,1,0,0,-1,,2.9", "held must end with a time"),
    ],
)  # fmt: skip
def test_faulty_tables_are_refused_by_line_and_column(tmp_path, text, message):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message):
        read_touches(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RecordingError, match=r"none\.csv cannot be read: No such file"):
        read_touches(tmp_path / "none.csv")


def test_shapes_must_agree():
    with pytest.raises(ArgumentError, match="force must have"):
        table(force=np.zeros((4, 3)))
    with pytest.raises(ArgumentError, match="temperature must have"):
        table(temperature=np.zeros(4))
    assert table(temperature=np.arange(5)).temperature[3].tolist() == [3.0, 3.0]
    assert table(temperature=30.0).temperature.tolist() == [[30.0, 30.0]] * 5


def test_rows_are_taken_whole():
    some = table(held=HELD, depth=[NAN, 1e-4, 2e-4, NAN, 3e-4]).rows(np.array([1, 4]))
    assert some.depth.tolist() == [1e-4, 3e-4]
    assert some.held.tolist() == [[2.0, 3.0], [8.0, 9.0]]
    assert some.touched.all()


# From rows to what the chips read


def test_readings_fill_rows_with_the_mean_of_the_good_ones():
    bare = table(field=np.zeros((5, 0, 3)), temperature=np.zeros((5, 0)), held=HELD)
    taken = readings()
    spoilt = [
        Reading(time=2.1, field=np.full((2, 3), 1.0), flags=[2, 0]),
        Reading(time=2.2, field=np.full((2, 3), NAN)),
    ]
    filled = bare.with_readings([*taken, *spoilt])
    np.testing.assert_allclose(filled.field[1], np.full((2, 3), 2.5e-6))
    assert filled.temperature[1, 0] == pytest.approx(22.5)
    assert np.isnan(filled.temperature[1, 1])
    with pytest.raises(ArgumentError, match="from 8 to 9 s, when row 5 was held; got none"):
        bare.with_readings(readings(until=8.0))


def test_rows_that_were_read_are_touches_held_until_they_settled():
    touches = table().held_touches()
    assert len(touches) == 3
    for touch, row in zip(touches, (1, 2, 4), strict=True):
        assert touch.contact.force.tolist() == table().force[row].tolist()
        (last,) = [r for r in touch.readings if touch.held[0] <= r.time <= touch.held[1]]
        np.testing.assert_array_equal(last.field, table().field[row])
    assert len(touches[0].readings) == 2
    assert len(touches[1].readings) == 1
    assert touches[1].rest == touches[0].rest
    assert touches[2].rest == (180.0, 180.0)


def test_a_recording_gives_each_touch_its_rest_and_its_readings():
    touches = table(held=HELD).held_touches(readings())
    assert [touch.rest for touch in touches] == [(0.0, 1.0), (0.0, 1.0), (6.0, 7.0)]
    assert [touch.held for touch in touches] == [(2.0, 3.0), (4.0, 5.0), (8.0, 9.0)]
    times = [[r.time for r in touch.readings] for touch in touches]
    assert [(stamps[0], stamps[-1]) for stamps in times] == [(0.0, 3.0), (3.25, 5.0), (5.25, 9.0)]


def test_rows_that_have_not_been_made_are_left_out():
    field = np.array(table().field)
    field[2:] = NAN
    assert len(table(field=field).held_touches()) == 1
    held = np.array(HELD)
    held[2] = NAN
    assert len(table(field=np.full((5, 2, 3), NAN), held=held).held_touches(readings())) == 2


@pytest.mark.parametrize(
    ("changes", "taken", "message"),
    [
        ({"field": np.full((5, 2, 3), NAN)}, None, "no row has been filled in"),
        ({}, readings(), "from_s and until_s must say when each row was held"),
        ({"held": HELD}, readings(until=4.0), "from 4 to 5 s, when row 3 was held; got none"),
        ({"held": [(0, 1), (2, 3), (2.9, 5), (6, 7), (8, 9)]}, readings(), "row 3 must be held"),
        ({"held": [(0, 2.5), *HELD[1:]]}, readings(), "row 2 must come after a row of the unt"),
    ],
)  # fmt: skip
def test_rows_that_cannot_be_held_touches_are_named(changes, taken, message):
    with pytest.raises(ArgumentError, match=message):
        table(**changes).held_touches(taken)


def test_the_untouched_skin_must_come_first():
    with pytest.raises(ArgumentError, match="row 1 must come after a row of the untouched skin"):
        table().rows(np.arange(1, 5)).held_touches()


def test_touches_may_follow_each_other_at_once():
    held = [(0, 2), (2, 3), (3, 5), (5, 7), (7, 9)]
    assert len(table(held=held).held_touches(readings())) == 3
    assert replace(table(), held=held).made.all()


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("10,10,0,0,-1_0,-1", "column force_z_N: must be a number; got '-1_0'"),
        ("10,10,0,0,-\u0663,-1", "column force_z_N: must be a number"),
        (",,,,,-1", "depth must be none where nothing touches; got 0.001 in row 1"),
    ],
)
def test_numbers_that_no_instrument_writes_and_depths_of_nothing_are_refused(
    tmp_path, row, message
):
    header = "x_mm,y_mm,force_x_N,force_y_N,force_z_N,displacement_z_mm"
    (tmp_path / "sheet.csv").write_text(f"{header}\n{row}\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        read_touches(tmp_path / "sheet.csv")


def test_a_force_in_another_unit_is_refused_by_its_row(tmp_path, planar):
    rows = ["10,10,0,0,-0.5,-1"] * 6 + ["10,10,0,0,-500,-1"]
    header = "x_mm,y_mm,force_x_N,force_y_N,force_z_N,displacement_z_mm"
    (tmp_path / "sheet.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    with pytest.raises(CalibrationError, match="force of row 7 must be like the others; got 500 N"):
        fit_paper(planar, tmp_path / "sheet.csv", tmp_path / "out.toml", date="2026-01-01")
