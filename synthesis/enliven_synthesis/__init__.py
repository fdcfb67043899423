"""Synthetic performers and depth cameras, with the faults of real cameras, for tests and training."""
