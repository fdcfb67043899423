"""Materials as the GPU draws them: what a material says, faces that are drawn together, and textures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
