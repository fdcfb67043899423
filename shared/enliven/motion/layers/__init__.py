"""Layers of motion on a skeleton: rotations along arc length, sampled, multiplied and placed.

The method follows AniMesh, section 5.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
