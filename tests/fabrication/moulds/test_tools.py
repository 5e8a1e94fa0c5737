"""Moulds and jigs by measures taken from their files."""

import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from smoskin.errors import DesignError
from smoskin.fabrication.moulds.assembly import pillars
from smoskin.fabrication.moulds.solids import stl
from smoskin.fabrication.moulds.tools import (
    column_mould,
    magnet_moulds,
    pillar_mould,
    scale_mould,
    tools,
)
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry


def read(part):
    return trimesh.load(io.BytesIO(stl(part)), file_type="stl")


@pytest.fixture(scope="module")
def made(planar):
    shop = Workshop()
    return {part.name: part for part in tools(planar, shop, flat_sheet(planar, shop))}


def test_every_tool_is_one_watertight_solid_in_millimetres(made):
    for part in made.values():
        mesh = read(part)
        assert mesh.is_watertight, part.name
        assert mesh.is_volume, part.name
        assert mesh.volume == pytest.approx(1e9 * part.solid.volume(), rel=1e-3)
        assert len(part.solid.decompose()) == 1, part.name
        assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-4)


def test_holes_of_the_column_plate_stand_under_the_bottom_vertices(planar, made):
    mesh = read(made["column_plate"])
    feet = 1e3 * geometry(planar).sheet.vertices[geometry(planar).sheet.columns.ravel(), :2]
    for place in feet:
        away = mesh.vertices[:, :2] - place
        ring = away[np.linalg.norm(away, axis=1) < 1e3 * planar.columns.radius + 0.5]
        assert len(ring) >= 100
        assert np.abs(ring.mean(axis=0)).max() < 0.01
        assert np.linalg.norm(ring, axis=1) == pytest.approx(1e3 * planar.columns.radius, abs=0.01)


def test_what_the_column_mould_casts_is_the_columns_volume(planar, made):
    plate = read(made["column_plate"])
    size_x, size_y, height = plate.extents
    assert height == pytest.approx(12.2)
    cast = size_x * size_y * height - plate.volume
    column = np.pi * (1e3 * planar.columns.radius) ** 2 * height
    assert cast == pytest.approx(91 * column, rel=5e-3)


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_pillars_are_cast_as_high_as_they_stand(name, request):
    design = request.getfixturevalue(name)
    mould, layer = pillar_mould(design, Workshop()), design.shear_layer
    size_x, size_y, height = mould.size
    cast = size_x * size_y * height - mould.solid.volume()
    assert cast == pytest.approx(layer.pillars * np.pi * layer.radius**2 * height, rel=1e-6)
    stands = pillars(design)[0]
    assert stands.solid.volume() == pytest.approx(cast / layer.pillars, rel=1e-6)
    assert 0.95 * layer.height < height <= layer.height


def test_sectors_are_quarters_of_the_magnets(planar):
    mould, jig = magnet_moulds(planar, Workshop())
    mesh = read(mould)
    cast = np.prod(mesh.extents) - mesh.volume
    magnet = planar.magnets[0]
    quarter = np.pi * magnet.radius**2 * magnet.height / 4 * 1e9
    assert cast == pytest.approx(12 * quarter, rel=5e-3)
    assert mould.made_of == ("PTFE", "PEEK", "aluminium")
    assert "aluminium" not in jig.made_of


def test_no_mould_of_silicone_is_printed_in_resin(made):
    for name in ("column_plate", "column_floor", "scale_mould", "foot_jig"):
        assert "SLA resin" not in made[name].made_of
        with pytest.raises(DesignError, match=rf"{name} must be made of .*; got SLA resin"):
            made[name].check_material("SLA resin")
    with pytest.raises(DesignError, match=r"magnet_mould_1 must be .*PTFE.*; got PLA"):
        made["magnet_mould_1"].check_material("PLA")


def test_scales_are_cast_whole(planar):
    mould = scale_mould(planar, Workshop())
    shape = np.prod(mould.size) - mould.solid.volume()
    from smoskin.fabrication.moulds.sheet import scale

    single = scale(planar, Workshop()).volume()
    assert shape == pytest.approx(12 * single, rel=1e-6)


def test_walls_thinner_than_the_printer_makes_are_refused(planar):
    wide = replace(planar, columns=replace(planar.columns, radius=6.9e-3))
    with pytest.raises(DesignError, match=r"walls must be at least 0.80 mm.*; got 0.4\d mm"):
        column_mould(wide, Workshop())
