"""Readers of motion captures: BVH files and CMU's exponential maps."""
