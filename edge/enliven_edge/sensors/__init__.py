"""Sensors: all sources of frames, opened by name and reopened after a loss.

Sensors are also checked for problems, and can be replaced by recordings.

:func:`open_sensor` opens a sensor by its name. Other packages can add sensors with the entry-point group
``enliven.sensors``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
