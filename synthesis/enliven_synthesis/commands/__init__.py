"""The commands ``enliven synthesize`` and ``enliven train-estimator``."""
