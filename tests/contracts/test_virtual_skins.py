"""What every virtual skin must do, whatever its mechanics."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from smoskin.design.document import read_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import Touches, touches_of
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact, Motion
from smoskin.roles import VirtualSkin
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

ONE = Contact(position=(0.052, 0.0667), force=(0.08, -0.05, -0.5))
OTHER = Contact(position=(0.09, 0.12), force=(0.0, 0.0, -0.3))
FAR_OFF = Contact(position=(0.05, 0.161), force=(0.0, 0.0, -0.5))


@pytest.fixture(
    scope="module",
    params=[(Twin, "planar"), (Twin, "curved"), (ReducedTwin, "planar"), (ReducedTwin, "curved")],
    ids=lambda param: f"{param[0].__name__}-{param[1]}",
)
def kind(request):
    return request.param


@pytest.fixture(scope="module")
def design(kind) -> SkinDesign:
    return read_design(kind[1])


@pytest.fixture(scope="module")
def make(kind, design) -> Callable[..., VirtualSkin]:
    return lambda seed=None: kind[0](design, seed=seed)


@pytest.fixture(scope="module")
def ideal(make) -> VirtualSkin:
    return make()


def test_untouched_it_is_at_rest(ideal, design):
    motion, rest = ideal.motion(), Motion.rest(len(design.magnets))
    assert_array_equal(motion.magnets, rest.magnets)
    assert_array_equal(motion.board, rest.board)
    assert motion.valid
    assert motion.valid.shape == ()
    sheet = geometry(design).sheet
    assert_allclose(ideal.sheet_vertices(), sheet.vertices, atol=1e-15)
    assert ideal.depths([]).shape == (0,)


def test_many_states_are_those_of_each(ideal):
    cases = [[ONE], [], [OTHER, ONE]]
    many = ideal.motions(touches_of(cases))
    assert many.magnets.shape == (3, len(ideal.design.magnets), 6)
    assert many.board.shape == (3, 6)
    assert many.valid.tolist() == [True] * 3
    for row, case in enumerate(cases):
        alone = ideal.motion(case)
        assert_allclose(many[row].magnets, alone.magnets, atol=1e-4 * np.abs(many.magnets).max())
        assert_allclose(many[row].board, alone.board, atol=1e-4 * np.abs(many.board).max())


def test_a_place_without_force_is_no_touch(ideal):
    """Wherever it lies."""
    alone = Touches(position=[[ONE.position]], force=[[ONE.force]])
    filled = Touches(position=[[(9.0, 9.0), ONE.position]], force=[[(0.0, 0.0, 0.0), ONE.force]])
    single, same = ideal.motions(alone), ideal.motions(filled)
    assert_allclose(same.magnets, single.magnets, atol=1e-9)


def test_a_reading_is_the_motions(make):
    skin, same = make(seed=3), make(seed=3)
    for contacts, degrees in (([ONE], 25.0), ([], 40.0)):
        motion = skin.motion(contacts, temperature=degrees)
        sensed = skin.sense(motion, time=1.5, temperature=degrees)
        assert same.read(contacts, time=1.5, temperature=degrees) == sensed
        assert sensed.time == 1.5
        assert_allclose(sensed.temperature, degrees, atol=0.1)


def test_ideal_chips_read_the_field_in_their_own_axes(ideal, design):
    motion = ideal.motion([ONE])
    reading, field = ideal.sense(motion), ideal.field(motion)
    board = Rotation.from_rotvec(motion.board[3:]).as_matrix()
    own = geometry(design).chip_axes @ mlx90393.rotations(design.halls)
    turned = np.einsum("sij,sj->si", board @ own, reading.field)
    assert_allclose(turned, field, atol=1e-15)


def test_samples_have_the_noise_of_their_generator_alone(ideal, design):
    motion = ideal.motions(touches_of([[ONE], []]))
    first, same, other = (ideal.sample(motion, np.random.default_rng(k)).counts for k in (7, 7, 8))
    assert first.shape == (2, len(design.halls), 3)
    assert_array_equal(first, same)
    assert (first != other).any()


def test_an_invalid_state_is_a_bad_measurement(make):
    for seed in (None, 0):
        skin = make(seed=seed)
        lost = skin.motion([ONE]).where(np.array(False))
        assert skin.sense(lost).flags.tolist() == [int(ChipFlag.INVALID)] * len(skin.design.halls)
        assert np.isnan(skin.field(lost)).all()


def test_every_answer_is_of_the_temperature_asked_for(ideal):
    """Whatever was asked before: cold after warm is cold, in each of the answers."""
    answers = {
        "motion": lambda t: ideal.motion([ONE], temperature=t).magnets[1:, :3],
        "motions": lambda t: ideal.motions(touches_of([[ONE]]), temperature=t).magnets[:, 1:, :3],
        "depths": lambda t: ideal.depths([ONE], temperature=t),
        "vertices": lambda t: ideal.sheet_vertices([ONE], temperature=t) - ideal.sheet_vertices(),
    }
    for name, answer in answers.items():
        cold = np.abs(answer(25.0)).max()
        ideal.motion([OTHER], temperature=45.0)
        warm = np.abs(answer(45.0)).max()
        ideal.motion([OTHER], temperature=45.0)
        assert np.abs(answer(25.0)).max() == pytest.approx(cold, rel=1e-4), name
        assert 0.85 * cold < warm < 0.99 * cold, name
    depth = ideal.depths([ONE])
    ideal.motion([OTHER], temperature=45.0)
    assert_allclose(ideal.depths([ONE]), depth, rtol=1e-4)


def test_the_skin_sinks_under_each_finger(ideal, design):
    skin = geometry(design)
    fingers = {
        cell: Contact(position=skin.tops[cell], force=(0, 0, -force))
        for cell, force in (((2, 3), 0.5), ((4, 1), 0.1))
    }
    # Round a limb a finger widens the arc, which rises elsewhere: there one at a time.
    together = [[finger] for finger in fingers.values()]
    if design.limb is None:
        together.append([*fingers.values()])
    for contacts in together:
        depths = ideal.depths(contacts)
        moved = ideal.sheet_vertices() - ideal.sheet_vertices(contacts)
        sunk = (moved * skin.axes[..., 2]).sum(axis=1)[skin.sheet.loaded]
        for contact, depth in zip(contacts, depths, strict=True):
            [cell] = [cell for cell, finger in fingers.items() if finger is contact]
            assert 5e-6 < depth < 2e-3
            assert 0.8 * sunk[cell] < depth <= 1.001 * sunk[cell]
    if design.limb is None:
        deep, shallow = depths
        assert 1e-5 < shallow < deep


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        (Contact(position=(-0.01, 0.05), force=(0, 0, -0.5)), "position must lie on the skin"),
        (FAR_OFF, "position must lie on the skin"),
        (Contact(position=(0.05, 0.05), force=(0, 0, 0.01)), "force must be finite and press"),
        (Contact(position=(0.05, 0.05), force=(0, 0, np.nan)), "force must be finite and press"),
    ],
)
def test_impossible_touches_are_refused(ideal, contact, message):
    for act in (ideal.check, ideal.read, ideal.motion, ideal.depths, ideal.sheet_vertices):
        with pytest.raises(ArgumentError, match=message):
            act([ONE, contact])


def test_touches_just_on_the_rim_are_taken(ideal):
    ideal.check([Contact(position=(0.0, 0.16), force=(0, 0, -0.5))])


@pytest.mark.parametrize("degrees", [75.5, -40.5, np.nan])
def test_a_temperature_that_no_skin_stands_is_refused(ideal, degrees):
    for act in (ideal.motion, ideal.depths, ideal.sheet_vertices, ideal.read):
        with pytest.raises(ArgumentError, match="temperature must lie in"):
            act([ONE], temperature=degrees)
