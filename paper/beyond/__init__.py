"""Figures that the paper does not have, and that its claims call for."""
