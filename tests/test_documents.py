"""Records as tables of plain values: units, kinds, what is refused and in which words."""

from dataclasses import dataclass, field
from decimal import Decimal
from typing import Literal

import numpy as np
import pytest

from smoskin.arrays import Floats
from smoskin.documents import Form, format_toml
from smoskin.errors import ArgumentError, DesignError, MissingExtraError, ModelError, SmoskinError


@dataclass(frozen=True, kw_only=True)
class Rubber:
    stiffness: float
    grade: str

    def __post_init__(self) -> None:
        if self.stiffness < 0:
            raise ArgumentError(f"stiffness must be >= 0 N/m; got {self.stiffness}")


@dataclass(frozen=True, kw_only=True)
class Measured:
    value: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class Foot:
    radius: float
    corner: tuple[int, int]
    rubber: Rubber
    bends: tuple[tuple[float, float], ...] = ()
    side: Literal["up", "down"] = "up"
    measured: tuple[Measured, ...] = ()
    spare: Rubber | None = None
    remark: str = field(default="", compare=False)


UNITS = {"radius": "mm", "stiffness": "N_per_mm", "bends": "mT", "value": "unit"}
FORM = Form(units=UNITS, error=ModelError)
FOOT = Foot(
    radius=0.0015,
    corner=(1, 2),
    rubber=Rubber(stiffness=17.67, grade="soft"),
    bends=((0.5, -0.25),),
    measured=(Measured(value=3e-6, unit="um"),),
    remark="not written",
)


def test_a_record_is_its_table():
    table = FORM.table(FOOT)
    assert table == {
        "radius_mm": 1.5,
        "corner": [1, 2],
        "rubber": {"stiffness_N_per_mm": 0.01767, "grade": "soft"},
        "bends_mT": [[500.0, -250.0]],
        "side": "up",
        "measured": [{"value": 3.0, "unit": "um"}],
    }
    assert FORM.record(Foot, table) == FOOT


def test_a_record_inside_may_stand_in_its_owners_table():
    inline = Form(units=UNITS, error=ModelError, inline=("rubber",))
    table = inline.table(FOOT)
    assert table["stiffness_N_per_mm"] == 0.01767
    assert "rubber" not in table
    assert inline.record(Foot, table) == FOOT
    del table["grade"]
    with pytest.raises(ModelError, match="missing key 'grade'"):
        inline.record(Foot, table)


def test_decimals_keep_every_digit():
    exact = Form(units=UNITS, error=ModelError, number=Decimal)
    assert exact.table(FOOT)["radius_mm"] == Decimal("1.5")
    text = format_toml(exact.table(FOOT), "writing a foot")
    assert exact.record(Foot, exact.parse_toml(text)) == FOOT


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"radius_mm": "1.5"}, "radius must be a number of mm; got '1.5'"),
        ({"radius_mm": True}, "radius must be a number of mm; got True"),
        ({"radius_mm": [1.5]}, r"radius must be a number of mm; got \[1.5\]"),
        ({"radius_mm": float("inf")}, "radius must be finite; got inf"),
        ({"radius_mm": Decimal("NaN")}, "radius must be finite; got NaN"),
        ({"corner": [1]}, r"corner must be a list of 2 values; got \[1\]"),
        ({"corner": [1, 2, 3]}, "corner must be a list of 2 values"),
        ({"corner": [1, 2.0]}, "corner.1 must be a whole number; got 2.0"),
        ({"corner": [1, True]}, "corner.1 must be a whole number; got True"),
        ({"bends_mT": 3.0}, "bends must be a list; got 3.0"),
        ({"bends_mT": [[1.0, "a"]]}, "bends.0.1 must be a number of mT; got 'a'"),
        ({"side": 1}, "side must be text; got 1"),
        ({"rubber": 3}, "rubber must be a table; got 3"),
        ({"spare": {"grade": "x"}}, "spare: missing key 'stiffness_N_per_mm'"),
        ({"rubber": {"stiffness_N_per_mm": 1, "grade": 2}}, "rubber.grade must be text; got 2"),
        (
            {"rubber": {"stiffness_N_per_mm": -1, "grade": "x"}},
            "rubber: stiffness must be >= 0 N/m",
        ),
        ({"measured": [{"value": 1.0, "unit": "inch"}]}, "unit must be one of mm, um.*got 'inch'"),
        ({"radius_cm": 1.0}, r"unknown key 'radius_cm'; did you mean 'radius_mm'\? Valid: radius"),
        ({"remark": "x"}, "unknown key 'remark'"),
        ({"radius_mm": {"value": 1.5, "origin": "assumed"}}, "radius must be a number of mm"),
    ],
)
def test_what_does_not_fit_is_refused_by_its_name(changes, message):
    with pytest.raises(ModelError, match=message):
        FORM.record(Foot, {**FORM.table(FOOT), **changes})


