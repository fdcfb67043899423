"""Sensors: all sources of frames, opened by name, with reopening, health checks and recordings in place of
devices.

:func:`open_sensor` opens a sensor by its name. Other packages add sensors by the entry-point group
``enliven.sensors``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
