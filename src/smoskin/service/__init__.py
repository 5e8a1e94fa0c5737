"""From a source of readings to whoever watches, records or acts on the touches."""
