"""The first minutes: a tour that points at each step, and detects or demonstrates it."""
