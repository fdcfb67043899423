"""Shapes from strokes: an outline is inflated to a mesh with a skeleton along its middle."""

from enliven.modeling.sketching.sketch import Plane, shape_from_stroke

__all__ = ["Plane", "shape_from_stroke"]
