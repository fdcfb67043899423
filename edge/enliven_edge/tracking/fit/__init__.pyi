from .alignment import align
from .fit import FitReport, Fitter
from .gauss_newton import cholesky
from .terms import point_row

__all__ = ["FitReport", "Fitter", "align", "cholesky", "point_row"]
