"""Bridges from the loop to other programs."""
