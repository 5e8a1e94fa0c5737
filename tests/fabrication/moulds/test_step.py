"""STEP files, read back by the library's own reader."""

import re
import sys
from dataclasses import replace

import pytest

from smoskin.errors import MissingExtraError
from smoskin.fabrication.bundle import make_bundle
from smoskin.fabrication.moulds.assembly import whole_skin
from smoskin.fabrication.moulds.files import step_file
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.workshop import Workshop

SHOP = Workshop()


def read(content, folder):
    """Solids of a STEP file, mm, by the name of their place in the assembly."""
    pytest.importorskip("OCP", reason="needs Open CASCADE (extra step)")
    from OCP.collections import Sequence_TDF_Label
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

    path = folder / "read.step"
    path.write_bytes(content)
    reader, document = STEPCAFControl_Reader(), TDocStd_Document(TCollection_ExtendedString("XCAF"))
    reader.SetNameMode(True)
    reader.ReadFile(str(path))
    assert reader.Transfer(document)
    free, places = Sequence_TDF_Label(), Sequence_TDF_Label()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(free)
    [whole] = free
    XCAFDoc_ShapeTool.GetComponents_s(whole, places)
    solids = {}
    for place in places:
        name = TDataStd_Name()
        assert place.FindAttribute(TDataStd_Name.GetID_s(), name)
        solids[name.Get().ToExtString()] = XCAFDoc_ShapeTool.GetShape_s(place)
    assert len(solids) == len(places)
    return solids


def measured(shape):
    """Volume, m3, and middle, m, of a valid closed solid."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    assert BRepCheck_Analyzer(shape).IsValid()
    solids = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID)
    solids.Next()
    assert not solids.More()
    props = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, props)
    middle = props.CentreOfMass()
    return props.Mass() * 1e-9, [1e-3 * c for c in (middle.X(), middle.Y(), middle.Z())]


def kinds_of_faces(shape):
    """Counts of a shape's faces by their surface."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    faces, kinds = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE), []
    while faces.More():
        kinds.append(BRepAdaptor_Surface(TopoDS.Face(faces.Current())).GetType().name)
        faces.Next()
    return {kind: kinds.count(kind) for kind in kinds}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar", "curved"])
def test_a_step_file_has_every_part_by_name_volume_and_place(name, request, tmp_path):
    design = request.getfixturevalue(name)
    content = step_file(design, SHOP).content
    solids = read(content, tmp_path)
    parts = whole_skin(design, flat_sheet(design, SHOP), SHOP)
    assert set(solids) == {part.name for part in parts}
    some = parts[::20] if design.limb else parts  # on a limb no two panels are one shape
    for part in [*some, *(part for part in parts if not part.slabs)]:
        volume, middle = measured(solids[part.name])
        assert volume == pytest.approx(part.solid.volume(), rel=5e-3), part.name
        low, high = part.solid.bounding_box()[:3], part.solid.bounding_box()[3:]
        assert all(a < m < b for a, m, b in zip(low, middle, high, strict=True)), part.name
    assert b"SI_UNIT(.MILLI.,.METRE.)" in content
    assert kinds_of_faces(solids["column_1"]) == {"GeomAbs_Plane": 2, "GeomAbs_Cylinder": 1}
    assert kinds_of_faces(solids["magnet_M2"]) == {"GeomAbs_Plane": 2, "GeomAbs_Cylinder": 1}
    assert set(kinds_of_faces(solids["frame"])) == {"GeomAbs_Plane"}


@pytest.mark.slow
def test_a_bundle_has_a_step_file_where_it_is_asked_for(planar):
    pytest.importorskip("OCP", reason="needs Open CASCADE (extra step)")
    corners = {"M1": (1, 2), "M2": (2, 1), "M3": (1, 1)}
    magnets = tuple(replace(m, corner=corners[m.name]) for m in planar.magnets)
    bundle = make_bundle(replace(planar, cells=(3, 3), magnets=magnets), step=True)
    [file] = [file for file in bundle.files if file.kind == "step"]
    assert (file.path, file.units) == ("assembly.step", "mm")
    assert re.search(rb"FILE_NAME\('[^']*','1980-01-01T00:00:00'", file.content)


def test_without_the_library_it_says_what_to_install(planar, monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP", None)
    with pytest.raises(MissingExtraError, match=r"\[step\]"):
        make_bundle(planar, step=True)
