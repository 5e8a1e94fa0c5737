"""An arm that yields to touch: the scripted demonstration, and a source of readings live."""
