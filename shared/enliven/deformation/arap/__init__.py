"""As-rigid-as-possible (ARAP) surface deformation with squash and stretch, driven by control points.

The method follows "Example-based retargeting", 2014.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
