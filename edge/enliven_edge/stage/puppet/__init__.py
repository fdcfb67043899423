"""Puppets are meshes that are animated by a few key poses (example-based retargeting).

Performers drive the control points. The viewer solves the surface.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
