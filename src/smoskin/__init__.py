"""smoskin: design, simulate, calibrate, train, run and see a sandwich Miura-ori tactile skin."""

__version__ = "0.1.0"
