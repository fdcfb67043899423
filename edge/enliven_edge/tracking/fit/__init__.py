"""The fit of the body model to a depth image: damped Gauss-Newton over data, prior and landmark terms."""

from enliven_edge.tracking.fit.alignment import align
from enliven_edge.tracking.fit.fit import FitReport, Fitter
from enliven_edge.tracking.fit.gauss_newton import cholesky
from enliven_edge.tracking.fit.terms import point_row

__all__ = ["FitReport", "Fitter", "align", "cholesky", "point_row"]
