"""Text-file sessions of example-based retargeting: a mesh, its control points, key poses and takes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
