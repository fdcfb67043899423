from .alignment import align as align
from .normal_equations import point_row as point_row
from .fit import FitReport as FitReport, Fitter as Fitter
from .gauss_newton import cholesky as cholesky
from .structures import PlacedFrames as PlacedFrames
