"""The published reduced model: attenuation, stiffness, creases and panels."""
