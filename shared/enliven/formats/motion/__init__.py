"""Motion captures: BVH files and CMU's exponential maps."""
