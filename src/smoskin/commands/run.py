"""Estimates of any source, as lines: what `smoskin run` does.

Decides with which design a source is read (its own, unless another is given) and that the first
readings are the zero.
"""

import json
import os
from collections.abc import Iterator
from contextlib import ExitStack

from smoskin.design.document import shipped_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.records import Estimate
from smoskin.roles import Estimator, Source
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.service.loop import Loop
from smoskin.service.recorder import Recorder
from smoskin.service.source import TwinSource, open_source


def watch(
    url: str,
    design: SkinDesign | None = None,
    *,
    calibration: str | os.PathLike[str] | None = None,
    zero: bool = True,
    seconds: float | None = None,
    record: str | os.PathLike[str] | None = None,
) -> Iterator[Estimate]:
    """Estimates of the readings of a source.

    Parameters
    ----------
    url : str
        The source, as `smoskin.open_source` takes it.
    design : SkinDesign, optional
        Design of the skin that the source reads; by default the source's own.
    calibration, record : path, optional
        File of this skin, as `smoskin.load_estimator` reads it, or it is taken to be as designed;
        and a new MCAP file for readings and estimates.
    zero : bool
        Whether the first 20 good readings are the zero: nothing may touch the skin in them, and
        they are answered by `Status.NOT_CALIBRATED`.
    seconds : float, optional
        Time after the first reading to stop at, s, on the readings' clock.

    Raises
    ------
    ArgumentError
        If the source has another number of chips than the design.
    DesignError
        If no design is given and the source's does not come with the package.
    ModelError
        If the source or the calibration belongs to another design, or the latter cannot be read.
    SourceError
        If the source cannot be opened or falls silent.
    """
    with ExitStack() as stack:
        source = stack.enter_context(open_source(url))
        skin = _design_of(source, url, design)
        estimator: Estimator = (
            ClosedFormEstimator(skin) if calibration is None else load_estimator(calibration, skin)
        )
        if zero:
            estimator = ZeroFirst(estimator)
        sinks = [] if record is None else [Recorder(record, skin)]
        first: float | None = None
        for estimate in stack.enter_context(Loop(source, estimator, sinks=sinks)):
            yield estimate
            first = estimate.time if first is None else first
            if seconds is not None and estimate.time - first >= seconds:
                return


def _design_of(source: Source, url: str, design: SkinDesign | None) -> SkinDesign:
    """The given design, which must be the source's, or the source's own."""
    own = source.design_hash
    if design is None:
        if isinstance(source, TwinSource):
            return source.design
        if own is None:
            raise ArgumentError(f"design must be given: {url!r} does not name it")
        return shipped_design(own)
    if own is not None:
        design.check_own(f"source {url!r}", own)
    if source.chips != len(design.halls):
        raise ArgumentError(
            f"source must have {len(design.halls)} chips, as design {design.name!r}; "
            f"got {source.chips} from {url!r}"
        )
    return design


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
    status = estimate.status.name
    if as_json:
        return json.dumps({"time_s": estimate.time, "status": status, "contacts": touches})
    places = "".join(
        f"  x {touch['x_mm']:6.1f} mm  y {touch['y_mm']:6.1f} mm  "
        "F ({:+.3f}, {:+.3f}, {:+.3f}) N".format(*touch["force_N"])
        for touch in touches
    )
    return f"{estimate.time:10.3f} s  {status:<14}{places}"
