"""From motion to readings: frames against magpylib's own, and what the chips add."""

from dataclasses import replace

import magpylib
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from magpylib_oracle import magpylib_disc
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Motion
from smoskin.twin.manufacture import Tolerances, as_designed, draw, drawn_skin
from smoskin.twin.readout import Readout
from smoskin.twin.surroundings import Ambience, Neighbour, Surroundings

EARTH = (20e-6, -5e-6, -45e-6)


def some_motion(rng, design, batch=()) -> Motion:
    """Half a millimetre, a degree or two, sheet and board."""
    magnets = rng.normal(size=(*batch, len(design.magnets), 6))
    magnets *= [3e-4, 3e-4, 1e-4, 0.03, 0.03, 0.03]
    magnets[..., [m.mount == "base" for m in design.magnets], :] = 0.0
    board = rng.normal(size=(*batch, 6)) * [2e-4, 2e-4, 1e-4, 0.01, 0.01, 0.02]
    return Motion(magnets=magnets, board=board)


def still(design) -> Motion:
    return Motion.rest(len(design.magnets))


def test_made_skins_rest_well_within_what_every_chip_reads(planar):
    counts = [
        Readout(planar, drawn_skin(planar, seed)).seen(still(planar))
        / mlx90393.sensitivity(planar.hall_setting)
        for seed in range(100)
    ]
    assert np.abs(counts).max() < 0.93 * 20_000


def magpylib_reading(design, made, around, motion):
    """The same skin built of magpylib's objects, moved by its own rotations; (S, 3), T."""
    extent = geometry(design).cell
    # The pillars' tops, in the middle.
    middle = [design.cells[0] * extent.length / 2, design.cells[1] * extent.width / 2]
    middle.append(-design.columns.height - design.board.thickness)
    turn, slide = Rotation.from_rotvec(motion.board[3:]), motion.board[:3]
    sources = []
    for g, (magnet, place) in enumerate(zip(design.magnets, geometry(design).magnets, strict=True)):
        strong = replace(magnet, remanence=magnet.remanence * made.remanence[g])
        disc = magpylib_disc(strong, place, made.magnet_turn[g])
        disc.move(made.magnet_place[g])
        if magnet.mount == "sheet":
            disc.rotate(Rotation.from_rotvec(motion.magnets[g, 3:]))
            disc.move(motion.magnets[g, :3])
            disc.rotate(turn, anchor=middle)
            disc.move(slide)
        sources.append(disc)
        for neighbour in around.neighbours:
            other = magpylib_disc(magnet, place, [0, 0, 0])
            other.rotate(Rotation.from_rotvec(neighbour.turn.copy()), anchor=(0, 0, 0))
            other.move(neighbour.place)
            sources.append(other)
    seen = []
    for s, site in enumerate(design.halls):
        chip = magpylib.Sensor(
            position=geometry(design).chips[s] + made.chips.place[s],
            orientation=Rotation.from_matrix(mlx90393.rotation(site)),
        )
        chip.rotate(Rotation.from_rotvec(made.chips.turn[s].copy()))
        chip.rotate(turn, anchor=middle)
        chip.move(slide)
        with np.errstate(all="ignore"):
            field = magpylib.getB(sources, chip, sumup=True)
        seen.append(field + chip.orientation.inv().apply(around.earth.copy()))
    return made.chips.answers(np.stack(seen))


@pytest.mark.parametrize("seed", range(4))
def test_a_made_skin_that_has_moved_reads_what_magpylib_says(planar, seed):
    rng = np.random.default_rng(seed)
    wide = Tolerances(magnet_tilt=0.1, chip_tilt=0.1, magnet_place=5e-4, chip_place=5e-4)
    made, motion = draw(planar, rng, wide), some_motion(rng, planar)
    around = Surroundings(
        earth=EARTH,
        neighbours=(Neighbour(place=(0.1, 0.0, 0.02), turn=(0.1, 0.2, 0.7)),),
    )
    ours = Readout(planar, made, around).seen(motion)
    assert_allclose(ours, magpylib_reading(planar, made, around, motion), rtol=1e-6, atol=5e-8)


def test_a_board_that_carries_everything_along_changes_nothing(planar):
    """Without a magnet on the base and without the Earth, nobody sees the board move."""
    alone = replace(planar, magnets=planar.magnets[1:], halls=planar.halls[1:])
    readout, rng = Readout(alone), np.random.default_rng(0)
    motion = some_motion(rng, alone)
    parked = replace(motion, board=np.zeros(6))
    assert_allclose(readout.seen(motion), readout.seen(parked), rtol=1e-9, atol=1e-13)


def test_the_earth_turns_in_the_chips_as_the_board_turns(planar):
    there, without = Readout(planar, surroundings=Surroundings(earth=EARTH)), Readout(planar)
    quarter = replace(still(planar), board=np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.pi / 2]))
    felt = there.seen(quarter) - without.seen(quarter)
    for s, site in enumerate(planar.halls):
        turned = Rotation.from_rotvec([0, 0, -np.pi / 2]).apply(EARTH)
        assert_allclose(felt[s], mlx90393.rotation(site).T @ turned, atol=1e-15)
    assert_allclose(there.field(still(planar)) - without.field(still(planar)), [EARTH] * 3)


