"""A scan as its user sees it: what happened, what to do better, and pictures of the mesh."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
