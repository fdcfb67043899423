"""Numeric input: quantities with units and arithmetic, and the position and size of objects."""
