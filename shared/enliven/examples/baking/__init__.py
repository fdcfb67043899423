"""Baking: converts a surface driven by control points to bones and morph targets for other programs."""
