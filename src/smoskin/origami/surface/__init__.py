"""Surfaces that a skin may lie on: in closed form, or of triangles."""
