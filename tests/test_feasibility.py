"""Whether designs can work: room for the magnets, and chips inside their range."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, DesignError
from smoskin.feasibility import (
    MARGIN,
    RATED_PRESS,
    RATED_SHEAR,
    check_design,
    field_extent,
    load_design,
    suited_to,
)
from smoskin.magnetics import mlx90393, sector
from smoskin.mechanics.reduced.stiffness import board_stiffness, stiffness_map
from smoskin.origami.cell import size
from smoskin.origami.geometry import geometry


def with_magnet(planar: SkinDesign, **changes: object) -> SkinDesign:
    magnets = tuple(replace(m, **changes) if m.name == "M2" else m for m in planar.magnets)
    return replace(planar, magnets=magnets)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"radius": 9e-3}, r"'M2' overlaps a column: radius must be below 6.50 mm"),
        (
            {"height": 14e-3},
            r"does not fit between chip and sheet: columns.height must exceed 20.1",
        ),
        ({"corner": (2, 4)}, "magnets 'M2' and 'M3' overlap"),
        ({"remanence": 1.4e6}, r"\|B_z\| reaches .* a gap of at least \d\.\d mm would do"),
    ],
)
def test_a_design_that_cannot_work_is_refused_with_what_would(planar, changes, message):
    with pytest.raises(DesignError, match=message):
        check_design(with_magnet(planar, **changes))


def test_a_range_that_the_field_overruns_is_refused(planar):
    fine = replace(planar, hall_setting=replace(planar.hall_setting, resolution=0))
    with pytest.raises(DesignError, match=r"'S1': .* choose a wider range|would do"):
        check_design(fine)


def test_columns_too_soft_for_the_rated_press_are_refused(planar):
    soft = replace(planar, columns=replace(planar.columns, radius=0.3e-3))
    with pytest.raises(DesignError, match="columns are too soft"):
        check_design(soft)


def refused(design, message):
    with pytest.raises(DesignError, match=message):
        check_design(design)


def test_what_is_promised():
    assert (RATED_PRESS, RATED_SHEAR, MARGIN) == (1.0, 0.5, 0.95)


def test_a_magnet_has_room_up_to_the_nearest_column(planar):
    """Its edge may come as near as a hundredth of a millimetre; the weak one keeps its field."""
    weak = {"remanence": 1e5}
    message = r"radius must be below (\d\.\d\d) mm at corner \(4, 2\)"
    with pytest.raises(DesignError, match=message) as error:
        check_design(with_magnet(planar, radius=9e-3, **weak))
    room = 1e-3 * float(str(error.value).split("below ")[1].split(" mm")[0])
    check_design(with_magnet(planar, radius=room - 1e-5, **weak))
    refused(with_magnet(planar, radius=room + 1e-5, **weak), "overlaps a column")


def test_magnets_of_one_mount_stay_apart(planar):
    """On the base, where no column stands between two of them; neighbours along y."""
    base, upper, last = (replace(magnet, remanence=1.0) for magnet in planar.magnets)
    near = replace(upper, mount="base", corner=(base.corner[0], base.corner[1] - 1))
    apart = size(planar.cell).width
    for less, fits in ((1e-6, True), (-1e-6, False)):
        wide = replace(near, radius=apart - base.radius - less)
        design = replace(planar, magnets=(base, wide, last))
        if fits:
            check_design(design)
        else:
            refused(design, r"'M1' and 'M2' overlap: they must be more than 26\.7 mm apart")


def test_a_magnet_fits_between_chip_and_sheet(planar):
    site, magnet = planar.halls[1], planar.magnets[1]
    needed = planar.board.sensing_height + site.gap + magnet.height
    for height, fits in ((needed + 1e-6, True), (needed, False)):
        columns = replace(planar.columns, height=height, radius=1.8e-3)
        loose = tuple(replace(each, play=0.02) for each in planar.magnets)
        frame = replace(planar.frame, held_height=1e-3)
        design = replace(planar, columns=columns, magnets=loose, frame=frame)
        if fits:
            check_design(design)
        else:
            refused(design, r"columns.height must exceed 8\.10 mm .* got 8\.10 mm")


def test_the_rated_press_may_not_sink_the_sheet_flat(planar):
    height = float(size(planar.cell).height)
    depth = RATED_PRESS / stiffness_map(planar, planar.coefficients).min()
    for share, works in ((1.001, True), (0.999, False)):
        # The columns' stiffness goes with the square of their radius.
        radius = planar.columns.radius * math.sqrt(share * depth / height)
        weak = tuple(replace(magnet, remanence=1e3, play=0.1) for magnet in planar.magnets)
        design = replace(planar, columns=replace(planar.columns, radius=radius), magnets=weak)
        if works:
            check_design(design)
        else:
            refused(design, "columns are too soft: a press of 1 N must sink the sheet by less")


def test_a_chip_keeps_five_percent_of_its_range(planar):
    extent, limit = field_extent(planar, planar.halls[1]), mlx90393.full_scale(planar.hall_setting)
    share = (extent.largest / (MARGIN * limit)).max()
    for factor, works in ((0.999, True), (1.001, False)):
        design = with_magnet(planar, remanence=planar.magnets[1].remanence * factor / share)
        if works:
            check_design(design)
        else:
            refused(design, r"hall site 'S2': \|B_z\| reaches .*95% of the range")


def test_the_remedy_is_one(planar):
    """The gap that the message names works, one a tenth of a millimetre smaller does not."""
    strong = with_magnet(planar, remanence=1.4e6)
    with pytest.raises(DesignError, match="a gap of at least") as error:
        check_design(strong)
    gap = 1e-3 * float(str(error.value).split("at least ")[1].split(" mm")[0])
    for change, works in ((0.0, True), (-2e-4, False)):
        halls = tuple(
            replace(site, gap=gap + change) if site.name == "S2" else site for site in strong.halls
        )
        if works:
            check_design(replace(strong, halls=halls))
        else:
            refused(replace(strong, halls=halls), "'S2'")


def test_the_extent_is_that_of_the_fields_over_the_stroke(planar):
    site = planar.halls[0]
    extent = field_extent(planar, site)
    assert extent.stroke == pytest.approx(RATED_SHEAR / board_stiffness(planar))
    magnet, turned = planar.magnet(site.magnet), mlx90393.rotation(site)
    places = np.random.default_rng(0).uniform(-extent.stroke, extent.stroke, (500, 3))
    places[:, 2] = geometry(planar).rest[0, 2]
    fields = np.abs(sector.field(magnet, places) @ turned)
    assert (fields <= extent.largest * (1 + 1e-3)).all()
    rest = sector.field(magnet, geometry(planar).rest[0]) @ turned
    np.testing.assert_allclose(extent.rest, rest, atol=1e-15)


def test_notches_that_tie_columns_are_refused(planar):
    tight = replace(planar.magnets[1], play=2e-6)
    design = replace(planar, magnets=(planar.magnets[0], tight, planar.magnets[2]))
    with pytest.raises(DesignError, match=r"play must be at least .* do not tie the columns"):
        check_design(design)


@pytest.mark.parametrize("name", ["planar", "optimised", "curved"])
@pytest.mark.parametrize("tesla", [0.4, 0.55, 0.7, 0.85, 1.0])
def test_gaps_make_up_for_other_magnets(name, tesla):
    """Read at rest as designed, but for the steps of shims, and in range on made skins."""
    design = load_design(name)
    suited = suited_to(design, tesla / sector.VACUUM_PERMEABILITY)
    check_design(suited)
    assert {magnet.remanence for magnet in suited.magnets} == {tesla / sector.VACUUM_PERMEABILITY}
    for before, after in zip(design.halls, suited.halls, strict=True):
        rest, designed = field_extent(suited, after), field_extent(design, before)
        share = np.linalg.norm(rest.rest) / np.linalg.norm(designed.rest)
        assert 0.94 < share <= 1.0
        near = replace(after, gap=after.gap - 0.5e-3)
        halls = tuple(near if site == after else site for site in suited.halls)
        worst = 1.09 * field_extent(replace(suited, halls=halls), near).largest
        assert (worst <= 50e-3).all()
        assert (worst <= 0.95 * mlx90393.full_scale(suited.hall_setting)).all()


def test_weaker_magnets_come_nearer(planar):
    gaps = [
        suited_to(planar, tesla / sector.VACUUM_PERMEABILITY).halls[1].gap
        for tesla in (1.0, 0.7, 0.4)
    ]
    assert gaps == sorted(gaps, reverse=True)
    assert len(set(gaps)) == 3
    assert gaps[0] == pytest.approx(planar.halls[1].gap)


def test_what_is_no_magnet_is_refused(planar):
    with pytest.raises(ArgumentError, match=r"remanence must lie in 300000..1.2e\+06 A/m; got 0.6"):
        suited_to(planar, 0.6)
