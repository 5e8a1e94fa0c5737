"""Networks as ONNX files, for robots and runtimes that know no Python.

The graph takes raw signals and the rubber's temperature and gives what `NetworkModel.predict`
gives, the layout of inputs and the ensemble's covariance included, in float32. Decides the names
of its inputs and outputs; hides how it is put together. Needs the extra `onnx`.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from smoskin.errors import MissingExtraError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.network.model import SPREADS, NetworkModel

_OPSET: Final = 17
"""Of the operators: known to every runtime of the last years."""
_IR: Final = 8
"""Of the file, which goes with them."""


def export_onnx(model: NetworkModel, path: Path | str) -> None:
    """Write a network as an ONNX file.

    Its inputs are `signals`, (B, 3 S), T, of the model's chips as
    `smoskin.sensing.response.table.ResponseTable` defines them, and `temperature`, (1,), degC. Its
    outputs are `values`, (B, 5): x, y, m, and Fx, Fy, Fz, N; their `covariance`, (B, 5, 5); and
    `novelty`, (B,), above 1 where they are not to be believed.

    Parameters
    ----------
    model : NetworkModel
    path : Path or str

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
    _write_layout(graph, model)
    _write_members(graph, model)
    _write_moments(graph, model)
    _write_units(graph, model)
    whole = onnx.helper.make_graph(
        graph.nodes,
        "smoskin_network",
        [
            graph.declared("signals", ["B", len(model.centre) - 1]),
            graph.declared("temperature", [1]),
        ],
        [
            graph.declared("values", ["B", 5]),
            graph.declared("covariance", ["B", 5, 5]),
            graph.declared("novelty", ["B"]),
        ],
        graph.constants,
    )
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

    def add(self, kind: str, *inputs: str, out: str = "", **attributes: int | list[int]) -> str:
        """The name of a new node's output."""
        name = out or f"n{len(self.nodes)}"
        self.nodes.append(self._onnx.helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def part(self, value: str, first: int, after: int) -> str:
        """Columns of the last axis."""
        ends = (self.constant([one], np.int64) for one in (first, after, -1))
        return self.add("Slice", value, *ends)

    def total(self, value: str, axis: int, *, keep: bool) -> str:
        """Sum along an axis."""
        return self.add("ReduceSum", value, self.constant([axis], np.int64), keepdims=int(keep))

    def declared(self, name: str, shape: list[str | int]) -> Any:
        """An input or output of the graph."""
        helper = self._onnx.helper
        return helper.make_tensor_value_info(name, self._onnx.TensorProto.FLOAT, shape)


def _write_layout(graph: _Graph, model: NetworkModel) -> None:
    """From `signals` to `inputs`, their `length`, and `novelty`."""
    # In units of the floor no square underflows float32.
    unit = graph.constant(model.floor)
    scaled = graph.add("Div", "signals", unit)
    squared = graph.total(graph.add("Mul", scaled, scaled), 1, keep=True)
    long = graph.add("Sqrt", graph.add("Add", squared, graph.constant(1.0)))
    graph.add("Mul", long, unit, out="length")
    direction = graph.add("Div", scaled, long)
    strength = graph.add("Add", graph.add("Log", long), graph.constant(np.log(model.floor)))
    both = graph.add("Concat", direction, strength, axis=1)
    centred = graph.add("Sub", both, graph.constant(model.centre))
    graph.add("Div", centred, graph.constant(model.scale), out="inputs")
    far = graph.add("MatMul", "inputs", graph.constant(model.whitener / model.reach))
    graph.add("Sqrt", graph.total(graph.add("Mul", far, far), 1, keep=False), out="novelty")


def _write_members(graph: _Graph, model: NetworkModel) -> None:
    """From `inputs` to all that members `said`, (M, B, ...)."""
    axes = graph.constant([0], np.int64)
    hidden = graph.add("Unsqueeze", "inputs", axes)
    for layer in model.layers[:-1]:
        sums = graph.add("MatMul", hidden, graph.constant(layer.weights))
        sums = graph.add("Add", sums, graph.constant(layer.bias))
        hidden = graph.add("Mul", sums, graph.add("Sigmoid", sums))
    last = model.layers[-1]
    sums = graph.add("MatMul", hidden, graph.constant(last.weights))
    graph.add("Add", sums, graph.constant(last.bias), out="said")


def _write_moments(graph: _Graph, model: NetworkModel) -> None:
    """From `said` to the ensemble's standardised `mean` (B, O) and `spread` (B, O, O)."""
    count = len(model.middle)
    members = graph.constant(model.members)
    each = graph.part("said", 0, count)
    sizes = graph.add("Clip", graph.part("said", count, 2 * count), *map(graph.constant, SPREADS))
    # Shares stand row by row below a diagonal of ones: put there by two constant products.
    numbers = count * (count - 1) // 2
    place = np.zeros((numbers, count * count))
    lower = np.tril_indices(count, -1)
    place[range(numbers), lower[0] * count + lower[1]] = 1.0
    shares = graph.add(
        "MatMul", graph.part("said", 2 * count, 2 * count + numbers), graph.constant(place)
    )
    shares = graph.add("Add", shares, graph.constant(np.eye(count).ravel()))
    square = graph.constant([model.members, -1, count, count], np.int64)
    shares = graph.add("Reshape", shares, square)
    last = graph.constant([-1], np.int64)
    deviations = graph.add("Unsqueeze", graph.add("Exp", sizes), last)
    mean = graph.add("Div", graph.total(each, 0, keep=False), members, out="mean")
    factor = graph.add("Mul", deviations, shares)
    apart = graph.add("Unsqueeze", graph.add("Sub", each, mean), last)
    beside = graph.add("Concat", factor, apart, axis=3)
    turned = graph.add("Transpose", beside, perm=[0, 1, 3, 2])
    squares = graph.total(graph.add("MatMul", beside, turned), 0, keep=False)
    graph.add("Div", squares, members, out="spread")


def _write_units(graph: _Graph, model: NetworkModel) -> None:
    """From `mean`, `spread`, `length` and `temperature` to `values` and `covariance`."""
    count = len(model.middle)
    warmer = graph.add("Sub", "temperature", graph.constant([REFERENCE_TEMPERATURE]))
    stiffer = graph.add("Mul", warmer, graph.constant([model.softening]))
    stiffer = graph.add("Add", stiffer, graph.constant([1.0]))
    strength = graph.add("Mul", "length", stiffer)
    sized = graph.add("Mul", "mean", graph.constant(model.size))
    natural = graph.add("Add", sized, graph.constant(model.middle))
    place = graph.part(natural, 0, 2)
    weight = graph.add("Exp", graph.part(natural, count - 1, count))
    push = graph.add("Neg", graph.add("Mul", weight, strength))
    one = graph.add("Exp", graph.add("Mul", place, graph.constant(0.0)))
    values, turn = [place, push], [one, push]
    if model.drag:
        drags = graph.add("Mul", graph.part(natural, 2, 4), strength)
        values.insert(1, drags)
        turn[1:1] = [strength, strength]
    rows = np.zeros((count, 5))
    rows[range(count), list(model.rows)] = 1.0
    spread_out = graph.constant(rows)
    joined = graph.add("Concat", *values, axis=1)
    graph.add("MatMul", joined, spread_out, out="values")
    turned = graph.add("Mul", graph.add("Concat", *turn, axis=1),
                       graph.constant(model.size * model.stretch))  # fmt: skip
    left = graph.add("Unsqueeze", turned, graph.constant([2], np.int64))
    right = graph.add("Unsqueeze", turned, graph.constant([1], np.int64))
    small = graph.add("Mul", graph.add("Mul", "spread", left), right)
    wide = graph.add("MatMul", small, spread_out)
    graph.add("MatMul", graph.constant(rows.T), wide, out="covariance")
