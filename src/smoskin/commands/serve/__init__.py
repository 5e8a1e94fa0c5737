"""Any number of skins in one process, for other programs: what `smoskin serve` does."""
