"""Depth cameras: each driver opens, reads and closes one, or without it rehearses with a recording's images.

What they have in common, such as opening them anew and keeping crashes out of the edge, is not done here but
in :mod:`enliven_edge.sensors.reopening` and :mod:`enliven_edge.sensors.isolation`.
"""

from enliven_edge.sensors.drivers.libcamera_images import LibcameraImages

__all__ = ["LibcameraImages"]
