"""Triangle meshes: the mesh type, readers and writers of mesh files, mesh repair, and surfaces through
scanned points.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
