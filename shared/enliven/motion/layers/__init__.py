"""Layers of motion on a skeleton: turns along arc length, sampled, multiplied and placed (AniMesh, section
5).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
