"""
Record and replay
=================

Readings and estimates go to a file that robotics viewers open, and come back bit for bit.
"""

import tempfile
from itertools import islice
from pathlib import Path

import smoskin as smo
from smoskin.plots import draw_readings

design = smo.load_design("planar")
path = Path(tempfile.mkdtemp()) / "second.mcap"
with smo.Recorder(path, design) as recorder, smo.open_source("twin://planar?speed=max") as source:
    sent = list(islice(source, 100))
    for reading in sent:
        recorder.write(reading)
replayed = list(smo.open_recording(path).readings())
print(f"{len(replayed)} readings in {path.stat().st_size / 1e3:.0f} kB")
assert replayed == sent
draw_readings(replayed)
