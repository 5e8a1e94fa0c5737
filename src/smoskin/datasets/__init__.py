"""Data sets of sweeps: what is pressed, what is computed, and files that resume."""
