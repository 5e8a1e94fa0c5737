"""A touch on a simulated skin, and what the closed-form estimator makes of it."""

import smoskin as smo

design = smo.load_design("planar")
twin = smo.ReducedTwin(design, seed=0)
estimator = smo.ClosedFormEstimator(design)

touch = smo.Contact(position=(0.050, 0.067), force=(0.2, 0.0, -0.5))  # m, N; -z presses
estimate = estimator.step(twin.read([touch]))

found = estimate.contacts[0]
print(estimate.status.value)
print(f"at {found.position * 1e3} mm, {found.normal_force:.3f} N, drag {found.force[:2]} N")
assert abs(found.normal_force - 0.5) < 0.01
