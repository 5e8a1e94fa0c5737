"""Pages of what lies still: folded sheets, meshes, and the folders of our own commands.

Decides what a slider does there and what is coloured.
"""

from pathlib import Path
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.origami.pattern import FoldedForms
from smoskin.origami.surface.mesh import read_triangles
from smoskin.outputs import read_input
from smoskin.space import Body, Shade, page

_PAGES: Final = ("fold.html", "assembly.html")
"""Pages of the folders that `tessellate` and `fabricate` write."""
_LARGEST: Final = 1 << 27
"""Bytes of a page that is served, at most."""
_TRIANGLES: Final = 2_000_000
"""Triangles that a browser shows, at most."""
_STRAIN: Final = 0.5
"""%: end of the scale of strain, the most that film and panels may be strained when they fold."""


def fold_page(forms: FoldedForms, title: str) -> bytes:
    """The page of a sheet with a slider through its states, coloured by strain.

    Strain is the largest change of length among a face's edges and diagonals from the first state.
    """
    starts = np.cumsum([0, *map(len, forms.faces)]).tolist()
    # Every face has its own corners, so that it has one colour.
    triangles = [
        (start, start + k, start + k + 1)
        for start, face in zip(starts, forms.faces, strict=False)
        for k in range(1, len(face) - 1)
    ]
    strains = 100 * np.stack([_strain(forms.frames, face) for face in forms.faces], axis=1)
    values = np.repeat(strains, [len(face) for face in forms.faces], axis=1)
    sheet = Body(
        name="sheet",
        colour="#9ecae1",
        frames=forms.frames[:, np.concatenate(forms.faces)],
        triangles=np.array(triangles),
        shades=[Shade(name="strain", unit="%", top=_STRAIN, values=values)],
    )
    return page([sheet], title, "fold", start=1.0)


def mesh_page(path: Path) -> bytes:
    """The page of an STL, OBJ or PLY file."""
    vertices, triangles = read_triangles(path)
    if len(triangles) > _TRIANGLES or not np.isfinite(vertices).all():
        raise ArgumentError(
            f"{path} must hold finite vertices and at most {_TRIANGLES:,} triangles to be seen; "
            f"got {len(triangles):,}"
        )
    body = Body(name=path.stem, colour="#b7c9a8", frames=vertices[None], triangles=triangles)
    return page([body], path.name, "apart")


def folder_page(folder: Path) -> bytes:
    """The page that a folder of ours holds."""
    for name in _PAGES:
        if (folder / name).is_file():
            return read_input(folder / name, _LARGEST)
    raise ArgumentError(
        f"file must be a folder of smoskin tessellate or fabricate, with {' or '.join(_PAGES)}; "
        f"{folder} has neither"
    )


def _strain(frames: Floats, face: tuple[int, ...]) -> Floats:
    """Largest change of a face's lengths in each state, as a share, (S,)."""
    first, second = np.triu_indices(len(face), 1)
    corners = frames[:, list(face)]
    lengths = np.linalg.norm(corners[:, first] - corners[:, second], axis=-1)
    rest = np.maximum(lengths[0], 1e-12)
    return np.asarray(np.abs(lengths / rest - 1).max(axis=1))
