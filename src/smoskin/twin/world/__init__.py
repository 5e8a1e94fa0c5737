"""Worlds in which skins are judged: what the twin's own assumptions leave out, effect by effect."""
