"""Parts larger than the printer's bed."""

import numpy as np
import pytest
import shapely

from smoskin.errors import DesignError
from smoskin.fabrication.layout import column_places
from smoskin.fabrication.moulds.solids import Part, prism
from smoskin.fabrication.moulds.split import split
from smoskin.fabrication.moulds.tools import column_mould
from smoskin.fabrication.workshop import Workshop


def test_pieces_fit_the_bed_and_no_cut_goes_through_a_column(planar):
    plate = column_mould(planar, Workshop())[0]
    bed = (0.08, 0.1, 0.1)
    pieces = split(plate, bed, column_places(planar))
    assert len(pieces) == 4
    total = sum(piece.solid.volume() for piece in pieces)
    pins = plate.solid.volume() - total
    assert 0 < pins < 4 * 2 * 2 * np.pi * 1.1e-3**2 * 8e-3
    radius = planar.columns.radius
    for piece in pieces:
        box = np.array(piece.solid.bounding_box()).reshape(2, 3)
        assert (box[1] - box[0] <= np.array(bed) + 1e-9).all()
        for axis in (0, 1):
            for wall in box[:, axis]:
                assert np.abs(column_places(planar)[:, axis] - wall).min() > radius + 0.3e-3


def test_what_fits_stays_whole_and_what_is_too_high_is_refused():
    part = Part(name="block", title="", solid=prism(shapely.box(0, 0, 0.1, 0.2), 0.0, 0.05))
    assert split(part, (0.2, 0.1, 0.1)) == [part]  # turned by a quarter
    with pytest.raises(DesignError, match=r"block must be at most 40 mm high.*got 50.0 mm"):
        split(part, (0.2, 0.2, 0.04))
    assert len(split(part, (0.1, 0.1, 0.1))) == 2
