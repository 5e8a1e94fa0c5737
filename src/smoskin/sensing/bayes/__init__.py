"""Touches by their posterior on a response table, with what is believed of them beforehand."""
