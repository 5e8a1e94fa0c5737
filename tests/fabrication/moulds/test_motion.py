"""The assembled skin under a press: nothing runs into anything in the range it is built for."""

import numpy as np
import pytest

from smoskin.fabrication.moulds import assembly
from smoskin.fabrication.moulds.holders import holders
from smoskin.fabrication.moulds.sheet import folded_panels
from smoskin.fabrication.moulds.solids import Part
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from solid_overlaps import overlaps

pytest.importorskip("jax")


def moved(part, shift, turn, about):
    """A part moved by a small motion about a point."""
    matrix = np.array([[1, -turn[2], turn[1]], [turn[2], 1, -turn[0]], [-turn[1], turn[0], 1]])
    pose = np.concatenate([matrix, (about + shift - matrix @ about)[:, None]], axis=1)
    return Part(name=part.name, title="", solid=part.solid.transform(pose))


@pytest.mark.slow
@pytest.mark.parametrize("cell", [(0, 0), (3, 2), (2, 3), (5, 5), (0, 3), (3, 0)])
def test_presses_of_1_n_bring_no_two_parts_together(planar, cell):
    from smoskin.twin.whole import Twin

    shop, twin = Workshop(), Twin(planar, seed=None)
    press = [Contact(position=geometry(planar).tops[cell], force=(0.0, 0.0, -1.0))]
    vertices = twin.sheet_vertices(press)
    motion = twin.motion(press)
    assert motion.valid.all()
    sunk = geometry(planar).sheet.vertices[:, 2] - vertices[:, 2]
    assert sunk.max() > 0.1e-3
    parts = folded_panels(planar, flat_sheet(planar, shop), shop, vertices=vertices)
    hung = {}
    for magnet, place, way in zip(
        planar.magnets, geometry(planar).magnets, motion.magnets, strict=True
    ):
        hung[magnet.name] = place, way
    for part in [*holders(planar, shop), *assembly.magnets(planar)]:
        place, way = hung[part.name.split("_")[-1]]
        parts.append(moved(part, way[:3], way[3:], place))
    fixed = [*assembly.chips(planar), *assembly.board(planar, shop), assembly.frame(planar)]
    overlapping = overlaps([*parts, *fixed])
    inside = {
        pair: shared
        for pair, shared in overlapping.items()
        # A magnet in its own holder is moved with it.
        if not (pair[0].startswith("holder") and pair[1].startswith("magnet"))
    }
    assert inside == {}
