"""The process sheet: steps with pictures, tolerances, checks and the first readings."""
