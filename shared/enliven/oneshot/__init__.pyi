from .edits import copy, cut, merge, mesh_at
from .examples import fit_examples
from .matching import match
from .possession import possess

__all__ = ["copy", "cut", "fit_examples", "match", "merge", "mesh_at", "possess"]
