"""Record a second of a live source, then play it back as fast as possible."""

import tempfile
from pathlib import Path

import smoskin as smo

design = smo.load_design("planar")
path = Path(tempfile.mkdtemp()) / "second.mcap"

source = smo.open_source("twin://planar?rate=100&speed=max")
for estimate in smo.run(
    source, smo.ClosedFormEstimator(design), sinks=[smo.Recorder(path, design)]
):
    if estimate.time >= 1.0:
        break
source.close()

replayed = list(
    smo.run(smo.open_source(f"replay:{path}?speed=max"), smo.ClosedFormEstimator(design))
)
recorded = list(smo.open_recording(path).estimates())
print(f"{len(recorded)} estimates recorded, {len(replayed)} made again from {path}")
assert replayed == recorded
