"""Flat patterns of the sheet: panels, film, carrier, coupon, and their drawings."""
