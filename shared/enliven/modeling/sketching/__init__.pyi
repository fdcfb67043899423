from .sketch import SketchPlane as SketchPlane, shape_from_stroke as shape_from_stroke
