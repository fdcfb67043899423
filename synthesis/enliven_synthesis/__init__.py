"""Synthesises a performer and a depth camera with the faults of a real one, for tests and training."""
