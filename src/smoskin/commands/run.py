"""Estimates of any source, as lines: what `smoskin run` does.

Decides which estimator reads a skin: the closed forms, or, where the calibration is a response
table of the very skin, the Bayesian one, or a trained network. The last two are zeroed by the first
readings.
"""

import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.calibration import read_calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.files import NETWORK, tensor_key
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import load_network
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.signals import FOLLOWING
from smoskin.service.loop import Loop
from smoskin.service.recorder import Recorder
from smoskin.service.source import open_source

_ZEROS: Final = 20
"""Good readings whose mean is the zero of an estimator that reads by what was learned."""


def watch(
    design: SkinDesign,
    url: str,
    *,
    calibration: str | os.PathLike[str] | None = None,
    seconds: float | None = None,
    record: str | os.PathLike[str] | None = None,
) -> Iterator[Estimate]:
    """Estimates of a source's readings.

    Parameters
    ----------
    design : SkinDesign
        Of the skin that the source reads.
    url : str
        As `smoskin.open_source` takes it.
    calibration : path, optional
        Of this skin; as designed by default. A calibration (TOML), a response table from a
        calibration by touches, or a network: with the last two nothing may touch the skin in the
        first 20 readings, which are answered by `Status.NOT_CALIBRATED`, and creep is undone.
    seconds : float, optional
        Stop this long after the first reading, on the readings' clock.
    record : path, optional
        Write readings and estimates to this MCAP file.

    Raises
    ------
    ArgumentError
        If the source has another number of chips than the design.
    ModelError
        If the calibration cannot be read or belongs to another design.
    MissingExtraError
        If it holds what was learned and `safetensors` is not installed.
    SourceError
        If the source cannot be opened or falls silent.
    """
    estimator = _estimator(design, calibration)
    source = open_source(url)
    if source.chips != len(design.halls):
        source.close()
        raise ArgumentError(
            f"source must have {len(design.halls)} chips, as design {design.name!r}; "
            f"got {source.chips} from {url!r}"
        )
    sinks = [] if record is None else [Recorder(record, design)]
    with Loop(source, estimator, sinks=sinks) as loop:
        first: float | None = None
        for estimate in loop:
            yield estimate
            first = estimate.time if first is None else first
            if seconds is not None and estimate.time - first >= seconds:
                return


def _estimator(design: SkinDesign, calibration: str | os.PathLike[str] | None) -> Estimator:
    """That which a skin's calibration is made for."""
    if calibration is None:
        return ClosedFormEstimator(design)
    file = Path(calibration)
    if not _holds_tensors(file):
        return ClosedFormEstimator(design, read_calibration(file, design))
    rubber = elastomer_prony(design.columns.material)
    if tensor_key(file) == NETWORK:
        network = load_network(file)
        return _ZeroedFirst(NetworkEstimator(design, network, creep=rubber, tracking=FOLLOWING))
    table = load_response_table(file)
    return _ZeroedFirst(BayesEstimator(design, table, creep=rubber, tracking=FOLLOWING))


def _holds_tensors(path: Path) -> bool:
    """Whether a file begins as tensor files do, with a length in binary: text holds no zeros."""
    try:
        with path.open("rb") as file:
            return b"\0" in file.read(8)
    except OSError:
        return False  # whoever reads it says why it cannot be read


class _ZeroedFirst(Estimator):
    """An estimator that takes its first good readings for its zero."""

    def __init__(self, inner: BayesEstimator | NetworkEstimator) -> None:
        self._inner = inner
        self._untouched: list[Reading] = []
        self._zeroed = False

    def reset(self) -> None:
        self._inner.reset()
        self._untouched.clear()
        self._zeroed = False

    @property
    def drift(self) -> Floats:
        return self._inner.drift

    def zero(self, readings: Sequence[Reading]) -> None:
        self._inner.zero(readings)
        self._zeroed = True

    def step(self, reading: Reading) -> Estimate:
        if self._zeroed:
            return self._inner.step(reading)
        if not reading.flags.any() and np.isfinite(reading.field).all():
            self._untouched.append(reading)
        if len(self._untouched) == _ZEROS:
            self.zero(self._untouched)
        return Estimate(time=reading.time, status=Status.NOT_CALIBRATED)


def estimate_line(estimate: Estimate, *, as_json: bool) -> str:
    """One estimate as a line of text, or of JSON, in millimetres and newtons."""
    touches = [
        {
            "x_mm": round(float(contact.position[0]) * 1e3, 3),
            "y_mm": round(float(contact.position[1]) * 1e3, 3),
            "force_N": contact.force.round(4).tolist(),
        }
        for contact in estimate.contacts
    ]
    if as_json:
        return json.dumps(
            {"time_s": estimate.time, "status": estimate.status.name, "contacts": touches}
        )
    places = "".join(
        f"  x {touch['x_mm']:6.1f} mm  y {touch['y_mm']:6.1f} mm  "
        "F ({:+.3f}, {:+.3f}, {:+.3f}) N".format(*touch["force_N"])
        for touch in touches
    )
    return f"{estimate.time:10.3f} s  {estimate.status.name:<14}{places}"
