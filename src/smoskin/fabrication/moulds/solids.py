"""Solids: how they are made of outlines, what a printed part is, and the files that it becomes.

Hides the solid modeller, and the formats STL and 3MF; lengths are metres here, millimetres there.
"""

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final
from xml.sax.saxutils import escape

import numpy as np
from shapely import Point, Polygon

from smoskin.arrays import Floats, Ints
from smoskin.errors import DesignError, require
from smoskin.origami.surface.mesh import format_stl

SEGMENTS: Final = 72
"""Sides of a circle."""
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Date in archives, which is always the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stuff:
    """What a part may be made of."""

    heat: float
    """degC up to which it keeps its shape."""
    cures: bool
    """Whether platinum silicone cures against it."""
    metal: bool = False
    """Whether it is a metal, which a magnetising pulse would heat and repel."""


STUFFS: Final = {
    "PLA": Stuff(heat=50.0, cures=True),
    "PETG": Stuff(heat=70.0, cures=True),
    "ABS": Stuff(heat=90.0, cures=True),
    "SLA resin": Stuff(heat=60.0, cures=False),
    "PTFE": Stuff(heat=250.0, cures=True),
    "PEEK": Stuff(heat=240.0, cures=True),
    "aluminium": Stuff(heat=300.0, cures=True, metal=True),
}
"""Materials of parts and tools. Uncured acrylates, sulphur and latex stop platinum silicone from
curing, so that no SLA print may touch it."""


@dataclass(frozen=True, slots=True, eq=False)
class Slab:
    """What is over an outline between two heights."""

    outline: Any
    """A shapely polygon, or several, m."""
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """A solid as it is made, standing on z = 0, or as it stands in the skin."""

    name: str
    title: str
    solid: Any
    """A `manifold3d.Manifold`, m."""
    slabs: tuple[Slab, ...] = ()
    """Slabs whose union it is, before it was posed; empty where it is none."""
    pose: Floats | None = None
    """(3, 4): where its slabs went, if they were moved."""
    quantity: int = 1
    heat: float = 25.0
    """degC that it must stand."""
    silicone: bool = False
    """Whether silicone cures in it."""
    pulse: bool = False
    """Whether it lies in the magnetising coil."""

    @property
    def made_of(self) -> tuple[str, ...]:
        """Materials that it may be made of."""
        return tuple(
            name
            for name, stuff in STUFFS.items()
            if stuff.heat >= self.heat
            and (stuff.cures or not self.silicone)
            and not (stuff.metal and self.pulse)
        )

    @property
    def size(self) -> Floats:
        """(3,), m: extent."""
        box = np.array(self.solid.bounding_box()).reshape(2, 3)
        return np.asarray(box[1] - box[0])

    def check_material(self, material: str) -> None:
        """Raise `DesignError` for a material that would ruin the part or what it makes."""
        if material not in self.made_of:
            raise DesignError(
                f"{self.name} must be made of one of {', '.join(self.made_of)}; got {material}"
            )


def extruded(
    name: str, title: str, *slabs: Slab, pose: Floats | None = None, silicone: bool = False
) -> Part:
    """The union of slabs, which overlap, put where a pose (3, 4) says."""
    solid = prism(slabs[0].outline, slabs[0].low, slabs[0].high)
    for slab in slabs[1:]:
        solid = solid + prism(slab.outline, slab.low, slab.high)
    if pose is not None:
        solid = solid.transform(pose)
    return Part(name=name, title=title, solid=solid, slabs=slabs, pose=pose, silicone=silicone)


def laid(part: Part, *, upside_down: bool = False) -> Part:
    """A part on z = 0 as it is made: upright as it was drawn, or on its head."""
    solid = part.solid
    if part.pose is not None:
        turn, middle = part.pose[:, :3].T, part.pose[:, 3]
        solid = solid.transform(np.concatenate([turn, -(turn @ middle)[:, None]], axis=1))
    if upside_down:
        solid = solid.transform(np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0]]))
    low = float(np.array(solid.bounding_box())[2])
    return replace(part, solid=solid.translate((0.0, 0.0, -low)), slabs=(), pose=None)


def prism(outline: Any, low: float, high: float) -> Any:
    """The solid over a shapely outline between two heights, m."""
    require("making solids", "fabrication", "manifold3d")
    from manifold3d import CrossSection, FillRule, Manifold

    rings = []
    for part in getattr(outline, "geoms", [outline]):
        rings += [1e3 * np.asarray(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)]
    section = CrossSection(rings, FillRule.EvenOdd)  # it rounds; in mm finely enough
    solid = Manifold.extrude(section, 1e3 * (high - low)).scale((1e-3, 1e-3, 1e-3))
    return solid.translate((0.0, 0.0, low))


