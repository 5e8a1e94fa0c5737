"""Gaussian processes trained on recordings of any board."""
