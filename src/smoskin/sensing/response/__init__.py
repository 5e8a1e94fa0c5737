"""Response tables: what chips read under a touch, fitted to a design and then to one skin."""
