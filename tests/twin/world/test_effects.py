"""Effects: each does what its record says, and leaves all the others alone."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("jax")

from smoskin.errors import ArgumentError
from smoskin.mechanics.reduced.stiffness import board_stiffness
from smoskin.mechanics.sheet.contact import Bilinear
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Motion, Reading
from smoskin.twin.manufacture import Tolerances
from smoskin.twin.whole import Twin
from smoskin.twin.world.arm import TURNING, Gravity
from smoskin.twin.world.arrival import Arrival
from smoskin.twin.world.effect import Effect, World, rng_of
from smoskin.twin.world.fields import Earth, Motor, Steel, Warmth
from smoskin.twin.world.making import Contact, Debonded, Fingers, Glue, Sectors
from smoskin.twin.world.memory import Friction, Loops
from smoskin.twin.world.strangers import STRANGERS
from smoskin.twin.world.worlds import EFFECTS, HARD, LIMB, PLAIN, world_of

TIMES = np.linspace(-1.0, 12.0, 40)


@pytest.fixture(scope="module")
def twin(planar):
    return Twin(planar, seed=2, manufactured=True)


def moving(count):
    """A motion of three magnets and a board that goes to and fro."""
    wave = np.sin(np.linspace(0, 9, count))[:, None]
    return Motion(
        magnets=np.repeat(1e-4 * wave[:, None], 3, axis=1) * np.ones(6),
        board=1e-5 * wave * np.ones(3),
    )


def test_a_world_of_nothing_is_the_plain_one(planar, twin):
    nothing = World(name="nothing", effects=(Effect(),))
    for world in (PLAIN, nothing):
        skin = world.skin(planar, 2)
        assert_array_equal(skin.deviations.columns, twin.deviations.columns)
        assert skin.contact == Bilinear()
        motion = skin.motions(Touches(position=[[(0.05, 0.07)]], force=[[(0.0, 0.0, -0.5)]]))
        run = world.run(skin, (2, 1))
        assert run.moved(TIMES[:1], motion) is motion
        assert run.around(TIMES) is None
        assert run.arrived([]) == []
    assert (PLAIN.plain, nothing.plain) == (True, False)


def test_one_effect_more_leaves_the_others_as_they_are(planar, twin):
    alone = World(name="a", effects=(Motor(),))
    both = World(name="b", effects=(Earth(), Motor()))
    earth = World(name="c", effects=(Earth(),))
    a, b, c = (world.run(twin, (5, 6)).around(TIMES).field for world in (alone, both, earth))
    assert_allclose(a + c, b, atol=1e-18)
    other = alone.run(twin, (5, 7)).around(TIMES).field
    assert np.abs(other - a).max() > 1e-6
    first, second = (
        World(name="d", effects=(Debonded(),)),
        World(name="e", effects=(Sectors(), Debonded())),
    )
    lost = [w.skin(planar, 4).deviations.columns for w in (first, second)]
    assert_array_equal(*lost)


def test_a_bench_knows_nothing_of_the_arm(twin):
    hard = HARD.run(twin, (1,), bench=True)
    around = hard.around(TIMES)
    assert not around.field.any()
    assert around.chips.any()


def test_the_earth_keeps_its_strength_and_the_zero_is_taken_before_the_arm_moves(twin):
    field = Earth().ambience(twin, np.random.default_rng(0), TIMES).field
    assert_allclose(np.linalg.norm(field, axis=-1), 60e-6, rtol=1e-9)
    assert_array_equal(field[TIMES <= 0], np.broadcast_to(field[0], field[TIMES <= 0].shape))
    half = np.argmin(np.abs(TIMES - TURNING.period / 2))
    turned = np.arccos(field[half, 0] @ field[0, 0] / 60e-6**2)
    assert 0.2 < turned <= TURNING.angle + 1e-9


def test_the_field_and_the_weight_turn_with_one_arm(twin):
    seed = (3, 1)
    rngs = [rng_of(effect, seed) for effect in (Earth(), Gravity(), Steel())]
    assert len({rng.integers(1 << 40) for rng in rngs}) == 1


def test_weight_moves_the_board_as_it_says(planar, twin):
    history = Gravity().history(twin, np.random.default_rng(1))
    rest = Motion.rest(3, (len(TIMES),))
    moved = history.steps(TIMES, rest)
    assert not moved.magnets[TIMES <= 0].any()
    level = np.argmin(np.abs(TIMES - TURNING.period / 2))
    shift = np.hypot(*moved.board[level, :2])
    # A quarter turn: all that moves, some 210 g, pulls sideways.
    weight = shift * board_stiffness(planar) * twin.deviations.shear_layer
    assert 1.7 < weight < 2.5
    assert not moved.magnets[:, 0].any()  # on the base
    assert 1e-6 < np.abs(moved.magnets[level, 1:, :2]).max() < 2e-3


def test_a_motor_is_a_dipole_that_goes_round(twin, planar):
    motor = Motor()
    assert 2e-7 * motor.moment / 0.05**3 == pytest.approx(100e-6, rel=0.05)
    field = motor.ambience(twin, np.random.default_rng(0), TIMES).field
    assert not field[TIMES <= 0].any()
    strengths = np.linalg.norm(field[TIMES > 0], axis=-1)
    assert 1e-6 < strengths.min() < strengths.max() < 100e-6
    assert_allclose(
        replace(motor, moment=0.12).ambience(twin, np.random.default_rng(0), TIMES).field, 2 * field
    )


def test_motor_and_steel_inside_a_limb_lie_60_mm_under_its_skin(curved):
    limb = Twin(curved, seed=1)
    chips = geometry(curved).chips
    middle = np.append(geometry(curved).extent / 2, -0.06)
    assert np.hypot(middle[1] - geometry(curved).roll.middle, middle[2] + 0.08) < 0.03
    inside = [effect for effect in LIMB.effects if effect not in HARD.effects]
    assert [type(effect) for effect in inside] == [Motor, Steel]
    motor = EFFECTS["motor-inside"]
    fields = motor.ambience(limb, np.random.default_rng(0), TIMES).field
    spun = np.linalg.norm(fields[TIMES > 0], axis=-1)
    # Across its moment a dipole has half of what it has along it.
    along = 2e-7 * motor.moment / np.linalg.norm(chips - middle, axis=1) ** 3
    assert ((0.49 * along < spun) & (spun < 1.001 * along)).all()
    assert 80e-6 < along.max() < 130e-6


def test_steel_answers_the_earth_as_a_sphere_of_iron_does(twin):
    soft = replace(Steel(), remanence=0.0, travel=0.0)
    large = replace(soft, radius=2 * soft.radius)
    weak, strong = (
        steel.ambience(twin, np.random.default_rng(0), TIMES).field for steel in (soft, large)
    )
    assert_allclose(strong, 8 * weak)
    # On the surface, in line with the field, iron doubles what it adds: (a / r)^3 2 B.
    place = np.array(soft.place) * [*np.array([0.12, 0.16]), 1.0]
    nearest = np.linalg.norm(twin.readout._chips - place, axis=1).min()
    assert np.abs(weak).max() <= 2 * 60e-6 * (soft.radius / nearest) ** 3 * 1.05


def test_warm_chips_read_warm_and_their_magnets_follow_half_way(twin):
    around = Warmth().ambience(twin, np.random.default_rng(0), TIMES)
    assert not around.chips[TIMES <= 0].any()
    assert_allclose(around.magnets, around.chips / 2)
    assert (np.diff(around.chips[TIMES > 0], axis=0) > 0).all()
    assert np.ptp(around.chips[-1]) > 0
    still = Motion.rest(3, (len(TIMES),))
    cold = twin.readout.seen(still, np.full(len(TIMES), 25.0))
    warm = twin.readout.seen(still, np.full(len(TIMES), 25.0), around)
    ratio = warm[-1, 0] / cold[-1, 0]
    assert_allclose(ratio, 1 - 0.005 * around.magnets[-1, 0], rtol=0.02)


def test_readings_come_late_or_not_at_all_but_in_order():
    readings = [
        Reading(time=0.1 * k, field=np.zeros((3, 3)), temperature=np.full(3, 25.0),
                flags=np.zeros(3, dtype=int))
        for k in range(2000)
    ]  # fmt: skip
    there = Arrival().arrived(readings, np.random.default_rng(0))
    assert len(there) == 2000
    lost = sum(reading is None for reading in there) / 2000
    assert 0.04 < lost < 0.12
    late = [reading.time - 0.1 * k for k, reading in enumerate(there) if reading is not None]
    assert np.mean(late) == pytest.approx(5e-3, rel=0.1)
    times = [reading.time for reading in there if reading is not None]
    assert (np.diff(times) > 0).all()
    again = Arrival(lost=0.0, burst=0.0, delay=0.0).arrived(readings, np.random.default_rng(0))
    assert [reading.time for reading in again] == [reading.time for reading in readings]


def test_loops_do_not_depend_on_pace_and_close(twin):
    ranges = Motion(magnets=np.full((3, 6), 1e-4), board=np.full(6, 1e-5))
    way = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, 0, 50), np.linspace(0, 1, 50)])

    def loop(values):
        loops = Loops(ranges, 0.05, (0.02, 0.06, 0.2))
        motion = Motion(
            magnets=values[:, None, None] * ranges.magnets, board=values[:, None] * ranges.board
        )
        return loops.steps(np.arange(float(len(values))), motion).magnets[:, 1, 2] / 1e-4

    out = loop(way)
    up, down, again = out[:50], out[50:100][::-1], out[100:]
    # A loop is 2 w sum(r) wide, and what is left at the end w sum(r).
    assert np.abs(down - up)[25] == pytest.approx(2 * 0.05 * 0.28, rel=1e-6)
    assert down[0] == pytest.approx(0.05 * 0.28, rel=1e-6)
    assert_allclose(again[25:], up[25:], atol=1e-12)
    assert_allclose(loop(np.repeat(way, 3))[::3], out, atol=1e-12)


def test_plays_stay_where_a_motion_is_none():
    ranges = Motion(magnets=np.full((1, 6), 1.0), board=np.full(6, 1.0))
    values = np.array([0.0, 1.0, np.nan, 0.5])
    motion = Motion(
        magnets=values[:, None, None] * np.ones((1, 6)), board=values[:, None] * np.ones(6)
    )
    out = Loops(ranges, 0.1, (0.3,)).steps(np.arange(4.0), motion)
    assert np.isnan(out.magnets[2]).all()
    assert_allclose(out.board[3], 0.5 + 0.1 * (0.7 - 0.5))
    for wrong in ((0.5, (0.1, 0.2)), (-0.1, (0.1,)), (0.1, (-0.1,))):
        with pytest.raises(ArgumentError, match="weight and plays must be"):
            Loops(ranges, *wrong)


def by_friction(values, share=0.12, width=0.12):
    """The first component of a motion of 1 a newton, with friction."""
    ranges = Motion(magnets=np.ones((1, 6)), board=np.zeros(6))
    motion = Motion(
        magnets=values[:, None, None] * np.ones((1, 6)), board=values[:, None] * np.ones(6)
    )
    out = Friction(ranges, share, width).steps(np.arange(float(len(values))), motion)
    assert_array_equal(out.board, motion.board)  # where nothing moves under touches
    return out.magnets[:, 0, 0]


def test_friction_is_the_bouc_wen_law_whatever_the_steps():
    """Its differential equation in small steps, by an integration of its own."""
    turns = [0.0, 1.0, 0.0, 0.3, 0.05, 0.1, -0.2, 0.0]
    z, slow = 0.0, [0.0]
    for begin, end in itertools.pairwise(turns):
        for step in np.full(4000, (end - begin) / 4000):
            middle = z + (step - (abs(step) * z + step * abs(z)) / 0.24) / 2
            z += step - (abs(step) * middle + step * abs(middle)) / 0.24
        slow.append(end - 0.12 * z)
    assert_allclose(by_friction(np.array(turns)), slow, atol=1e-7)
    fine = np.interp(np.linspace(0, 7, 701), range(8), turns)
    assert_allclose(by_friction(fine)[::100], slow, atol=1e-7)
    invalid = np.insert(fine, 50, np.nan)
    assert_allclose(np.delete(by_friction(invalid), 50), by_friction(fine))


def test_friction_leaves_as_much_as_plays_do():
    """Of touches of 0.1 to 1 N, a few per cent; but small loops inside a large one go on."""
    ranges = Motion(magnets=np.ones((1, 6)), board=np.ones(6))
    for force in (0.1, 0.3, 1.0):
        values = np.array([0.0, force, 0.0])
        motion = Motion(
            magnets=values[:, None, None] * np.ones((1, 6)), board=values[:, None] * np.ones(6)
        )
        plays = Loops(ranges, 0.05, (0.02, 0.06, 0.2)).steps(values, motion).magnets[-1, 0, 0]
        assert plays / 1.6 < by_friction(values)[-1] < 1.6 * plays
    small = by_friction(np.array([0.0, 1.0, *10 * [0.5, 0.55]]))[2::2]
    assert (np.diff(small) < -1e-5).all() or (np.diff(small) > 1e-5).all()
    for wrong in ((1.0, 0.1), (-0.1, 0.1), (0.1, 0.0)):
        with pytest.raises(ArgumentError, match="share must be"):
            Friction(ranges, *wrong)


def test_skins_are_made_worse_as_each_effect_says(planar, twin):
    usual = Tolerances()
    worse = Glue().tolerances(usual)
    assert worse.magnet_place == 2 * usual.magnet_place
    assert worse.column_height == 2 * usual.column_height
    assert (worse.remanence, worse.chip_zero) == (usual.remanence, usual.chip_zero)
    lost = Debonded().skin(planar, twin.deviations, np.random.default_rng(0)).columns
    assert ((lost / twin.deviations.columns) < 0.01).sum() == 1
    skin = World(name="s", effects=(Sectors(),)).skin(planar, 2)
    assert skin.deviations.sectors.shape == (3, 4)
    assert 0.02 < skin.deviations.sectors.std() < 0.09
    rest = Motion.rest(3)
    off = skin.readout.seen(rest) - twin.readout.seen(rest)
    assert 1e-5 < np.abs(off).max() < 5e-3


def test_every_skin_has_a_law_of_its_own_that_a_given_one_replaces(planar):
    world = World(name="c", effects=(Contact(),))
    laws = [world.skin(planar, seed).contact for seed in range(4)]
    assert laws == [STRANGERS[name] for name in Contact().laws]
    assert world.skin(planar, 0, Bilinear()).contact == Bilinear()


def test_fingers_are_as_wide_as_hertz_has_them():
    touches = Touches(position=np.zeros((500, 1, 2)), force=np.zeros((500, 1, 3)))
    wide = Fingers().fingers(touches, np.random.default_rng(0)).radius
    assert wide.min() == pytest.approx(2.47e-3, rel=0.02)
    assert wide.max() == pytest.approx(3.91e-3, rel=0.02)


def test_fingers_drag_no_more_than_friction_lets_them():
    rng = np.random.default_rng(1)
    force = np.concatenate(
        [rng.uniform(-0.4, 0.4, (300, 1, 2)), -rng.uniform(0.1, 1, (300, 1, 1))], -1
    )
    asked = Touches(position=np.zeros((300, 1, 2)), force=force)
    made = Fingers().fingers(asked, rng).force
    assert_array_equal(made[..., 2], force[..., 2])
    before, after = (np.hypot(f[..., 0], f[..., 1]) for f in (force, made))
    assert (after <= np.minimum(before, -0.8 * force[..., 2]) + 1e-12).all()
    assert_array_equal(made[before <= -0.2 * force[..., 2]], force[before <= -0.2 * force[..., 2]])
    assert_allclose(made[..., 0] * force[..., 1], made[..., 1] * force[..., 0], atol=1e-12)


def test_worlds_are_known_by_name():
    assert world_of() is PLAIN
    assert world_of("hard") is HARD
    assert (HARD.on_arm, PLAIN.on_arm) == (True, False)
    assert [name for name in EFFECTS if world_of(effect=name).on_arm] == ["gravity"]
    assert {effect.name for effect in (world_of(effect=n) for n in EFFECTS)} == set(EFFECTS)
    with pytest.raises(ArgumentError, match="world must be one of plain, hard, limb; got 'soft'"):
        world_of("soft")
    with pytest.raises(
        ArgumentError, match=r"effect must be one of stream, contact, .*; got 'rain'"
    ):
        world_of(effect="rain")
