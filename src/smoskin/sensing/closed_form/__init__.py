"""The published estimator: rules for the pressed cell, the force law, and their calibration."""
