"""Every printed number and figure of the paper beside what the package computes."""
