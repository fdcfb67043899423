"""enliven: everything that is mathematics, a format or a message.

No camera, no window, no thread and no global state lives here, so that the edge, the viewer and
user scripts can share it. Units are metres, seconds and radians; the world is right-handed with
+Y up and the floor at y = 0; quaternions are (w, x, y, z).

``from enliven import …`` has the types that everything passes on, and functions that do a whole task in one
call; docs/library.md shows each at work. Rooms such as ``enliven.matching`` have the solvers behind them. A
name is loaded when it is first asked for.
"""

from importlib.metadata import PackageNotFoundError, version

import lazy_loader

try:
    __version__ = version("enliven")
except PackageNotFoundError:  # the folder is on Python's path without being installed
    __version__ = "0+unknown"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
