"""The paper's theory on the whole sheet: which cells it names, with no table of the skin."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.feasibility import suited_to
from smoskin.magnetics.sector import VACUUM_PERMEABILITY
from smoskin.mechanics.sheet.touches import Covered, Sticking, Touches
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator

pytest.importorskip("jax")
from smoskin.twin.whole import Twin

ATTENUATION = (0.55, 0.55)
"""v_a of the motions, alike in x and y as the SI takes it; from 0.52 to 0.58 the names are the same
but for one cell or two. Least squares to the magnets' motions give 0.48 and 0.44
(`paper.models.reduction.fit_magnets`), Text S5's fit to the stiffness none."""
OF_STATICS = (0.55, 0.5)
"""v_a where cells are named by statics; 0.05 more or less of either costs a name or two, y up
four under covers at 0.1 N."""
NO_DEDUCTION = 1e7
"""N/m: sheet that a drag does not move over the board, as under cover panels."""


def named(twin, force, drag=(0.0, 0.0), grip=None) -> int:
    """Cells that are named right by one noisy reading of a press each, after zeroing.

    By the SI's signs and ratios, or by statics where a grip is given.
    """
    design = twin.design
    nominal = Calibration.nominal(design)
    attenuation = ATTENUATION if grip is None else OF_STATICS
    theory = replace(nominal.coefficients, attenuation=attenuation)
    known = replace(nominal, coefficients=theory, sheet_stiffness=NO_DEDUCTION)
    estimator = ClosedFormEstimator(design, known, grip=grip)
    still = twin.motion([])
    times = iter(0.01 * np.arange(1000))
    rest = [twin.readout.read(still, twin.noise, time=next(times)) for _ in range(20)]
    estimator.zero(rest, force=True)
    places = geometry(design).tops.reshape(-1, 1, 2)
    motions = twin.motions(Touches(position=places, force=[[(*drag, -force)]] * len(places)))
    right = 0
    for place, motion in zip(places[:, 0], motions, strict=True):
        estimator.step(twin.readout.read(still, twin.noise, time=next(times)))
        contacts = estimator.step(twin.readout.read(motion, twin.noise, time=next(times))).contacts
        right += bool(contacts) and np.allclose(contacts[0].position, place)
    return right


@pytest.mark.parametrize(("grip", "least"), [(Sticking(), (33, 35, 35)), (Covered(), (30, 30, 31))])
def test_theory_names_the_cells_of_the_whole_sheet(planar, grip, least):
    """Under covers next to the magnets' lines cells are taken for their neighbours."""
    twin = Twin(planar, seed=1, grip=grip)
    for force, cells in zip((0.1, 0.3, 1.0), least, strict=True):
        assert named(twin, force) >= cells


def test_stiffer_panels_name_more_cells_under_covers(planar):
    """As built they are a compromise: the more the panels tie cells together, the less two touches
    are told apart."""
    stiff = replace(planar, panels=replace(planar.panels, thickness=2e-3))
    assert named(Twin(stiff, seed=1, grip=Covered()), 0.3) >= 34


def test_drags_through_covers_change_one_name_at_most(planar):
    twin = Twin(planar, seed=1, grip=Covered())
    for drag in ((0.3, 0.0), (0.0, -0.3), (0.21, 0.21)):
        assert named(twin, 0.3, drag) >= 29


def test_a_drag_that_sticks_to_the_sheet_moves_it_too_far_for_theory(planar):
    """A soft sheet sways by more than it folds, and turns: no one share of S26's kind helps."""
    assert named(Twin(planar, seed=1), 0.3, (0.3, 0.0)) < 12


@pytest.mark.parametrize("seed", [1, 2, 7])
@pytest.mark.parametrize("grip", [Sticking(), Covered()])
def test_statics_name_the_cells_of_the_whole_sheet(planar, grip, seed):
    """Over the nodal line of the lower chip's z too, where it does not weigh a press."""
    twin = Twin(planar, seed=seed, grip=grip)
    for force in (0.1, 0.3, 1.0):
        assert named(twin, force, grip=grip) >= 35


@pytest.mark.parametrize("grip", [Sticking(), Covered()])
def test_statics_name_cells_under_drags(planar, grip):
    twin = Twin(planar, seed=1, grip=grip)
    for drag in ((0.3, 0.0), (0.0, -0.3), (0.21, 0.21)):
        assert named(twin, 0.3, drag, grip) >= 34


def test_small_drags_of_hard_presses_are_not_told_from_the_hold(planar):
    """What the finger holds is known to a fifth; a drag as large as that goes to other cells."""
    assert named(Twin(planar, seed=1), 1.0, (0.3, 0.0), Sticking()) < 30


@pytest.mark.parametrize(("drag", "least"), [(0.0, 0.97), (0.3, 0.85)])
@pytest.mark.parametrize("grip", [Sticking(), Covered()])
def test_statics_name_the_cells_of_made_skins(planar, grip, drag, least):
    skins = [Twin(planar, seed=seed, manufactured=True, grip=grip) for seed in (1, 2, 3)]
    names = [named(skin, 0.3, (drag, 0.0), grip) for skin in skins]
    assert np.mean(names) >= least * 36


@pytest.mark.parametrize(("grip", "least"), [(Sticking(), 0.93), (Covered(), 0.8)])
def test_made_skins_are_named_from_where_their_magnets_rest(planar, grip, least):
    skins = [Twin(planar, seed=seed, manufactured=True, grip=grip) for seed in (1, 3, 4)]
    assert np.mean([named(skin, 0.5) for skin in skins]) >= least * 36


@pytest.mark.parametrize("tesla", [0.4, 0.7, 1.0])
def test_other_magnets_are_made_up_for_by_gaps(planar, tesla):
    """Left as designed, weak ones name 21 cells at 0.1 N."""
    twin = Twin(suited_to(planar, tesla / VACUUM_PERMEABILITY), seed=1)
    assert named(twin, 0.1) >= 33
    assert named(twin, 0.3) >= 34
