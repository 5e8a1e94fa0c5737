"""From a touch to the motion of the sheet and its magnets, and to its stiffness."""
