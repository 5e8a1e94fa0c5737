"""Response tables: the functions they are made of, their fit and their file."""

import json
from dataclasses import asdict, replace
from importlib import resources

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.arrays import assign
from smoskin.commands.table import Effort
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics.mlx90393 import noise
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.response.basis import TouchBasis
from smoskin.sensing.response.fit import add_warmth, fit_response_table
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.sensing.signals.loops import Loops
from smoskin.twin.readout import Readout
from tables_of_response import (
    BASIS,
    motions,
    plain,
    presses,
    random_table,
    random_touches,
    reduced_table,
    signals,
    table_with_modes,
)

AT = np.array([[0.031, 0.047], [0.0601, 0.081], [0.10, 0.12], [0.003, 0.158]])
PUSH = np.array([[0.1, -0.05, -0.5], [0.0, 0.0, -0.9], [-0.2, 0.1, -0.3], [0.05, 0.0, -0.7]])


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def test_slopes_are_derivatives(skin):
    table = reduced_table(skin)
    slopes = table.slopes(AT, PUSH)
    for k, step in enumerate((1e-7, 1e-7, 1e-6, 1e-6, 1e-6)):
        ahead, behind = (np.concatenate([AT, PUSH], axis=1) for _ in range(2))
        ahead[:, k] += step
        behind[:, k] -= step
        change = table.signals(ahead[:, :2], ahead[:, 2:])
        change = change - table.signals(behind[:, :2], behind[:, 2:])
        assert slopes[..., k] == pytest.approx(change / (2 * step), rel=1e-4, abs=1e-6)


def test_presses_held_out_are_met_to_the_chips_noise(skin):
    table = reduced_table(skin)
    where, push = presses(skin, 200, seed=7)
    true = signals(skin, Readout(skin), motions(skin, where, push)).reshape(200, -1)
    missed = np.sqrt(np.mean((table.signals(where, push) - true) ** 2))
    assert missed < noise(skin.hall_setting).max()
    # It knows so itself.
    stated = np.sqrt(np.trace(table.misfit) / table.count * np.mean((push**2).sum(axis=1)))
    assert missed == pytest.approx(stated, rel=0.6)


def test_past_the_outermost_vertices_the_answer_goes_on(skin):
    """As on a lever: what a millimetre changes at the rim it changes just within the vertices."""
    table = reduced_table(skin)
    places = [[0.0, 0.05], [0.001, 0.05], [0.014, 0.05], [0.015, 0.05]]
    rim, rim_on, inner, inner_on = table.signals(places, np.tile(PUSH[0], (4, 1)))
    assert np.linalg.norm(rim_on - rim) > 0.3 * np.linalg.norm(inner_on - inner)


def test_warmer_rubber_takes_its_share_off_the_force(skin):
    table = reduced_table(skin)
    factor = 1 + 10 * table.softening
    assert factor > 1.02
    cool, warm = (
        table.signals(AT, PUSH / factor),
        table.signals(AT, PUSH, REFERENCE_TEMPERATURE + 10),
    )
    assert warm == pytest.approx(cool, abs=1e-12)
    # What a degree changes besides is fitted to what is left.
    where, push = presses(skin, 300, seed=3)
    per_degree = (
        table.signals(where, push, REFERENCE_TEMPERATURE + 1)
        - table.signals(where, push, REFERENCE_TEMPERATURE - 1)
    ) / 2
    same = add_warmth(table, where, push, per_degree.reshape(300, 3, 3))
    assert np.abs(same.warmth).max() < 1e-3 * np.abs(table.mean).max()


def test_two_touches_that_do_not_couple_add_up(skin):
    table = reduced_table(skin)
    where = np.stack([AT[:2], AT[2:]], axis=1)
    push = np.zeros((2, 2, 3))
    push[..., 2] = [[-0.5, -0.3], [-0.8, -0.4]]
    added = table.signals(where[:, 0], push[:, 0]) + table.signals(where[:, 1], push[:, 1])
    assert table.together(where, push) == pytest.approx(added)
    swapped = table.together(where[:, ::-1], push[:, ::-1])
    assert swapped == pytest.approx(added)


