"""Detection of a posture in a single frame: creates hypotheses, fits them, and keeps the best."""
