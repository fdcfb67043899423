"""Meshes moved by a few example poses: performers drive control points, and the surface follows in the
viewer.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
