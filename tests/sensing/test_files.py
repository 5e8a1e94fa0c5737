"""Files of what was learned: what is written is read, and anything else is refused."""

import json

import numpy as np
import pytest

from smoskin.errors import ModelError
from smoskin.sensing.files import TensorFile, tensor_key

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
    with pytest.raises(ModelError, match=r"^said by its owner$"):
        KIND.read(tmp_path / "one", ("a", "b"), failing(ModelError("said by its owner")))


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
