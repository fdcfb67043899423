from .alignment import align
from .carried_points import point_row
from .fit import FitReport, Fitter
from .gauss_newton import cholesky
from .structures import PlacedFrames

__all__ = ["FitReport", "Fitter", "PlacedFrames", "align", "cholesky", "point_row"]
