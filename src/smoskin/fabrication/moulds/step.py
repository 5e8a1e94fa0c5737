"""The assembled skin as a STEP file: named solids in one assembly, millimetres.

Decides which shapes are exact: slabs are extrusions, their circles cylinders; what was rolled or
cut in space keeps its facets. Equal parts are one shape at several places. Hides the library.
"""

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from shapely.affinity import translate

from smoskin.arrays import Floats
from smoskin.errors import require
from smoskin.fabrication.moulds.solids import SEGMENTS, Part, Slab, triangles_of

_STAMP: Final = "1980-01-01T00:00:00"
"""Date in the file's head, which is always the same."""
_ROUND: Final = 1e-9
"""m: by how much corners of a circle may differ in their distance from its middle."""


def step(parts: Sequence[Part], title: str) -> bytes:
    """Parts where they stand, each a solid of its name.

    Raises
    ------
    MissingExtraError
        If the modelling library is not installed.
    """
    require("writing STEP files", "step", "OCP")
    from OCP.Message import Message
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString as Text
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    Message.DefaultMessenger_s().ChangePrinters().Clear()  # it tells its steps otherwise
    document = TDocStd_Document(Text("XCAF"))
    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    whole, kinds = tool.NewShape(), {}
    TDataStd_Name.Set_s(whole, Text(title))
    for part in parts:
        slabs, pose = _at_origin(part)
        key = _key(slabs) if slabs else part.name
        if key not in kinds:
            kinds[key] = tool.AddShape(_exact(slabs) if slabs else _facets(part), False)
            TDataStd_Name.Set_s(kinds[key], Text(part.name))
        there = TopLoc_Location(_motion(pose))
        TDataStd_Name.Set_s(tool.AddComponent(whole, kinds[key], there), Text(part.name))
    tool.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.SetNameMode(True)
    writer.Transfer(document)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "assembly.step"
        writer.Write(str(path))
        text = path.read_text(encoding="utf-8")
    return re.sub(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'", f"'{_STAMP}'", text, count=1).encode()


def _at_origin(part: Part) -> tuple[list[Slab], Floats]:
    """A part's slabs with a corner at the origin, and the pose (3, 4) that brings them back."""
    pose = np.eye(4)[:3] if part.pose is None or not part.slabs else part.pose.copy()
    if not part.slabs:
        return [], pose
    first = getattr(part.slabs[0].outline, "geoms", [part.slabs[0].outline])[0]
    x, y = first.exterior.coords[0]
    pose[:, 3] += pose[:, :2] @ [x, y]
    moved = [Slab(translate(s.outline, -x, -y), s.low, s.high) for s in part.slabs]
    return moved, pose


def _key(slabs: Sequence[Slab]) -> str:
    """What equal slabs have in common: their corners to 10 nm."""
    return repr(
        [
            (np.round(1e8 * shapely.get_coordinates(s.outline)).astype(int).tolist(), s.low, s.high)
            for s in slabs
        ]
    )


def _motion(pose: Floats) -> Any:
    """A pose (3, 4), m, in millimetres."""
    from OCP.gp import gp_Trsf

    motion = gp_Trsf()
    motion.SetValues(*(pose * [1.0, 1.0, 1.0, 1e3]).ravel().tolist())
    return motion


def _exact(slabs: Sequence[Slab]) -> Any:
    """The union of slabs, millimetres."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain

    shapes = [
        _extrusion(outline, slab.low, slab.high)
        for slab in slabs
        for outline in getattr(slab.outline, "geoms", [slab.outline])
    ]
    if len(shapes) == 1:
        return shapes[0]
    whole = shapes[0]
    for shape in shapes[1:]:
        whole = BRepAlgoAPI_Fuse(whole, shape).Shape()
    joined = ShapeUpgrade_UnifySameDomain(whole)
    joined.Build()
    return _solid_of(joined.Shape())


def _extrusion(outline: Any, low: float, high: float) -> Any:
    """The solid over one polygon between two heights, m."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
    from OCP.gp import gp_Vec

    face = BRepBuilderAPI_MakeFace(_ring(outline.exterior, low, hole=False), True)
    for inner in outline.interiors:
        face.Add(_ring(inner, low, hole=True))
    return BRepPrimAPI_MakePrism(face.Face(), gp_Vec(0.0, 0.0, 1e3 * (high - low))).Shape()


def _ring(ring: Any, height: float, *, hole: bool) -> Any:
    """A closed wire at a height, m, counter-clockwise or, round a hole, clockwise."""
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeEdge,
        BRepBuilderAPI_MakePolygon,
        BRepBuilderAPI_MakeWire,
    )
    from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pnt

    corners = np.asarray(ring.coords)[:-1]
    middle = corners.mean(axis=0)
    away = np.linalg.norm(corners - middle, axis=1)
    if len(corners) == SEGMENTS and np.ptp(away) < _ROUND:
        turn = 2 * np.pi / SEGMENTS
        radius = float(away.mean() * np.sqrt(np.sin(turn) / turn))
        up = gp_Ax2(
            gp_Pnt(*(1e3 * middle).tolist(), 1e3 * height), gp_Dir(0.0, 0.0, -1.0 if hole else 1.0)
        )
        return BRepBuilderAPI_MakeWire(
            BRepBuilderAPI_MakeEdge(gp_Circ(up, 1e3 * radius)).Edge()
        ).Wire()
    if ring.is_ccw == hole:
        corners = corners[::-1]
    wire = BRepBuilderAPI_MakePolygon()
    for x, y in (1e3 * corners).tolist():
        wire.Add(gp_Pnt(x, y, 1e3 * height))
    wire.Close()
    return wire.Wire()


def _facets(part: Part) -> Any:
    """A part's triangles as a solid, those of one plane joined, millimetres."""
    from OCP.BRep import BRep_Builder
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeEdge,
        BRepBuilderAPI_MakeFace,
        BRepBuilderAPI_MakeSolid,
        BRepBuilderAPI_MakeVertex,
        BRepBuilderAPI_MakeWire,
    )
    from OCP.gp import gp_Pnt
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
    from OCP.TopoDS import TopoDS, TopoDS_Shell

    vertices, triangles = triangles_of(part.solid)
    corners = [
        BRepBuilderAPI_MakeVertex(gp_Pnt(*place)).Vertex() for place in (1e3 * vertices).tolist()
    ]
    edges: dict[tuple[int, int], Any] = {}
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for triangle in triangles.tolist():
        wire = BRepBuilderAPI_MakeWire()
        for start, end in zip(triangle, [*triangle[1:], triangle[0]], strict=True):
            if (end, start) in edges:
                wire.Add(TopoDS.Edge(edges[end, start].Reversed()))
            else:
                edges[start, end] = BRepBuilderAPI_MakeEdge(corners[start], corners[end]).Edge()
                wire.Add(edges[start, end])
        builder.Add(shell, BRepBuilderAPI_MakeFace(wire.Wire(), True).Face())
    shell.Closed(True)
    joined = ShapeUpgrade_UnifySameDomain(BRepBuilderAPI_MakeSolid(shell).Solid())
    joined.Build()
    return _solid_of(joined.Shape())


def _solid_of(shape: Any) -> Any:
    """The one solid of a shape."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID)
    return explorer.Current()
