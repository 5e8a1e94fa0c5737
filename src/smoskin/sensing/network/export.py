"""Networks as ONNX files, for robots and runtimes that know no Python.

The graph takes raw signals and the rubber's temperature and takes the steps of
`smoskin.sensing.network.model.Ensemble`, with its arrays, in float32. Decides the names of its
inputs and outputs; hides how it is put together. Needs the extra `onnx`.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from smoskin.errors import MissingExtraError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.network.model import SPREADS, Ensemble, NetworkModel

_OPSET: Final = 17
"""Version of the operators: known to every runtime of the last years."""
_IR: Final = 8
"""Version of the file, which goes with them."""


def export_onnx(model: NetworkModel, path: Path | str) -> None:
    """Write a network as an ONNX file.

    Its inputs are `signals`, (B, 3 S), T, of the model's chips as
    `smoskin.sensing.response.table.ResponseTable` defines them, and `temperature`, (1,), degC. Its
    outputs are `values`, (B, 5): x, y, m, and Fx, Fy, Fz, N; their `covariance`, (B, 5, 5); and
    `novelty`, (B,), above 1 where they are not to be believed.

    Parameters
    ----------
    model : NetworkModel
        Network to write.
    path : Path or str
        ONNX file.

    Raises
    ------
    MissingExtraError
        If `onnx` is not installed.
    """
    try:
        import onnx
    except ImportError as error:
        raise MissingExtraError("writing ONNX files", "onnx") from error
    graph = _Graph(onnx)
    ensemble = Ensemble(model)
    length = _write_members(graph, ensemble)
    _write_moments(graph, ensemble, length)
    signals = graph.declared("signals", "B", len(model.centre) - 1)
    given = [signals, graph.declared("temperature", 1)]
    values, spread = graph.declared("values", "B", 5), graph.declared("covariance", "B", 5, 5)
    answers = [values, spread, graph.declared("novelty", "B")]
    name = "smoskin_network"
    whole = onnx.helper.make_graph(graph.nodes, name, given, answers, graph.constants)
    file = onnx.helper.make_model(
        whole,
        opset_imports=[onnx.helper.make_opsetid("", _OPSET)],
        ir_version=_IR,
        producer_name="smoskin",
    )
    chips = ",".join(str(chip) for chip in model.chips)
    onnx.helper.set_model_props(
        file,
        {"design": model.design_hash, "chips": chips, "data_sha256": model.data_sha256},
    )
    onnx.checker.check_model(file, full_check=True)
    onnx.save(file, str(path))


class _Graph:
    """Nodes and constants, named as they come."""

    def __init__(self, onnx: Any) -> None:
        self._onnx = onnx
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, value: ArrayLike, kind: DTypeLike = np.float32) -> str:
        """The name of a constant."""
        name = f"c{len(self.constants)}"
        array = np.ascontiguousarray(np.asarray(value, dtype=kind))
        self.constants.append(self._onnx.numpy_helper.from_array(array, name))
        return name

    def add(self, kind: str, *inputs: Any, out: str = "", **attributes: int | list[int]) -> str:
        """The name of a new node's output; inputs are names, or arrays as constants."""
        names = [value if isinstance(value, str) else self.constant(value) for value in inputs]
        name = out or f"n{len(self.nodes)}"
        self.nodes.append(self._onnx.helper.make_node(kind, names, [name], **attributes))
        return name

    def part(self, value: str, axis: int, first: int, after: int) -> str:
        """Part of an axis."""
        ends = (self.constant([end], np.int64) for end in (first, after, axis))
        return self.add("Slice", value, *ends)

    def total(self, value: str, axis: int, *, keep: bool, out: str = "") -> str:
        """Sum along an axis."""
        axes = self.constant([axis], np.int64)
        return self.add("ReduceSum", value, axes, keepdims=int(keep), out=out)

    def reshaped(self, value: str, shape: list[int]) -> str:
        """The same in another shape."""
        return self.add("Reshape", value, self.constant(shape, np.int64))

    def declared(self, name: str, *shape: str | int) -> Any:
        """An input or output of the graph."""
        helper = self._onnx.helper
        return helper.make_tensor_value_info(name, self._onnx.TensorProto.FLOAT, list(shape))


