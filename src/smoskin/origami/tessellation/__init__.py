"""Folded sheets that lie on surfaces: found, unfolded, folded again and judged."""
