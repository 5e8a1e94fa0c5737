"""A robot arm that yields to touch: the law, what stops it, and the arms that it moves."""
