"""Segmentation: which pixels belong to which person, and which groups of pixels may be a new one."""
