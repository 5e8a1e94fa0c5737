"""What the estimator answers of what its sheet reads: the statuses at their edges, and spreads."""

from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.errors import ArgumentError, ModelError
from smoskin.origami.geometry import geometry
from smoskin.records import Status
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.closed_form.sheets import Solution

FORCE = np.array([0.1, -0.2, -0.6])
NOISE, PLACE = np.diag([1e-6, 4e-6, 9e-6]), np.diag([0.01, 0.04, 0.09])


def answered(planar, *, confidence=1.0, misfit=0.0, solution=True, within=True, least=0.5):
    """What is answered where the sheet finds so sure a touch on cell (2, 3)."""
    estimator = ClosedFormEstimator(planar, least_confidence=least)
    solved = Solution((2, 3), FORCE, confidence, misfit) if solution else None
    estimator._sheet = SimpleNamespace(
        solve=lambda motions: solved,
        most_misfit=0.35,
        place=np.broadcast_to(PLACE, (6, 6, 3, 3)),
    )
    estimator._covariance[..., 2:, 2:] = NOISE
    estimator._drag_alone[0, 2:4, 2:4] = NOISE[:2, :2]
    estimator._inverse = SimpleNamespace(
        displacements=lambda field: (np.zeros((1, 3, 3)), np.array([within]))
    )
    return estimator._read(7.0, np.zeros(9), 25.0)


@pytest.mark.parametrize(
    ("given", "status", "contacts"),
    [
        ({}, Status.CONTACT, 1),
        ({"confidence": 0.51}, Status.CONTACT, 1),
        ({"confidence": 0.5}, Status.CONTACT, 1),
        ({"confidence": 0.49}, Status.AMBIGUOUS, 1),
        ({"confidence": 0.29, "least": 0.3}, Status.AMBIGUOUS, 1),
        ({"confidence": 0.31, "least": 0.3}, Status.CONTACT, 1),
        ({"misfit": 0.35}, Status.CONTACT, 1),
        ({"misfit": 0.36}, Status.OUT_OF_RANGE, 0),
        ({"solution": False}, Status.AMBIGUOUS, 0),
        ({"within": False}, Status.OUT_OF_RANGE, 0),
    ],
)
def test_statuses_at_their_edges(planar, given, status, contacts):
    estimate = answered(planar, **given)
    assert (estimate.status, len(estimate.contacts), estimate.time) == (status, contacts, 7.0)
    for contact in estimate.contacts:
        np.testing.assert_array_equal(contact.position, geometry(planar).tops[2, 3])
        np.testing.assert_array_equal(contact.force, FORCE)


def test_a_cell_spreads_as_level_over_it_and_a_force_with_its_size(planar):
    (spread,) = answered(planar).covariance
    cell = geometry(planar).cell
    np.testing.assert_allclose(np.diag(spread)[:2], np.array([cell.length, cell.width]) ** 2 / 12)
    np.testing.assert_allclose(spread[2:, 2:], NOISE + 0.6**2 * PLACE)
    assert not spread[:2, 2:].any()
    (spread,) = answered(planar, confidence=0.1).covariance
    np.testing.assert_allclose(spread[2:4, 2:4], NOISE[:2, :2])
    assert np.isnan(spread[:2]).all()
    assert np.isnan(spread[4]).all()


@pytest.mark.parametrize("least", [-0.01, 1.01, np.nan])
def test_a_confidence_is_a_chance(planar, least):
    with pytest.raises(ArgumentError, match=r"least_confidence must lie in \[0, 1\]"):
        ClosedFormEstimator(planar, least_confidence=least)
    for end in (0.0, 1.0):
        ClosedFormEstimator(planar, least_confidence=end)


def test_a_calibration_of_another_design_is_refused(planar, long_planar):
    with pytest.raises(ModelError, match="design"):
        ClosedFormEstimator(long_planar, Calibration.nominal(planar))
