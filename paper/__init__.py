"""The paper beside what the package computes: a script a figure or table.

Each script prints what is printed beside what is computed, asserts and draws; ``python -m paper``
runs them all. `beyond` holds figures that the paper does not have, `models` what only the paper
needs, `shared` what scripts have in common.
"""
