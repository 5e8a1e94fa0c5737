"""A rig of one's own: a stage and a force gauge, and the press that they make together."""