def test_modes_explain_skins_that_they_were_not_made_from(skin):
    from smoskin.twin.manufacture import draw

    table = table_with_modes(skin)
    where, push = presses(skin, 150, seed=11)
    motion = motions(skin, where, push)
    made = Readout(skin, draw(skin, np.random.default_rng([10, 0])))
    left = signals(skin, made, motion).reshape(150, -1) - table.signals(where, push)
    ways = table.mode_signals(where, push)
    weights = np.linalg.lstsq(ways[:75].swapaxes(1, 2).reshape(-1, len(table.modes)),
                              left[:75].ravel(), rcond=None)[0]  # fmt: skip
    after = left[75:] - np.einsum("bkc,k->bc", ways[75:], weights)
    assert np.sqrt(np.mean(after**2)) < 0.1 * np.sqrt(np.mean(left[75:] ** 2))


def test_chips_may_be_left_out(skin):
    table = table_with_modes(skin)
    fewer = table.of_chips((2, 1))
    full = table.signals(AT, PUSH).reshape(-1, 3, 3)
    assert fewer.signals(AT, PUSH) == pytest.approx(full[:, [2, 1]].reshape(-1, 6))
    with pytest.raises(ArgumentError, match=r"chips must be among \(0, 1, 2\); got \(3,\)"):
        table.of_chips((3,))


def test_the_file_gives_the_table_back(skin, tmp_path):
    pytest.importorskip("safetensors")
    table = table_with_modes(skin)
    table.save(tmp_path / "skin.response")
    back = load_response_table(tmp_path / "skin.response")
    assert back.design_hash == skin.content_hash
    assert back.chips == table.chips
    assert back.forces == table.forces
    assert np.array_equal(back.mean, table.mean)
    assert back.origin == table.origin
    # Half precision: eleven bits of each coefficient.
    np.testing.assert_allclose(back.modes, table.modes, rtol=2**-11, atol=1e-11)
    ways = table.mode_signals(AT, PUSH)
    np.testing.assert_allclose(back.mode_signals(AT, PUSH), ways, atol=1e-3 * np.abs(ways).max())
    np.testing.assert_array_equal(back.signals(AT, PUSH), table.signals(AT, PUSH))


def test_files_of_the_format_before_are_read(skin, tmp_path):
    tensors = pytest.importorskip("safetensors.numpy")
    table = table_with_modes(skin)
    table.save(tmp_path / "new")
    arrays = tensors.load_file(tmp_path / "new")
    for name in ("modes", "grip_modes"):
        arrays[name] = np.ascontiguousarray(getattr(table, name), np.float32)
    header = {
        "format": 2, "design": "d", "chips": [0, 1, 2], "forces_N": [0.1, 1.0],
        "softening_per_K": 0.003, "radius_m": 0.004, "signals": "",
    }  # fmt: skip
    for number in (3, 2, 1):
        text = json.dumps(header | {"format": number})
        tensors.save_file(arrays, tmp_path / str(number), {"smoskin_response_table": text})
    drawn, opened = len(table.modes), len(table.contact.spread)
    for number in ("2", "3"):
        back = load_response_table(tmp_path / number)
        np.testing.assert_allclose(back.modes[:drawn], table.modes, rtol=1e-6, atol=1e-15)
        # They took the law of contact as known, which a design's table does not.
        assert back.warp_modes.shape == (drawn + opened, opened)
        assert back.origin == {}
        assert back.residue == 0.0
    with pytest.raises(ModelError, match="format must be 4; got 1"):
        load_response_table(tmp_path / "1")


def test_the_table_that_ships_is_that_of_the_shipped_design(planar):
    table = load_response_table("planar")
    assert table.design_hash == planar.content_hash, (
        "the planar design has changed: remake its table with "
        "`smoskin table planar --out src/smoskin/sensing/response/planar.table`"
    )
    assert table.origin["effort"] == json.loads(json.dumps(asdict(Effort()))), (
        "the table that ships must be made with full effort, by `smoskin table planar`"
    )
    assert table.origin["smoskin"]
    file = resources.files("smoskin.sensing.response") / "planar.table"
    assert len(file.read_bytes()) < 3e6