def _write_members(graph: _Graph, ensemble: Ensemble) -> str:
    """From `signals` to the members' `numbers`, (M, ..., B), and `novelty`; returns the length."""
    model, width = ensemble.model, ensemble.width
    # In units of the floor no square underflows float32.
    scaled = graph.add("Div", graph.add("Transpose", "signals", perm=[1, 0]), model.floor)
    squared = graph.total(graph.add("Mul", scaled, scaled), 0, keep=True)
    ratio = graph.add("Sqrt", graph.add("Add", squared, 1.0))
    direction = graph.add("Div", scaled, ratio)
    logarithm = graph.add("Add", graph.add("Log", ratio), np.log(model.floor))
    # The inputs are centred before they are multiplied: float32 would lose them otherwise.
    inputs = graph.add("Concat", direction, logarithm, axis=0)
    inputs = graph.add("Sub", inputs, model.centre[:, None])
    both = graph.add("MatMul", ensemble.first, inputs)
    both = graph.add("Add", both, ensemble.first_bias + ensemble.first @ model.centre[:, None])
    far = graph.part(both, 0, width, width + len(model.centre))
    far = graph.total(graph.add("Mul", far, far), 0, keep=False)
    graph.add("Sqrt", far, out="novelty")
    half = graph.part(both, 0, 0, width)
    half = graph.reshaped(half, [model.members, width // model.members, -1])
    for k, (weights, bias) in enumerate([*ensemble.hidden, ensemble.last]):
        hidden = graph.add("Mul", graph.add("Add", graph.add("Tanh", half), 1.0), half)
        end = "numbers" if k == len(ensemble.hidden) else ""
        half = graph.add("Add", graph.add("MatMul", weights, hidden), bias, out=end)
    return graph.add("Mul", ratio, model.floor)


def _write_moments(graph: _Graph, ensemble: Ensemble, length: str) -> None:
    """From `numbers`, `temperature` and the length to `values` and `covariance`."""
    model, ends = ensemble.model, ensemble.deviations
    many = ensemble.last[0].shape[1]
    sizes = graph.add("Clip", graph.part("numbers", 1, ends.start, ends.stop), *SPREADS)
    parts = [
        graph.part("numbers", 1, 0, ends.start),
        graph.add("Exp", sizes),
        graph.part("numbers", 1, ends.stop, many),
    ]
    picks = graph.reshaped(graph.add("Concat", *parts, axis=1), [model.members * many, -1])
    left, right = (
        graph.add("Gather", picks, graph.constant(rows, np.int64), axis=0)
        for rows in (ensemble.left, ensemble.right)
    )
    factor = graph.add("Mul", left, right)
    mean = graph.total(graph.add("Mul", factor, ensemble.means[:, None]), 1, keep=False)
    natural = graph.add("Add", graph.add("Mul", mean, ensemble.size), ensemble.middle)
    warmer = graph.add("Sub", "temperature", [REFERENCE_TEMPERATURE])
    stiffer = graph.add("Add", graph.add("Mul", warmer, [model.softening]), [1.0])
    strength = graph.add("Mul", length, stiffer)
    weight = graph.add("Exp", graph.part(natural, 0, 4, 5))
    push = graph.add("Neg", graph.add("Mul", weight, strength))
    drags = graph.add("Mul", graph.part(natural, 0, 2, 4), strength)
    values = graph.add("Concat", graph.part(natural, 0, 0, 2), drags, push, axis=0)
    graph.add("Transpose", values, perm=[1, 0], out="values")
    ones = graph.add("Div", strength, strength)
    units = graph.add("Concat", ones, ones, strength, strength, push, axis=0)
    units = graph.reshaped(graph.add("Mul", units, ensemble.stretch), [5, 1, -1])
    beside = (ensemble.means > 0)[:, None].astype(np.float32)
    apart = graph.add("Mul", graph.reshaped(mean, [5, 1, -1]), beside)
    factor = graph.add("Mul", graph.add("Sub", factor, apart), units)
    root, turned = (graph.add("Transpose", factor, perm=perm) for perm in ([2, 0, 1], [2, 1, 0]))
    graph.add("MatMul", root, turned, out="covariance")
