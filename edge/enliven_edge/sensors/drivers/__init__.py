"""Depth cameras: each driver opens, reads and closes one, or without it rehearses with a recording's images.

What they have in common, such as opening them anew and keeping crashes out of the edge, is not done here but
in :mod:`enliven_edge.sensors.reopening` and :mod:`enliven_edge.sensors.isolation`. What their arguments have
in common is said here:

    width, height: pixels of the depth image.
    fps: images a second.
    rehearse: a recording that is played through the camera's library in place of a camera.
    before: the identity of the camera that was open last; of several it is taken again.

Every driver raises InputError for a mode, preset or recording that cannot be used, and ResourceError where
its library or the camera is missing, or the camera is in use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
