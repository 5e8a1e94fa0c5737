"""Networks as ONNX files, for robots and runtimes that know no Python.

The graph takes raw signals and the rubber's temperature and takes the steps of
`smoskin.sensing.network.model.Ensemble`, with its arrays, in float32. Decides the names of its
inputs and outputs; hides its nodes, which stand in `graph.onnxtxt` (a part between blank lines for
each layer). Needs the extra `onnx`.
"""

from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from smoskin.errors import require
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.outputs import write_output
from smoskin.sensing.network.model import SPREADS, Ensemble, NetworkModel


def export_onnx(model: NetworkModel, path: Path | str) -> None:
    """Write a network as an ONNX file.

    Its inputs are `signals`, (B, 3 S), T, of the model's chips as
    `smoskin.sensing.response.table.ResponseTable` defines them, and `temperature`, (1,), degC. Its
    outputs are `values`, (B, 5): x, y, m, and Fx, Fy, Fz, N; their `covariance`, (B, 5, 5); and
    `novelty`, (B,), above 1 where they are not to be believed. It raises a `MissingExtraError` if
    `onnx` is not installed.
    """
    require("writing ONNX files", "onnx", "onnx")
    import onnx
    import onnx.parser

    ensemble = Ensemble(model)
    # The file's operators, of set 17, are known to every runtime of the last years. Its signals are
    # in units of the floor, whose squares do not underflow float32.
    whole = resources.files("smoskin.sensing.network").joinpath("graph.onnxtxt").read_text("utf-8")
    start, layer, end = whole.replace("SIGNALS", str(len(model.centre) - 1)).split("\n\n")
    count = len(ensemble.hidden) + 1
    layers = [layer.replace("#", str(k)).replace("&", str(k + 1)) for k in range(count)]
    file = onnx.parser.parse_model("\n".join([start, *layers, end.replace("#", str(count))]))
    for name, value in _constants(ensemble).items():
        array = np.asarray(value)
        kind = np.int64 if array.dtype.kind == "i" else np.float32
        tensor = onnx.numpy_helper.from_array(np.ascontiguousarray(array, kind), name)
        file.graph.initializer.append(tensor)
    chips = ",".join(str(chip) for chip in model.chips)
    facts = {"design": model.design_hash, "chips": chips, "data_sha256": model.data_sha256}
    onnx.helper.set_model_props(file, facts)
    onnx.checker.check_model(file, full_check=True)
    write_output(path, file.SerializeToString())


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
        "picked": ensemble.picks,
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