def box(corners: Floats, low: float, high: float) -> Any:
    """The block over a rectangle."""
    return prism(Polygon(corners), low, high)


def disc(place: Any, radius: float) -> Polygon:
    """A circle as a polygon of the same area, (x, y) of its middle, m."""
    wider = radius * float(np.sqrt(2 * np.pi / SEGMENTS / np.sin(2 * np.pi / SEGMENTS)))
    turns = np.arange(SEGMENTS) * 2 * np.pi / SEGMENTS
    return Polygon(np.asarray(place)[:2] + wider * np.stack([np.cos(turns), np.sin(turns)], -1))


def hole(place: Any, radius: float) -> Any:
    """A circle to be taken out of an outline."""
    return Point(*np.asarray(place)[:2].tolist()).buffer(radius, quad_segs=SEGMENTS // 4)


def joined(solids: list[Any]) -> Any:
    """The union of solids."""
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean(solids, OpType.Add)


def under_surface(vertices: Floats, facets: Ints, floor: float) -> Any:
    """The solid between a surface of quadrilaterals over a plane region and a floor below, m."""
    from manifold3d import Manifold, Mesh64

    count = len(vertices)
    triangles = np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    there = set(map(tuple, edges.tolist()))
    rim = np.array([pair for pair in edges.tolist() if (pair[1], pair[0]) not in there])
    start, end = rim.T
    walls = [
        np.stack([end, start, start + count], axis=1),
        np.stack([end, start + count, end + count], axis=1),
    ]
    below = vertices * [1.0, 1.0, 0.0] + [0.0, 0.0, floor]
    whole = np.concatenate([triangles, triangles[:, ::-1] + count, *walls])
    mesh = Mesh64(np.concatenate([vertices, below]), whole.astype(np.uint64))
    return Manifold(mesh)


def triangles_of(solid: Any) -> tuple[Floats, Ints]:
    """Vertices, m, and triangles of a solid, edges shorter than a micrometre drawn together.

    A file's single precision would merge their ends and leave holes.
    """
    mesh = solid.simplify(1e-6).to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, dtype=np.int64)


def joined_mesh(parts: Sequence[Part]) -> tuple[Floats, Ints]:
    """Vertices, m, and triangles of several parts, one after another."""
    places, faces, count = [], [], 0
    for part in parts:
        vertices, triangles = triangles_of(part.solid)
        places.append(vertices)
        faces.append(triangles + count)
        count += len(vertices)
    return np.concatenate(places), np.concatenate(faces)


def stl(part: Part) -> bytes:
    """A part as a binary STL file, millimetres."""
    return format_stl(*triangles_of(part.solid), f"smoskin {part.name}, mm")


def three_mf(parts: list[Part], title: str) -> bytes:
    """Parts side by side in one 3MF file, millimetres."""
    objects, items, across = [], [], 0.0
    for number, part in enumerate(parts, 1):
        vertices, triangles = triangles_of(part.solid)
        points = "".join(
            f'<vertex x="{x:.6f}" y="{y:.6f}" z="{z:.6f}"/>'
            for x, y, z in (1e3 * vertices).tolist()
        )
        faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles.tolist())
        objects.append(
            f'<object id="{number}" type="model" name="{escape(part.name)}"><mesh>'
            f"<vertices>{points}</vertices><triangles>{faces}</triangles></mesh></object>"
        )
        shift = across - 1e3 * float(vertices[:, 0].min())
        items.append(f'<item objectid="{number}" transform="1 0 0 0 1 0 0 0 1 {shift:.6f} 0 0"/>')
        across += 1e3 * float(part.size[0]) + 10.0
    model = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f'<metadata name="Title">{escape(title)}</metadata>'
        f"<resources>{''.join(objects)}</resources><build>{''.join(items)}</build></model>"
    )
    types = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<Types '
        'xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default '
        'Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="model" '
        'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
    )
    relations = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<Relationships '
        'xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
        'Target="/3D/3dmodel.model" Id="rel0" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
    )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in (
            ("[Content_Types].xml", types),
            ("_rels/.rels", relations),
            ("3D/3dmodel.model", model),
        ):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, text)
    return stream.getvalue()
