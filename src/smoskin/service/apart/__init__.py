"""What runs beside the loop in a process of its own."""