def test_messages_can_be_read():
    long = {**FORM.table(FOOT), "radius_mm": "x" * 5000}
    with pytest.raises(ModelError) as refused:
        FORM.record(Foot, long)
    assert len(str(refused.value)) == 300
    assert str(refused.value).startswith("radius must be a number of mm; got 'xxx")
    with pytest.raises(ModelError, match="document must be a table; got 3"):
        FORM.record(Foot, 3)
    with pytest.raises(ModelError, match="not a TOML document"):
        FORM.parse_toml("=")


def test_gaps_are_taken_only_where_they_may_be():
    table = {"stiffness_N_per_mm": float("nan"), "grade": "x"}
    open_form = Form(units=UNITS, error=ModelError, gaps=True)
    gap = open_form.record(Rubber, table)
    assert np.isnan(gap.stiffness)
    assert np.isnan(open_form.table(gap)["stiffness_N_per_mm"])
    with pytest.raises(ModelError, match="stiffness must be finite"):
        FORM.record(Rubber, table)


def test_origins_go_both_ways():
    origins = {"rubber.stiffness": {"origin": "printed", "reason": "S3"}}
    table = FORM.table(FOOT, origins)
    assert table["rubber"]["stiffness_N_per_mm"] == {
        "value": 0.01767,
        **origins["rubber.stiffness"],
    }
    again: dict[str, dict[str, str]] = {}
    assert FORM.record(Foot, table, again) == FOOT
    assert again == origins
    table["radius_mm"] = {"value": 1.5}
    with pytest.raises(ModelError, match="radius: missing key 'origin'"):
        FORM.record(Foot, table, {})


def test_arrays_are_nested_lists():
    @dataclass(frozen=True, eq=False)
    class Grid:
        stiffness: Floats

    table = FORM.table(Grid(np.array([[1e3, 2e3]])))
    assert table == {"stiffness_N_per_mm": [[1.0, 2.0]]}
    assert np.array_equal(FORM.record(Grid, table).stiffness, [[1e3, 2e3]])
    with pytest.raises(ModelError, match="stiffness must be a list"):
        FORM.record(Grid, {"stiffness_N_per_mm": 1.0})


def test_the_records_own_error_keeps_its_words():
    @dataclass(frozen=True)
    class Refusing:
        grade: str

        def __post_init__(self) -> None:
            raise DesignError("grade must be soft; got hard")

    with pytest.raises(DesignError, match=r"^grade must be soft; got hard$"):
        Form(units={}, error=DesignError).record(Refusing, {"grade": "hard"})


def test_writing_toml_without_its_writer_names_the_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "tomli_w", None)
    with pytest.raises(MissingExtraError, match=r"writing a foot needs the extra 'cli'"):
        format_toml({}, "writing a foot")


@pytest.mark.parametrize(
    "text",
    [
        "[" * 900 + "]" * 900,
        "a = " + "[" * 20_000,
        "\n".join(["a = ["] + ["["] * 20_000),
        "a = " + "9" * 5_000,
        "\n" * 2**18 + "a = 1",
        "a = \x00",
    ],
)
def test_what_would_hang_or_break_the_reader_is_refused(text):
    with pytest.raises(SmoskinError) as caught:
        Form(units={}, error=SmoskinError).parse_toml(text)
    assert len(str(caught.value)) <= 300
