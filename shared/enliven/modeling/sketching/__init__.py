"""Shapes from strokes: an outline is inflated to a mesh with a skeleton along its middle."""
