"""Designs as records and as TOML documents."""

import math
import pickle
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin import units
from smoskin.design.document import format_design, parse_design, read_design
from smoskin.design.skin import HallSite, MiuraCell, SkinDesign
from smoskin.errors import DesignError, ModelError
from smoskin.feasibility import load_design


def test_every_physical_value_of_the_shipped_design_says_where_it_comes_from(planar):
    assert planar.provenance["cell.panel_a"].origin == "inferred"
    assert planar.provenance["magnets.1.remanence"].origin == "printed"
    unsaid = [
        path
        for part in (
            "cell",
            "creases",
            "panels",
            "columns",
            "frame",
            "board",
            "shear_layer",
            "hall_setting",
        )
        for path in (f"{part}.{name}" for name in getattr(planar, part).__dataclass_fields__)
        if path not in planar.provenance or not planar.provenance[path].reason
    ]
    assert unsaid == []


@given(
    a=st.floats(1e-3, 0.1),
    b=st.floats(1e-3, 0.1),
    alpha=st.floats(0.2, 1.5),
    share=st.floats(0.05, 0.99),
    v_f=st.floats(0.1, 3.0),
)
def test_a_design_survives_its_document_to_the_last_bit(planar, a, b, alpha, share, v_f):
    cell = MiuraCell(panel_a=a, panel_b=b, sector_angle=alpha, fold_angle=alpha * share)
    coefficients = replace(planar.coefficients, folding_correction_x=(v_f, 0.1 + v_f, 1.0))
    design = replace(planar, cell=cell, coefficients=coefficients)
    again = parse_design(format_design(design))
    assert again == design
    assert again.content_hash == design.content_hash
    assert again.provenance == design.provenance


@given(value=st.floats(1e-9, 1e9), suffix=st.sampled_from(sorted(units.SI_PER_SUFFIX)))
def test_units_convert_both_ways_without_loss(value, suffix):
    assert units.to_si(units.from_si(value, suffix), suffix) == value


def test_hash_follows_what_is_built_and_nothing_else(planar):
    assert replace(planar, name="other").content_hash == planar.content_hash
    assert replace(planar, provenance={}).content_hash == planar.content_hash
    thicker = replace(planar, columns=replace(planar.columns, radius=1.6e-3))
    assert thicker.content_hash != planar.content_hash
    # What could not be chosen once leaves the hash of tables made before as it was.
    assert planar.content_hash.startswith("4cf6126ec89a9732")
    assert read_design("optimised").content_hash.startswith("7b761238cdba714f")
    for part, choice in (("columns", {"rim_share": 0.9}), ("creases", {"vertex_hole": 1e-3})):
        chosen = replace(planar, **{part: replace(getattr(planar, part), **choice)})
        assert chosen.content_hash != planar.content_hash
        assert parse_design(format_design(chosen)) == chosen


def test_plain_values_are_read_too(planar):
    text = format_design(replace(planar, provenance={}))
    assert "origin" not in text
    assert parse_design(text) == planar


def edited(planar: SkinDesign, old: str, new: str) -> str:
    text = format_design(replace(planar, provenance={}))
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("panel_a_mm", "panel_a_cm", r"unknown key 'panel_a_cm'; did you mean 'panel_a_mm'\?"),
        ("[frame]", "[fram]", r"unknown key 'fram'; did you mean 'frame'\?"),
        ("[[halls]]\n", "[[halls]]\ncolour = 1\n", "unknown key 'colour'"),
        ("gap_mm = 5.6\n", "", "halls.0: missing key 'gap_mm'"),
        ("panel_a_mm = 15.5334", 'panel_a_mm = "long"', "must be a number of mm; got 'long'"),
        ("panel_a_mm = 15.5334", "panel_a_mm = true", "must be a number of mm; got True"),
        ("panel_a_mm = 15.5334", "panel_a_mm = -1.0", "panel_a must be positive"),
        ("panel_a_mm = 15.5334", "panel_a_mm = nan", "cell.panel_a must be finite; got NaN"),
        ("fold_angle_deg = 44.5909", "fold_angle_deg = 60", r"\(0, 0.9131\) rad; got 1.047"),
        ("pillars = 8", "pillars = 0", "pillars must be positive"),
        ('material = "Ecoflex 00-30"', 'material = "jelly"', "must be one of Ecoflex 00-30"),
        ('mount = "base"', 'mount = "lid"', "mount must be 'sheet' or 'base'; got 'lid'"),
        ('magnet = "M1"', 'magnet = "M9"', "magnet must be one of M1, M2, M3; got 'M9'"),
        ("address = 12", "address = 13", "hall addresses must have different names"),
        ("gain_selection = 3", "gain_selection = 8", "gain_selection must lie in 0..7; got 8"),
        ("oversampling = 1", 'oversampling = "1"', "hall_setting.oversampling must be a whole"),
        ("cells = [\n    6,\n    6,\n]", "cells = 6", "cells must be a list of 2 values; got 6"),
        ('name = "planar"', "name = planar", "not a TOML document"),
        ('name = "planar"', "", "missing key 'name'"),
    ],
)
def test_a_bad_document_is_refused_with_the_reason(planar, old, new, message):
    with pytest.raises(DesignError, match=message):
        parse_design(edited(planar, old, new))


def test_a_value_without_its_origin_is_refused(planar):
    text = edited(planar, "panel_a_mm = 15.5334", "panel_a_mm = { value = 15.5 }")
    with pytest.raises(DesignError, match=r"cell.panel_a: missing key 'origin'"):
        parse_design(text)


