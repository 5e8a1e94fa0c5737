"""Real chips and boards: drivers, wire formats and the sources that read them."""
