"""Materials on the GPU: material parameters, batches of faces, and textures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
