"""Networks as ONNX files: what onnxruntime makes of them."""

import sys

import numpy as np
import onnxruntime
import pytest

from networks import random_network
from smoskin.errors import MissingExtraError
from smoskin.sensing.network.export import export_onnx


def session(path):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


@pytest.mark.parametrize("drag", [0.0, 0.5])
@pytest.mark.parametrize("chips", [(1, 2), (0, 1, 2), (0, 1, 2, 3)])
def test_onnxruntime_gives_the_same_numbers(tmp_path, drag, chips):
    model = random_network(drag=drag, chips=chips, depth=3, members=4, width=16)
    export_onnx(model, tmp_path / "network.onnx")
    runs = session(tmp_path / "network.onnx")
    signals = np.random.default_rng(0).normal(size=(200, 3 * len(chips))).astype(np.float32)
    signals *= np.geomspace(1e-5, 1e-2, 200, dtype=np.float32)[:, None]
    values, covariance, novelty = runs.run(
        None, {"signals": signals, "temperature": np.array([31.0], np.float32)}
    )
    ours = model.predict(signals, 31.0)
    size = np.sqrt(np.einsum("bii->bi", ours.covariance))
    unit = np.abs(ours.values) + size
    assert (np.abs(values - ours.values) <= 1e-5 * unit).all()
    assert (np.abs(covariance - ours.covariance) <= 1e-5 * size[:, :, None] * size[:, None]).all()
    assert novelty == pytest.approx(ours.novelty, rel=1e-5)


def test_any_number_of_touches_and_what_the_file_says_of_itself(tmp_path):
    model = random_network()
    export_onnx(model, tmp_path / "network.onnx")
    runs = session(tmp_path / "network.onnx")
    assert [node.name for node in runs.get_inputs()] == ["signals", "temperature"]
    assert [node.name for node in runs.get_outputs()] == ["values", "covariance", "novelty"]
    about = runs.get_modelmeta().custom_metadata_map
    assert about["design"] == model.design_hash
    assert about["chips"] == "1,2"
    for count in (1, 7):
        given = {"signals": np.zeros((count, 6), np.float32), "temperature": [np.float32(25)]}
        values, covariance, novelty = runs.run(None, given)
        assert values.shape == (count, 5)
        assert covariance.shape == (count, 5, 5)
        assert novelty.shape == (count,)
        assert np.isfinite(values).all()


def test_without_onnx_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(MissingExtraError, match=r"pip install .*\[onnx\]'$"):
        export_onnx(random_network(), tmp_path / "network.onnx")
