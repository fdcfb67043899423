from .sketch import Plane, shape_from_stroke

__all__ = ["Plane", "shape_from_stroke"]
