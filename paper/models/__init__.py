"""Models that only the paper needs: soft magnets, finite presses, fits of the reduced sheet."""
