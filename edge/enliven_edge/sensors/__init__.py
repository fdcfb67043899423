"""Sensors: all sources of frames.

Sensors are opened by name, reopened after a loss, checked for problems, and can be replaced by recordings.

:func:`open_sensor` opens a sensor by its name. Other packages can add sensors with the entry-point group
``enliven.sensors``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
