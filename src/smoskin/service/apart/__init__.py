"""Who gets the processors: what runs in a process of its own, and what runs first."""
