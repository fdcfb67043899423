"""Loose things that characters and performers knock about: boxes and balls in a physics engine (an extra)."""
