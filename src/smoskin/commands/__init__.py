"""What people run: short programs over the package's own parts."""
