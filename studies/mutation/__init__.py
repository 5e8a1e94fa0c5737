"""Faults seeded into the sources at random, to learn whether the tests notice them.

Decides which changes count as faults (`faults`), which tests judge one, and in which order
(`trials`). A fault that no test of the default tier notices is a gap in the tests, or harmless.
"""
