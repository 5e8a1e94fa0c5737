"""Solids and their files, read by others."""

import io
import xml.etree.ElementTree as ET
import zipfile

import numpy as np
import pytest
import shapely
import trimesh

from smoskin.fabrication.moulds.solids import (
    Part,
    disc,
    joined,
    prism,
    stl,
    three_mf,
    under_surface,
)


def ring():
    outline = shapely.box(0, 0, 0.03, 0.02).difference(disc((0.01, 0.01), 4e-3))
    return Part(name="ring", title="a plate with a hole", solid=prism(outline, 0.0, 5e-3))


def test_circles_have_the_area_of_circles():
    assert disc((0.1, 0.2), 3e-3).area == pytest.approx(np.pi * 9e-6, rel=1e-12)


def test_stl_files_are_read_with_the_volume_of_the_part():
    mesh = trimesh.load(io.BytesIO(stl(ring())), file_type="stl")
    assert mesh.is_volume
    assert mesh.volume == pytest.approx((600 - np.pi * 16) * 5, rel=1e-5)
    assert stl(ring()) == stl(ring())


def test_3mf_files_hold_all_parts_side_by_side_in_millimetres():
    content = three_mf([ring(), ring()], "two <rings>")
    assert content == three_mf([ring(), ring()], "two <rings>")
    archive = zipfile.ZipFile(io.BytesIO(content))
    assert archive.testzip() is None
    assert {info.date_time[0] for info in archive.infolist()} == {1980}
    root = ET.fromstring(archive.read("3D/3dmodel.model"))
    space = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    assert root.get("unit") == "millimeter"
    for element in root.iter(f"{space}object"):
        points = [[float(v.get(a)) for a in "xyz"] for v in element.iter(f"{space}vertex")]
        faces = [[int(t.get(f"v{k}")) for k in (1, 2, 3)] for t in element.iter(f"{space}triangle")]
        mesh = trimesh.Trimesh(points, faces)
        assert mesh.is_volume
        assert mesh.volume == pytest.approx((600 - np.pi * 16) * 5, rel=1e-5)
    places = [float(i.get("transform").split()[9]) for i in root.iter(f"{space}item")]
    assert places == pytest.approx([0.0, 40.0])


def test_a_block_under_a_surface_has_its_mean_height():
    places = np.array(
        [[0, 0, 1], [2, 0, 2], [2, 1, 3], [0, 1, 2], [4, 0, 1], [4, 1, 2]], dtype=float
    )
    block = under_surface(places, np.array([[0, 1, 2, 3], [1, 4, 5, 2]]), 0.0)
    assert block.volume() == pytest.approx(2 * 2 + 2 * 2)
    assert joined([block, block.translate((10.0, 0, 0))]).volume() == pytest.approx(16)
