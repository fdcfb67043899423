"""Takes: motion clips from motion captures, recordings and possessed meshes, read from files of any known
kind.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
