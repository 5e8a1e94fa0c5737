"""From readings to touches: conditioning, estimators, their calibration and training."""
