"""Boards of a skin: its chips' floating board, the slack tail and the base's microcontroller."""
