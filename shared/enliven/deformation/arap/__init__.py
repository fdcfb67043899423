"""As-rigid-as-possible surfaces with squash and stretch, moved by control points (example-based retargeting,
2014).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
