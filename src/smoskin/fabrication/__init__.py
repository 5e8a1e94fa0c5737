"""Files from which a workshop and a board house build a skin."""
