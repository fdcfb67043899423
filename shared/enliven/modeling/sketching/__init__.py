"""Sketch-based modeling: an outline is inflated to a mesh with a skeleton along its medial axis."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
