"""Matching: which part of a skeleton a pose means (AniMesh, section 4): abstraction, ranking, picking,
symmetry.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
