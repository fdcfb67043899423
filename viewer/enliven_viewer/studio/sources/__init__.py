"""Sources of motion: a take's skeleton next to the shapes, and the parts of shapes that it could drive."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
