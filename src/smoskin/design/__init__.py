"""What is built: skins as data, read from and written to TOML."""
