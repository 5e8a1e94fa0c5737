"""Readings that are numbered, published by the skin's node at a steady rate: RATE COUNT LISTENERS.

It begins when so many listen, or after 20 s: what comes before a listener is found is not for it.
"""

import json
import sys
import time

import numpy as np

from smoskin.feasibility import load_design
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.service.bridges.ros import RosNode

rate, count, listeners = float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
touch = Contact(position=(0.045, 0.080), force=(0.1, -0.05, -0.5))
took = np.zeros(count)
with RosNode(load_design("planar"), zero=lambda: None) as node:
    started = time.monotonic()
    while node._node.count_subscribers("skin/chip0/field") < listeners:
        if time.monotonic() - started > 20.0:
            break
        time.sleep(0.05)
    begun = time.monotonic()
    for number in range(count):
        time.sleep(max(begun + number / rate - time.monotonic(), 0.0))
        now = time.monotonic()
        reading = Reading(time=now, field=np.full((3, 3), number * 1e-9))
        covariance = np.zeros((1, 5, 5))
        node.write(
            reading,
            Estimate(time=now, status=Status.CONTACT, contacts=(touch,), covariance=covariance),
        )
        took[number] = time.monotonic() - now
    lasted = time.monotonic() - begun
    time.sleep(0.5)
ms = 1e3 * np.percentile(took, [50, 99, 99.9, 100])
print(json.dumps({"seconds": lasted, "write_ms": ms.tolist(), "dropped": node.dropped}))
