"""Sketch-based modeling: an outline is inflated to a mesh with a skeleton along its medial axis."""
