"""Files of what was learned: what is written is read, and anything else is refused."""

import json

import numpy as np
import pytest

from smoskin.errors import ModelError
from smoskin.sensing.files import TensorFile, check_filled, check_within, tensor_key

tensors = pytest.importorskip("safetensors.numpy")

KIND = TensorFile("a thing", "things", 3, older=(2,))
ARRAYS = {"a": np.arange(6.0).reshape(2, 3).T, "b": np.array([1, 2], dtype=np.int64)}


def both(arrays, header):
    return arrays, header


def test_what_is_written_is_read(tmp_path):
    KIND.write(tmp_path / "one", ARRAYS, {"name": "x", "format": 3})
    arrays, header = KIND.read(tmp_path / "one", ("b", "a"), both)
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(arrays[name], array)
        assert arrays[name].dtype == array.dtype
    assert header == {"name": "x", "format": 3}
    assert tensor_key(tmp_path / "one") == "things"


def test_other_kinds_formats_and_names_are_refused(tmp_path):
    KIND.write(tmp_path / "one", ARRAYS, {})
    for names in (("a",), ("a", "b", "c"), ("a", "c")):
        with pytest.raises(ModelError, match="a thing of this package must be given"):
            KIND.read(tmp_path / "one", names, both)
    with pytest.raises(ModelError, match="another of this package must be given"):
        TensorFile("another", "others", 3).read(tmp_path / "one", ("a", "b"), both)
    older, newer = (TensorFile("a thing", "things", n) for n in (2, 4))
    older.write(tmp_path / "old", ARRAYS, {})
    assert KIND.read(tmp_path / "old", ("a", "b"), both)[1] == {"format": 2}
    newer.write(tmp_path / "new", ARRAYS, {})
    with pytest.raises(ModelError, match="new: format must be 3; got 4"):
        KIND.read(tmp_path / "new", ("a", "b"), both)
    with pytest.raises(ModelError, match="format must be 2; got 3"):
        older.read(tmp_path / "one", ("a", "b"), both)


def test_damage_is_said_in_a_sentence(tmp_path):
    for text in ("no JSON", "{}", "[1]", json.dumps({"format": "3"})):
        tensors.save_file(dict(ARRAYS, a=ARRAYS["a"].copy()), tmp_path / "bad", {"things": text})
        with pytest.raises(ModelError, match=r"bad: (its description is damaged|format must be)"):
            KIND.read(tmp_path / "bad", ("a", "b"), both)
    KIND.write(tmp_path / "one", ARRAYS, {})

    def failing(error):
        def build(arrays, header):
            raise error

        return build

    for error in (KeyError("x"), TypeError("x"), ValueError("x")):
        with pytest.raises(ModelError, match="its description is damaged"):
            KIND.read(tmp_path / "one", ("a", "b"), failing(error))
    with pytest.raises(ModelError, match=r"one: said by its owner$"):
        KIND.read(tmp_path / "one", ("a", "b"), failing(ModelError("said by its owner")))


@pytest.mark.parametrize("seed", range(8))
def test_one_flipped_bit_is_refused_or_changes_nothing(tmp_path, seed):
    file, draw = tmp_path / "one", np.random.default_rng(seed)
    KIND.write(file, ARRAYS, {"name": "x"})
    whole = bytearray(file.read_bytes())
    for _ in range(40):
        place, bit = int(draw.integers(len(whole))), 1 << int(draw.integers(8))
        whole[place] ^= bit
        file.write_bytes(whole)
        try:
            arrays, header = KIND.read(file, ("a", "b"), both)
        except ModelError:
            pass
        else:
            assert header["name"] == "x"
            assert all(np.array_equal(arrays[name], ARRAYS[name]) for name in ARRAYS)
        whole[place] ^= bit


def test_a_changed_number_does_not_fit_the_checksum_and_older_files_have_none(tmp_path):
    KIND.write(tmp_path / "one", ARRAYS, {"name": "x"})
    whole = (tmp_path / "one").read_bytes()
    (tmp_path / "one").write_bytes(whole[:-2] + b"\1" + whole[-1:])
    with pytest.raises(ModelError, match=r"one is damaged: its checksum does not fit; make it"):
        KIND.read(tmp_path / "one", ("a", "b"), both)
    text = json.dumps({"format": 2, "name": "x"})
    plain = {name: np.ascontiguousarray(array) for name, array in ARRAYS.items()}
    tensors.save_file(plain, tmp_path / "old", {"things": text})
    assert KIND.read(tmp_path / "old", ("a", "b"), both)[1] == {"format": 2, "name": "x"}


def test_numbers_that_cannot_be_are_refused_by_name():
    limits = np.array([-1.0, 1e-3, 1e-3]), 10.0
    check_within("thing: a", [0.0, 1.0, 10.0], *limits)
    for wrong, words in (
        ([0.0, 0.0, 1.0], "must be positive, within 0.001 and 10; got 0"),
        ([-2.0, 1.0, 1.0], "must lie within -1 and 10; got -2"),
        ([0.0, 1e30, 1.0], "must be positive, within 0.001 and 10; got 1e[+]30"),
        ([0.0, np.nan, 1.0], "must be finite"),
        ([0.0, np.inf, 1.0], "must be finite"),
    ):
        with pytest.raises(ModelError, match=f"^thing: a {words}"):
            check_within("thing: a", wrong, *limits)
    check_filled("thing", {"a": np.ones(3), "b": np.zeros(0)}, "a", "b")
    with pytest.raises(ModelError, match="thing: a must not be zero everywhere"):
        check_filled("thing", {"a": np.zeros(3)}, "a")


def test_what_is_no_tensor_file_is_refused(tmp_path):
    (tmp_path / "text").write_text("text")
    for path, sentence in (
        ("text", "cannot be read as a thing"),
        ("none", "none cannot be read: No such file"),
        ("", "must be a file; got a folder"),
    ):
        with pytest.raises(ModelError, match=sentence):
            KIND.read(tmp_path / path, ("a", "b"), both)
        with pytest.raises(ModelError, match=sentence.replace("thing", "tensor file")):
            tensor_key(tmp_path / path)
    tensors.save_file({"a": np.zeros(2)}, tmp_path / "plain")
    assert tensor_key(tmp_path / "plain") == ""
