"""Zero a skin in the Earth's field, and watch the zero follow a slow drift."""

import numpy as np

import smoskin as smo

design = smo.load_design("planar")
twin = smo.ReducedTwin(design, seed=0)
estimator = smo.ClosedFormEstimator(design)
earth = np.array([20e-6, -10e-6, 45e-6])


def read(time, touches=()):
    """A reading with the Earth's field and a drift of 1 uT a second on top."""
    reading = twin.read(touches, time=time)
    return smo.Reading(
        time=time,
        field=reading.field + earth + 1e-6 * time,
        temperature=reading.temperature,
        flags=reading.flags,
    )


estimator.zero([read(0.01 * k) for k in range(50)])
idle = [estimator.step(read(1 + 0.05 * k)) for k in range(2000)]
assert {estimate.status for estimate in idle} == {smo.Status.NO_CONTACT}
print(f"followed {np.abs(estimator.drift).max() * 1e6:.0f} uT of drift")

touch = smo.Contact(position=(0.09, 0.12), force=(0.0, 0.0, -0.3))
estimate = estimator.step(read(101.0, [touch]))
print(f"still {estimate.contacts[0].normal_force:.3f} N")
assert abs(estimate.contacts[0].normal_force - 0.3) < 0.01
