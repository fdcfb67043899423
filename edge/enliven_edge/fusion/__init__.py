"""Fusion of several sensors in one space: the pose of each, and one set of bodies from all of them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
