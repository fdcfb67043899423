from .alignment import align as align
from .fit import FitReport as FitReport, Fitter as Fitter
from .gauss_newton import cholesky as cholesky
from .terms import point_row as point_row
