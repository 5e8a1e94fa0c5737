"""Solid parts of a skin, and the moulds and jigs that it is made with."""
