"""Estimates of any source, as lines: what `smoskin run` does."""

import json
import os
from collections.abc import Iterator

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.records import Estimate
from smoskin.sensing.calibration import read_calibration
from smoskin.sensing.closed_form import ClosedFormEstimator
from smoskin.service.loop import Loop
from smoskin.service.recording import Recorder
from smoskin.service.source import open_source


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
        Of this skin; as designed by default.
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
    SourceError
        If the source cannot be opened or falls silent.
    """
    known = None if calibration is None else read_calibration(calibration, design)
    source = open_source(url)
    if source.chips != len(design.halls):
        source.close()
        raise ArgumentError(
            f"source must have {len(design.halls)} chips, as design {design.name!r}; "
            f"got {source.chips} from {url!r}"
        )
    sinks = [] if record is None else [Recorder(record, design)]
    with Loop(source, ClosedFormEstimator(design, known), sinks=sinks) as loop:
        first: float | None = None
        for estimate in loop:
            yield estimate
            first = estimate.time if first is None else first
            if seconds is not None and estimate.time - first >= seconds:
                return


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
