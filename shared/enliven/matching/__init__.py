"""Matching (AniMesh, section 4): finds the parts of a skeleton that a pose resembles, by abstraction and
ranking.

Also contains the interactive choice of a match, and the symmetry of limbs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
