"""enliven: all mathematics, file formats and messages of the project.

This package contains no camera, window, thread or global state, so the edge, the viewer and user scripts can
share it. Units are metres, seconds and radians. The world is right-handed with +Y up and the floor at y = 0.
Quaternions are (w, x, y, z).

``from enliven import ...`` provides the common types, and functions that perform a whole task in one call.
docs/library.md shows how to use each. Packages such as ``enliven.matching`` contain the solvers. A name is
imported when it is first used.
"""

from importlib.metadata import PackageNotFoundError, version

import lazy_loader

try:
    __version__ = version("enliven")
except PackageNotFoundError:  # The folder is on Python's path, but the package is not installed.
    __version__ = "0+unknown"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
