"""Depth cameras: each driver opens, reads and closes one, or without it rehearses with a recording's images.

What they have in common, such as opening them anew and keeping crashes out of the edge, is not done here but
in :mod:`enliven_edge.sensors.reopening` and :mod:`enliven_edge.sensors.isolation`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