def test_a_neighbour_far_away_is_not_felt_and_one_beside_is(planar):
    rest, alone = still(planar), Readout(planar)
    felt = [
        np.abs(
            Readout(
                planar, surroundings=Surroundings(neighbours=(Neighbour(place=(x, 0, 0)),))
            ).field(rest)
            - alone.field(rest)
        ).max()
        for x in (0.12, 1.2)
    ]
    assert felt[0] > 5e-8 > 1e-10 > felt[1]


def test_a_batch_is_its_states(planar):
    readout, rng = Readout(planar), np.random.default_rng(0)
    motion = some_motion(rng, planar, (2, 3))
    warmth = np.linspace(20, 40, 6).reshape(2, 3)
    seen = readout.seen(motion, warmth)
    assert seen.shape == (2, 3, 3, 3)
    assert_allclose(seen[1, 2], readout.seen(motion[1, 2], 40.0), rtol=1e-9, atol=1e-14)


def test_heat_weakens_the_field_of_the_magnets_alone(planar):
    readout = Readout(planar, surroundings=Surroundings(earth=EARTH))
    rest = still(planar)
    cold, warm = readout.field(rest), readout.field(rest, 35.0)
    assert_allclose(warm - EARTH, 0.95 / 0.955 * (cold - EARTH), atol=1e-15)


@pytest.mark.parametrize("degrees", [-41.0, 76.0, float("nan")])
def test_a_temperature_that_no_skin_stands_is_refused(planar, degrees):
    with pytest.raises(ArgumentError, match=r"temperature must lie in .*75 degC"):
        Readout(planar).read(still(planar), None, temperature=degrees)


def test_an_invalid_state_is_a_bad_measurement(planar):
    lost = still(planar).scaled(np.nan)
    for rng in (None, np.random.default_rng(0)):
        reading = Readout(planar).read(lost, rng)
        assert reading.flags.tolist() == [int(ChipFlag.INVALID)] * 3


def test_ideal_and_noisy_chips_agree_within_noise_and_steps(planar):
    readout, rng = Readout(planar), np.random.default_rng(0)
    motion = some_motion(rng, planar, (2000,))[np.zeros(2000, dtype=int)]
    counts = readout.sample(motion, rng).counts
    step = mlx90393.sensitivity(planar.hall_setting)
    off = (counts * step - readout.seen(motion)).mean(axis=0) / step
    assert np.all((off > -1.0) & (off < 0.0))


def test_as_designed_deviates_by_nothing(planar):
    motion = some_motion(np.random.default_rng(1), planar)
    assert_allclose(Readout(planar, as_designed(planar)).seen(motion), Readout(planar).seen(motion))


def test_surroundings_must_be_finite():
    with pytest.raises(ArgumentError, match="earth must be three finite numbers"):
        Surroundings(earth=(0.0, float("nan"), 0.0))
    with pytest.raises(ArgumentError, match=r"place must have shape \(\.\.\., 3\)"):
        Neighbour(place=(0.0, 1.0))


def test_each_chip_tells_a_warmth_of_its_own(planar):
    made = draw(planar, np.random.default_rng(1), Tolerances(chip_warmth=2.0))
    readout, own = Readout(planar, made), made.chips.warmth
    assert np.abs(own).min() > 0.2
    ideal = readout.read(still(planar), None, temperature=30.0)
    assert_allclose(ideal.temperature, 30.0 + own, rtol=1e-12)
    noisy = readout.read(still(planar), np.random.default_rng(0), temperature=30.0)
    assert_allclose(noisy.temperature, 30.0 + own, atol=0.1)


def test_warm_chips_read_less_of_every_field(planar):
    """The magnets' field hardly weakens; what a warm skin reads of the Earth's falls as well."""
    earth = Surroundings(earth=(30e-6, -40e-6, 55e-6))
    alone, around = Readout(planar), Readout(planar, surroundings=earth)
    rest = still(planar)
    assert_allclose(
        around.seen(rest, 45.0) - alone.seen(rest, 45.0),
        0.91 * (around.seen(rest) - alone.seen(rest)),
        atol=1e-15,
    )
    assert_allclose(alone.seen(rest, 45.0), 0.9 * alone.seen(rest), rtol=1e-12)
    assert_allclose(alone.field(rest, 45.0), 0.9 / 0.91 * alone.field(rest), rtol=1e-12)


def test_a_chip_warmer_than_its_magnet_reads_less_than_the_magnet_gives(planar):
    none = np.zeros((1, 3))
    chips_alone = Ambience(field=np.zeros((1, 3, 3)), magnets=none, chips=none + 2.0)
    rest = Motion.rest(len(planar.magnets), (1,))
    plain = Readout(planar)
    assert_allclose(
        plain.seen(rest, np.array([25.0]), chips_alone), 0.991 * plain.seen(rest), rtol=1e-12
    )
