"""Puppets in the studio: their surfaces in the current pose, control points, key poses and dragging."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
