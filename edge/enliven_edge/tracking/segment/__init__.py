"""Segmentation: which pixels belong to which person, and which groups of pixels may be a new one."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
