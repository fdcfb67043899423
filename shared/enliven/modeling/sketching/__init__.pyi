from .sketch import SketchPlane, shape_from_stroke

__all__ = ["SketchPlane", "shape_from_stroke"]