def test_other_files_are_refused(tmp_path):
    tensors = pytest.importorskip("safetensors.numpy")
    shipped = r"table must be that of a shipped design \(curved, planar\) or"
    with pytest.raises(ModelError, match=shipped):
        load_response_table(tmp_path / "none")
    (tmp_path / "text").write_text("no tensors")
    with pytest.raises(ModelError, match="cannot be read as a response table"):
        load_response_table(tmp_path / "text")
    tensors.save_file({"mean": np.zeros(3)}, str(tmp_path / "other"))
    with pytest.raises(ModelError, match="a response table of this package must be given"):
        load_response_table(tmp_path / "other")


def test_a_flipped_bit_in_a_copy_of_the_shipped_table_is_refused(tmp_path):
    whole = (resources.files("smoskin.sensing.response") / "planar.table").read_bytes()
    for place in (len(whole) // 2, len(whole) - 1):
        copy = bytearray(whole)
        copy[place] ^= 1
        (tmp_path / "t.table").write_bytes(copy)
        with pytest.raises(ModelError, match=r"t\.table is damaged: its checksum does not fit"):
            load_response_table(tmp_path / "t.table")


def test_a_number_that_cannot_be_is_refused_with_file_and_entry(tmp_path):
    changes = {"softening": 1e30, "forces": (0.05, 1e300), "grip": 1e30, "curvature": -1e30}
    for name, wild in changes.items():
        table, size = random_table(), np.ones_like(getattr(random_table(), name))
        assign(table, **{name: tuple(wild) if name == "forces" else (wild * size)[()]})
        table.save(tmp_path / "wild.table")
        with pytest.raises(ModelError, match=rf"wild\.table: response table: {name} must (lie|be)"):
            load_response_table(tmp_path / "wild.table")


def test_wrong_tables_and_presses_are_refused(skin):
    table = reduced_table(skin)
    with pytest.raises(ModelError, match="mean must have shape"):
        replace(table, mean=table.mean[..., :2])
    with pytest.raises(ModelError, match="misfit must be finite"):
        replace(table, misfit=np.full_like(table.misfit, np.nan))
    with pytest.raises(ArgumentError, match="at least 3630"):
        fit_response_table(skin, AT, PUSH, np.zeros((4, 3, 3)))
    with pytest.raises(ArgumentError, match="lines_x must rise"):
        TouchBasis(extent=(0.1, 0.1), lines_x=[0.05, 0.02], lines_y=[0.05])
    assert isinstance(table, ResponseTable)


def test_signals_are_the_sums_of_softened_forces_and_warmth():
    table = random_table()
    place, force = random_touches(5)
    degrees = np.array([-7.0, 0.0, 3.0, 11.0, 20.0])
    softened = force / (1 + 0.004 * degrees)[:, None]
    rows = BASIS.rows(place, softened)
    expected = rows @ table.mean.reshape(-1, 9)
    expected = expected + degrees[:, None] * (rows @ table.warmth.reshape(-1, 9))
    batch = table.signals(place, force, REFERENCE_TEMPERATURE + degrees)
    assert_allclose(batch, expected, rtol=1e-9, atol=1e-15)
    for k, temperature in enumerate(REFERENCE_TEMPERATURE + degrees):
        (value,), _ = table.point_table(temperature).at(place[k : k + 1], force[k : k + 1])
        assert_allclose(value, expected[k], rtol=1e-9, atol=1e-15)
    assert_allclose(table.signals(place, force), BASIS.sums(table.mean, place, force))
    rows = BASIS.rows(place, force)
    for k in range(3):
        mode = rows @ table.modes[k].reshape(-1, 9)
        assert_allclose(table.mode_signals(place, force)[:, k], mode, rtol=1e-9, atol=1e-15)


def test_chips_left_out_take_everything_of_theirs_along():
    table = random_table()
    fewer = table.of_chips((2, 0))
    rows = [6, 7, 8, 0, 1, 2]
    assert fewer.chips == (2, 0)
    assert fewer.count == 6
    for name in ("mean", "warmth", "modes"):
        assert_allclose(getattr(fewer, name), getattr(table, name)[..., rows])
    for name in ("misfit", "pair_misfit"):
        assert_allclose(getattr(fewer, name), getattr(table, name)[rows][:, rows])
    assert_allclose(fewer.curvature, table.curvature[[2, 0]])
    assert_allclose(fewer.grip, table.grip)
    # Chips are known by their place in a reading, also where some have been left out.
    assert fewer.of_chips((0,)).chips == (0,)
    assert_allclose(fewer.of_chips((0,)).mean, table.mean[..., :3])
    with pytest.raises(ArgumentError, match=r"chips must be among \(2, 0\); got \(1,\)"):
        fewer.of_chips((1,))
    with pytest.raises(ArgumentError, match="chips must be among"):
        table.of_chips(())


def test_tables_of_arrays_that_do_not_fit_are_refused():
    table = random_table()
    for name in ("mean", "warmth", "modes", "grip", "grip_modes", "curvature", "misfit",
                 "pair_misfit"):  # fmt: skip
        array = getattr(table, name)
        with pytest.raises(ModelError, match=f"response table: {name} must have"):
            replace(table, **{name: array[..., :-1]})
        with pytest.raises(ModelError, match=f"response table: {name} must be finite"):
            replace(table, **{name: np.full_like(array, np.inf)})
        assert not array.flags.writeable
    with pytest.raises(ModelError, match="grip_modes must have"):
        replace(table, modes=table.modes[:2])
    for forces in ((0.0, 1.0), (0.5, 0.5), (1.0, 0.5)):
        with pytest.raises(ModelError, match="rising positive forces"):
            replace(table, forces=forces)
    assert table.origin == {}


def test_a_whole_table_comes_back_from_its_file(tmp_path):
    pytest.importorskip("safetensors")
    table = replace(random_table(chips=(2, 0)), origin={"effort": {"skins": 3}}, residue=0.01)
    table.save(tmp_path / "a")
    back = load_response_table(tmp_path / "a")
    for name in ("design_hash", "chips", "forces", "softening", "residue", "origin"):
        assert getattr(back, name) == getattr(table, name)
    for name in ("mean", "warmth", "grip", "curvature", "misfit", "pair_misfit"):
        np.testing.assert_array_equal(getattr(back, name), getattr(table, name))
    for name in ("extent", "lines_x", "lines_y", "exponents", "radius"):
        np.testing.assert_array_equal(getattr(back.basis, name), getattr(table.basis, name))
    largest = np.abs(table.grip_modes).max()
    assert_allclose(back.grip_modes, table.grip_modes, rtol=2**-11, atol=1e-11 * largest)
    assert back.loops is None
    weights = np.repeat([[0.1, 0.05], [0.0, 0.02]], 3, axis=1)
    loops = Loops(weights=weights, plays=[0.05, 0.2], reach=np.linspace(1e-3, 2e-3, 6))
    replace(table, loops=loops).save(tmp_path / "loops")
    other = load_response_table(tmp_path / "loops").of_chips((0,)).loops
    np.testing.assert_array_equal(other.weights, weights[:, 3:])
    np.testing.assert_array_equal(other.reach, loops.reach[3:])
    with pytest.raises(ModelError, match="loops must be of its 6 signals; got 3"):
        replace(table, loops=other)
    # The largest number may be negative.
    below = replace(table, modes=-np.abs(table.modes) - 1e-4)
    below.save(tmp_path / "below")
    back = load_response_table(tmp_path / "below")
    assert_allclose(back.modes, below.modes, rtol=2**-11)
    bare = replace(table, modes=table.modes[:0], grip_modes=table.grip_modes[:0])
    bare.save(tmp_path / "b")
    assert len(load_response_table(tmp_path / "b").modes) == 0


@pytest.mark.parametrize(("share", "known"), [(0.049, True), (0.051, False)])
def test_a_table_is_one_skins_where_modes_leave_5_percent_of_a_press_open(share, known):
    table = random_table(modes=1)
    assert replace(table, modes=share * table.mean[None]).calibrated is known
    by_drags = table.basis.exponents[:, :2].any(axis=1)[:, None]
    drags = np.where(by_drags, table.mean, share * table.mean)[None]
    assert replace(table, modes=drags).calibrated is known
