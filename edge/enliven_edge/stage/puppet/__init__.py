"""Puppets are meshes that a few example poses move.

Performers drive their control points; the viewer solves the surface.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
