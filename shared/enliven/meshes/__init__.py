"""Triangle meshes: the type, readers of mesh files, repair, and surfaces of scans."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
