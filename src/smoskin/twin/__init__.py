"""The digital twin: from contacts to what the chips read."""
