"""Loose boxes and balls that characters and performers knock about, by a physics engine (an extra)."""
