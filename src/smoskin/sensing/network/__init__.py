"""Ensembles of small networks trained on response tables."""
