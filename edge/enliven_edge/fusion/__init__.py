"""Fusion of several sensors in one space: the pose of each, and one set of bodies from all of them."""
