"""A touch by statics: the lower chip's force, and cells that answer as theory says."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Covered, Sticking, Touches
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.closed_form.statics import StaticSheet
from smoskin.sensing.response.table import load_response_table


@pytest.mark.parametrize("grip", [Sticking(), Covered()])
def test_presses_that_follow_the_theory_are_read_back(planar, grip):
    """As few motions as the noise allows, so that the cell is certain."""
    sheet = StaticSheet(planar, Calibration.nominal(planar), grip)
    force = np.einsum("nmfk,nmk->nmf", sheet.loads, sheet.presses)
    np.testing.assert_allclose(force, np.broadcast_to([0.0, 0.0, -1.0], force.shape), atol=1e-9)
    for cell in np.ndindex(planar.cells):
        answer = sheet.solve(0.3 * sheet.presses[cell])
        assert answer.cell == cell
        np.testing.assert_allclose(answer.force, [0.0, 0.0, -0.3], atol=1e-9)
        assert answer.misfit < 1e-12


def test_the_lower_chip_weighs_a_touch(planar):
    """Board, pillars and the chip's own turn in its magnet's field, against the whole twin."""
    pytest.importorskip("jax")
    from smoskin.magnetics.inversion import FieldInverse
    from smoskin.twin.whole import Twin

    sheet = StaticSheet(planar, Calibration.nominal(planar), Covered())
    by_force = sheet.lower.reshape(36, 3, 3)
    twin, inverse = Twin(planar, seed=None, grip=Covered()), FieldInverse(planar)
    places = geometry(planar).tops.reshape(-1, 1, 2)
    for drag in ((0.0, 0.0), (0.2, -0.1)):
        force = np.array([*drag, -0.5])
        moved = twin.motions(Touches(position=places, force=[[force]] * 36))
        seen = inverse.displacements(inverse.rest_field + twin.readout.risen(moved))[0]
        np.testing.assert_allclose(by_force @ force, seen[:, 0], atol=1e-6)


def test_a_grip_needs_a_flat_skin_known_by_theory(planar, curved):
    with pytest.raises(ArgumentError, match=r"flat where grip is given; got 'curved"):
        ClosedFormEstimator(curved, grip=Covered())
    with pytest.raises(ArgumentError, match="grip must be None where a response table is given"):
        ClosedFormEstimator(planar, load_response_table("planar"), grip=Sticking())
