"""Sensors: everything that delivers frames, by name, with reopening, health and recordings in place of
devices.

:func:`open_sensor` opens one by its name; other packages add sensors by the entry-point group
``enliven.sensors``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