def test_axes_must_be_right_handed():
    def site(*axes: str) -> HallSite:
        return HallSite(name="S", magnet="M", gap=6e-3, axes=axes, address=0x0C)

    assert site("+y", "+z", "+x").axes == ("+y", "+z", "+x")
    for axes in (("+x", "+y", "-z"), ("+x", "+x", "+z"), ("+y", "+x", "+z")):
        with pytest.raises(DesignError, match="right-handed"):
            site(*axes)


def test_an_unknown_design_names_the_known_ones(tmp_path):
    with pytest.raises(DesignError, match=r"shipped design .*planar"):
        load_design("plannar")
    bad = tmp_path / "skin.toml"
    bad.write_text("name = 3")
    with pytest.raises(DesignError, match=r"skin.toml: missing key"):
        read_design(bad)


def test_a_magnet_off_the_grid_is_refused(planar):
    def with_corner(corner):
        first, *others = planar.magnets
        return replace(planar, magnets=(replace(first, corner=corner), *others))

    for edge in ((0, 0), (6, 6)):
        assert with_corner(edge).magnets[0].corner == edge
    for wrong in ((7, 2), (2, 7), (-1, 2), (2, -1)):
        with pytest.raises(DesignError, match=r"corner must lie in \(0..6, 0..6\); got"):
            with_corner(wrong)


@pytest.mark.parametrize(
    ("part", "name", "ends", "wrong"),
    [
        ("cell", "sector_angle", (0.9, math.pi / 2 - 1e-9), (math.pi / 2, 0.0, math.nan)),
        ("cell", "fold_angle", (1e-9, 0.913), (0.0, 0.91313, math.nan)),
        ("cell", "panel_a", (1e-6, 1.0), (0.0, 0.99e-6, 1.01, math.inf)),
        ("frame", "clearance", (1e-6, 1.0), (0.0, math.inf, math.nan)),
        ("hall_setting", "gain_selection", (0, 7), (-1, 8)),
        ("hall_setting", "resolution", (0, 3), (-1, 4)),
        ("hall_setting", "oversampling", (0, 3), (-1, 4)),
        ("hall_setting", "digital_filter", (0, 7), (-1, 8)),
        ("coefficients", "attenuation", ((1e-9, 1.0), (1.0, 1e-9)), ((0.0, 1.0), (0.5, 1.0001))),
        ("coefficients", "stiffness_variation", (1e-3, 1e3), (0.0, 0.99e-3, 1001.0, math.inf)),
        ("coefficients", "folding_correction_x", ((1e-6, 1, 1e6),), ((0.0, 1, 1), (1.0, 1), ())),
        ("coefficients", "folding_correction_y", ((1e-6, 1, 1e6),), ((0.0, 1, 1), (1.0, 1), ())),
    ],
)
def test_numbers_are_taken_up_to_their_ends(planar, part, name, ends, wrong):
    whole = getattr(planar, part)
    for value in ends:
        assert getattr(replace(whole, **{name: value}), name) == value
    for value in wrong:
        with pytest.raises(DesignError, match=r"must|cannot fold"):
            replace(whole, **{name: value})


def test_addresses_are_those_of_seven_bits(planar):
    site = planar.halls[0]
    for address in (0x08, 0x77):
        assert replace(site, address=address).address == address
    for address in (0x07, 0x78):
        with pytest.raises(DesignError, match=r"7-bit I2C address in 0x08\.\.0x77; got 0x"):
            replace(site, address=address)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cells": (0, 6)}, r"cells must be at least \(1, 1\); got \(0, 6\)"),
        ({"cells": (65, 6)}, r"cells must be at most 64 a side; got \(65, 6\)"),
        ({"name": ""}, r"skin\.name must be 1 to 100 characters of text; got ''"),
        ({"name": "x" * 101}, r"skin\.name must be 1 to 100 characters of text"),
        ({"cells": (6, 0)}, r"cells must be at least \(1, 1\); got \(6, 0\)"),
        ({"halls": ()}, "halls must name at least one chip"),
    ],
)
def test_a_skin_has_cells_and_chips(planar, changes, message):
    with pytest.raises(DesignError, match=message):
        replace(planar, **changes)


def test_a_design_is_pickled_whole(planar):
    again = pickle.loads(pickle.dumps(planar))
    assert again == planar
    assert again.provenance == planar.provenance


def test_what_belongs_to_another_design_is_refused_by_name(planar):
    planar.check_own("table", planar.content_hash)
    with pytest.raises(ModelError, match=r"table must be of the design 'planar' .*; got one of 0"):
        planar.check_own("table", "0" * 64)
    with pytest.raises(DesignError, match="magnet must be one of M1, M2, M3; got 'M4'"):
        planar.magnet("M4")


def test_fold_angle_message_is_the_documented_sentence():
    with pytest.raises(DesignError, match=r"must lie in \(0, alpha\) = \(0, 0.913\) rad; got 1.2"):
        MiuraCell(panel_a=0.01, panel_b=0.01, sector_angle=0.913, fold_angle=1.2)
    with pytest.raises(DesignError, match="cannot fold"):
        MiuraCell(panel_a=0.01, panel_b=0.01, sector_angle=1.0, fold_angle=math.nan)


def test_holes_and_rim_columns_that_leave_nothing_are_refused(planar):
    with pytest.raises(DesignError, match=r"rim_share must leave the rim's .* got 0.5, free from"):
        replace(planar, columns=replace(planar.columns, rim_share=0.5))
    with pytest.raises(DesignError, match=r"vertex_hole must leave of creases of 14.2442 mm some"):
        replace(planar, creases=replace(planar.creases, vertex_hole=7.2e-3))
