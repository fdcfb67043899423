from .edits import copy as copy, cut as cut, merge as merge, mesh_at as mesh_at
from .examples import fit_examples as fit_examples
from .exporting import export as export
from .matching import match as match
from .possession import possess as possess
