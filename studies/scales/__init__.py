"""Elastomer scales on the folded sheet: the law by which they share a touch out among vertices.

A cover is pressed in finite elements (`studies.scales.cover`); what its facets feel loads the
sheet, and the law is sought that moves the magnets most nearly alike (`studies.scales.law`).
"""
