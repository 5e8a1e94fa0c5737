"""What boards say over a serial port: this package's frames and those of boards by others."""
