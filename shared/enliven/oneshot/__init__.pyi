from .edits import copy, cut, merge, mesh_at
from .examples import fit_examples
from .exporting import export
from .matching import match
from .possession import possess

__all__ = ["copy", "cut", "export", "fit_examples", "match", "merge", "mesh_at", "possess"]
