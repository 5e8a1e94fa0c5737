"""Networks as ONNX files, for robots and runtimes that know no Python.

The graph takes raw signals and the rubber's temperature and takes the steps of
`smoskin.sensing.network.model.Ensemble`, with its arrays, in float32. Decides the names of its
inputs and outputs. Needs the extra `onnx`.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.errors import MissingExtraError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.network.model import SPREADS, Ensemble, NetworkModel

# Operators of set 17 are known to every runtime of the last years. In units of the floor no square
# underflows float32, which would also lose inputs that were not centred before the first product.
_START: Final = """
<ir_version: 8, opset_import: ["": 17], producer_name: "smoskin">
smoskin_network (float[B, SIGNALS] signals, float[1] temperature)
    => (float[B, 5] values, float[B, 5, 5] covariance, float[B] novelty)
    <float one = {1}, int64[1] second = {1}, int64[3] parts = {2, 2, 1},
     int64[2] plane = {5, -1}, int64[3] each = {5, 1, -1}> {
  rows = Transpose <perm = [1, 0]> (signals)
  scaled = Div (rows, floor)
  squared = ReduceSumSquare <axes = [0]> (scaled)
  above = Add (squared, one)
  ratio = Sqrt (above)
  direction = Div (scaled, ratio)
  relative = Log (ratio)
  logarithm = Add (relative, log_floor)
  joined = Concat <axis = 0> (direction, logarithm)
  inputs = Sub (joined, centre)
  product = MatMul (first, inputs)
  both = Add (product, first_bias)
  units, far = Split <axis = 0> (both, widths)
  novelty = ReduceL2 <axes = [0], keepdims = 0> (far)
  half0 = Reshape (units, members)
"""
_LAYER: Final = """
  tanh# = Tanh (half#)
  share# = Add (tanh#, one)
  hidden# = Mul (share#, half#)
  sums# = MatMul (weights#, hidden#)
  half& = Add (sums#, bias#)
"""
_END: Final = """
  averages, logarithms, others = Split <axis = 1> (half#, kinds)
  clipped = Clip (logarithms, least, most)
  deviations = Exp (clipped)
  numbers = Concat <axis = 1> (averages, deviations, others)
  picks = Reshape (numbers, flat)
  left = Gather (picks, left_picks)
  right = Gather (picks, right_picks)
  factor = Mul (left, right)
  weighted = Mul (factor, means)
  mean = ReduceSum <keepdims = 1> (weighted, second)
  column = Reshape (mean, plane)
  sized = Mul (column, size)
  natural = Add (sized, middle)
  place, drags, weight = Split <axis = 0> (natural, parts)
  length = Mul (ratio, floor)
  warmth = Mul (temperature, softening)
  stiffer = Add (warmth, cold)
  strength = Mul (length, stiffer)
  drag = Mul (drags, strength)
  lever = Exp (weight)
  push = Mul (lever, strength)
  force = Neg (push)
  answers = Concat <axis = 0> (place, drag, force)
  values = Transpose <perm = [1, 0]> (answers)
  ones = Div (strength, strength)
  unit = Concat <axis = 0> (ones, ones, strength, strength, force)
  stretched = Mul (unit, stretch)
  wide = Reshape (stretched, each)
  shift = Mul (mean, beside)
  apart = Sub (factor, shift)
  spread = Mul (apart, wide)
  root = Transpose <perm = [2, 0, 1]> (spread)
  turned = Transpose <perm = [2, 1, 0]> (spread)
  covariance = MatMul (root, turned)
}
"""


def export_onnx(model: NetworkModel, path: Path | str) -> None:
    """Write a network as an ONNX file.

    Its inputs are `signals`, (B, 3 S), T, of the model's chips as
    `smoskin.sensing.response.table.ResponseTable` defines them, and `temperature`, (1,), degC. Its
    outputs are `values`, (B, 5): x, y, m, and Fx, Fy, Fz, N; their `covariance`, (B, 5, 5); and
    `novelty`, (B,), above 1 where they are not to be believed.

    Raises
    ------
    MissingExtraError
        If `onnx` is not installed.
    """
    try:
        import onnx
        import onnx.parser
    except ImportError as error:
        raise MissingExtraError("writing ONNX files", "onnx") from error
    ensemble = Ensemble(model)
    layers = range(len(ensemble.hidden) + 1)
    text = _START.replace("SIGNALS", str(len(model.centre) - 1))
    text += "".join(_LAYER.replace("#", str(k)).replace("&", str(k + 1)) for k in layers)
    file = onnx.parser.parse_model(text + _END.replace("#", str(len(layers))))
    for name, value in _constants(ensemble).items():
        array = np.asarray(value)
        kind = np.int64 if array.dtype.kind == "i" else np.float32
        tensor = onnx.numpy_helper.from_array(np.ascontiguousarray(array, kind), name)
        file.graph.initializer.append(tensor)
    chips = ",".join(str(chip) for chip in model.chips)
    facts = {"design": model.design_hash, "chips": chips, "data_sha256": model.data_sha256}
    onnx.helper.set_model_props(file, facts)
    onnx.checker.check_model(file, full_check=True)
    onnx.save(file, str(path))


def _constants(ensemble: Ensemble) -> dict[str, ArrayLike]:
    """What the graph names without computing it."""
    model, ends, members = ensemble.model, ensemble.deviations, ensemble.model.members
    numbers, centre = ensemble.last[0].shape[1], model.centre[:, None]
    constants: dict[str, ArrayLike] = {
        "floor": model.floor,
        "log_floor": np.log(model.floor),
        "centre": centre,
        "first": ensemble.first,
        "first_bias": ensemble.first_bias + ensemble.first @ centre,
        "widths": [ensemble.width, len(centre)],
        "members": [members, ensemble.width // members, -1],
        "kinds": [ends.start, ends.start, numbers - ends.stop],
        "least": SPREADS[0],
        "most": SPREADS[1],
        "flat": [members * numbers, -1],
        "left_picks": ensemble.picks[0],
        "right_picks": ensemble.picks[1],
        "means": ensemble.means[:, None],
        "size": ensemble.size,
        "middle": ensemble.middle,
        "softening": model.softening,
        "cold": 1 - model.softening * REFERENCE_TEMPERATURE,
        "stretch": ensemble.stretch,
        "beside": (ensemble.means > 0)[:, None].astype(np.float32),
    }
    for k, (weights, bias) in enumerate([*ensemble.hidden, ensemble.last]):
        constants |= {f"weights{k}": weights, f"bias{k}": bias}
    return constants
